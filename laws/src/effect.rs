//! What an effect is: physics that a rigid arm leaves out, in one definition for the plant, for `compare` and for the diagnosis.

use std::fmt::Debug;

use freeplay_arm::{Arm, Joint};
use nalgebra::{Isometry3, Vector3};

use crate::injection::Injection;
use crate::scene::{Prediction, Scene};
use crate::{LawError, Values};

/// An effect with its parameters, at its place. The stages are called in the order in which they stand here; each effect does
/// something in one or a few of them.
///
/// `arm` to `measure` say what a *recording* shows, given the motion that the encoders read, without integrating anything.
/// [`Effect::inject`] puts the same law into the plant. A test of each effect compares the two.
pub trait Effect: Debug + Send + Sync {
    /// Changes the rigid arm: masses, lengths, gravity.
    ///
    /// # Errors
    /// A change that leaves no possible arm.
    fn arm(&self, _parts: &mut ArmParts) -> Result<(), LawError> {
        Ok(())
    }

    /// Adds to `shift`, `[joint][point]`, how far each link is from where the motor-side encoder has it, rad (m).
    fn shift(&self, _scene: &Scene, _shift: &mut [Vec<f64>]) {}

    /// Adds to `torque`, `[joint][point]`, what the drives have to spend beyond the rigid arm, N·m (N).
    fn torque(&self, _scene: &Scene, _torque: &mut [Vec<f64>]) {}

    /// Adds to `tool`, `[axis][point]`, how far the tool is from where the shifted joints put it, base frame, m.
    fn displace(&self, _scene: &Scene, _tool: &mut [Vec<f64>; 3]) {}

    /// Changes what is measured: gains, offsets, delays.
    fn measure(&self, _scene: &Scene, _prediction: &mut Prediction) {}

    /// Puts the effect into a plant. Changes of the arm are already in.
    fn inject(&self, injection: &mut Injection);
}

/// The parts of an arm, to be changed and put together again.
#[derive(Clone, Debug)]
pub struct ArmParts {
    /// The joints from the base outwards, each with the link it moves.
    pub joints: Vec<Joint>,
    /// Pose of the tool in the last link's frame.
    pub tool: Isometry3<f64>,
    /// Gravity in the base frame, m/s².
    pub gravity: Vector3<f64>,
}

impl ArmParts {
    /// The parts of `arm`.
    pub fn of(arm: &Arm) -> ArmParts {
        ArmParts { joints: arm.joints().to_vec(), tool: *arm.tool(), gravity: *arm.gravity() }
    }

    /// The arm called `name` that these parts make.
    ///
    /// # Errors
    /// [`LawError::Changed`]: no such arm can exist.
    pub fn into_arm(self, name: &str) -> Result<Arm, LawError> {
        Arm::new(name, self.joints, self.tool, self.gravity).map_err(LawError::Changed)
    }
}

/// Where an effect can sit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Site {
    /// On any joint, or the link that it moves.
    Joint,
    /// On a revolute joint.
    Revolute,
    /// On the arm as a whole.
    Arm,
}

/// Where an effect shows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Seen {
    /// In the torques.
    pub torque: bool,
    /// In the tool's pose or the link encoders.
    pub pose: bool,
}

/// One parameter of an effect.
#[derive(Clone, Copy, Debug)]
pub struct Parameter {
    /// Its name in arm files and in `diagnosis.json`.
    pub name: &'static str,
    /// What it is, in a few words.
    pub meaning: &'static str,
    /// What it may be.
    pub range: Range,
}

/// What a parameter may be.
#[derive(Clone, Copy, Debug)]
pub enum Range {
    /// A number.
    Number {
        /// Unit for a revolute joint, and for the arm as a whole.
        unit: &'static str,
        /// Unit for a prismatic joint.
        prismatic_unit: &'static str,
        /// Least value.
        least: f64,
        /// Greatest value.
        most: f64,
        /// Value taken where the file is silent; `None` if it has to be given.
        default: Option<f64>,
        /// How the effect depends on it.
        role: Role,
    },
    /// Three numbers: a vector in the frame that the meaning names.
    Vector {
        /// Unit.
        unit: &'static str,
        /// Value taken where the file is silent; `None` if it has to be given.
        default: Option<[f64; 3]>,
        /// How the effect depends on it.
        role: Role,
    },
    /// The name of another joint.
    OtherJoint,
    /// One of these words; the first is taken where the file is silent.
    Word(&'static [&'static str]),
}

/// How the prediction depends on a parameter: what a diagnosis can do about it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Role {
    /// The whole effect is proportional to it (together with the others of this role: a sum of terms).
    Linear,
    /// It shapes the effect; searched on a grid and refined.
    Shape,
    /// The measured motion hardly depends on it (a contact's stiffness); given by the material, not identified.
    Given,
}

/// An entry of the catalogue: one kind of effect.
pub struct Kind {
    /// Name in arm files and in `diagnosis.json`.
    pub name: &'static str,
    /// What a mechanical engineer calls it.
    pub title: &'static str,
    /// Where it can sit.
    pub site: Site,
    /// Its parameters, in the order in which people name them.
    pub parameters: &'static [Parameter],
    /// Where it shows.
    pub seen: Seen,
    /// Whether its law jumps with the motion: what it predicts goes through the low-pass that the measurement went through.
    pub rough: bool,
    /// The law, in one line with its symbols.
    pub equation: &'static str,
    /// Author, year.
    pub source: &'static str,
    /// What gives it away.
    pub signature: &'static str,
    /// The kinds that look like it, and what separates them.
    pub confounders: &'static [(&'static str, &'static str)],
    /// Makes the effect of checked values.
    pub build: fn(&Values) -> Result<Box<dyn Effect>, LawError>,
}

impl Debug for Kind {
    fn fmt(&self, formatter: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(formatter, "Kind({})", self.name)
    }
}

impl Kind {
    /// The unit of the parameter called `name` at `joint`; empty for words.
    pub fn unit(&self, name: &str, joint: Option<&Joint>) -> &'static str {
        use freeplay_arm::JointKind::Prismatic;
        let parameter = self.parameters.iter().find(|parameter| parameter.name == name);
        match parameter.map(|parameter| parameter.range) {
            Some(Range::Number { prismatic_unit, .. }) if joint.is_some_and(|j| j.kind == Prismatic) => {
                prismatic_unit
            }
            Some(Range::Number { unit, .. } | Range::Vector { unit, .. }) => unit,
            _ => "",
        }
    }
}
