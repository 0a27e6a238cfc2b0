//! Files named on the command line: errors of the storage crate become failures with an exit code, and the program reports the files that it wrote.

use std::path::{Path, PathBuf};

use freeplay_storage::{Claim, Exposure, Operation, OutputFolder, Refusal, StorageError, plain_words};
use serde::de::DeserializeOwned;

use crate::exit::Failure;
use crate::messages;

/// Earlier results without `--force` are an error of the command line; all other errors concern files and disks.
impl From<StorageError> for Failure {
    fn from(error: StorageError) -> Self {
        match error.refusal() {
            Some(Refusal::Occupied(_)) => Failure::usage(error),
            _ => Failure::input(error),
        }
    }
}

/// A file that can't be read.
pub fn unreadable(path: &Path, error: std::io::Error) -> Failure {
    StorageError::new(Operation::Read, path, error).into()
}

/// A file that can't be written.
pub fn unwritable(path: &Path, error: std::io::Error) -> Failure {
    StorageError::new(Operation::Write, path, error).into()
}

/// The text of a document, at most [`freeplay_storage::DOCUMENT_LIMIT`] bytes.
///
/// # Errors
/// The file, the system's error, and the remedy.
pub fn read_text(path: &Path) -> Result<String, Failure> {
    Ok(freeplay_storage::read_text(path)?)
}

/// The JSON in a file that should be `what`, such as "the receipt that freeplay blind left".
///
/// # Errors
/// As [`read_text`]; the fault with line and column, and the expected file.
pub fn read_json<T: DeserializeOwned>(path: &Path, what: &str) -> Result<T, Failure> {
    let text = read_text(path)?;
    let wrong = |why: String| Failure::input(format!("{}: {why}; give {what}", path.display()));
    if text.trim().is_empty() {
        return Err(wrong("the file is empty".to_owned()));
    }
    serde_json::from_str(&text).map_err(|error| wrong(plain_words(&error.to_string())))
}

/// Makes the folder `path` and those above it.
///
/// # Errors
/// The folder, the system's error, and the remedy.
pub fn make_folder(path: &Path) -> Result<(), Failure> {
    Ok(freeplay_storage::make_folder(path)?)
}

/// Claims the folder `out` for the results of one command; without it, a new one named by the time.
///
/// The folder is locked until the value is dropped. `results` are names that the command writes first or last: an existing one belongs to an earlier command,
/// and is kept without `force`.
///
/// # Errors
/// A folder that can't be made, that another command uses, or that holds earlier results.
pub fn claim(out: Option<&Path>, results: &[&str], force: bool) -> Result<OutputFolder, Failure> {
    claim_or_new(out, &timed_folder(), results, force)
}

/// The same; without `out`, a new folder named `new`, or `new-2` and so on.
///
/// # Errors
/// As [`claim`].
pub fn claim_or_new(
    out: Option<&Path>,
    new: &Path,
    results: &[&str],
    force: bool,
) -> Result<OutputFolder, Failure> {
    let folder = match out {
        Some(out) => OutputFolder::claim(out, Claim { results, force })?,
        None => OutputFolder::claim_new(new)?,
    };
    if !folder.holds_lock() {
        let path = folder.path().display();
        messages::note(format_args!(
            "note: the file system of {path} has no locks: let no other command write there meanwhile"
        ));
    }
    if let Some(Exposure { folder, owner }) = Exposure::of(folder.path()) {
        let who = owner.map_or_else(|| "every user".to_owned(), |owner| format!("user {owner}"));
        messages::note(format_args!(
            "note: {who} can replace files in {}; name a folder of your own to be sure of the results",
            folder.display()
        ));
    }
    Ok(folder)
}

/// A folder in `out/`, named by the time.
fn timed_folder() -> PathBuf {
    let now = time::OffsetDateTime::now_utc();
    let (date, time) = (now.date(), now.time());
    let stamp = format!("{date}T{:02}-{:02}-{:02}", time.hour(), time.minute(), time.second());
    Path::new("out").join(stamp)
}

/// Checks that a file could be written to `path`, without leaving anything; for commands that run for minutes before they write.
///
/// # Errors
/// No folder for the file, or a folder at its path.
pub fn check_target(path: &Path) -> Result<(), Failure> {
    Ok(freeplay_storage::check_target(path)?)
}

/// Writes a file that only its owner can read, completely or not at all.
///
/// # Errors
/// The file, the system's error, and the remedy.
pub fn write(path: &Path, text: &str) -> Result<(), Failure> {
    freeplay_storage::write(path, text)?;
    messages::detail(format_args!("wrote {}: {:.1} kB", path.display(), text.len() as f64 * 1e-3));
    Ok(())
}
