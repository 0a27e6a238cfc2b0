//! A file that is readable while it grows: the recording of a run.

use std::io::{self, Write};
use std::path::Path;
use std::process::Stdio;

use crate::atomic::AtomicFile;
use crate::error::{Operation, StorageError};
use crate::handle::Handle;
use crate::path::check_path;

/// A file that has its name at once and grows under it. The bytes written by a killed process stay; a power cut may lose bytes that
/// are not yet [finished](LiveFile::finish). A reader must accept a file that ends early.
#[derive(Debug)]
pub struct LiveFile(Handle);

impl LiveFile {
    /// Creates an empty file in place of `target`, readable only by its owner. A link under this name is replaced.
    ///
    /// # Errors
    /// See [`AtomicFile::create`].
    pub fn create(target: &Path) -> Result<Self, StorageError> {
        AtomicFile::create(target)?.into_published().map(Self)
    }

    /// Opens the regular file `target` for appending, and creates it if it is missing.
    ///
    /// # Errors
    /// A refused path; a link, a pipe or a device under the name; an error of the operating system.
    pub fn open_to_append(target: &Path) -> Result<Self, StorageError> {
        let opened = check_path(target).and_then(|()| Handle::append(target));
        opened.map(Self).map_err(|source| StorageError::new(Operation::Write, target, source))
    }

    /// Truncates the file to `length` bytes and continues there.
    ///
    /// # Errors
    /// An error of the operating system.
    pub fn truncate(&mut self, length: u64) -> io::Result<()> {
        self.0.truncate(length)
    }

    /// Makes all written bytes durable.
    ///
    /// # Errors
    /// An error of the operating system.
    pub fn finish(&self) -> io::Result<()> {
        self.0.sync()
    }

    /// The file as the standard output or error of a child process.
    ///
    /// # Errors
    /// An error of the operating system.
    pub fn to_stdio(&self) -> io::Result<Stdio> {
        self.0.try_clone().map(|handle| handle.into_file().into())
    }
}

impl Write for LiveFile {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.0.write(bytes)
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}
