//! The tests of the diagnosis, in one program: linked once, they run in parallel on all cores.
#![allow(clippy::unwrap_used, reason = "a test ends at the first surprise")]

mod common;
mod generated;

mod constants;
mod cutoff;
mod diagnose;
mod excite;
mod journals;
mod known_answers;
mod missing;
mod notes;
mod plain_recordings;
mod real_recordings;
mod servos;
mod servos_beside_torque;
mod set_up;
mod teeth;
