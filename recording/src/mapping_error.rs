//! Errors of a mapping file, each with its remedy.

use std::path::PathBuf;

use thiserror::Error;

use crate::place::Place;

/// Reason why a mapping can't be used. The message names the mapping file, line, column, value and remedy.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum MappingError {
    /// The file can't be read.
    #[error("mapping {}: {source}; check the path and the permissions", file.display())]
    Unreadable {
        /// The file.
        file: PathBuf,
        /// The system's error.
        source: std::io::Error,
    },
    /// Not TOML, an unknown key, one missing or of the wrong type.
    #[error("{at}: {message}")]
    Syntax {
        /// The place.
        at: Place,
        /// The cause in plain words, and the line with a mark.
        message: String,
    },
    /// A unit that does not fit the quantity.
    #[error("{at}: {key}.unit = {unit:?} is none of its units: {known}; give one of these")]
    Unit {
        /// The place.
        at: Place,
        /// The quantity.
        key: &'static str,
        /// The unit.
        unit: String,
        /// The valid units.
        known: String,
    },
    /// An invalid separator or decimal sign.
    #[error(
        "{at}: {key} = {value:?} is not possible; give a single ASCII character other than a digit or a quote"
    )]
    Sign {
        /// The place.
        at: Place,
        /// The key.
        key: &'static str,
        /// The value.
        value: char,
    },
    /// NaN or infinity.
    #[error("{at}: {key}.{what} holds {value}; give finite numbers")]
    NotFinite {
        /// The place.
        at: Place,
        /// The quantity.
        key: &'static str,
        /// The key in its table.
        what: &'static str,
        /// The value.
        value: f64,
    },
    /// A named column is not in the recording.
    #[error("{at}: {key}.columns: {recording} has no column {column:?}; it has {found}: correct the name")]
    NoColumn {
        /// The place.
        at: Place,
        /// The quantity.
        key: &'static str,
        /// The recording, at its header.
        recording: Box<Place>,
        /// The column.
        column: String,
        /// The columns of the recording, shortened.
        found: String,
    },
    /// The number of columns, names or numbers differs from that of the quantity.
    #[error("{at}: {key}: {found} {what}, expected {expected}; give one for each")]
    Count {
        /// The place.
        at: Place,
        /// The quantity.
        key: &'static str,
        /// Columns, names, factors and so on.
        what: &'static str,
        /// The number found.
        found: usize,
        /// The number expected.
        expected: usize,
    },
    /// A joint number that does not exist.
    #[error("{at}: relative: there is no joint {number}; give a number from 1 to {joints}")]
    NoJoint {
        /// The place.
        at: Place,
        /// The number.
        number: usize,
        /// Joints of the recording.
        joints: usize,
    },
    /// One column for two quantities.
    #[error("{at}: column {column:?} is named for {one} and for {other}; name it once")]
    Twice {
        /// The place of the second quantity.
        at: Place,
        /// The column.
        column: String,
        /// The contract's name of the first quantity.
        one: String,
        /// The contract's name of the second quantity.
        other: String,
    },
}
