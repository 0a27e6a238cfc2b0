//! The errors of a chain of joints that is not an arm.

use thiserror::Error;

/// Most joints of an arm. It bounds the memory that a broken or hostile file can demand.
pub const MAX_DOF: usize = 64;

/// Reason why a chain of joints is not an arm.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum ArmError {
    /// The chain has no joint.
    #[error("the arm has no moving joint; it needs at least one revolute or prismatic joint")]
    NoJoints,
    /// More joints than [`MAX_DOF`].
    #[error(
        "the arm has {count} moving joints, more than the {MAX_DOF} allowed; lock or leave out the joints not needed"
    )]
    TooManyJoints {
        /// Number of joints.
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
    /// A joint whose name contains a line break, which no table and no message can show.
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
        /// The joint of the value; `None` for the arm as a whole.
        joint: Option<String>,
        /// Name of the quantity, with its unit.
        quantity: String,
        /// The value found.
        value: String,
        /// The allowed values.
        must: &'static str,
    },
    /// A joint whose motion no inertia resists.
    #[error(
        "joint `{name}` moves no inertia (effective inertia {felt:e}): no mass beyond it resists its motion, so its acceleration would be infinite; \
         give its link or one beyond it a mass away from the axis or an inertia about it, or lock the joint"
    )]
    MovesNoInertia {
        /// The joint.
        name: String,
        /// Effective inertia of the joint, kg·m² or kg.
        felt: f64,
    },
    /// An index beyond the last joint.
    #[error("there is no joint number {index} (from 0) in an arm of {dof} joints")]
    NoSuchJoint {
        /// The requested index.
        index: usize,
        /// Number of joints.
        dof: usize,
    },
}

impl ArmError {
    /// The joint of the error, if the error concerns one joint.
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
