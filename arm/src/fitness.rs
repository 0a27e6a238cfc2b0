//! The purposes that an arm can serve, and the masses and inertias that it lacks for the others.

use std::fmt;
use std::sync::Arc;

use thiserror::Error;

use crate::arm_error::ArmError;
use crate::place::Place;

/// A use of an arm, in the order of its requirements on the masses.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Purpose {
    /// Poses of the tool: lengths and axes alone.
    ToolPose,
    /// Torques of a given motion: masses, and possible inertias.
    Torque,
    /// Motion under given torques: every joint must move an inertia, too.
    Simulation,
}

/// The first thing that an arm lacks for a [`Purpose`].
#[derive(Clone, Debug, Error, PartialEq)]
pub enum Shortfall {
    /// No link that a joint moves has a mass.
    #[error(
        "{at}: no moving link of this file has a mass (<inertial>, or `mass` of a [[joint]]): torques and simulations need masses; \
         tool poses can be compared without them"
    )]
    NoMasses {
        /// The start of the file.
        at: Place,
    },
    /// The inertia of a moving link is impossible.
    #[error(
        "{at}: link `{link}`: <inertia> is `{value}`; {problem}; correct it for torques and simulations; tool poses can be compared without it"
    )]
    ImpossibleInertia {
        /// The place of the inertia.
        at: Place,
        /// The link.
        link: String,
        /// The text in the file.
        value: String,
        /// The fault of the link, in words.
        problem: String,
    },
    /// A joint whose motion no inertia resists.
    #[error("{at}: link `{link}`: {source}, or a `rotor_inertia` in an arm file")]
    MovesNoInertia {
        /// The place of the joint.
        at: Place,
        /// The link that the joint moves.
        link: String,
        /// The joint and its inertia.
        source: Box<ArmError>,
    },
}

/// The place of a joint in its file, and the link that the joint moves.
#[derive(Clone, Debug, PartialEq)]
pub struct JointSource {
    /// The joint.
    pub joint: String,
    /// The link that the joint moves.
    pub link: String,
    /// The place of the joint.
    pub at: Place,
}

/// The shortfalls of an arm and the places of its joints in their file; arms derived from it inherit them. The arms of [`crate::Arm::new`]
/// have no shortfalls and no file.
#[derive(Clone, Default)]
pub struct Fitness {
    sources: Arc<[JointSource]>,
    lacks: Option<Arc<Lacks>>,
}

/// The output does not depend on the places of the joints in a file.
impl fmt::Debug for Fitness {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_tuple("Fitness").field(&self.lacks).finish()
    }
}

/// Equality ignores the places of the joints in their files.
impl PartialEq for Fitness {
    fn eq(&self, other: &Self) -> bool {
        self.lacks == other.lacks
    }
}

#[derive(Debug, PartialEq)]
struct Lacks {
    torque: Option<Shortfall>,
    simulation: Option<Shortfall>,
}

impl Fitness {
    /// For an arm from a file; arms derived from it inherit the shortfall `torque`.
    pub fn of_file(sources: Vec<JointSource>, torque: Option<Shortfall>) -> Fitness {
        Fitness { sources: sources.into(), lacks: Some(Arc::new(Lacks { torque, simulation: None })) }
    }

    /// The same after a check of the joints' inertias: `moves` names a joint that moves none.
    ///
    /// # Errors
    /// `moves`, if this is the fitness of an arm without shortfalls.
    pub(crate) fn judged(&self, moves: Result<(), ArmError>) -> Result<Fitness, ArmError> {
        let with = |lacks: Option<Arc<Lacks>>| Fitness { sources: Arc::clone(&self.sources), lacks };
        let Some(lacks) = &self.lacks else { return moves.map(|()| with(None)) };
        let none = match moves {
            Ok(()) if lacks.torque.is_none() => return Ok(with(None)),
            Ok(()) => None,
            Err(source) => {
                let origin = self.sources.iter().find(|origin| Some(origin.joint.as_str()) == source.joint());
                // A joint without a place in the file comes from an effect.
                let Some(JointSource { link, at, .. }) = origin.cloned() else { return Err(source) };
                Some(Shortfall::MovesNoInertia { at, link, source: Box::new(source) })
            }
        };
        let simulation = lacks.torque.clone().or(none);
        Ok(with(Some(Arc::new(Lacks { torque: lacks.torque.clone(), simulation }))))
    }

    /// The place of the joint `name` in its file; `None` for a joint from an effect, and for the arms of [`crate::Arm::new`].
    pub fn place(&self, name: &str) -> Option<&Place> {
        self.sources.iter().find(|origin| origin.joint == name).map(|origin| &origin.at)
    }

    /// The first shortfall for `purpose`.
    pub(crate) fn shortfall(&self, purpose: Purpose) -> Option<&Shortfall> {
        let lacks = self.lacks.as_ref()?;
        match purpose {
            Purpose::ToolPose => None,
            Purpose::Torque => lacks.torque.as_ref(),
            Purpose::Simulation => lacks.simulation.as_ref(),
        }
    }
}
