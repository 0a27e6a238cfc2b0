//! The tests of the report, in one program: they are linked once, and run side by side on all cores.
#![allow(clippy::unwrap_used, reason = "a test ends at the first surprise")]

mod common;

mod browser;
mod drawing;
mod page;
mod vendor;
