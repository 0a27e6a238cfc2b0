//! What the `[[effect]]` tables of an arm file say, as laws.

use freeplay_arm::{Arm, ArmFile, EffectTable};
use thiserror::Error;

use crate::catalogue::{CATALOGUE, kind};
use crate::effect::{Effect, Kind};
use crate::injection::Injection;
use crate::scene::changed;
use crate::{Clearance, Values};

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
        known: String,
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
    #[error("effect {kind}: joint {joint} is prismatic; the effect needs a revolute joint")]
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
    /// An effect changes the arm into one that cannot exist.
    #[error("the arm with its effects can't be built: {0}")]
    Changed(freeplay_arm::ArmError),
    /// The extended arm can't be built.
    #[error("the arm with play can't be built: {0}; two joints with play need a link with mass between them")]
    Arm(#[from] freeplay_arm::ArmError),
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
                known: CATALOGUE.iter().map(|kind| kind.name).collect::<Vec<_>>().join(", "),
            });
        };
        let values = Values::of(kind, table, arm)?;
        Ok(Placed { kind, joint: values.joint().ok(), effect: (kind.build)(&values)? })
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
    /// [`LawError::Twice`] for a second effect of the same kind at the same place.
    pub fn add(&mut self, placed: Placed, arm: &Arm) -> Result<(), LawError> {
        let same = |other: &Placed| other.kind.name == placed.kind.name && other.joint == placed.joint;
        if self.placed.iter().any(same) {
            let joint = placed.joint.map_or("none", |joint| &arm.joints()[joint].name).to_owned();
            return Err(LawError::Twice { kind: placed.kind.name.to_owned(), joint });
        }
        let mut clearances = self.injection().clearances;
        let mut injection = Injection::default();
        placed.effect.inject(&mut injection);
        clearances.extend(injection.clearances);
        clearances.retain(|(_, clearance)| clearance.clearance > 0.0);
        clearances.sort_by_key(|(joint, _)| *joint);
        self.clearances = clearances;
        self.placed.push(placed);
        Ok(())
    }

    /// What these effects put into a plant, beside their changes of the arm.
    pub fn injection(&self) -> Injection {
        let mut injection = Injection::default();
        for placed in &self.placed {
            placed.effect.inject(&mut injection);
        }
        injection
    }

    /// `arm` with the effects that change it.
    ///
    /// # Errors
    /// [`LawError::Changed`] if an effect leaves no possible arm.
    pub fn changed(&self, arm: &Arm) -> Result<Arm, LawError> {
        changed(arm, &self.placed)
    }
}
