//! The parts of an arm, for effects that change them.

use freeplay_arm::{Arm, Fitness, Joint};
use nalgebra::{Isometry3, Vector3};

use crate::law_error::LawError;

/// The parts of an arm, for changes and reassembly.
#[derive(Clone, Debug)]
pub struct ArmParts {
    /// The joints from the base outwards, each with the link it moves.
    pub joints: Vec<Joint>,
    /// Pose of the tool in the last link's frame.
    pub tool: Isometry3<f64>,
    /// Gravity in the base frame, m/s².
    pub gravity: Vector3<f64>,
    /// The shortfalls of the original arm.
    fitness: Fitness,
}

impl ArmParts {
    /// The parts of `arm`.
    pub fn of(arm: &Arm) -> ArmParts {
        ArmParts {
            joints: arm.joints().to_vec(),
            tool: *arm.tool(),
            gravity: *arm.gravity(),
            fitness: arm.fitness().clone(),
        }
    }

    /// True if they are the parts of `arm`, unchanged.
    pub fn are_of(&self, arm: &Arm) -> bool {
        self.joints == arm.joints() && self.tool == *arm.tool() && self.gravity == *arm.gravity()
    }

    /// The arm called `name` made of these parts.
    ///
    /// # Errors
    /// [`LawError::Changed`] if the arm is impossible.
    pub fn into_arm(self, name: &str) -> Result<Arm, LawError> {
        Arm::derived(name, self.joints, self.tool, self.gravity, &self.fitness).map_err(LawError::Changed)
    }
}
