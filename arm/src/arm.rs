//! The checked, immutable arm.

use nalgebra::{Isometry3, Vector3};
use thiserror::Error;

use crate::check;
use crate::fitness::{Fitness, Purpose, Shortfall};
use crate::joint::Joint;
use crate::link::LinkConstants;

/// Most joints an arm may have. It bounds what a broken or hostile file can ask for.
pub const MAX_DOF: usize = 64;

/// Why a chain of joints is not an arm.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum ArmError {
    /// No joint at all.
    #[error("the arm has no moving joint; it needs at least one revolute or prismatic joint")]
    NoJoints,
    /// More joints than [`MAX_DOF`].
    #[error(
        "the arm has {count} moving joints, more than the {MAX_DOF} allowed; lock or leave out the joints not needed"
    )]
    TooManyJoints {
        /// How many there are.
        count: usize,
    },
    /// Two joints share a name.
    #[error("two joints are called `{name}`; every joint needs a name of its own")]
    DuplicateName {
        /// The name.
        name: String,
    },
    /// A joint without a name.
    #[error("joint number {number} has an empty name; give it one")]
    EmptyName {
        /// Position in the chain, from 1.
        number: usize,
    },
    /// A joint whose name has a line break, so that no table and no message can carry it.
    #[error("joint number {number} is called {name:?}; remove the line break from its name")]
    NameOfLines {
        /// Position in the chain, from 1.
        number: usize,
        /// The name.
        name: String,
    },
    /// A value outside its range, NaN or infinite.
    #[error("{}: {quantity} is {value}, but must be {must}", joint.as_ref().map_or("the arm".to_owned(), |name| format!("joint `{name}`")))]
    Value {
        /// The joint whose value it is; `None` for the arm as a whole.
        joint: Option<String>,
        /// Which quantity, with its unit.
        quantity: String,
        /// The value found.
        value: String,
        /// What is allowed.
        must: &'static str,
    },
    /// A joint whose motion no inertia resists.
    #[error(
        "joint `{name}` moves no inertia (felt inertia {felt:e}): no mass beyond it resists its motion, so its acceleration would be \
         infinite; give its link or one beyond it a mass away from the axis or an inertia about it, or lock the joint"
    )]
    MovesNoInertia {
        /// The joint.
        name: String,
        /// Inertia felt at the joint, kg·m² or kg.
        felt: f64,
    },
    /// An index that names no joint.
    #[error("there is no joint number {index} (from 0) in an arm of {dof} joints")]
    NoSuchJoint {
        /// The index asked for.
        index: usize,
        /// Number of joints.
        dof: usize,
    },
}

impl ArmError {
    /// The joint that the error is about, if it is about one.
    pub fn joint(&self) -> Option<&str> {
        match self {
            ArmError::Value { joint, .. } => joint.as_deref(),
            ArmError::MovesNoInertia { name, .. } | ArmError::DuplicateName { name } => Some(name),
            ArmError::NoJoints
            | ArmError::TooManyJoints { .. }
            | ArmError::EmptyName { .. }
            | ArmError::NameOfLines { .. }
            | ArmError::NoSuchJoint { .. } => None,
        }
    }
}

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

    /// The same for an arm that is made of one with `fitness`: where that one lacked something for a [`Purpose`], this one may, too,
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
        let constants = joints.iter().map(LinkConstants::of).collect();
        let name = name.to_owned();
        let arm = Arm { name, joints, tool, gravity, constants, fitness: Fitness::default() };
        let fitness = fitness.judged(check::every_joint_moves_inertia(&arm))?;
        Ok(Arm { fitness, ..arm })
    }

    /// The shortfalls of this arm, handed on to the arms that are made of it.
    pub fn fitness(&self) -> &Fitness {
        &self.fitness
    }

    /// Checks that the arm can be used for `purpose`. Arms of [`Arm::new`] can be used for all; those of a file may lack masses.
    ///
    /// # Errors
    /// [`Shortfall`]: link, line and what is missing.
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

    /// The same arm with `joint` inserted before joint number `index` (from 0). The inserted joint takes over the placement of
    /// joint `index`, which gets the identity placement; the placement given in `joint` is not used.
    ///
    /// # Errors
    /// [`ArmError::NoSuchJoint`] for an index beyond the last joint, and whatever [`Arm::new`] finds.
    pub fn with_joint_inserted_before(&self, index: usize, joint: Joint) -> Result<Arm, ArmError> {
        let mut joints = self.joints.clone();
        let next = joints.get_mut(index).ok_or(ArmError::NoSuchJoint { index, dof: self.joints.len() })?;
        let placement = std::mem::replace(&mut next.placement, Isometry3::identity());
        joints.insert(index, Joint { placement, ..joint });
        Arm::derived(&self.name, joints, self.tool, self.gravity, &self.fitness)
    }

    pub(crate) fn constants(&self) -> &[LinkConstants] {
        &self.constants
    }
}
