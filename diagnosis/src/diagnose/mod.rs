//! The diagnosis from end to end: set-up first, then torques and poses, then commanded positions.

mod engine;
mod set_up;

pub use set_up::diagnose;
