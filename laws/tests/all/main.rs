//! The tests of the laws of the catalogue, in one program: they are linked once, and run side by side on all cores.
#![allow(clippy::unwrap_used, reason = "a test ends at the first surprise")]

mod common;

mod catalogue;
mod contact;
mod effects_in_pose;
mod effects_in_torque;
mod friction;
mod giving_loads_the_drives;
mod lubrication;
mod manual;
