//! Tolerances: a machine may differ from its model by this much, and the diagnosis does not call the difference a finding.

use freeplay_laws::{ArmParts, Kind as EffectKind, Tolerance};
use nalgebra::{Isometry3, Vector3};

use crate::conventions::Late;
use crate::data::columns::Answer;

/// Tolerances of the nominal model: half the width within which a machine of that model may be.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tolerances {
    /// Mass of a link, as a fraction.
    pub mass: f64,
    /// Inertia of a link about its centre of mass, and of a rotor that the model names, as a fraction.
    pub inertia: f64,
    /// Friction that the model names, its laws in the arm file included, as a fraction.
    pub friction: f64,
    /// Zero of an encoder, rad (m for a slide).
    pub zero: f64,
    /// Length between joints, position of the tool, and distance of a link's centre of mass from where it should be, m; along each axis of that 1/√3 as much.
    pub length: f64,
    /// Delay of the torques, of the tracker and of the link encoders against the joint encoders, s.
    pub delay: f64,
    /// Orientation of the tracker's frame, rad.
    pub frame: f64,
}

impl Default for Tolerances {
    fn default() -> Self {
        Self { mass: 0.02, inertia: 0.02, friction: 0.05, zero: 1e-4, length: 1e-4, delay: 6e-4, frame: 1e-4 }
    }
}

impl Tolerances {
    /// True if an effect of `kind` with these `parameters` lies inside the tolerances, so that it is no finding. A torque that is held from one sample to the next,
    /// `step` s, is half of that late or early by itself.
    pub(crate) fn hold(&self, kind: &EffectKind, parameters: &toml::Table, step: f64) -> bool {
        let (name, neutral, tolerance) = match kind.tolerance {
            Some(Tolerance::Zero) => ("offset", 0.0, self.zero),
            Some(Tolerance::Length) => ("offset", 0.0, self.length),
            Some(Tolerance::Mass) => ("scale", 1.0, self.mass),
            Some(Tolerance::Delay) => {
                let is_held = parameters.get("channel").and_then(toml::Value::as_str) == Some("torque");
                ("delay", 0.0, self.delay + if is_held { 0.5 * step } else { 0.0 })
            }
            Some(Tolerance::Inertia | Tolerance::Friction) | None => return false,
        };
        parameters.get(name).and_then(toml::Value::as_float).is_some_and(|x| (x - neutral).abs() <= tolerance)
    }
}

/// Standard deviation of a quantity spread evenly over ±1: 1/√3.
pub(crate) fn even() -> f64 {
    1.0 / 3.0_f64.sqrt()
}

/// A nuisance: a direction in which the machine may differ from its model, scaled so that its prior is a normal of variance one.
#[derive(Debug)]
pub(crate) struct Nuisance {
    /// What it is, for people.
    pub name: String,
    /// What one standard deviation of it adds to each channel.
    pub answer: Answer,
    /// Whether it has no prior at all: the zero of a link encoder.
    pub free: bool,
    /// What of the machine it is.
    pub of: Of,
}

/// What of a machine is uncertain. Joints by number.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Of {
    /// Mass of a link.
    Mass(usize),
    /// Inertia of a link about its centre of mass.
    Inertia(usize),
    /// Centre of mass of a link, along a direction of its frame.
    Centre(usize, Vector3<f64>),
    /// Inertia of a rotor that the model names.
    Rotor(usize),
    /// Length between a joint and the one before.
    Length(usize),
    /// Length of the tool.
    Tool,
    /// Viscous friction that the model names.
    Viscous(usize),
    /// Coulomb friction that the model names.
    Coulomb(usize),
    /// The strength of a law that the arm file has.
    Law,
    /// Zero of an encoder.
    Zero,
    /// Delay of the torques or of the tracker, and how many seconds one standard deviation of it is.
    Delay(Late, f64),
    /// A property of the measurement other than a delay: the tracker's frame, the zero of a link encoder.
    Measurement,
}

impl Of {
    /// Changes `parts` by so many standard `deviations` of it; what an arm file does not say leaves them as they are.
    pub fn change(self, parts: &mut ArmParts, tolerances: &Tolerances, deviations: f64) {
        let by = |tolerance: f64| even() * tolerance * deviations;
        match self {
            Self::Mass(joint) => parts.joints[joint].inertia.mass *= 1.0 + by(tolerances.mass),
            Self::Inertia(joint) => parts.joints[joint].inertia.about_com *= 1.0 + by(tolerances.inertia),
            Self::Centre(joint, along) => {
                parts.joints[joint].inertia.com += even() * by(tolerances.length) * along
            }
            Self::Rotor(joint) => parts.joints[joint].rotor_inertia *= 1.0 + by(tolerances.inertia),
            Self::Length(joint) => lengthen(&mut parts.joints[joint].placement, by(tolerances.length)),
            Self::Tool => lengthen(&mut parts.tool, by(tolerances.length)),
            Self::Viscous(joint) => parts.joints[joint].friction.viscous *= 1.0 + by(tolerances.friction),
            Self::Coulomb(joint) => parts.joints[joint].friction.coulomb *= 1.0 + by(tolerances.friction),
            Self::Law | Self::Zero | Self::Delay(..) | Self::Measurement => {}
        }
    }
}

/// Adds `amount` to the length of a way that has one.
fn lengthen(way: &mut Isometry3<f64>, amount: f64) {
    if let Some(direction) = way.translation.vector.try_normalize(1e-6) {
        way.translation.vector += direction * amount;
    }
}
