//! Folders: creating, listing, reserving; removing names and making them durable.

use std::fs::{DirBuilder, File, FileTimes, OpenOptions};
use std::io::{self, ErrorKind};
use std::os::unix::fs::{DirBuilderExt, MetadataExt, OpenOptionsExt};
use std::path::{Path, PathBuf};
use std::time::SystemTime;

use rustix::fs::OFlags;

use crate::call::Call;
use crate::error::{Operation, Refusal, StorageError};
use crate::handle::flags;
use crate::path::{check_path, parent};
use crate::perform::perform;

/// Accessible only by the owner.
const PRIVATE: u32 = 0o700;

/// Opens a folder. A pipe planted in its place causes an error without waiting.
pub(crate) fn open_folder(folder: &Path) -> io::Result<File> {
    OpenOptions::new().read(true).custom_flags(flags(OFlags::DIRECTORY)).open(folder)
}

/// Makes the names in `folder` durable. The function ignores file systems without this feature.
pub(crate) fn sync_folder(folder: &Path) -> io::Result<()> {
    let synced = perform(&Call::SyncFolder(folder), || open_folder(folder)?.sync_all());
    match synced {
        Err(error) if matches!(error.kind(), ErrorKind::InvalidInput | ErrorKind::Unsupported) => Ok(()),
        done => done,
    }
}

/// Removes a name. For a link, the function removes the link and not its target.
pub(crate) fn remove(path: &Path) -> io::Result<()> {
    perform(&Call::Remove(path), || std::fs::remove_file(path))
}

/// Removes the file or link `path`, if it exists.
///
/// # Errors
/// An error of the operating system.
pub fn remove_file(path: &Path) -> Result<(), StorageError> {
    match check_path(path).and_then(|()| remove(path)) {
        Err(error) if error.kind() == ErrorKind::NotFound => Ok(()),
        done => done.map_err(|source| StorageError::new(Operation::Write, path, source)),
    }
}

/// Creates the folder `path` and its parents, private to their owner, and makes them durable.
///
/// # Errors
/// A refused path; a file or a link in its place; an error of the operating system.
pub fn make_folder(path: &Path) -> Result<(), StorageError> {
    let failed = |source| StorageError::new(Operation::Folder, path, source);
    check_path(path).map_err(failed)?;
    if std::fs::symlink_metadata(path).is_ok_and(|found| found.is_symlink()) {
        return Err(failed(Refusal::Link.into()));
    }
    make_missing(path).map_err(failed)
}

/// Creates the missing folders of `path` and its parents.
pub(crate) fn make_missing(path: &Path) -> io::Result<()> {
    for folder in missing(path).iter().rev() {
        let made = perform(&Call::MakeFolder(folder), || DirBuilder::new().mode(PRIVATE).create(folder));
        match made {
            // Another process created it meanwhile.
            Err(error) if error.kind() == ErrorKind::AlreadyExists && folder.is_dir() => {}
            done => done?,
        }
        sync_folder(&parent(folder))?;
    }
    // A query of the folder reveals a file at its path or at that of a parent.
    if path.as_os_str().is_empty() || std::fs::metadata(path)?.is_dir() {
        Ok(())
    } else {
        Err(ErrorKind::AlreadyExists.into())
    }
}

/// The missing folders of `path`, the innermost first.
fn missing(path: &Path) -> Vec<PathBuf> {
    let is_missing = |folder: &&Path| {
        let found = std::fs::symlink_metadata(folder);
        !folder.as_os_str().is_empty() && found.is_err_and(|error| error.kind() == ErrorKind::NotFound)
    };
    path.ancestors().take_while(is_missing).map(Path::to_owned).collect()
}

/// Folders created in advance for results that take minutes to compute. Dropping this value removes those that are still empty.
#[derive(Debug)]
pub(crate) struct ReservedFolder {
    made: Vec<PathBuf>,
}

impl ReservedFolder {
    /// Records the missing folders of `path`.
    pub fn before(path: &Path) -> Self {
        Self { made: missing(path) }
    }

    /// Keeps the folders, because another process owns them.
    pub fn leave(&mut self) {
        self.made.clear();
    }
}

impl Drop for ReservedFolder {
    fn drop(&mut self) {
        // The system removes only empty folders.
        let _ = self.made.iter().try_for_each(|folder| remove_one_folder(folder));
    }
}

