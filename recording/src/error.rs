//! Errors of reading and writing recordings, each with its remedy.

use std::io;
use std::path::PathBuf;

use freeplay_storage::StorageError;
use thiserror::Error;

use crate::mapping_error::MappingError;
use crate::names::ColumnError;
use crate::place::Place;

/// Reason why a file cannot be read as a recording. The message names the file, the line, the column, the value and the remedy, on one line.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum ReadError {
    /// The operating system cannot read the file.
    #[error("{}: {source}; check the path and the permissions", file.display())]
    Io {
        /// The file.
        file: PathBuf,
        /// The system's error.
        source: io::Error,
    },
    /// A folder instead of a file.
    #[error("{}: is a folder without a ROS bag or a LeRobot data set; name one recording in it", file.display())]
    Folder {
        /// The folder.
        file: PathBuf,
    },
    /// A pipe, device or socket instead of a file.
    #[error(transparent)]
    NotAFile(StorageError),
    /// No bytes.
    #[error("{}: the file is empty; a CSV begins with a header such as t,q1,q2", file.display())]
    Empty {
        /// The file.
        file: PathBuf,
    },
    /// A file of an unsupported kind.
    #[error("{}: {what}; the readable formats are CSV, MCAP, ROS bags, Parquet, .npz, .mat", file.display())]
    NotText {
        /// The file.
        file: PathBuf,
        /// Its kind and the remedy.
        what: &'static str,
    },
    /// A file of a known kind that can't be used.
    #[error("{}: {what}", file.display())]
    Unusable {
        /// The file.
        file: PathBuf,
        /// The reason and the remedy.
        what: String,
    },
    /// The first line holds numbers.
    #[error(
        "{place}: no header: the first line begins with {value:?}; put the column names first, e.g. t,q1,q2, or name the columns by number in a mapping file (columns = \"1\") for freeplay record import"
    )]
    NoHeader {
        /// The line.
        place: Place,
        /// Its first cell.
        value: String,
    },
    /// The column names do not form a recording.
    #[error("{place}: {source}")]
    Columns {
        /// The header.
        place: Place,
        /// The fault in the names.
        source: ColumnError,
    },
    /// A row with another number of cells than the header has.
    #[error(
        "{place}: expected {expected} cells as in the header, found {found}; complete or remove the row (decimals are written with a point, not a comma)"
    )]
    Ragged {
        /// The row.
        place: Place,
        /// Cells of the header.
        expected: usize,
        /// Cells of the row.
        found: usize,
    },
    /// A cell that is not a number.
    #[error("{place}: column {column}: {value:?} is not a number; {remedy}")]
    NotANumber {
        /// The row.
        place: Place,
        /// The column.
        column: String,
        /// The cell.
        value: String,
        /// The remedy.
        remedy: &'static str,
    },
    /// Every row lacks a required value.
    #[error(
        "{place}: {what}, and all {rows} rows lack such a value: no row is left; record it, or name another column for it in a mapping file: freeplay record import"
    )]
    NothingLeft {
        /// The first such row.
        place: Place,
        /// The missing value.
        what: String,
        /// Number of incomplete rows.
        rows: u64,
    },
    /// Time that jumps back, or stands still.
    #[error(
        "{place}: column t: {value:?} does not come after {previous:?} in the row before: the clock stands still, jumps back or begins again here; cut the file into one recording each, or correct the times from here on"
    )]
    Time {
        /// The row.
        place: Place,
        /// Its time, s.
        value: f64,
        /// The time of the row before, s.
        previous: f64,
    },
    /// A line longer than any line of a recording.
    #[error("{place}: the line is longer than {limit} bytes; not a CSV, or a quote that is never closed")]
    LongLine {
        /// Beginning of the line.
        place: Place,
        /// The longest line read, bytes.
        limit: usize,
    },
    /// More numbers than the reader keeps in memory.
    #[error("{}: {columns} columns of {rows} rows or more are above the limit of {limit} numbers (8 bytes each); {remedy}", file.display())]
    TooLarge {
        /// The file.
        file: PathBuf,
        /// Its columns.
        columns: usize,
        /// Number of its rows, exact or estimated.
        rows: u64,
        /// The limit.
        limit: u64,
        /// A way to thin the recording.
        remedy: String,
    },
    /// A header and nothing below it.
    #[error("{}: no samples{why}; record some motion", file.display())]
    NoSamples {
        /// The file.
        file: PathBuf,
        /// The reason, if the file states it.
        why: &'static str,
    },
    /// Columns of unequal length, in a recording made in memory.
    #[error("{}: column {column} has {found} values, t has {expected}; give every column one value per sample", file.display())]
    Lengths {
        /// The recording.
        file: PathBuf,
        /// The column.
        column: String,
        /// Number of its values.
        found: usize,
        /// Values of the first column.
        expected: usize,
    },
    /// An MCAP file that contradicts itself.
    #[error("{}: damaged at byte {offset}: {what}; `mcap recover` saves what is left", file.display())]
    Damaged {
        /// The file.
        file: PathBuf,
        /// Offset at which the damaged record begins.
        offset: u64,
        /// The fault.
        what: String,
    },
    /// An MCAP file with a compression that this crate cannot read.
    #[error("{}: chunks are compressed with {compression:?}; convert it: `mcap compress --compression zstd`", file.display())]
    Compression {
        /// The file.
        file: PathBuf,
        /// The compression.
        compression: String,
    },
    /// An MCAP file without Freeplay's topic.
    #[error("{}: no topic {expected}; found: {topics}; record with `freeplay run`, or turn a ROS 2 bag into a recording with `freeplay record import`", file.display())]
    NoTopic {
        /// The file.
        file: PathBuf,
        /// The topic.
        expected: &'static str,
        /// The topics of the file.
        topics: String,
    },
    /// The mapping does not fit the file.
    #[error(transparent)]
    Mapping(Box<MappingError>),
    /// A bag without joint states.
    #[error("{}: no topic of type {expected}; found: {topics}", file.display())]
    NoJointStates {
        /// The file.
        file: PathBuf,
        /// The type.
        expected: &'static str,
        /// The topics of the file, with their types.
        topics: String,
    },
    /// A bag with several topics of the required type.
    #[error("{}: several topics of type {kind}: {topics}; choose one with {option}", file.display())]
    ManyTopics {
        /// The file.
        file: PathBuf,
        /// The type.
        kind: &'static str,
        /// The topics.
        topics: String,
        /// The option that selects one.
        option: &'static str,
    },
    /// A message of a bag that cannot be used.
    #[error("{place}: topic {topic}: {what}")]
    Bag {
        /// The message.
        place: Place,
        /// Its topic.
        topic: String,
        /// The fault and the remedy.
        what: String,
    },
    /// A topic or a message in a form that this crate does not read.
    #[error(
        "{place}: topic {topic}: {what}; it must be written as float64 fields, schema ros2msg, messages cdr (little-endian)"
    )]
    Form {
        /// The message, or the file if the topic itself is at fault.
        place: Place,
        /// The topic.
        topic: &'static str,
        /// The fault.
        what: String,
    },
}

