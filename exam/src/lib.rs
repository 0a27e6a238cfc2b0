//! Exams of controllers and of the loop.
//!
//! - [`swap_command`] and `swap_measures`: what a swap of controllers costs.
//! - [`faults`]: faults injected on purpose, and what comes of each.
//! - [`mod@bench`]: how long every stage of the loop takes.
//! - `recorded`: a run with what it recorded.

pub mod bench;
pub mod faults;
mod recorded;
pub mod swap_command;
mod swap_measures;
