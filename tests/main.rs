//! The tests of the command, in one program: they are linked once, and run in parallel on all cores.
//!
//! Tests that fill the common shared memory with foreign files have separate programs: `hostile_places`, `kills`, `leftovers`.

mod common;

mod bench;
mod blind;
mod blind_kills;
mod crate_edges;
mod demo;
mod doctor;
mod dry_friction;
mod errors;
mod export;
mod faults;
mod flags;
mod formats;
mod guide;
mod hostile;
mod inputs;
mod learned;
mod live;
mod modules;
mod mujoco_proof;
mod orphans;
mod public_robots;
mod python;
mod real_machines;
mod receipt;
mod record;
mod report;
mod reproduce;
mod robots;
mod run;
mod sandbox;
mod scenario;
mod security;
mod servo_mode;
mod set_up;
mod storage;
mod storage_faults;
mod swap;
mod terminal;
mod train;
