//! The checked, immutable arm.

use nalgebra::{Isometry3, Vector3};

use crate::fitness::{Fitness, Purpose, Shortfall};
use crate::joint::Joint;
use crate::link::LinkConstants;

/// A serial chain of joints on a fixed base, checked and immutable.
#[derive(Clone, Debug)]
pub struct Arm {
    name: String,
    joints: Vec<Joint>,
    tool: Isometry3<f64>,
    gravity: Vector3<f64>,
    constants: Vec<LinkConstants>,
    fitness: Fitness,
}

impl Arm {
    /// An arm of checked joints.
    pub(crate) fn unchecked(
        name: &str,
        joints: Vec<Joint>,
        tool: Isometry3<f64>,
        gravity: Vector3<f64>,
    ) -> Arm {
        let constants = joints.iter().map(LinkConstants::of).collect();
        Arm { name: name.to_owned(), joints, tool, gravity, constants, fitness: Fitness::default() }
    }

    /// The same arm with the shortfalls of `fitness`.
    pub fn with_fitness(self, fitness: Fitness) -> Arm {
        Arm { fitness, ..self }
    }

    /// The shortfalls of this arm; arms derived from it inherit them.
    pub fn fitness(&self) -> &Fitness {
        &self.fitness
    }

    /// Checks that the arm can be used for `purpose`. Arms of [`Arm::new`] can be used for all purposes; those of a file may lack masses.
    ///
    /// # Errors
    /// [`Shortfall`] with the link, the line and the missing property.
    pub fn require(&self, purpose: Purpose) -> Result<(), Shortfall> {
        self.fitness.shortfall(purpose).map_or(Ok(()), |shortfall| Err(shortfall.clone()))
    }

    /// Number of joints.
    pub fn dof(&self) -> usize {
        self.joints.len()
    }

    /// Name of the arm.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// The joints from the base outwards.
    pub fn joints(&self) -> &[Joint] {
        &self.joints
    }

    /// Position in the chain, from 0, of the joint called `name`.
    pub fn joint_index(&self, name: &str) -> Option<usize> {
        self.joints.iter().position(|joint| joint.name == name)
    }

    /// Pose of the tool frame `tool0` in the last link's frame, m.
    pub fn tool(&self) -> &Isometry3<f64> {
        &self.tool
    }

    /// Acceleration of gravity in the base frame, m/s².
    pub fn gravity(&self) -> &Vector3<f64> {
        &self.gravity
    }

    /// The same arm under the gravity `g`, m/s² in the base frame.
    pub fn with_gravity(&self, g: Vector3<f64>) -> Arm {
        Arm { gravity: g, ..self.clone() }
    }

    pub(crate) fn constants(&self) -> &[LinkConstants] {
        &self.constants
    }
}
