//! The tests of FMUs in one binary: they are linked once and run in parallel on all cores.
#![allow(clippy::unwrap_used, reason = "a test ends at the first surprise")]

mod instance;
mod states;
