//! The tests of the controllers, in one program: they are linked once, and run side by side on all cores.
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
