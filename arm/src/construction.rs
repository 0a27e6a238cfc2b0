//! The construction of an arm: it checks the joints, and by the dynamics that each moves an inertia.

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
    /// An inertia tensor has to be positive semi-definite. One that breaks the triangle inequality, as many CAD exports and
    /// identified models do, is accepted: [`crate::Inertia::triangle_excess`] tells.
    ///
    /// # Errors
    /// [`ArmError`] names the joint, the value and what is allowed: see its variants.
    pub fn new(
        name: &str,
        joints: Vec<Joint>,
        tool: Isometry3<f64>,
        gravity: Vector3<f64>,
    ) -> Result<Arm, ArmError> {
        Arm::derived(name, joints, tool, gravity, &Fitness::default())
    }

    /// The same for an arm that is made of one with `fitness`: where that one lacked something for a [`crate::Purpose`], this one may, too,
    /// and gains what its joints now have.
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

    /// The same arm with `joint` inserted before joint number `index` (from 0). The inserted joint takes over the placement of
    /// joint `index`, which gets the identity placement; the placement given in `joint` is not used.
    ///
    /// # Errors
    /// [`ArmError::NoSuchJoint`] for an index beyond the last joint, and whatever [`Arm::new`] finds.
    pub fn with_joint_inserted_before(&self, index: usize, joint: Joint) -> Result<Arm, ArmError> {
        let mut joints = self.joints().to_vec();
        let next = joints.get_mut(index).ok_or(ArmError::NoSuchJoint { index, dof: self.dof() })?;
        let placement = std::mem::replace(&mut next.placement, Isometry3::identity());
        joints.insert(index, Joint { placement, ..joint });
        Arm::derived(self.name(), joints, *self.tool(), *self.gravity(), self.fitness())
    }
}
