//! Errors of the file system.

use std::io::{self, ErrorKind};
use std::path::{Path, PathBuf};

use thiserror::Error;

/// The longest accepted path, bytes. Linux permits 4,096; a path must leave room for the names of results below it.
pub const PATH_LIMIT: usize = 1024;

/// The attempted operation.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Operation {
    /// Opening or reading a file, listing a folder.
    Read,
    /// Creating, writing, renaming or removing a file.
    Write,
    /// Creating or locking a folder.
    Folder,
}

/// A cause that this crate detects before the operating system.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
pub enum Refusal {
    /// A pipe, device, socket or folder where a regular file is expected.
    #[error("it is {0}, not a regular file")]
    NotRegular(&'static str),
    /// A link at a place where links are not followed.
    #[error("it is a link, and links are not followed here")]
    Link,
    /// A file larger than the limit of its kind.
    #[error("the file is longer than {limit} bytes, the most that is read of its kind")]
    TooLarge {
        /// The limit, bytes.
        limit: u64,
    },
    /// A path that cannot be printed or stored as text.
    #[error("the path is not UTF-8")]
    PathNotUtf8,
    /// A path longer than [`PATH_LIMIT`].
    #[error("the path has {length} bytes, above the limit of {limit}", limit = PATH_LIMIT)]
    PathTooLong {
        /// Length of the path, bytes.
        length: usize,
    },
    /// Another process writes this file or uses this folder.
    #[error("another process is writing to it")]
    Busy,
    /// Results of an earlier command.
    #[error("it holds {0} of an earlier command")]
    Occupied(String),
}

impl Refusal {
    fn kind(&self) -> ErrorKind {
        match self {
            Refusal::TooLarge { .. } => ErrorKind::FileTooLarge,
            Refusal::Busy => ErrorKind::ResourceBusy,
            Refusal::Occupied(_) => ErrorKind::AlreadyExists,
            _ => ErrorKind::InvalidInput,
        }
    }

    fn remedy(&self) -> &'static str {
        match self {
            Refusal::NotRegular(_) => "save the data as a file, and name that",
            Refusal::Link => "put the file or folder itself there",
            Refusal::TooLarge { .. } => "check that it is the right file",
            Refusal::PathNotUtf8 => "rename the file or folder",
            Refusal::PathTooLong { .. } => "name a shorter path, or move the file or folder up",
            Refusal::Busy => "wait until the other process has ended, or name another place",
            Refusal::Occupied(_) => "name another with --out, or replace the results with --force",
        }
    }
}

impl From<Refusal> for io::Error {
    fn from(refusal: Refusal) -> Self {
        io::Error::new(refusal.kind(), refusal)
    }
}

/// A failed access to a file or folder: the operation, the path, the cause and the remedy in one line.
#[derive(Debug, Error)]
#[error("cannot {} {}: {source}; {}", self.verb(), path.display(), self.remedy())]
pub struct StorageError {
    /// The attempted operation.
    pub operation: Operation,
    /// The file or folder.
    pub path: PathBuf,
    /// The error of the operating system, or a [`Refusal`].
    pub source: io::Error,
}

impl StorageError {
    /// The error of an `operation` on `path`.
    #[must_use]
    pub fn new(operation: Operation, path: &Path, source: io::Error) -> Self {
        Self { operation, path: path.to_path_buf(), source }
    }

    fn verb(&self) -> &'static str {
        match self.operation {
            Operation::Read => "read",
            Operation::Write => "write",
            Operation::Folder if matches!(self.refusal(), Some(Refusal::Busy | Refusal::Occupied(_))) => {
                "use the folder"
            }
            Operation::Folder => "create the folder",
        }
    }

    /// The cause, if this crate detected it.
    #[must_use]
    pub fn refusal(&self) -> Option<&Refusal> {
        self.source.get_ref().and_then(|cause| cause.downcast_ref())
    }

    /// The remedy.
    #[must_use]
    pub fn remedy(&self) -> &'static str {
        match (self.refusal(), self.operation) {
            (Some(refusal), _) => refusal.remedy(),
            (None, Operation::Read) => remedy_for_reading(self.source.kind()),
            (None, _) => remedy_for_writing(self.source.kind()),
        }
    }
}

/// For a caller that names the path itself, the conversion keeps only the cause.
impl From<StorageError> for io::Error {
    fn from(error: StorageError) -> Self {
        error.source
    }
}

fn remedy_for_reading(kind: ErrorKind) -> &'static str {
    match kind {
        ErrorKind::NotFound => "check the path: a relative one begins where the command is called",
        ErrorKind::IsADirectory => "name a file in it",
        ErrorKind::NotADirectory => "check the path: a part of it is a file, not a folder",
        ErrorKind::PermissionDenied => "let yourself read it, as with chmod u+r, or name another",
        ErrorKind::InvalidData => "it is no text in UTF-8; check that it is the right file",
        _ => "check the file and the disk that it is on",
    }
}

fn remedy_for_writing(kind: ErrorKind) -> &'static str {
    match kind {
        ErrorKind::NotFound => "make its folder, or name another one",
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
