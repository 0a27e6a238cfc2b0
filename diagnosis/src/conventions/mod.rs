//! Tests that recording and model describe the same arm, in the same units, signs, order and on the same clock.
//!
//! The files in the order in which data passes through them:
//!
//! - `reading`: the reading of columns, and its application to a recording.
//! - `samples`: a recording as few, effectively independent rows.
//! - `change`: the changes of a hypothesis, and their prior odds.
//! - `bodies`, `along`: the arm along a motion; `normal`, `torques`: its fit to the recorded torques; `problem`: the evidence of a set of changes.
//! - `search`: the best set, from several starts.
//! - `kinds`: the hypotheses and findings of each kind of fault, one file each.
//! - `examine`: the whole test; `finding`: its result; `several`: for several recordings; `mapping`: as a mapping file.

mod along;
mod bodies;
mod change;
mod examine;
mod finding;
mod free_arm;
mod kinds;
mod mapping;
mod normal;
mod odds;
mod outcome;
mod problem;
mod reading;
mod samples;
mod search;
mod several;
mod torques;

pub(crate) use change::Late;
pub use examine::examine;
pub use finding::{Certainty, Setup, SetupFinding, sentences};
pub(crate) use kinds::clock_offset::unsure as clock_unsure;
pub(crate) use kinds::joint_zero::unsure as zero_unsure;
pub use kinds::time_unit::found as time_unit;
pub use reading::{PositionReading, Reading, TorqueReading};
pub use several::Mended;
