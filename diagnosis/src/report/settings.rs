//! The options of a diagnosis, and the reasons of its failure.

use freeplay_laws::LawError;
use thiserror::Error;

use crate::data::tolerance::Tolerances;
use crate::error::ResidualError;
use crate::signals::motion::Settings;

/// The options of a diagnosis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DiagnoseSettings {
    /// The treatment of recordings.
    pub treatment: Settings,
    /// Permitted differences between machine and model: within them there is no finding.
    pub tolerances: Tolerances,
    /// Seed of all random numbers.
    pub seed: u64,
}

impl Default for DiagnoseSettings {
    fn default() -> Self {
        Self { treatment: Settings::default(), tolerances: Tolerances::default(), seed: 1 }
    }
}

/// Reason why there is no diagnosis.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum DiagnoseError {
    /// No recording.
    #[error("no recording: give at least one")]
    NoRecording,
    /// The recordings have different columns.
    #[error(
        "{first} and {other} hold different columns; diagnose them one by one, or record the same columns"
    )]
    DifferentColumns {
        /// The first recording.
        first: String,
        /// One that differs.
        other: String,
    },
    /// Model and recording can't be compared.
    #[error(transparent)]
    Residual(#[from] ResidualError),
    /// The effects of the model are invalid.
    #[error("the model's effects: {0}")]
    Law(#[from] LawError),
    /// The equations of this recording are singular in double precision.
    #[error(
        "the fit of the model's tolerances to this recording is singular; are q in rad (or m), tau in N*m and t in s?"
    )]
    Singular,
}
