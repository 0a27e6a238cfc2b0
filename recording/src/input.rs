//! The input of a reader: its source, and the required amount of it.

use std::path::Path;

use crate::error::ReadError;
use crate::place::{Place, Row};

/// Largest number of values (rows times columns) in one recording: 2 GiB of them. While the columns grow, memory use may reach twice that for a short time.
pub const MAX_NUMBERS: u64 = 1 << 28;

/// The input of a reader, with its known properties and the required amount of it.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Source<'a> {
    /// Its name, for messages.
    pub file: &'a Path,
    /// Its length, bytes, if it has one.
    pub size: Option<u64>,
    /// The number of joints of the arm, if it is known.
    pub joints: Option<usize>,
    /// The most numbers to read.
    pub limit: u64,
    /// Rows of the overview, if only that is required.
    pub overview: Option<usize>,
}

impl<'a> Source<'a> {
    /// All of the file at `file`, of any arm.
    pub fn of(file: &'a Path) -> Self {
        Self { file, size: None, joints: None, limit: MAX_NUMBERS, overview: None }
    }

    /// Fails if `rows` of so many `columns` exceed the limit; `remedy` is part of the message.
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
