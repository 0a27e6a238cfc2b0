//! Where a model and a recording differ: residuals, and what they are made of.
//!
//! The folders follow the data, each below the one before: `signals`, `conventions`, `data`, `candidates`, `evidence`, `search`, `choice`, `report`, `findings`; beside
//! them `compare`, `servo` and `next_motion`, and above all `diagnose` and [`page`]. A file names no folder after its own: the command's test `modules` reads the paths.
//!
//! The nouns, in the order in which data passes through them:
//!
//! - [`Settings`]: what a user may choose of the treatment; [`default_cutoff_hz`] is the rule for the rest.
//! - [`Grid`]: the uniform time grid that a recording is put on, cut where the recording has gaps.
//! - [`LowPass`]: the filter without phase that every column passes; [`derivatives`] on a uniform grid.
//! - [`Treatment`]: grid, filter, the ends left out, decimation: the same for every column, measured or modelled; it makes the
//!   [`freeplay_laws::Trajectory`] of a recording.
//! - [`Residuals`]: one [`Channel`] for each thing measured that the model can predict ([`Kind`]): torques, tool position, link
//!   encoders; made by [`residuals`] from the [`freeplay_laws::Prediction`] of the arm with its effects.
//! - [`Comparison`]: the [`ChannelError`] of each channel; made by [`compare`], which does all of the above, of long recordings part by part.
//! - [`compare_commands`]: the same for measured positions against commanded ones, where these are all there is ([`commands_alone`]).
//! - [`beyond_limits`]: the joints that a recording has where they can't be, in words.
//! - [`examine`]: whether a recording and a model mean the same: a [`Setup`] of [`SetupFinding`]s with their [`Certainty`] and [`sentences`], and the [`Reading`]
//!   ([`PositionReading`], [`TorqueReading`]) that mends it; [`Mended`] is that of several recordings.
//! - [`diagnose`]: from recordings to a [`Diagnosis`] with its [`Verdict`]: where they differ from the model ([`Location`], [`Map`]),
//!   what is missing ([`Effect`] with its [`Parameter`]s and [`Evidence`]), what else was weighed ([`Alternative`], [`EvidenceRow`]),
//!   what can't be told ([`Untestable`]), to what the machine follows its laws ([`Discrepancy`]), how much better the model gets on the test part of the
//!   data ([`Fit`], [`Gain`]), and what pictures are drawn from ([`Passage`], [`Trace`], [`Variable`]); findings are named from odds of [`NAMED_FROM`] on;
//!   [`DiagnoseSettings`] with [`Tolerances`] say what is asked, [`DiagnoseError`] why there is no answer.
//! - [`excite`]: the next motion, an [`Excitation`] of the family [`Fourier`], that separates causes ([`Rival`]s) which a recording could
//!   not; [`ExciteSettings`] with the [`ChannelNoise`] say what is asked, [`Used`] how safe it is, [`ExciteError`] why there is none.
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
