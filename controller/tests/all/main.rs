//! The tests of the controllers in one binary: they are linked once and run in parallel on all cores.
#![allow(clippy::unwrap_used, reason = "a test ends at the first surprise")]

mod chain;
mod simulation;

mod acceleration_programme;
mod answers;
mod any_arm;
mod compensation;
mod deviation;
mod horizon;
mod look_ahead;
mod passages;
mod qp;
mod remainder;
mod runs;
mod signals;
mod task;
