//! Do recording and model speak of the same arm, in the same units, signs, order and on the same clock?
//!
//! The files in the order in which data passes through them:
//!
//! - `reading`: how columns are read; what a recording is with that reading.
//! - `samples`: a recording as few, effectively independent rows.
//! - `change`: what a hypothesis changes, and its prior odds.
//! - `regression`, `problem`: the evidence of a set of changes.
//! - `search`: the best set, from several starts.
//! - `kinds`: what each kind of fault asks and says, one file each.
//! - `examine`: all of it; `finding`: what comes of it; `several`: of several recordings; `mapping`: as a mapping file.

mod change;
mod examine;
mod finding;
mod kinds;
mod mapping;
mod problem;
mod reading;
mod regression;
mod samples;
mod search;
mod several;

pub use examine::examine;
pub use finding::{Certainty, Setup, SetupFinding, sentences};
pub use kinds::time_unit::found as time_unit;
pub use reading::{PositionReading, Reading, TorqueReading};
pub use several::Mended;
