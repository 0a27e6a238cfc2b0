//! Files that a person names: what could not be read or written is said in one way, with the next step.

use std::io::{Error, ErrorKind, Write};
use std::os::unix::fs::OpenOptionsExt;
use std::path::{Path, PathBuf};

use serde::de::DeserializeOwned;

use crate::exit::Failure;
use crate::messages;

/// What to do about a file that can't be read.
pub fn how_to_read(error: &Error) -> &'static str {
    match error.kind() {
        ErrorKind::NotFound => "check the path: a relative one begins where the command is called",
        ErrorKind::IsADirectory => "name a file in it",
        ErrorKind::NotADirectory => "check the path: a part of it is a file, not a folder",
        ErrorKind::PermissionDenied => "let yourself read it, as with chmod u+r, or name another",
        ErrorKind::InvalidData => "it is no text in UTF-8; check that it is the right file",
        _ => "check the file and the disk that it is on",
    }
}

/// What to do about a file or folder that can't be written.
fn how_to_write(error: &Error) -> &'static str {
    match error.kind() {
        ErrorKind::NotFound => "make the folder that it is to be in, or name another",
        ErrorKind::IsADirectory => "name a file in it",
        ErrorKind::AlreadyExists => "a file has this name; remove it, or name another folder",
        ErrorKind::NotADirectory => "a part of the path is a file; name another",
        ErrorKind::PermissionDenied | ErrorKind::ReadOnlyFilesystem => {
            "name a place that you may write to, or change its permissions"
        }
        ErrorKind::StorageFull | ErrorKind::QuotaExceeded | ErrorKind::FileTooLarge => {
            "free some space, or name another disk"
        }
        _ => "name another place, or check the disk that it is on",
    }
}

/// A file that can't be read.
pub fn unreadable(path: &Path, error: &Error) -> Failure {
    Failure::input(format!("cannot read {}: {error}; {}", path.display(), how_to_read(error)))
}

/// A file that can't be written.
pub fn unwritable(path: &Path, error: &Error) -> Failure {
    Failure::input(format!("cannot write {}: {error}; {}", path.display(), how_to_write(error)))
}

/// The text of a file.
///
/// # Errors
/// The file, what the system said, and what to do.
pub fn read_text(path: &Path) -> Result<String, Failure> {
    std::fs::read_to_string(path).map_err(|error| unreadable(path, &error))
}

/// The JSON in a file that should be `what`, such as "the receipt that freeplay blind left".
///
/// # Errors
/// As [`read_text`]; what is wrong with line and column, and what to give instead.
pub fn read_json<T: DeserializeOwned>(path: &Path, what: &str) -> Result<T, Failure> {
    let text = read_text(path)?;
    let wrong = |why: String| Failure::input(format!("{}: {why}; give {what}", path.display()));
    if text.trim().is_empty() {
        return Err(wrong("the file is empty".to_owned()));
    }
    serde_json::from_str(&text).map_err(|error| wrong(error.to_string()))
}

/// Makes the folder `path` and those above it.
///
/// # Errors
/// The folder, what the system said, and what to do.
pub fn make_folder(path: &Path) -> Result<(), Failure> {
    std::fs::create_dir_all(path).map_err(|error| {
        let (path, remedy) = (path.display(), how_to_write(&error));
        Failure::input(format!("cannot create the folder {path}: {error}; {remedy}"))
    })
}

/// A folder for what takes minutes to be found, made before. Unless something is in it, it is gone again with this.
pub struct Folder {
    /// Those that had to be made, the innermost first.
    made: Vec<PathBuf>,
}

impl Folder {
    /// Makes the folder `path` and those above it.
    ///
    /// # Errors
    /// As [`make_folder`].
    pub fn reserve(path: &Path) -> Result<Self, Failure> {
        let missing = |folder: &&Path| !folder.as_os_str().is_empty() && !folder.exists();
        let made = path.ancestors().take_while(missing).map(Path::to_owned).collect();
        make_folder(path)?;
        Ok(Self { made })
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        // One that is not empty can't be removed, and should not be.
        let _ = self.made.iter().try_for_each(std::fs::remove_dir);
    }
}

/// Whether a file could be written to `path`, without leaving anything: for what takes minutes before it writes.
///
/// # Errors
/// No folder to write it into, or a folder in its place.
pub fn check_target(path: &Path) -> Result<(), Failure> {
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let kind = match (folder.is_dir(), path.is_dir()) {
        (true, false) => return Ok(()),
        (true, true) => ErrorKind::IsADirectory,
        (false, _) if folder.exists() => ErrorKind::NotADirectory,
        (false, _) => ErrorKind::NotFound,
    };
    let said = match kind {
        ErrorKind::IsADirectory => "it is a folder".to_owned(),
        ErrorKind::NotADirectory => format!("{} is no folder", folder.display()),
        _ => format!("there is no folder {}", folder.display()),
    };
    let remedy = how_to_write(&kind.into());
    Err(Failure::input(format!("cannot write {}: {said}; {remedy}", path.display())))
}

/// Writes a file that only its owner can read.
///
/// # Errors
/// The file, what the system said, and what to do.
pub fn write(path: &Path, text: &str) -> Result<(), Failure> {
    let mut options = std::fs::OpenOptions::new();
    options.write(true).create(true).truncate(true).mode(0o600);
    options
        .open(path)
        .and_then(|mut file| file.write_all(text.as_bytes()))
        .map_err(|error| unwritable(path, &error))?;
    messages::detail(format_args!("wrote {}: {:.1} kB", path.display(), text.len() as f64 * 1e-3));
    Ok(())
}
