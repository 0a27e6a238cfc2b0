//! The tests of an arm: kinematics and dynamics, in one program: they are linked once, and run side by side on all cores.
#![allow(clippy::unwrap_used, reason = "a test ends at the first surprise")]

mod common;

mod allocation;
mod dynamics;
mod golden;
mod inverse_kinematics;
mod kinematics;
mod pendulums;
mod runge_kutta;
