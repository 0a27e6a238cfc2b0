//! Tolerances: permitted differences between a machine and its model; the diagnosis does not report them as findings.

use freeplay_laws::{ArmParts, Kind as EffectKind, Tolerance};
use nalgebra::{Isometry3, UnitQuaternion, Vector3};

use crate::conventions::Late;
use crate::data::columns::Answer;

/// Tolerances of the nominal model: half-widths of the permitted range of a machine.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tolerances {
    /// Mass of a link, as a fraction.
    pub mass: f64,
    /// Inertia of a link about its centre of mass, and of a rotor that the model names, as a fraction.
    pub inertia: f64,
    /// Friction of the model, including the friction laws in the arm file, as a fraction.
    pub friction: f64,
    /// Zero of an encoder, rad (m for a slide).
    pub zero: f64,
    /// Length between joints, position of the tool, and distance of a link's centre of mass from its modelled position, m; 1/√3 of that along each axis.
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
    /// Returns true if an effect of `kind` with these `parameters` lies within the tolerances, so that it is no finding. A torque that is held from one sample
    /// to the next, `step` s, is late or early by half of that already.
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
    /// Its name, for people.
    pub name: String,
    /// Contribution of one standard deviation to each channel.
    pub answer: Answer,
    /// True if it has no prior, like the zero of a link encoder.
    pub free: bool,
    /// The uncertain quantity of the machine.
    pub of: Of,
}

/// An uncertain quantity of a machine. Joints by number.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Of {
    /// Mass of a link.
    Mass(usize),
    /// Inertia of a link about its centre of mass.
    Inertia(usize),
    /// Centre of mass of a link, along a direction of its frame.
    Centre(usize, Vector3<f64>),
    /// Inertia of a rotor in the model.
    Rotor(usize),
    /// Length between a joint and the one before.
    Length(usize),
    /// Length of the tool.
    Tool,
    /// Viscous friction of the model.
    Viscous(usize),
    /// Coulomb friction of the model.
    Coulomb(usize),
    /// The strength of a law in the arm file.
    Law,
    /// Zero of an encoder.
    Zero,
    /// Delay of the torques or of the tracker, and its standard deviation in seconds.
    Delay(Late, f64),
    /// Zero of a joint that the test of conventions fitted, and its standard deviation in rad.
    FittedZero(usize, f64),
    /// A property of the measurement other than a delay: the tracker's frame, the zero of a link encoder.
    Measurement,
}

impl Of {
    /// Returns true if the law `kind` with this `shape` changes the same delay. The columns of a delay and of a change of it differ, unlike those of other
    /// quantities.
    pub fn is_in(self, kind: &EffectKind, shape: &toml::Table) -> bool {
        let channel = shape.get("channel").and_then(toml::Value::as_str);
        let late = match self {
            Self::Delay(Late::Torque, _) => "torque",
            Self::Delay(Late::Tool, _) => "tool",
            _ => return false,
        };
        kind.tolerance == Some(Tolerance::Delay) && (channel == Some(late) || channel == Some("position"))
    }

    /// Changes `parts` by the given number of standard `deviations`. Quantities that are not in an arm file leave `parts` unchanged.
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
            Self::FittedZero(joint, deviation) => {
                let joint = &mut parts.joints[joint];
                joint.placement *= UnitQuaternion::from_axis_angle(&joint.axis, deviation * deviations);
            }
            Self::Law | Self::Zero | Self::Delay(..) | Self::Measurement => {}
        }
    }
}

/// Adds `amount` to the length of the translation in `way`, if it has one.
fn lengthen(way: &mut Isometry3<f64>, amount: f64) {
    if let Some(direction) = way.translation.vector.try_normalize(1e-6) {
        way.translation.vector += direction * amount;
    }
}
