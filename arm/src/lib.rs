//! The rigid arm: model, kinematics and dynamics of a serial chain.
//!
//! An arm is a chain of one to [`MAX_DOF`] revolute or prismatic joints on a fixed base, with a tool at its end. This crate contains no
//! time, contact, processes or files; `freeplay-model` reads arms from files.
//!
//! The nouns, in the order in which data passes through them:
//!
//! - [`Joint`]: one joint and the link it moves: [`JointKind`], axis, placement, [`Limits`], [`JointFriction`], [`Inertia`].
//! - [`Arm`]: the checked, immutable chain of joints, with tool and gravity; each use of an arm is a [`Purpose`], and a property that it
//!   lacks for one a [`Shortfall`] ([`Arm::require`], [`Fitness`]).
//! - [`Workspace`]: the intermediate results for one arm, allocated once; every function below writes into it.
//! - Kinematics, q → poses: [`forward_kinematics`], [`jacobian`], [`tool_bias_acceleration`].
//! - Inverse kinematics, pose → q: [`inverse_kinematics`], [`inverse_kinematics_global`], [`IkTask`], [`IkOptions`], [`IkReport`].
//! - Inverse dynamics, q, v, a → tau: [`rnea`], [`bias`], [`gravity_torque`], [`joint_reaction`].
//! - Mass matrix, q → M: [`crba`]; with the bias torques: [`mass_and_bias`].
//! - Forward dynamics, q, v, tau → a: [`aba`], [`hybrid_aba`] with one [`Drive`] per joint.
//! - Energy: [`kinetic_energy`], [`potential_energy`].
//!
//! Conventions: SI units and radians. World is the base frame (`base_link`), z up. Slices of length [`Arm::dof`] hold q
//! (rad or m), v (rad/s or m/s), a (rad/s² or m/s²) and tau (N·m or N). No function of the loop allocates, locks or logs.

mod arm;
mod arm_error;
mod brief;
mod check;
mod construction;
mod dynamics;
mod fitness;
mod inverse;
mod joint;
mod kinematics;
mod link;
mod place;
mod spatial;
mod workspace;

pub use arm::Arm;
pub use arm_error::{ArmError, MAX_DOF};
pub use brief::brief;
pub use dynamics::energy::{kinetic_energy, potential_energy};
pub use dynamics::forward::{Drive, aba, hybrid_aba};
pub use dynamics::inverse::{bias, gravity_torque, joint_reaction, rnea};
pub use dynamics::mass_matrix::{crba, mass_and_bias};
pub use fitness::{Fitness, JointSource, Purpose, Shortfall};
pub use inverse::{
    IkError, IkOptions, IkReport, IkTask, inverse_kinematics, inverse_kinematics_global,
    inverse_kinematics_with,
};
pub use joint::{Inertia, Joint, JointFriction, JointKind, Limits};
pub use kinematics::{forward_kinematics, jacobian, tool_bias_acceleration};
pub use place::Place;
pub use workspace::Workspace;
