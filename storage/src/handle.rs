//! An open file; [`perform`] makes its writes, truncations and syncs.

use std::fs::{File, FileType, OpenOptions};
use std::io::{self, Read, Seek, SeekFrom, Write};
use std::os::unix::fs::{FileTypeExt, MetadataExt, OpenOptionsExt};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};

use rustix::fs::{FlockOperation, OFlags, flock};

use crate::call::Call;
use crate::error::Refusal;
use crate::perform::perform;

/// Accessible only by the owner.
const PRIVATE: u32 = 0o600;

/// The number of the next created file.
static NEXT: AtomicU64 = AtomicU64::new(1);

/// Text for a kind of file.
pub(crate) fn kind(found: FileType) -> &'static str {
    match found {
        found if found.is_fifo() => "a pipe",
        found if found.is_socket() => "a socket",
        found if found.is_block_device() || found.is_char_device() => "a device",
        found if found.is_dir() => "a folder",
        _ => "of another kind",
    }
}

/// Flags for `open` that follow no links and do not wait for pipes.
pub(crate) fn flags(flags: OFlags) -> i32 {
    flags.bits().cast_signed()
}

/// A file open for writing.
#[derive(Debug)]
pub(crate) struct Handle {
    file: File,
    path: PathBuf,
    number: u64,
    offset: u64,
}

impl Handle {
    /// Creates the file `path`, which must not exist, private to its owner.
    pub fn create_new(path: &Path) -> io::Result<Self> {
        let number = NEXT.fetch_add(1, Ordering::Relaxed);
        let file = perform(&Call::Create { path, handle: number }, || {
            let mut options = OpenOptions::new();
            options.read(true).write(true).create_new(true).mode(PRIVATE);
            options.custom_flags(flags(OFlags::NOFOLLOW)).open(path)
        })?;
        Ok(Self { file, path: path.to_path_buf(), number, offset: 0 })
    }

    /// Opens the regular file `path` for appending; if it is missing, creates it private to its owner.
    pub fn append(path: &Path) -> io::Result<Self> {
        let number = NEXT.fetch_add(1, Ordering::Relaxed);
        let file = perform(&Call::Append { path, handle: number }, || {
            let mut options = OpenOptions::new();
            options.append(true).create(true).mode(PRIVATE);
            options.custom_flags(flags(OFlags::NOFOLLOW | OFlags::NONBLOCK)).open(path)
        })?;
        let metadata = file.metadata()?;
        if !metadata.is_file() {
            return Err(Refusal::NotRegular(kind(metadata.file_type())).into());
        }
        Ok(Self { file, path: path.to_path_buf(), number, offset: metadata.len() })
    }

    /// Locks the file until it is closed, unless another process holds the lock.
    pub fn lock(&self) -> io::Result<()> {
        perform(&Call::Lock(&self.path), || lock(&self.file))
    }

    /// Returns true if the name `path` still refers to this file.
    pub fn is_at(&self, path: &Path) -> bool {
        std::fs::symlink_metadata(path).is_ok_and(|found| !found.is_symlink()) && is_at(&self.file, path)
    }

    /// Records the new name of the file.
    pub fn renamed(&mut self, path: &Path) {
        self.path = path.to_path_buf();
    }

    /// Truncates the file to `length` bytes and continues there.
    pub fn truncate(&mut self, length: u64) -> io::Result<()> {
        let call = Call::Truncate { handle: self.number, length };
        perform(&call, || self.file.set_len(length))?;
        self.seek(SeekFrom::Start(length)).map(|_| ())
    }

    /// Makes all written bytes durable.
    pub fn sync(&self) -> io::Result<()> {
        perform(&Call::SyncFile { handle: self.number }, || self.file.sync_all())
    }

    /// The same open file under a second descriptor.
    pub fn try_clone(&self) -> io::Result<Self> {
        Ok(Self { file: self.file.try_clone()?, path: self.path.clone(), ..*self })
    }

    /// The open file itself.
    pub fn into_file(self) -> File {
        self.file
    }
}

/// Returns true if the name `path` refers to the open `file`.
pub(crate) fn is_at(file: &File, path: &Path) -> bool {
    let (Ok(there), Ok(here)) = (std::fs::metadata(path), file.metadata()) else { return false };
    (there.dev(), there.ino()) == (here.dev(), here.ino())
}

/// Takes the lock of an open file or folder without waiting.
pub(crate) fn lock(file: &File) -> io::Result<()> {
    match flock(file, FlockOperation::NonBlockingLockExclusive) {
        Err(rustix::io::Errno::WOULDBLOCK) => Err(Refusal::Busy.into()),
        done => done.map_err(io::Error::from),
    }
}

impl Write for Handle {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let call = Call::Write { handle: self.number, offset: self.offset, bytes };
        // `write_all` completes short writes, so that the log of a debug build contains whole writes.
        perform(&call, || self.file.write_all(bytes))?;
        self.offset += bytes.len() as u64;
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

impl Read for Handle {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let read = perform(&Call::Read(&self.path), || self.file.read(buffer))?;
        self.offset += read as u64;
        Ok(read)
    }
}

impl Seek for Handle {
    fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
        self.offset = self.file.seek(to)?;
        Ok(self.offset)
    }
}
