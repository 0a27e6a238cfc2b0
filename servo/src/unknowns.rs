//! The parameters that a fit estimates, each with its prior.

use crate::model_parameter::ModelParameter;
use crate::servo_arm::ServoArm;

/// One parameter that a fit estimates.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Unknown {
    /// Index of the joint.
    pub joint: usize,
    /// The parameter.
    pub parameter: ModelParameter,
    /// Mean of the prior, in the unit of the parameter.
    pub expected: f64,
    /// Standard deviation of the prior.
    pub deviation: f64,
    /// Step of its finite differences.
    pub step: f64,
    /// True if the value is in N·m ([`ModelParameter::value_in_torque`]), as in a model with a known stiffness; otherwise it is a ratio to
    /// the stiffness.
    pub is_torque: bool,
    /// The least permitted value, [`ModelParameter::least`] without further knowledge.
    pub least: f64,
}

impl Unknown {
    /// True if `other` is the same parameter of the same joint, for any prior.
    pub fn is_same(&self, other: &Unknown) -> bool {
        self.joint == other.joint && self.parameter == other.parameter
    }

    /// The same in N·m, for a servo with `stiffness`, N·m/rad.
    #[must_use]
    pub fn in_torque(self, stiffness: f64) -> Unknown {
        if self.is_torque { self } else { Unknown { is_torque: true, ..self.scaled(stiffness) } }
    }

    /// The same as a ratio to `stiffness`, N·m/rad.
    #[must_use]
    pub fn as_ratio(self, stiffness: f64) -> Unknown {
        if self.is_torque { Unknown { is_torque: false, ..self.scaled(1.0 / stiffness) } } else { self }
    }

    fn scaled(self, factor: f64) -> Unknown {
        match self.parameter {
            ModelParameter::Lag
            | ModelParameter::Coulomb
            | ModelParameter::Stiction
            | ModelParameter::Rotor => Unknown {
                expected: self.expected * factor,
                deviation: self.deviation * factor,
                step: self.step * factor,
                least: self.least * factor,
                ..self
            },
            // The value is a logarithm.
            ModelParameter::TorqueLimit => Unknown { expected: self.expected + factor.ln(), ..self },
            _ => self,
        }
    }

    /// Its value in `arm`.
    pub fn of(&self, arm: &ServoArm) -> f64 {
        if self.parameter.is_of_arm() {
            return arm.burden.as_ref().map_or(0.0, |burden| burden.of(self.joint, self.parameter));
        }
        let joint = &arm.joints[self.joint];
        if self.is_torque { self.parameter.value_in_torque(joint) } else { self.parameter.of(joint) }
    }

    /// Sets its value in `arm` to `x`.
    pub fn set(&self, arm: &mut ServoArm, x: f64) {
        if self.parameter.is_of_arm() {
            return arm.set_burden(self.joint, self.parameter, x);
        }
        let joint = &mut arm.joints[self.joint];
        if self.is_torque { self.parameter.set_torque(joint, x) } else { self.parameter.set(joint, x) }
    }
}

#[cfg(test)]
mod tests {
    use super::{ModelParameter, Unknown};
    use crate::joint::JointServo;

    /// A value set as a ratio equals the value set in N·m, and vice versa.
    #[test]
    fn ratios_and_torques_are_one_number() {
        let stiffness = 40.0;
        for parameter in [
            ModelParameter::Lag,
            ModelParameter::Coulomb,
            ModelParameter::Stiction,
            ModelParameter::Rotor,
            ModelParameter::TorqueLimit,
            ModelParameter::Delay,
        ] {
            let ratio = Unknown {
                joint: 0,
                parameter,
                expected: 0.05,
                deviation: 0.02,
                step: 0.001,
                is_torque: false,
                least: parameter.least(),
            };
            let torque = ratio.in_torque(stiffness);
            let mut joint = JointServo::stiff(stiffness);
            parameter.set(&mut joint, ratio.expected);
            assert!((parameter.value_in_torque(&joint) - torque.expected).abs() < 1e-12, "{parameter:?}");
            let back = torque.as_ratio(stiffness);
            assert!((back.expected - ratio.expected).abs() < 1e-12 && !back.is_torque, "{parameter:?}");
            assert!((back.deviation - ratio.deviation).abs() < 1e-12, "{parameter:?}");
        }
    }
}
