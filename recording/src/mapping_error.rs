//! What can be wrong with a mapping file, and what to do about it.

use std::path::PathBuf;

use thiserror::Error;

use crate::place::Place;

/// Why a mapping can't be used. The message names the mapping file, line, column, value and what to do.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum MappingError {
    /// The file can't be read.
    #[error("mapping {}: {source}; check the path and the permissions", file.display())]
    Unreadable {
        /// The file.
        file: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
    /// Not TOML, an unknown key, one missing or of the wrong type.
    #[error("{at}: {message}")]
    Syntax {
        /// Where.
        at: Place,
        /// The cause in plain words, and the line with a mark.
        message: String,
    },
    /// A unit that the quantity is not given in.
    #[error("{at}: {key}.unit = {unit:?} is none of its units: {known}; give one of these")]
    Unit {
        /// Where.
        at: Place,
        /// The quantity.
        key: &'static str,
        /// What is given.
        unit: String,
        /// What may be given.
        known: String,
    },
    /// A separator or decimal sign that no CSV has.
    #[error("{at}: {key} = {value:?} cannot be; give a single ASCII character other than a digit or a quote")]
    Sign {
        /// Where.
        at: Place,
        /// The key.
        key: &'static str,
        /// What is given.
        value: char,
    },
    /// A number that is none.
    #[error("{at}: {key}.{what} holds {value}; give finite numbers")]
    NotFinite {
        /// Where.
        at: Place,
        /// The quantity.
        key: &'static str,
        /// The key in its table.
        what: &'static str,
        /// What is given.
        value: f64,
    },
    /// A named column is not in the recording.
    #[error("{at}: {key}.columns: {recording} has no column {column:?}; it has {found}: correct the name")]
    NoColumn {
        /// Where.
        at: Place,
        /// The quantity.
        key: &'static str,
        /// The recording, at its header.
        recording: Box<Place>,
        /// The column.
        column: String,
        /// The columns that are there, shortened.
        found: String,
    },
    /// Another number of columns, names or numbers than the quantity has.
    #[error("{at}: {key}: {found} {what}, expected {expected}; give one for each")]
    Count {
        /// Where.
        at: Place,
        /// The quantity.
        key: &'static str,
        /// Columns, names, factors and so on.
        what: &'static str,
        /// How many there are.
        found: usize,
        /// How many there should be.
        expected: usize,
    },
    /// A joint by a number that none has.
    #[error("{at}: relative: there is no joint {number}; give a number from 1 to {joints}")]
    NoJoint {
        /// Where.
        at: Place,
        /// What is given.
        number: usize,
        /// Joints of the recording.
        joints: usize,
    },
    /// One column for two quantities.
    #[error("{at}: column {column:?} is named for {one} and for {other}; name it once")]
    Twice {
        /// Where the second stands.
        at: Place,
        /// The column.
        column: String,
        /// The first name of ours.
        one: String,
        /// The second.
        other: String,
    },
}
