//! The tests of an arm: models of robots, kinematics and dynamics, in one program: they are linked once, and run side by side on all cores.
#![allow(clippy::unwrap_used, reason = "a test ends at the first surprise")]

mod common;

mod allocation;
mod bad_models;
mod dynamics;
mod export;
mod fuzz_models;
mod golden;
mod inverse_kinematics;
mod kinematics;
mod mjcf;
mod model_files;
mod pendulums;
mod robots;
