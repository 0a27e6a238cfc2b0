//! The tests of the plant, in one program: they are linked once, and run side by side on all cores.
#![allow(clippy::unwrap_used, reason = "a test ends at the first surprise")]

mod common;

mod catalogue;
mod effects;
mod energy;
mod impacts;
mod loop_allocations;
mod plays;
mod stiction;
