//! The tests of recordings: formats, imports and damaged files, in one program: they are linked once, and run in parallel on all cores.
//!
//! Tests that measure the peak memory of a process have separate programs.
#![allow(clippy::unwrap_used, reason = "a test ends at the first surprise")]

mod bad_files;
mod bit_flips;
mod csv_forms;
mod foreign_mcap;
mod fuzz;
mod import;
mod other_packages;
mod other_readers;
mod parquet;
mod real_recordings;
mod round_trip;
