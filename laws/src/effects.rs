//! What the `[[effect]]` tables of an arm file say, as laws.

use freeplay_arm::{ArmFile, JointKind};
use thiserror::Error;

use crate::Clearance;

/// Why an effect can't be taken from an arm file.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum LawError {
    /// A parameter is unknown, missing or of the wrong type.
    #[error("line {line}: effect {kind}: {message}")]
    Unreadable {
        /// The effect's kind.
        kind: String,
        /// Line in the arm file.
        line: usize,
        /// What is wrong.
        message: String,
    },
    /// A parameter is outside what the law allows.
    #[error("effect {kind}: {parameter} = {value} is out of range; it must be {range}")]
    OutOfRange {
        /// The effect's kind.
        kind: String,
        /// Which parameter.
        parameter: &'static str,
        /// Its value.
        value: f64,
        /// What it may be.
        range: &'static str,
    },
    /// No such effect.
    #[error("line {line}: unknown effect kind {kind:?}; known: {known}")]
    UnknownKind {
        /// What the file says.
        kind: String,
        /// Line in the arm file.
        line: usize,
        /// The kinds there are.
        known: &'static str,
    },
    /// The effect names a joint that the arm does not have, or none.
    #[error("line {line}: effect {kind}: joint {joint:?} is not one of {joints}")]
    UnknownJoint {
        /// The effect's kind.
        kind: String,
        /// Line in the arm file.
        line: usize,
        /// What the file says.
        joint: String,
        /// The joints there are.
        joints: String,
    },
    /// The effect cannot sit on this joint.
    #[error("effect {kind}: joint {joint} is prismatic; a clearance needs a revolute joint")]
    WrongJoint {
        /// The effect's kind.
        kind: String,
        /// The joint.
        joint: String,
    },
    /// Two effects of one kind sit on one joint.
    #[error("effect {kind}: joint {joint} has it twice; remove one")]
    Twice {
        /// The effect's kind.
        kind: String,
        /// The joint.
        joint: String,
    },
    /// The extended arm can't be built.
    #[error("the arm with play can't be built: {0}; two joints with play need a link with mass between them")]
    Arm(#[from] freeplay_arm::ArmError),
}

/// The effects of an arm file, by kind.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Effects {
    /// Clearances by joint index of the nominal arm, in ascending order.
    pub clearances: Vec<(usize, Clearance)>,
}

impl Effects {
    /// Reads the effects of `file`.
    ///
    /// # Errors
    /// See [`LawError`]; the first effect that can't be taken is named with its line.
    pub fn of(file: &ArmFile) -> Result<Self, LawError> {
        let mut effects = Self::default();
        for table in &file.effects {
            if table.kind != Clearance::KIND {
                return Err(LawError::UnknownKind {
                    kind: table.kind.clone(),
                    line: table.line,
                    known: Clearance::KIND,
                });
            }
            let name = table.joint.clone().unwrap_or_default();
            let Some(joint) = file.arm.joint_index(&name) else {
                let joints = file.arm.joints().iter().map(|j| j.name.as_str()).collect::<Vec<_>>().join(", ");
                return Err(LawError::UnknownJoint {
                    kind: table.kind.clone(),
                    line: table.line,
                    joint: name,
                    joints,
                });
            };
            effects.add_clearance(&file.arm, joint, Clearance::from_effect(table)?)?;
        }
        Ok(effects)
    }

    /// Adds a clearance at the joint with index `joint` of `arm`; a clearance of zero adds nothing.
    ///
    /// # Errors
    /// [`LawError::WrongJoint`] for a prismatic joint, [`LawError::Twice`] if the joint has one.
    pub fn add_clearance(
        &mut self,
        arm: &freeplay_arm::Arm,
        joint: usize,
        clearance: Clearance,
    ) -> Result<(), LawError> {
        let of = &arm.joints()[joint];
        let kind = Clearance::KIND.to_owned();
        if of.kind != JointKind::Revolute {
            return Err(LawError::WrongJoint { kind, joint: of.name.clone() });
        }
        if self.clearances.iter().any(|(at, _)| *at == joint) {
            return Err(LawError::Twice { kind, joint: of.name.clone() });
        }
        if clearance.clearance > 0.0 {
            self.clearances.push((joint, clearance));
            self.clearances.sort_by_key(|(at, _)| *at);
        }
        Ok(())
    }
}
