//! From a recording to what the model leaves out. The files in the order in which data passes through them:
//!
//! - `thinning` and `stage`: recordings made ready, and what any effect would add to each channel of them.
//! - `tolerance`: how far a machine may be from its model without that being a finding.
//! - `rows`, `parts` and `data`: which rows count, which of the three parts of the data they belong to, all of them stacked.
//! - `noise`, `instruments`, `shapes` and `weights`: how much each row says.
//! - `candidate`: every effect at every place in every form, as columns.
//! - `event`, `moments`, `whitening`, `windows` and `tails`: what happens at a time.
//! - `system` and `bvls`: the linear model and its evidence.
//! - `search` and `choice`: the most probable set of effects.
//! - `held`: joints that were told to move and stand.
//! - `nameless`, `alternatives`, `interval`, `joined`, `gain`, `locate`, `words`, `passage` and `conclude`: what is said, tested on data that no search sees.
//! - `excite`: the next motion, where two causes remain.
//! - `engine`: all of it, of recordings as they stand; `set_up`: after the question whether recording and model mean the same.

mod alternatives;
mod beside;
mod block;
mod bvls;
mod candidate;
mod choice;
mod columns;
mod conclude;
mod confirm;
mod data;
mod engine;
mod event;
mod excite;
mod gain;
mod held;
mod instruments;
mod interval;
mod joined;
mod locate;
mod moments;
mod nameless;
mod noise;
mod parts;
mod passage;
mod quality;
mod report;
mod rows;
mod search;
mod set_up;
mod shapes;
mod stage;
mod system;
mod tails;
mod thinning;
mod tolerance;
mod variables;
mod weights;
mod whitening;
mod windows;
mod words;

pub use crate::statistics::STRONG as NAMED_FROM;
pub(crate) use alternatives::LISTED;
pub(crate) use conclude::insufficient;
pub use engine::{DiagnoseError, DiagnoseSettings};
pub use excite::{ChannelNoise, Excitation, ExciteError, ExciteSettings, Fourier, Rival, Used, excite};
pub use gain::Gain;
pub(crate) use locate::BINS;
pub use locate::Map;
pub(crate) use noise::Noises;
pub use passage::{Passage, Trace};
pub use report::{
    Alternative, DIAGNOSIS_SCHEMA, Diagnosis, Discrepancy, Effect, Evidence, EvidenceRow, Fit, Location,
    Parameter, Rmse, Tuned, Untestable, Verdict,
};
pub use set_up::diagnose;
pub(crate) use thinning::bounded;
pub use tolerance::Tolerances;
pub use variables::Variable;
pub use words::TO_TELL;
pub(crate) use words::{odds, phrase, statement};
