//! What an effect does: physics that a rigid arm leaves out, in one definition for the plant, for `compare` and for the diagnosis.

use std::fmt::Debug;

use freeplay_arm::Joint;
use freeplay_arm::export::Element;
use toml::Value;

use crate::LawError;
use crate::arm_parts::ArmParts;
use crate::basis::vector;
use crate::columns::Columns;
use crate::injection::Injection;
use crate::play::across;
use crate::prediction::{Change, Prediction};
use crate::scene::Scene;

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

    /// Adds to `shift`, `[joint][point]`, how far each link is from where the motor-side encoder has it, rad (m). The link's velocity and
    /// acceleration follow, unless the kind is rough.
    fn shift(&self, _scene: &Scene, _shift: &mut Columns) {}

    /// Adds to `torque`, `[joint][point]`, what the drives have to spend beyond the rigid arm, N·m (N).
    fn torque(&self, _scene: &Scene, _torque: &mut Columns) {}

    /// Adds to `tool`, `[axis][point]`, how far the tool is from where the shifted joints put it, base frame, m.
    fn displace(&self, _scene: &Scene, _tool: &mut Columns) {}

    /// The three before in one: an effect that takes one course through the motion follows it once.
    fn apply(&self, scene: &Scene, change: &mut Change) {
        self.shift(scene, &mut change.link);
        self.torque(scene, &mut change.torque);
        self.displace(scene, &mut change.tool);
    }

    /// Whether [`Effect::measure`] does anything.
    fn measures(&self) -> bool {
        false
    }

    /// Changes what is measured: gains, offsets, delays.
    fn measure(&self, _scene: &Scene, _prediction: &mut Prediction) {}

    /// Whether [`Effect::measure`] makes corners, which a low-pass on what was measured rounds.
    fn bends(&self) -> bool {
        false
    }

    /// The same with its memory standing at `start` as a motion begins; `None` if it has none of that sort that a recording leaves open, or if it was told.
    fn with_initial_state(&self, _start: Start) -> Option<Box<dyn Effect>> {
        None
    }

    /// Courses that the effect may take, where a recorded motion does not foretell which; none where it does.
    fn courses(&self) -> Vec<Box<dyn Effect>> {
        Vec::new()
    }

    /// Puts the effect into a plant. Changes of the arm are already in.
    fn inject(&self, injection: &mut Injection);

    /// Adds to `elements` what multibody tools share words for. Changes of the arm are already in.
    fn export_elements(&self, _elements: &mut Vec<Element>) -> ExportCoverage {
        ExportCoverage::Not
    }
}

/// How much of an effect the elements that multibody tools share can express.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ExportCoverage {
    /// All of it.
    Whole,
    /// All but what the words name.
    But(&'static str),
    /// Nothing: other tools have no such law.
    Not,
    /// Nothing, for the reason that the words give.
    Never(&'static str),
}

/// Where a memory stands as a motion begins.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Start {
    /// Between two stops: −1 at the one, 1 at the other.
    Between(f64),
    /// In a bearing: along the two slides of [`crate::ArmWithPlay`], as shares of the clearance.
    Within([f64; 2]),
}

impl Start {
    /// The same as an arm file says it of `joint`.
    pub fn said_of(self, joint: &Joint) -> Value {
        match self {
            Start::Between(place) => Value::Float(place),
            Start::Within([first, second]) => {
                let [e1, e2] = across(&joint.axis);
                vector((first * e1.into_inner() + second * e2.into_inner()).into())
            }
        }
    }
}
