//! The interface of an effect: physics beyond a rigid arm, in one definition for the plant, for `compare` and for the diagnosis.

use std::fmt::Debug;

use freeplay_arm::Joint;
use freeplay_model::export::Element;
use toml::Value;

use crate::LawError;
use crate::arm_parts::ArmParts;
use crate::basis::vector;
use crate::columns::Columns;
use crate::injection::Injection;
use crate::play::across;
use crate::prediction::{Change, Prediction};
use crate::scene::Scene;

/// An effect with its parameters, at its place. Callers run the stages in the order below; each effect contributes to one or a few of them.
///
/// `arm` to `measure` predict a *recording* from the motion of the encoders, without integrating anything. [`Effect::inject`] puts the same
/// law into the plant. A test of each effect compares the two.
pub trait Effect: Debug + Send + Sync {
    /// Changes the rigid arm: masses, lengths, gravity.
    ///
    /// # Errors
    /// [`LawError`] if the change makes the arm impossible.
    fn arm(&self, _parts: &mut ArmParts) -> Result<(), LawError> {
        Ok(())
    }

    /// Adds to `shift`, `[joint][point]`, the displacement of each link from its motor-side encoder, rad (m). The link's velocity and
    /// acceleration follow, unless the kind is rough.
    fn shift(&self, _scene: &Scene, _shift: &mut Columns) {}

    /// Adds to `torque`, `[joint][point]`, the torque of the drives beyond the rigid arm, N·m (N).
    fn torque(&self, _scene: &Scene, _torque: &mut Columns) {}

    /// Adds to `tool`, `[axis][point]`, the tool's displacement from its position by the shifted joints, base frame, m.
    fn displace(&self, _scene: &Scene, _tool: &mut Columns) {}

    /// Runs the three stages above in one pass, for an effect with a single course through the motion.
    fn apply(&self, scene: &Scene, change: &mut Change) {
        self.shift(scene, &mut change.link);
        self.torque(scene, &mut change.torque);
        self.displace(scene, &mut change.tool);
    }

    /// True if [`Effect::measure`] changes the prediction.
    fn measures(&self) -> bool {
        false
    }

    /// Changes the measurements: gains, offsets, delays.
    fn measure(&self, _scene: &Scene, _prediction: &mut Prediction) {}

    /// True if [`Effect::measure`] makes corners, which the low-pass of the measurement rounds.
    fn bends(&self) -> bool {
        false
    }

    /// The same with the initial state `start`; `None` if the effect has no state that a recording leaves undetermined, or if its initial
    /// state is given.
    fn with_initial_state(&self, _start: Start) -> Option<Box<dyn Effect>> {
        None
    }

    /// Possible courses of the effect, if the recorded motion does not determine the course; empty otherwise.
    fn courses(&self) -> Vec<Box<dyn Effect>> {
        Vec::new()
    }

    /// Puts the effect into a plant. The arm already includes the effect's changes.
    fn inject(&self, injection: &mut Injection);

    /// Adds the elements that multibody tools have in common to `elements`. The arm already includes the effect's changes.
    fn export_elements(&self, _elements: &mut Vec<Element>) -> ExportCoverage {
        ExportCoverage::Not
    }
}

/// The part of an effect that the common elements of multibody tools can express.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ExportCoverage {
    /// The whole effect.
    Whole,
    /// All but the named part.
    But(&'static str),
    /// Nothing: other tools have no such law.
    Not,
    /// Nothing, for the given reason.
    Never(&'static str),
}

/// The initial state of a memory.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Start {
    /// Between two stops: −1 at the one, 1 at the other.
    Between(f64),
    /// In a bearing: along the two slides of [`crate::ArmWithPlay`], as shares of the clearance.
    Within([f64; 2]),
}

impl Start {
    /// The value in an arm file, for `joint`.
    pub fn file_value(self, joint: &Joint) -> Value {
        match self {
            Start::Between(place) => Value::Float(place),
            Start::Within([first, second]) => {
                let [e1, e2] = across(&joint.axis);
                vector((first * e1.into_inner() + second * e2.into_inner()).into())
            }
        }
    }
}