fn remove_one_folder(folder: &Path) -> io::Result<()> {
    perform(&Call::RemoveFolder(folder), || std::fs::remove_dir(folder))
}

/// Removes the folder `path` with its contents, if it exists, without following links.
///
/// # Errors
/// An error of the operating system.
pub fn remove_folder(path: &Path) -> Result<(), StorageError> {
    match perform(&Call::RemoveFolder(path), || std::fs::remove_dir_all(path)) {
        Err(error) if error.kind() == ErrorKind::NotFound => Ok(()),
        done => done.map_err(|source| StorageError::new(Operation::Folder, path, source)),
    }
}

/// Kind of an entry of a folder.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum EntryKind {
    /// A regular file.
    File,
    /// A folder.
    Folder,
    /// A link, whatever its target.
    Link,
    /// A pipe, device or socket.
    Other,
}

/// An entry of a folder.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Entry {
    /// The folder's path with the entry's name.
    pub path: PathBuf,
    /// Kind of the entry; links are not followed.
    pub kind: EntryKind,
}

/// Lists the entries of the folder `path`, by name. The folder itself may be a link; its entries are not followed.
///
/// # Errors
/// A refused path; an error of the operating system.
pub fn list(path: &Path) -> Result<Vec<Entry>, StorageError> {
    let failed = |source| StorageError::new(Operation::Read, path, source);
    check_path(path).map_err(failed)?;
    let entries = perform(&Call::List(path), || std::fs::read_dir(path)?.collect::<io::Result<Vec<_>>>());
    let mut found = Vec::new();
    for entry in entries.map_err(failed)? {
        let kind = match entry.file_type().map_err(failed)? {
            kind if kind.is_file() => EntryKind::File,
            kind if kind.is_dir() => EntryKind::Folder,
            kind if kind.is_symlink() => EntryKind::Link,
            _ => EntryKind::Other,
        };
        found.push(Entry { path: entry.path(), kind });
    }
    found.sort_by(|a, b| a.path.cmp(&b.path));
    Ok(found)
}

/// Sets the times of the last access and of the last change of the file or folder `path`.
///
/// # Errors
/// An error of the operating system.
pub fn set_times(path: &Path, time: SystemTime) -> Result<(), StorageError> {
    let times = FileTimes::new().set_accessed(time).set_modified(time);
    let open = || OpenOptions::new().read(true).custom_flags(flags(OFlags::NONBLOCK)).open(path);
    perform(&Call::SetTimes(path), || open()?.set_times(times))
        .map_err(|source| StorageError::new(Operation::Write, path, source))
}

/// Checks in advance, without side effects, that a file could be written to `path`; it serves results that take minutes to
/// compute.
///
/// # Errors
/// A refused path; a missing folder; a folder at the path of the file.
pub fn check_target(path: &Path) -> Result<(), StorageError> {
    let failed = |source| Err(StorageError::new(Operation::Write, path, source));
    if let Err(refused) = check_path(path) {
        return failed(refused);
    }
    let folder = parent(path);
    let (kind, text) = match (folder.is_dir(), path.is_dir()) {
        (true, false) => return Ok(()),
        (true, true) => (ErrorKind::IsADirectory, "it is a folder".to_owned()),
        (false, _) if folder.exists() => {
            (ErrorKind::NotADirectory, format!("{} is no folder", folder.display()))
        }
        (false, _) => (ErrorKind::NotFound, format!("there is no folder {}", folder.display())),
    };
    failed(io::Error::new(kind, text))
}

/// Identity of a file. If a write replaces a file atomically, the identity changes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FileIdentity {
    device: u64,
    inode: u64,
}

impl FileIdentity {
    /// The identity of the file `path`, with links followed; `None` if it does not exist.
    #[must_use]
    pub fn of(path: &Path) -> Option<Self> {
        let found = std::fs::metadata(path).ok()?;
        Some(Self { device: found.dev(), inode: found.ino() })
    }
}

/// Returns true if two paths lead to the same file. Links are followed.
#[must_use]
pub fn same_file(one: &Path, other: &Path) -> bool {
    FileIdentity::of(one).is_some_and(|one| FileIdentity::of(other) == Some(one))
}
