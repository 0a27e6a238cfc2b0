//! What the `[[effect]]` tables of an arm file say, as laws.

use freeplay_arm::{Arm, ArmFile, EffectTable};
use thiserror::Error;

use crate::catalogue::COMMANDED;
use crate::effect::Effect;
use crate::injection::{Injection, Transmission};
use crate::kind::{Kind, kind, kinds};
use crate::predict::changed;
use crate::{Clearance, Values};

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

/// An effect at its place.
#[derive(Debug)]
pub struct Placed {
    /// Its entry in the catalogue.
    pub kind: &'static Kind,
    /// Index of the joint it sits at; `None` for an effect of the whole arm.
    pub joint: Option<usize>,
    /// The law with its parameters.
    pub effect: Box<dyn Effect>,
    /// Line of its table in the arm file; 0 if it does not come from one.
    pub line: usize,
}

impl Placed {
    /// The effect that `table` describes, at its place in `arm`.
    ///
    /// # Errors
    /// See [`LawError`].
    pub fn new(table: &EffectTable, arm: &Arm) -> Result<Placed, LawError> {
        let Some(kind) = kind(&table.kind) else {
            return Err(LawError::UnknownKind {
                kind: table.kind.clone(),
                line: table.line,
                known: kinds()
                    .chain(COMMANDED.iter().copied())
                    .map(|kind| kind.name)
                    .collect::<Vec<_>>()
                    .join(", "),
            });
        };
        let values = Values::of(kind, table, arm)?;
        Ok(Placed { kind, joint: values.joint().ok(), effect: (kind.build)(&values)?, line: table.line })
    }
}

/// The effects of an arm file.
#[derive(Debug, Default)]
pub struct Effects {
    /// All of them, in the order of the file.
    pub placed: Vec<Placed>,
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
            effects.add(Placed::new(table, &file.arm)?, &file.arm)?;
        }
        Ok(effects)
    }

    /// Adds `placed`, an effect of `arm`.
    ///
    /// # Errors
    /// [`LawError::Twice`] for a second effect of the same kind at the same place, but for what happens at a time: that may happen again.
    pub fn add(&mut self, placed: Placed, arm: &Arm) -> Result<(), LawError> {
        let same = |other: &Placed| {
            other.kind.name == placed.kind.name && other.joint == placed.joint && !placed.kind.happens()
        };
        if self.placed.iter().any(same) {
            let joint = placed.joint.map_or("none", |joint| &arm.joints()[joint].name).to_owned();
            return Err(LawError::Twice { kind: placed.kind.name.to_owned(), line: placed.line, joint });
        }
        let mut injection = self.injection();
        placed.effect.inject(&mut injection);
        let mut clearances = injection.clearances;
        clearances.retain(|(_, clearance)| clearance.clearance > 0.0);
        clearances.sort_by_key(|(joint, _)| *joint);
        if let Some(pair) = clearances.windows(2).find(|pair| pair[0].0 == pair[1].0) {
            let joint = arm.joints()[pair[0].0].name.clone();
            return Err(LawError::Twice {
                kind: "that gives the joint play".to_owned(),
                line: placed.line,
                joint,
            });
        }
        self.clearances = clearances;
        self.placed.push(placed);
        Ok(())
    }

    /// What these effects put into a plant, beside their changes of the arm. What stands between one motor and its link is one
    /// transmission, in series.
    pub fn injection(&self) -> Injection {
        let mut injection = Injection::default();
        for placed in &self.placed {
            placed.effect.inject(&mut injection);
        }
        let mut transmissions: Vec<(usize, Transmission)> = Vec::new();
        for (joint, transmission) in injection.transmissions {
            match transmissions.iter_mut().find(|(other, _)| *other == joint) {
                Some((_, other)) => *other = other.in_series(transmission),
                None => transmissions.push((joint, transmission)),
            }
        }
        Injection { transmissions, ..injection }
    }

    /// `arm` with the effects that change it.
    ///
    /// # Errors
    /// [`LawError::Changed`] if an effect leaves no possible arm.
    pub fn changed(&self, arm: &Arm) -> Result<Arm, LawError> {
        changed(arm, &self.placed)
    }
}
