//! Commanded against measured positions: the servos of an arm. The files in the order in which data passes through them:
//!
//! - `tracks`: recordings as rollouts.
//! - `compare`: measured positions against positions simulated from the commands.
//! - `parts`: the fit, choice and test parts.
//! - `limits`: limits and dead bands, tested one by one; the fit itself is in the crate `freeplay-servo`.
//! - `recorded`: the recordings and their events; `servos`: servos without a given model; `changes`, `search`: the effects that a given model with servos
//!   lacks.
//! - `burdens`, `rotors`: payloads, inclinations and rotor inertias, tested when the servos are known.
//! - `black_box`: nameless filters as a baseline.
//! - `scores`: errors on the test part.
//! - `events`: stops and contacts, which no servo explains.
//! - `torque_law`, `beside_torque`, `torque_servos`: for recordings with torques, the law of each joint, its validity, and its findings.
//! - `findings`: the parameters as effects; `event_effects`: events as effects; `passages`: rows for pictures; `conclude`: the result; `diagnose`: the whole
//!   sequence.

mod alone;
mod beside_torque;
mod black_box;
mod burdens;
mod changes;
mod compare;
mod conclude;
mod diagnose;
mod event_effects;
mod events;
mod findings;
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
