//! The input of a reader: where it comes from, and how much of it is wanted.

use std::path::Path;

use crate::error::ReadError;
use crate::place::{Place, Row};

/// The most numbers (rows times columns) that one recording may hold: 2 GiB of them. While the columns
/// grow, up to twice that may be in use for a moment.
pub const MAX_NUMBERS: u64 = 1 << 28;

/// The input of a reader, with what is known of it and how much of it is wanted.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Source<'a> {
    /// Its name, for messages.
    pub file: &'a Path,
    /// Its length, bytes, where it has one.
    pub size: Option<u64>,
    /// The joints of the arm, where they are known.
    pub joints: Option<usize>,
    /// The most numbers to read.
    pub limit: u64,
    /// Rows of the overview, where no more is wanted.
    pub overview: Option<usize>,
}

impl<'a> Source<'a> {
    /// All of the file at `file`, of any arm.
    pub fn of(file: &'a Path) -> Self {
        Self { file, size: None, joints: None, limit: MAX_NUMBERS, overview: None }
    }

    /// Fails if `rows` of so many `columns` are more numbers than what is read; `remedy` says what to do then.
    pub fn check_size(&self, columns: usize, rows: u64, remedy: &str) -> Result<(), ReadError> {
        if rows.saturating_mul(columns as u64) <= self.limit {
            return Ok(());
        }
        let (file, remedy) = (self.file.to_path_buf(), remedy.to_owned());
        Err(ReadError::TooLarge { file, columns, rows, limit: self.limit, remedy })
    }

    /// A place in this input.
    pub fn place(&self, row: Row) -> Place {
        Place { file: self.file.to_path_buf(), row }
    }
}