/// Reason why a recording cannot be written.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum WriteError {
    /// The file name has no known ending for a format.
    #[error("{}: a recording is written as .csv or .mcap, or exported as .parquet; choose one of these endings", file.display())]
    Ending {
        /// The file.
        file: PathBuf,
    },
    /// The file cannot be created.
    #[error("{}: cannot be created: {source}; check the folder and its permissions", file.display())]
    Create {
        /// The file.
        file: PathBuf,
        /// The system's error.
        source: io::Error,
    },
    /// The columns do not form a recording.
    #[error(transparent)]
    Columns(#[from] ColumnError),
    /// A row of another width than the layout.
    #[error("{}: row {row}: expected {expected} values, found {found}", file.display())]
    Width {
        /// The file.
        file: PathBuf,
        /// The row, counted from 1.
        row: u64,
        /// Columns of the layout.
        expected: usize,
        /// Values of the row.
        found: usize,
    },
    /// An event without a time.
    #[error("{}: event {kind:?} has the time {t}; give a finite time in seconds", file.display())]
    EventTime {
        /// The file.
        file: PathBuf,
        /// The event's kind.
        kind: String,
        /// Its time.
        t: f64,
    },
    /// The system refuses further bytes.
    #[error("{}: writing stopped after {kept} of {rows} rows: {source}; the rows before it stay readable; free some space or write elsewhere", file.display())]
    Stopped {
        /// The file.
        file: PathBuf,
        /// Rows handed over, the last one included.
        rows: u64,
        /// Rows known to be in the file.
        kept: u64,
        /// The system's error.
        source: io::Error,
    },
    /// An export that failed before its end.
    #[error("{}: the export stopped: {source}; an existing file is unchanged; free some space or write elsewhere", file.display())]
    NotExported {
        /// The file.
        file: PathBuf,
        /// The system's error.
        source: io::Error,
    },
    /// Writing on after an error or after the end.
    #[error("{}: the recording takes no more rows: an earlier error closed it, or it is finished", file.display())]
    Closed {
        /// The file.
        file: PathBuf,
    },
}

impl From<MappingError> for ReadError {
    fn from(error: MappingError) -> Self {
        Self::Mapping(Box::new(error))
    }
}
