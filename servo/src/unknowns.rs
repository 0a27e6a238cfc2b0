//! The numbers that a fit looks for, each with what is believed of it before.

use crate::quantity::Quantity;
use crate::servo_arm::ServoArm;

/// One number that a fit looks for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Unknown {
    /// Index of the joint.
    pub joint: usize,
    /// What it is.
    pub quantity: Quantity,
    /// The value believed before, in the unit of the quantity.
    pub expected: f64,
    /// Standard deviation of that belief.
    pub deviation: f64,
    /// Step of its finite differences.
    pub step: f64,
    /// Whether it stands in N·m ([`Quantity::torque_of`]), as in a model whose stiffness is known: else it is a ratio to the stiffness.
    pub is_torque: bool,
    /// The least value that it may have, [`Quantity::least`] if nothing else is known.
    pub least: f64,
}

impl Unknown {
    /// Whether `other` is the same quantity of the same joint, whatever is believed of it.
    pub fn is_same(&self, other: &Unknown) -> bool {
        self.joint == other.joint && self.quantity == other.quantity
    }

    /// The same in N·m, where the servo has `stiffness`, N·m/rad.
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
        match self.quantity {
            Quantity::Lag | Quantity::Coulomb | Quantity::Stiction | Quantity::Rotor => Unknown {
                expected: self.expected * factor,
                deviation: self.deviation * factor,
                step: self.step * factor,
                least: self.least * factor,
                ..self
            },
            // A logarithm.
            Quantity::TorqueLimit => Unknown { expected: self.expected + factor.ln(), ..self },
            _ => self,
        }
    }

    /// Its value in `arm`.
    pub fn of(&self, arm: &ServoArm) -> f64 {
        if self.quantity.is_of_arm() {
            return arm.burden.as_ref().map_or(0.0, |burden| burden.of(self.joint, self.quantity));
        }
        let joint = &arm.joints[self.joint];
        if self.is_torque { self.quantity.torque_of(joint) } else { self.quantity.of(joint) }
    }

    /// Gives it the value `x` in `arm`.
    pub fn set(&self, arm: &mut ServoArm, x: f64) {
        if self.quantity.is_of_arm() {
            return arm.bear(self.joint, self.quantity, x);
        }
        let joint = &mut arm.joints[self.joint];
        if self.is_torque { self.quantity.set_torque(joint, x) } else { self.quantity.set(joint, x) }
    }
}

#[cfg(test)]
mod tests {
    use super::{Quantity, Unknown};
    use crate::joint::JointServo;

    /// What is set as a ratio reads in N·m as what is set in N·m, and back.
    #[test]
    fn ratios_and_torques_are_one_number() {
        let stiffness = 40.0;
        for quantity in [
            Quantity::Lag,
            Quantity::Coulomb,
            Quantity::Stiction,
            Quantity::Rotor,
            Quantity::TorqueLimit,
            Quantity::Delay,
        ] {
            let ratio = Unknown {
                joint: 0,
                quantity,
                expected: 0.05,
                deviation: 0.02,
                step: 0.001,
                is_torque: false,
                least: quantity.least(),
            };
            let torque = ratio.in_torque(stiffness);
            let mut joint = JointServo::stiff(stiffness);
            quantity.set(&mut joint, ratio.expected);
            assert!((quantity.torque_of(&joint) - torque.expected).abs() < 1e-12, "{quantity:?}");
            let back = torque.as_ratio(stiffness);
            assert!((back.expected - ratio.expected).abs() < 1e-12 && !back.is_torque, "{quantity:?}");
            assert!((back.deviation - ratio.deviation).abs() < 1e-12, "{quantity:?}");
        }
    }
}
