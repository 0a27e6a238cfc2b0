//! The defects of a path file, with their places.

use std::fmt;
use std::path::PathBuf;

/// Fewest rows of a path file.
pub const FEWEST_ROWS: usize = 4;

/// A place in a file: line and column (the ordinal of the field), both counted from 1.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Place {
    /// The file.
    pub file: PathBuf,
    /// The line, from 1.
    pub line: u64,
    /// The field within the line, from 1.
    pub column: usize,
}

impl fmt::Display for Place {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}:{}:{}", self.file.display(), self.line, self.column)
    }
}

/// Reason why a path file could not be read.
#[derive(thiserror::Error, Debug)]
pub enum FileError {
    /// The file cannot be read.
    #[error(transparent)]
    Storage(#[from] freeplay_storage::StorageError),
    /// The file is not text.
    #[error("{}: {source}", file.display())]
    Read {
        /// The file.
        file: PathBuf,
        /// The reader's error.
        source: csv::Error,
    },
    /// A required column is not in the header.
    #[error("{place}: column {name} is missing: the header is t,q1…qn or t,x,y,z[,qx,qy,qz,qw]")]
    MissingColumn {
        /// The header.
        place: Place,
        /// The required column.
        name: String,
    },
    /// A required column is in the header twice.
    #[error("{place}: column {name} appears twice: remove one")]
    DuplicateColumn {
        /// The second one.
        place: Place,
        /// Its name.
        name: String,
    },
    /// The file is for another arm.
    #[error("{place}: the file has {found} joint column(s), the arm {expected} joint(s)")]
    JointCount {
        /// The last joint column.
        place: Place,
        /// Joint columns in the header.
        found: usize,
        /// Joints of the arm.
        expected: usize,
    },
    /// A row is shorter or longer than the header.
    #[error("{place}: the row has {found} fields, the header {expected}")]
    Ragged {
        /// The row.
        place: Place,
        /// Fields of the row.
        found: usize,
        /// Fields of the header.
        expected: usize,
    },
    /// A field is not a finite number.
    #[error("{place}: {name} = {text:?} is not a finite number")]
    NotANumber {
        /// The field.
        place: Place,
        /// Its column.
        name: String,
        /// Its text, cut if it is long.
        text: String,
    },
    /// A time does not increase.
    #[error("{place}: t = {time} s does not come after {previous} s: time has to increase")]
    TimeNotIncreasing {
        /// The field.
        place: Place,
        /// The time found, s.
        time: f64,
        /// The time of the row before, s.
        previous: f64,
    },
    /// A quaternion whose norm is too far from 1.
    #[error("{place}: qx,qy,qz,qw have norm {norm}: a unit quaternion is needed")]
    Quaternion {
        /// The row.
        place: Place,
        /// The norm found.
        norm: f64,
    },
    /// Too few rows for a smooth curve.
    #[error("{}: {found} rows; at least {FEWEST_ROWS} are needed", file.display())]
    TooFewRows {
        /// The file.
        file: PathBuf,
        /// Rows found.
        found: usize,
    },
    /// More rows than the memory limit permits.
    #[error("{place}: more than {most} rows (over all laps): use fewer rows or laps")]
    TooManyRows {
        /// The first row too many.
        place: Place,
        /// The most rows of this width.
        most: usize,
    },
    /// Several laps of a file whose last row differs from its first.
    #[error(
        "{place}: {name} ends at {last} but begins at {first}: for several laps the last row repeats the first"
    )]
    NotClosed {
        /// The field of the last row.
        place: Place,
        /// Its column.
        name: String,
        /// Value in the first row.
        first: f64,
        /// Value in the last row.
        last: f64,
    },
}
