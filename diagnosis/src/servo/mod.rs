//! Commanded against measured positions: the servos of an arm. The files in the order in which data passes through them:
//!
//! - `tracks`: recordings as rollouts take them.
//! - `compare`: measured positions against those simulated from the commands.
//! - `parts`: what is fitted, what chooses and what judges.
//! - `limits`: limits and dead bands, weighed one by one; the fit itself is in the crate `freeplay-servo`.
//! - `recorded`: what was recorded, and what happened in it; `servos`: servos of which nothing is known; `changes`, `search`: what a given model with servos lacks.
//! - `burdens`, `rotors`: what the arm carries, how it stands, inertia of its motors, asked for when the servos are known.
//! - `black_box`: filters without a name, to be beaten.
//! - `scores`: errors on what no step has seen.
//! - `events`: stops and contacts, which no servo explains.
//! - `torque_law`, `beside_torque`, `torque_servos`: where torques were recorded, too, the law of each joint, whether it holds, what is said of it.
//! - `findings`: the numbers as effects; `happenings`: events as effects; `passages`: rows for pictures; `conclude`: what is said; `diagnose`: all of it.

mod alone;
mod beside_torque;
mod black_box;
mod burdens;
mod changes;
mod compare;
mod conclude;
mod diagnose;
mod events;
mod findings;
mod happenings;
mod limits;
mod parts;
mod passages;
mod recorded;
mod rotors;
mod scores;
mod search;
mod servos;
mod torque_law;
mod torque_servos;
mod tracks;

pub use beside_torque::add_servos;
pub use compare::{compare_all, compare_commands};
pub use diagnose::diagnose;
pub use tracks::commands_alone;
