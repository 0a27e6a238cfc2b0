//! The errors of an effect that cannot be taken from an arm file or put on an arm.

use thiserror::Error;

/// Why an effect can't be taken from an arm file.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum LawError {
    /// A parameter is unknown, missing or of the wrong type.
    #[error("{}effect {kind}: {message}", place(*.line))]
    Unreadable {
        /// The effect's kind.
        kind: String,
        /// Line in the arm file; 0 if it does not come from one.
        line: usize,
        /// What is wrong.
        message: String,
    },
    /// A parameter is outside what the law allows.
    #[error("{}effect {kind}: {parameter} = {value} is out of range; it must be {range}", place(*.line))]
    OutOfRange {
        /// The effect's kind.
        kind: String,
        /// Line in the arm file; 0 if it does not come from one.
        line: usize,
        /// Which parameter.
        parameter: &'static str,
        /// Its value.
        value: f64,
        /// What it may be.
        range: &'static str,
    },
    /// No such effect.
    #[error("{}unknown effect kind {kind:?}; known: {known}", place(*.line))]
    UnknownKind {
        /// What the file says.
        kind: String,
        /// Line in the arm file; 0 if it does not come from one.
        line: usize,
        /// The kinds there are.
        known: String,
    },
    /// The effect names a joint that the arm does not have, or none.
    #[error("{}effect {kind}: joint {joint:?} is not one of {joints}", place(*.line))]
    UnknownJoint {
        /// The effect's kind.
        kind: String,
        /// Line in the arm file; 0 if it does not come from one.
        line: usize,
        /// What the file says.
        joint: String,
        /// The joints there are.
        joints: String,
    },
    /// The effect cannot sit on this joint.
    #[error("{}effect {kind}: joint {joint} is prismatic; the effect needs a revolute joint", place(*.line))]
    WrongJoint {
        /// The effect's kind.
        kind: String,
        /// Line in the arm file; 0 if it does not come from one.
        line: usize,
        /// The joint.
        joint: String,
    },
    /// Two effects of one kind sit on one joint.
    #[error("{}effect {kind}: joint {joint} has it twice; remove one", place(*.line))]
    Twice {
        /// The effect's kind.
        kind: String,
        /// Line of the second in the arm file; 0 if it does not come from one.
        line: usize,
        /// The joint.
        joint: String,
    },
    /// An effect changes the arm into one that cannot exist.
    #[error("the arm with its effects can't be built: {0}")]
    Changed(freeplay_arm::ArmError),
    /// The extended arm can't be built.
    #[error("the arm with play can't be built: {0}; two joints with play need a link with mass between them")]
    Arm(#[from] freeplay_arm::ArmError),
}

/// `line 12: `, or nothing for a table that does not come from a file.
fn place(line: usize) -> String {
    if line > 0 { format!("line {line}: ") } else { String::new() }
}

impl LawError {
    /// The line of the arm file that it is about.
    pub fn line(&self) -> Option<usize> {
        match self {
            Self::Unreadable { line, .. }
            | Self::OutOfRange { line, .. }
            | Self::UnknownKind { line, .. }
            | Self::UnknownJoint { line, .. }
            | Self::WrongJoint { line, .. }
            | Self::Twice { line, .. } => Some(*line).filter(|&line| line > 0),
            Self::Changed(_) | Self::Arm(_) => None,
        }
    }

    /// The same with its line, for a parameter out of its range.
    pub(crate) fn at(mut self, place: usize) -> Self {
        if let Self::OutOfRange { line, .. } = &mut self {
            *line = place;
        }
        self
    }
}
