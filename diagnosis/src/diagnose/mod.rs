//! From a recording to what the model leaves out. The files in the order in which data passes through them:
//!
//! - `parts`: what a fit rests on and what is held out.
//! - `stage`: one recording made ready, and what any effect would add to each channel of it.
//! - `tolerance`: how far a machine may be from its model without that being a finding.
//! - `universal`: the unnamed correction, which competes with every named effect.
//! - `stuck` and `counted`: torques that are no measurement; how much each row counts.
//! - `case`, `columns`, `bounded`, `system` and `scores`: all recordings stacked; their columns; least squares inside bounds; the linear system behind
//!   every question; what blocks of columns explain there.
//! - `quality`: what the recordings are good for.
//! - `hypothesis`, `moment` and `upon`: each kind of effect at each place in each shape; what happens in one recording alone, and what acts on what other
//!   laws say.
//! - `noise`, `twins` and `floor`: what is found in nothing.
//! - `search`, `places`, `select`, `backward`, `refine` and `simplify`: which effects explain what the model leaves, in which shape, and with no more law than there is;
//!   `validate`: whether they do so where they were not fitted.
//! - `show`, `trial`, `judge`, `proven`, `sift` and `other_choices`: what they are worth on held-out data, and whether others are worth more.
//! - `excess`: whether more is left than noise explains.
//! - `variables` and `passage`: what pictures are drawn from.
//! - `through`: what the sensors let through of the machine's tolerances.
//! - `robust`: numbers that a few rows don't bend.
//! - `interval`, `numbers`, `rivals`, `locate`, `words`, `conclude`, `report`: what is said.
//! - `engine`: all of it, of recordings as they stand; `set_up`: after the question whether recording and model mean the same.
//! - `excite`: the next motion, where two causes remain.

mod backward;
mod beside;
mod bounded;
mod case;
mod columns;
mod conclude;
mod counted;
mod engine;
mod excess;
mod excite;
mod floor;
mod hypothesis;
mod interval;
mod journal;
mod judge;
mod locate;
mod moment;
mod noise;
mod numbers;
mod other_choices;
mod parts;
mod passage;
mod places;
mod proven;
mod quality;
mod refine;
mod report;
mod rivals;
mod robust;
mod scores;
mod search;
mod select;
mod set_up;
mod show;
mod sift;
mod simplify;
mod stage;
mod system;
mod through;
mod tolerance;
mod trial;
mod twins;
mod universal;
mod upon;
mod validate;
mod variables;
mod words;

pub use engine::{DiagnoseError, DiagnoseSettings};
pub use excite::{ChannelNoise, Excitation, ExciteError, ExciteSettings, Fourier, Rival, Used, excite};
pub use locate::Map;
pub use passage::{Passage, Trace};
pub use report::{
    Alternative, DIAGNOSIS_SCHEMA, Diagnosis, Effect, Evidence, EvidenceRow, Fit, Location, Parameter, Rmse,
    Tuned, Untestable, Verdict,
};
pub use set_up::diagnose;
pub use show::Gain;
pub use tolerance::Tolerances;
pub use variables::Variable;
pub use words::TO_TELL;
pub(crate) use words::{phrase, statement};
