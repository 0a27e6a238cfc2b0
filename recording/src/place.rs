//! A place in a file.

use std::fmt;
use std::path::PathBuf;

/// A place in a recording.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Place {
    /// The file.
    pub file: PathBuf,
    /// The row in it.
    pub row: Row,
}

/// A row of a recording, with the numbering of its format.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Row {
    /// No particular row: the recording as a whole.
    Whole,
    /// A line of a CSV, counted from 1, the header included.
    Line(u64),
    /// A line and a column of a text such as a mapping file, each counted from 1.
    Cell(u64, u64),
    /// A message on the topic of an MCAP file, counted from 1.
    Message(u64),
    /// A sample of a recording made in memory, counted from 1.
    Sample(u64),
}

impl fmt::Display for Place {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let file = self.file.display();
        match self.row {
            Row::Whole => write!(f, "{file}"),
            Row::Line(line) => write!(f, "{file}:{line}"),
            Row::Cell(line, column) => write!(f, "{file}:{line}:{column}"),
            Row::Message(message) => write!(f, "{file}, message {message}"),
            Row::Sample(sample) => write!(f, "{file}, sample {sample}"),
        }
    }
}
