//! Exams of controllers and of the loop.
//!
//! - [`swap_command`] and `swap_measures`: the cost of a swap of controllers.
//! - [`faults`]: injected faults, and the outcome of each.
//! - [`mod@bench`]: the duration of every stage of the loop.
//! - `recorded`: a run with its recording.

pub mod bench;
pub mod faults;
mod recorded;
pub mod swap_command;
mod swap_measures;
