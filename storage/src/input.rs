//! Regular files open for reading, and whole files up to a limit.

use std::fs::{File, OpenOptions};
use std::io::{self, ErrorKind, Read, Seek, SeekFrom};
use std::os::unix::fs::OpenOptionsExt;
use std::path::{Path, PathBuf};

use rustix::fs::OFlags;

use crate::call::Call;
use crate::error::{Operation, Refusal, StorageError};
use crate::handle::{flags, kind};
use crate::path::check_path;
use crate::perform::perform;

/// Largest size of a document: a model, scenario, task, mapping, weight file, path, diagnosis, summary or receipt; bytes. Parsers keep several
/// copies of a document in memory; the largest of the project, the receipt of a full blind set, has 3 MB.
pub const DOCUMENT_LIMIT: u64 = 32 << 20;

/// Largest size of a file that people write: a model, a scenario, a mapping; bytes. Parsers of TOML and XML build trees of about a hundred
/// bytes for a byte of text, so that such a file needs at most 0.4 GiB. The largest public robots have 0.3 MiB.
pub const CONFIG_LIMIT: u64 = 4 << 20;

/// A regular file open for reading.
///
/// The function refuses pipes, devices, sockets and folders: recordings are read more than once, and reading a pipe without a writer would
/// never end. It accepts `/dev/stdin` if that is redirected from a file, and refuses it for a pipe or a terminal.
#[derive(Debug)]
pub struct InputFile {
    file: File,
    path: PathBuf,
    length: u64,
}

impl InputFile {
    /// Opens `path`. The last component may be a link.
    ///
    /// # Errors
    /// A refused path; [`Refusal::NotRegular`]; an error of the operating system.
    pub fn open(path: &Path) -> Result<Self, StorageError> {
        Self::open_with(path, OFlags::empty())
    }

    fn open_with(path: &Path, more: OFlags) -> Result<Self, StorageError> {
        let failed = |source| StorageError::new(Operation::Read, path, source);
        check_path(path).map_err(failed)?;
        let file = perform(&Call::Open(path), || {
            let all = OFlags::NONBLOCK | OFlags::NOCTTY | more;
            OpenOptions::new().read(true).custom_flags(flags(all)).open(path)
        });
        let file = file.map_err(|error| failed(explained(path, error)))?;
        let metadata = file.metadata().map_err(failed)?;
        if metadata.is_dir() {
            return Err(failed(rustix::io::Errno::ISDIR.into()));
        }
        if !metadata.is_file() {
            return Err(failed(Refusal::NotRegular(kind(metadata.file_type())).into()));
        }
        Ok(Self { file, path: path.to_path_buf(), length: metadata.len() })
    }

    /// Length at opening, bytes.
    #[must_use]
    pub fn length(&self) -> u64 {
        self.length
    }

    /// The file itself, for a reader with random access, such as that of Parquet.
    #[must_use]
    pub fn into_file(self) -> File {
        self.file
    }
}

/// Replaces the unclear error numbers for opening a socket or a link by a [`Refusal`].
fn explained(path: &Path, error: io::Error) -> io::Error {
    let found = std::fs::symlink_metadata(path).map(|metadata| metadata.file_type());
    match (found, rustix::io::Errno::from_io_error(&error)) {
        (Ok(found), Some(rustix::io::Errno::LOOP)) if found.is_symlink() => Refusal::Link.into(),
        (Ok(found), Some(rustix::io::Errno::NXIO)) => Refusal::NotRegular(kind(found)).into(),
        _ => error,
    }
}

impl Read for InputFile {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        perform(&Call::Read(&self.path), || self.file.read(buffer))
    }
}

impl Seek for InputFile {
    fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
        self.file.seek(to)
    }
}

/// Opens `path`, whose last component must not be a link.
///
/// # Errors
/// See [`InputFile::open`]; [`Refusal::Link`].
pub fn open_without_links(path: &Path) -> Result<InputFile, StorageError> {
    InputFile::open_with(path, OFlags::NOFOLLOW)
}

/// Reads the bytes of the file `path`, at most `limit`.
///
/// # Errors
/// See [`InputFile::open`]; [`Refusal::TooLarge`].
pub fn read_bytes(path: &Path, limit: u64) -> Result<Vec<u8>, StorageError> {
    let mut file = InputFile::open(path)?;
    let failed = |source| StorageError::new(Operation::Read, path, source);
    if file.length() > limit {
        return Err(failed(Refusal::TooLarge { limit }.into()));
    }
    let mut bytes = Vec::new();
    (&mut file).take(limit.saturating_add(1)).read_to_end(&mut bytes).map_err(failed)?;
    if bytes.len() as u64 > limit {
        return Err(failed(Refusal::TooLarge { limit }.into()));
    }
    Ok(bytes)
}

/// Reads the text of the document `path`, at most [`DOCUMENT_LIMIT`] bytes.
///
/// # Errors
/// See [`read_bytes`]; [`ErrorKind::InvalidData`] if the text is not UTF-8.
pub fn read_text(path: &Path) -> Result<String, StorageError> {
    text(path, DOCUMENT_LIMIT)
}

/// Reads the text of the file `path` that people write, at most [`CONFIG_LIMIT`] bytes.
///
/// # Errors
/// See [`read_text`].
pub fn read_config(path: &Path) -> Result<String, StorageError> {
    text(path, CONFIG_LIMIT)
}

fn text(path: &Path, limit: u64) -> Result<String, StorageError> {
    String::from_utf8(read_bytes(path, limit)?).map_err(|error| {
        let source = io::Error::new(ErrorKind::InvalidData, error.utf8_error());
        StorageError::new(Operation::Read, path, source)
    })
}
