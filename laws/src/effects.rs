//! The laws of the `[[effect]]` tables of an arm file.

use freeplay_arm::Arm;
use freeplay_model::ArmFile;

use crate::clearance::Clearance;
use crate::injection::{Injection, Transmission};
use crate::law_error::LawError;
use crate::placed::Placed;
use crate::predict::changed;

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
    /// See [`LawError`]; it names the line of the first invalid effect.
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
    /// [`LawError::Twice`] for a second effect of the same kind at the same place; an effect at a time of the recording may occur several
    /// times.
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

    /// The contributions of these effects to a plant, besides their changes of the arm. Transmissions of one joint combine in series.
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
    /// [`LawError::Changed`] if an effect makes the arm impossible.
    pub fn changed(&self, arm: &Arm) -> Result<Arm, LawError> {
        changed(arm, &self.placed)
    }
}
