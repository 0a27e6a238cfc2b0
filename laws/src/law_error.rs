//! The errors of an effect that is invalid in an arm file or impossible on an arm.

use thiserror::Error;

/// Reason why an effect of an arm file is invalid.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum LawError {
    /// A parameter is unknown, missing or of the wrong type.
    #[error("{}effect {kind}: {message}", place(*.line))]
    Unreadable {
        /// The effect's kind.
        kind: String,
        /// Line in the arm file; 0 if it does not come from one.
        line: usize,
        /// The error in words.
        message: String,
    },
    /// A parameter is outside the range of the law.
    #[error("{}effect {kind}: {parameter} = {value} is out of range; it must be {range}", place(*.line))]
    OutOfRange {
        /// The effect's kind.
        kind: String,
        /// Line in the arm file; 0 if it does not come from one.
        line: usize,
        /// The parameter.
        parameter: &'static str,
        /// Its value.
        value: f64,
        /// The permitted range.
        range: &'static str,
    },
    /// Unknown kind of effect.
    #[error("{}unknown effect kind {kind:?}; known: {known}", place(*.line))]
    UnknownKind {
        /// The kind in the file.
        kind: String,
        /// Line in the arm file; 0 if it does not come from one.
        line: usize,
        /// The known kinds.
        known: String,
    },
    /// The effect names a joint that the arm does not have, or names no joint.
    #[error("{}effect {kind}: joint {joint:?} is not one of {joints}", place(*.line))]
    UnknownJoint {
        /// The effect's kind.
        kind: String,
        /// Line in the arm file; 0 if it does not come from one.
        line: usize,
        /// The name in the file.
        joint: String,
        /// The joints of the arm.
        joints: String,
    },
    /// The effect is not possible on this joint.
    #[error("{}effect {kind}: joint {joint} is prismatic; the effect needs a revolute joint", place(*.line))]
    WrongJoint {
        /// The effect's kind.
        kind: String,
        /// Line in the arm file; 0 if it does not come from one.
        line: usize,
        /// The joint.
        joint: String,
    },
    /// One joint has two effects of one kind.
    #[error("{}effect {kind}: joint {joint} has this effect twice; remove one", place(*.line))]
    Twice {
        /// The effect's kind.
        kind: String,
        /// Line of the second in the arm file; 0 if it does not come from one.
        line: usize,
        /// The joint.
        joint: String,
    },
    /// An effect changes the arm into an impossible one.
    #[error("the arm with its effects can't be built: {0}")]
    Changed(freeplay_arm::ArmError),
    /// The extended arm can't be built.
    #[error("the arm with play can't be built: {0}; two joints with play need a link with mass between them")]
    Arm(#[from] freeplay_arm::ArmError),
}

/// `line 12: `, or an empty text for a table without a file.
fn place(line: usize) -> String {
    if line > 0 { format!("line {line}: ") } else { String::new() }
}

impl LawError {
    /// The line of the arm file with the error.
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
