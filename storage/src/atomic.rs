//! Atomic files: a file appears complete or not at all.
//!
//! The writer puts the bytes into a temporary file in the same folder, `.NAME.freeplay-part`, created exclusively and without following
//! links. A commit makes them durable, renames the file to its target, and makes the name durable. The rename replaces a link under the
//! target's name and never writes through it. The writer holds a lock on its temporary file. The file of a killed process is unlocked, and
//! the next write to the same target removes it.

use std::fs::FileType;
use std::io::{self, ErrorKind, Read, Seek, SeekFrom, Write};
use std::os::unix::fs::FileTypeExt;
use std::path::{Path, PathBuf};

use crate::call::Call;
use crate::error::{Operation, Refusal, StorageError};
use crate::folder::{remove, sync_folder};
use crate::handle::Handle;
use crate::path::{check_path, file_name, parent};
use crate::perform::perform;

/// Suffix of the name of every temporary file.
pub const TEMPORARY_SUFFIX: &str = ".freeplay-part";

/// Number of attempts to create a temporary file that another process removes at the same time.
const TRIES: usize = 8;

/// A file that is being written. If it is dropped without [`AtomicFile::commit`], the earlier target stays.
#[derive(Debug)]
pub struct AtomicFile {
    handle: Handle,
    temporary: PathBuf,
    target: PathBuf,
    is_published: bool,
}

impl AtomicFile {
    /// Creates a file that will replace `target`.
    ///
    /// # Errors
    /// A refused path; a folder or device under the name; another process that writes the same file; an error of the operating system.
    pub fn create(target: &Path) -> Result<Self, StorageError> {
        Self::begin(target).map_err(|source| StorageError::new(Operation::Write, target, source))
    }

    fn begin(target: &Path) -> io::Result<Self> {
        check_path(target)?;
        check_replaceable(target)?;
        let temporary = target.with_file_name(format!(".{}{TEMPORARY_SUFFIX}", file_name(target)?));
        for _ in 0..TRIES {
            match Handle::create_new(&temporary) {
                Ok(handle) => {
                    let file = Self { handle, temporary, target: target.to_path_buf(), is_published: false };
                    file.handle.lock()?;
                    if file.handle.is_at(&file.temporary) {
                        return Ok(file);
                    }
                    // Another process removed it as a leftover before it was locked.
                    return Err(Refusal::Busy.into());
                }
                Err(error) if error.kind() == ErrorKind::AlreadyExists => remove_leftover(&temporary)?,
                Err(error) => return Err(error),
            }
        }
        Err(Refusal::Busy.into())
    }

    /// Truncates the bytes written so far to `length`.
    ///
    /// # Errors
    /// An error of the operating system.
    pub fn truncate(&mut self, length: u64) -> io::Result<()> {
        self.handle.truncate(length)
    }

    /// Makes the file durable and renames it to its target.
    ///
    /// # Errors
    /// An error of the operating system. The target stays as before, unless the last step failed: then the new file is there, complete,
    /// and a power cut may restore the old one.
    pub fn commit(mut self) -> Result<(), StorageError> {
        let done = self.handle.sync().and_then(|()| self.publish());
        done.map_err(|source| StorageError::new(Operation::Write, &self.target, source))
    }

    /// Renames the file to its target.
    fn publish(&mut self) -> io::Result<()> {
        let (from, to) = (&self.temporary, &self.target);
        perform(&Call::Rename { from, to }, || std::fs::rename(from, to))?;
        self.is_published = true;
        sync_folder(&parent(&self.target))
    }

    /// Renames the file to its target now; it continues to grow under that name.
    pub(crate) fn into_published(mut self) -> Result<Handle, StorageError> {
        self.publish().map_err(|source| StorageError::new(Operation::Write, &self.target, source))?;
        self.handle.renamed(&self.target);
        self.handle.try_clone().map_err(|source| StorageError::new(Operation::Write, &self.target, source))
    }
}

impl Drop for AtomicFile {
    fn drop(&mut self) {
        if !self.is_published {
            // The original error is the one to report.
            let _ = remove(&self.temporary);
        }
    }
}

impl Write for AtomicFile {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.handle.write(bytes)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.handle.flush()
    }
}

impl Read for AtomicFile {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        self.handle.read(buffer)
    }
}

impl Seek for AtomicFile {
    fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
        self.handle.seek(to)
    }
}

/// Writes `bytes` to `target` atomically, readable only by its owner.
///
/// # Errors
/// The errors of [`AtomicFile`]; the target stays as before.
pub fn write(target: &Path, bytes: impl AsRef<[u8]>) -> Result<(), StorageError> {
    let mut file = AtomicFile::create(target)?;
    file.write_all(bytes.as_ref()).map_err(|source| StorageError::new(Operation::Write, target, source))?;
    file.commit()
}

/// Refuses a target that a file must not replace: a folder, a device, a pipe, a socket, a link to one of these, or a name in a folder of a
/// kernel file system.
fn check_replaceable(target: &Path) -> io::Result<()> {
    let is_replaceable = |kind: FileType| kind.is_file() || kind.is_symlink();
    for found in [std::fs::symlink_metadata(target), std::fs::metadata(target)].into_iter().flatten() {
        let kind = found.file_type();
        if kind.is_dir() {
            return Err(rustix::io::Errno::ISDIR.into());
        }
        if !is_replaceable(kind) || kind.is_char_device() {
            return Err(Refusal::NotRegular(crate::handle::kind(kind)).into());
        }
    }
    let folder = std::fs::canonicalize(parent(target)).unwrap_or_default();
    if folder == Path::new("/dev") || folder.starts_with("/dev/fd") || folder.starts_with("/proc") {
        return Err(Refusal::NotRegular("in a folder of the kernel").into());
    }
    Ok(())
}

/// Removes a temporary file without a lock.
fn remove_leftover(temporary: &Path) -> io::Result<()> {
    let Ok(metadata) = std::fs::symlink_metadata(temporary) else { return Ok(()) };
    if !metadata.is_file() {
        // A planted link or pipe; removing the name does not follow it.
        return remove(temporary);
    }
    match Handle::append(temporary) {
        Ok(leftover) => {
            leftover.lock()?;
            // A process that replaces it would need the lock that this one holds.
            if leftover.is_at(temporary) { remove(temporary) } else { Ok(()) }
        }
        Err(error) if error.kind() == ErrorKind::NotFound => Ok(()),
        Err(error) => Err(error),
    }
}
