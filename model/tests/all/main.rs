//! The tests of model files: robots of other authors, faulty files, and files for other tools, in one program.
#![allow(clippy::unwrap_used, reason = "a test ends at the first surprise")]

#[path = "../../../arm/tests/all/common/mod.rs"]
mod common;

mod bad_models;
mod export;
mod fuzz_models;
mod mjcf;
mod model_files;
mod robots;
