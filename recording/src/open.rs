//! Opening a file, and detecting its kind from its first bytes.

use std::io::{ErrorKind, Read};
use std::path::Path;

use freeplay_storage::{InputFile, Refusal};

use crate::error::ReadError;
use crate::mcap_records::is_magic;

/// Opens the file at `path`, which must be a regular one.
///
/// # Errors
/// [`ReadError::Io`], [`ReadError::Folder`], [`ReadError::NotAFile`].
pub(crate) fn open(path: &Path) -> Result<InputFile, ReadError> {
    InputFile::open(path).map_err(|error| match error.refusal() {
        _ if error.source.kind() == ErrorKind::IsADirectory => ReadError::Folder { file: path.to_path_buf() },
        Some(Refusal::NotRegular(_)) => ReadError::NotAFile(error),
        _ => ReadError::Io { file: path.to_path_buf(), source: error.into() },
    })
}

/// All of the file at `path`, at most `most` bytes.
///
/// # Errors
/// As [`open`]; [`ReadError::Unusable`] for a longer one.
pub(crate) fn bytes(path: &Path, most: u64) -> Result<Vec<u8>, ReadError> {
    let file = open(path)?;
    let mut bytes = Vec::new();
    let read = file.take(most.saturating_add(1)).read_to_end(&mut bytes);
    let read = read.map_err(|source| ReadError::Io { file: path.to_path_buf(), source })?;
    if read as u64 > most {
        let what = format!("it is longer than {most} bytes; cut it into shorter recordings");
        return Err(ReadError::Unusable { file: path.to_path_buf(), what });
    }
    Ok(bytes)
}

/// Kind of a file, by its first bytes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Kind {
    Mcap,
    Sqlite,
    Ros1,
    Parquet,
    Zip,
    Npy,
    Mat,
    /// Text, or an unknown kind.
    Text,
    /// An unsupported kind: its description and the remedy.
    Foreign(&'static str),
}

/// Number of bytes for [`Kind::of`].
pub(crate) const HEAD: usize = 16;

impl Kind {
    /// The kind of a file that begins with `head`.
    pub fn of(head: &[u8]) -> Self {
        match head {
            _ if head.get(..mcap::MAGIC.len()).is_some_and(is_magic) => Self::Mcap,
            _ if head.starts_with(b"SQLite format 3\0") => Self::Sqlite,
            _ if head.starts_with(b"#ROSBAG V2") => Self::Ros1,
            _ if head.starts_with(b"#ROSBAG") => {
                Self::Foreign("a ROS bag of an old version: `rosbag fix` it first")
            }
            _ if head.starts_with(b"PAR1") => Self::Parquet,
            _ if head.starts_with(b"PK\x03\x04") || head.starts_with(b"PK\x05\x06") => Self::Zip,
            _ if head.starts_with(b"\x93NUMPY") => Self::Npy,
            _ if head.starts_with(b"MATLAB 5.0") => Self::Mat,
            _ if head.starts_with(b"MATLAB 7.3") => Self::Foreign(
                "a MATLAB v7.3 file: save it with -v7, as in save('run.mat', '-v7', 't', 'q', 'tau')",
            ),
            _ if head.starts_with(b"\x89HDF\r\n\x1a\n") => Self::Foreign(
                "a HDF5 file: write it as .npz or CSV, in Python numpy.savez('run.npz', t=t, q=q, tau=tau)",
            ),
            _ if head.starts_with(b"ARROW1") || head.starts_with(b"\xff\xff\xff\xff") => {
                Self::Foreign("an Arrow or Feather file: write it as Parquet, in Python DataFrame.to_parquet")
            }
            _ if head.starts_with(b"ULog") => Self::Foreign("a PX4 log: convert it with `ulog2csv`"),
            _ if head.starts_with(b"\x80")
                && head.get(1).is_some_and(|version| (2..=5).contains(version)) =>
            {
                Self::Foreign("a Python pickle: write it as .npz or Parquet, in Python DataFrame.to_parquet")
            }
            _ if head.starts_with(b"\xd0\xcf\x11\xe0") => Self::Foreign("an old Excel file: save it as CSV"),
            [0xff, 0xfe, ..] | [0xfe, 0xff, ..] => Self::Foreign("UTF-16 text: save it as UTF-8"),
            [0x1f, 0x8b, ..] => Self::Foreign("compressed by gzip: gunzip it first"),
            [0x28, 0xb5, 0x2f, 0xfd, ..] => Self::Foreign("compressed by zstd: unzstd it first"),
            [b'B', b'Z', b'h', ..] => Self::Foreign("compressed by bzip2: bunzip2 it first"),
            [0xfd, b'7', b'z', b'X', b'Z', ..] => Self::Foreign("compressed by xz: unxz it first"),
            [b'{', ..] | [b'[', b'{', ..] => {
                Self::Foreign("JSON: write it as CSV, in Python pandas.read_json(…).to_csv")
            }
            [b'<', b'?' | b'!' | b'a'..=b'z', ..] => Self::Foreign("XML, such as the model of a robot"),
            _ => Self::Text,
        }
    }
}

/// The first bytes of `input`.
///
/// # Errors
/// [`ReadError::Io`].
pub(crate) fn head(input: &mut impl Read, file: &Path) -> Result<Vec<u8>, ReadError> {
    let mut head = Vec::new();
    let read = input.take(HEAD as u64).read_to_end(&mut head);
    read.map_err(|source| ReadError::Io { file: file.to_path_buf(), source })?;
    Ok(head)
}
