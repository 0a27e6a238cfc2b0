//! The construction of an arm: it checks the joints, and checks by the dynamics that each moves an inertia.

use nalgebra::{Isometry3, Vector3};

use crate::arm::Arm;
use crate::arm_error::ArmError;
use crate::check;
use crate::fitness::Fitness;
use crate::joint::Joint;

impl Arm {
    /// An arm of `joints` from the base outwards, with the pose of the tool frame `tool0` in the last link's frame and the
    /// acceleration of gravity in the base frame, m/s².
    ///
    /// An inertia tensor must be positive semi-definite. One that violates the triangle inequality, as in many CAD exports and identified
    /// models, is accepted: [`crate::Inertia::triangle_excess`] gives the violation.
    ///
    /// # Errors
    /// [`ArmError`] with the joint, the value and the permitted values: see its variants.
    pub fn new(
        name: &str,
        joints: Vec<Joint>,
        tool: Isometry3<f64>,
        gravity: Vector3<f64>,
    ) -> Result<Arm, ArmError> {
        Arm::derived(name, joints, tool, gravity, &Fitness::default())
    }

    /// The same for an arm derived from one with `fitness`: a shortfall of that arm for a [`crate::Purpose`] is permitted here, too, and
    /// disappears if the new joints remove it.
    ///
    /// # Errors
    /// As [`Arm::new`].
    pub fn derived(
        name: &str,
        mut joints: Vec<Joint>,
        tool: Isometry3<f64>,
        gravity: Vector3<f64>,
        fitness: &Fitness,
    ) -> Result<Arm, ArmError> {
        check::chain(&joints)?;
        check::pose(None, "tool pose", &tool)?;
        check::finite(None, "gravity (m/s²)", gravity.as_slice())?;
        for joint in &mut joints {
            check::joint(joint)?;
            let tensor = joint.inertia.about_com;
            joint.inertia.about_com = (tensor + tensor.transpose()) * 0.5;
        }
        let arm = Arm::unchecked(name, joints, tool, gravity);
        let fitness = fitness.judged(check::every_joint_moves_inertia(&arm))?;
        Ok(arm.with_fitness(fitness))
    }

    /// The same arm with `joint` inserted before joint number `index` (from 0). The inserted joint takes over the placement of joint
    /// `index`, which gets the identity placement; the function ignores the placement in `joint`.
    ///
    /// # Errors
    /// [`ArmError::NoSuchJoint`] for an index beyond the last joint, and the errors of [`Arm::new`].
    pub fn with_joint_inserted_before(&self, index: usize, joint: Joint) -> Result<Arm, ArmError> {
        let mut joints = self.joints().to_vec();
        let next = joints.get_mut(index).ok_or(ArmError::NoSuchJoint { index, dof: self.dof() })?;
        let placement = std::mem::replace(&mut next.placement, Isometry3::identity());
        joints.insert(index, Joint { placement, ..joint });
        Arm::derived(self.name(), joints, *self.tool(), *self.gravity(), self.fitness())
    }
}
