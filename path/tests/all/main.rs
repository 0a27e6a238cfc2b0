//! The tests of paths, in one program: they are linked once, and run side by side on all cores.
#![allow(clippy::unwrap_used, reason = "a test ends at the first surprise")]

mod common;

mod allocation;
mod files;
mod joint_path;
mod properties;
mod spec;
mod tool_path;
