//! Differences between a model and a recording: residuals and their causes.
//!
//! The folders follow the data, each below the one before: `signals`, `conventions`, `data`, `candidates`, `evidence`, `search`, `choice`, `report`,
//! `findings`; beside them are `compare`, `servo` and `next_motion`, and on top `diagnose` and [`page`]. A file uses no folder later in this list than its own:
//! the test `modules` of the command checks the paths.
//!
//! The nouns, in the order in which data passes through them:
//!
//! - [`Settings`]: the options of the preparation; [`default_cutoff_hz`] sets the default cutoff.
//! - [`Grid`]: the uniform time grid of a recording, cut at gaps.
//! - [`LowPass`]: the zero-phase filter that every column passes; [`derivatives`] on a uniform grid.
//! - [`Treatment`]: grid, filter, trimmed ends and decimation, the same for every measured or modelled column; it makes the [`freeplay_laws::Trajectory`] of a
//!   recording.
//! - [`Residuals`]: one [`Channel`] for each measured quantity that the model can predict ([`Kind`]): torques, tool position, link encoders; [`residuals`]
//!   computes them from the [`freeplay_laws::Prediction`] of the arm with its effects.
//! - [`Comparison`]: the [`ChannelError`] of each channel; [`compare`] runs all of the above and makes it, part by part for long recordings.
//! - [`compare_commands`]: the same for measured against commanded positions, in recordings without other channels ([`commands_alone`]).
//! - [`beyond_limits`]: the joints with recorded positions beyond their limits, in words.
//! - [`examine`]: a test that recording and model use the same conventions. Its [`Setup`] holds [`SetupFinding`]s with their [`Certainty`] and [`sentences`],
//!   and the [`Reading`] ([`PositionReading`], [`TorqueReading`]) that corrects the recording; [`Mended`] is the reading of several recordings.
//! - [`diagnose`]: from recordings to a [`Diagnosis`] with its [`Verdict`]: where they differ from the model ([`Location`], [`Map`]), the missing effects
//!   ([`Effect`] with its [`Parameter`]s and [`Evidence`]), the other effects compared ([`Alternative`], [`EvidenceRow`]), the untestable ones
//!   ([`Untestable`]), the relative accuracy of the model ([`Discrepancy`]), its improvement on the test part of the data ([`Fit`], [`Gain`]), and the data of
//!   the pictures ([`Passage`], [`Trace`], [`Variable`]). A finding needs odds of [`NAMED_FROM`]. [`DiagnoseSettings`] with [`Tolerances`] are the options,
//!   [`DiagnoseError`] is the reason of a failure.
//! - [`excite`]: the next motion, an [`Excitation`] of the family [`Fourier`] that separates causes ([`Rival`]s) which a recording could not.
//!   [`ExciteSettings`] with the [`ChannelNoise`] are the options, [`Used`] is the use of the limits, [`ExciteError`] the reason of a failure.
//! - [`page`]: a diagnosis as an HTML report, and the words for its parts.
//! - [`recorded`]: a recording of the arm that a model describes, with checks of its units.
//! - [`ResidualError`]: why a recording and a model can't be compared.

mod candidates;
mod choice;
mod compare;
mod conventions;
mod data;
mod diagnose;
mod error;
mod evidence;
mod findings;
#[cfg(test)]
#[path = "../tests/all/common/mod.rs"]
mod made;
mod next_motion;
pub mod page;
mod random;
pub mod recorded;
mod report;
mod search;
mod servo;
mod signals;
mod sorting;
mod statistics;

pub use candidates::candidate::Untestable;
pub use compare::channel_error::ChannelError;
pub use compare::comparison::{Comparison, SCHEMA, compare};
pub use compare::notes::beyond_limits;
pub use conventions::{
    Certainty, Mended, PositionReading, Reading, Setup, SetupFinding, TorqueReading, examine, sentences,
    time_unit,
};
pub use data::tolerance::Tolerances;
pub use diagnose::diagnose;
pub use error::ResidualError;
pub use evidence::gain::Gain;
pub use next_motion::{Excitation, ExciteError, ExciteSettings, Fourier, Rival, Used, excite};
pub use report::diagnosis::{
    Alternative, ChannelNoise, DIAGNOSIS_SCHEMA, Diagnosis, Discrepancy, Effect, Evidence, EvidenceRow, Fit,
    Location, Map, Parameter, Passage, Rmse, Trace, Tuned, Variable, Verdict,
};
pub use report::settings::{DiagnoseError, DiagnoseSettings};
pub use report::words::TO_TELL;
pub use servo::{commands_alone, compare_all, compare_commands};
pub use signals::channel::{Channel, Kind};
pub use signals::filter::{LowPass, derivatives};
pub use signals::grid::Grid;
pub use signals::motion::{Settings, Treatment, default_cutoff_hz};
pub use signals::residual::{Residuals, residuals};
pub use statistics::STRONG as NAMED_FROM;
