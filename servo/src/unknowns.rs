//! The numbers that a fit looks for, each with what is believed of it before.

use crate::joint::JointServo;
use crate::rollout::ServoArm;

/// A quantity of a joint. Where no load acts on a joint, only ratios to the servo's stiffness can be known; so all but the stiffness
/// itself are such ratios, times or angles.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Quantity {
    /// Natural logarithm of the stiffness in N·m/rad.
    Stiffness,
    /// Damping over stiffness, s.
    Lag,
    /// Sliding friction over stiffness, rad.
    Coulomb,
    /// Breakaway above sliding friction, over stiffness, rad.
    Stiction,
    /// Rotor inertia over stiffness, s².
    Rotor,
    /// Delay of the commands, s; an effect does not come before its cause.
    Delay,
    /// Set-point minus command, rad.
    Offset,
    /// Dead band, rad.
    Deadband,
    /// Natural logarithm of the torque limit over stiffness in rad.
    TorqueLimit,
    /// Natural logarithm of the speed limit in rad/s.
    SpeedLimit,
    /// Mass on the last link beside what the arm file has, kg; of the whole arm.
    Payload,
    /// Where its centre of mass is off the tool, along x of the last link's frame, m; of the whole arm.
    PayloadX,
    /// The same along y.
    PayloadY,
    /// The same along z.
    PayloadZ,
    /// Natural logarithm of the true over the modelled mass of the joint's link.
    LinkMass,
    /// Roll of the base, rad; of the whole arm.
    Roll,
    /// Pitch of the base, rad; of the whole arm.
    Pitch,
}

impl Quantity {
    /// The quantities of the whole arm, of no link and no servo.
    pub(crate) const OF_WHOLE_ARM: [Quantity; 6] = [
        Quantity::Payload,
        Quantity::PayloadX,
        Quantity::PayloadY,
        Quantity::PayloadZ,
        Quantity::Roll,
        Quantity::Pitch,
    ];

    /// Whether it is the arm's, and not a servo's.
    pub fn is_of_arm(self) -> bool {
        self == Quantity::LinkMass || Quantity::OF_WHOLE_ARM.contains(&self)
    }

    /// Whether it says where a body is, and not whether there is one.
    pub fn is_place(self) -> bool {
        matches!(self, Quantity::PayloadX | Quantity::PayloadY | Quantity::PayloadZ)
    }

    /// The least value that is physical.
    pub fn least(self) -> f64 {
        match self {
            Quantity::Lag
            | Quantity::Coulomb
            | Quantity::Stiction
            | Quantity::Rotor
            | Quantity::Delay
            | Quantity::Deadband => 0.0,
            _ => f64::NEG_INFINITY,
        }
    }

    /// Its value for `joint`.
    pub fn of(self, joint: &JointServo) -> f64 {
        match self {
            Quantity::Stiffness => joint.stiffness.ln(),
            Quantity::Lag => joint.damping / joint.stiffness,
            Quantity::Coulomb => joint.coulomb / joint.stiffness,
            Quantity::Stiction => joint.stiction / joint.stiffness,
            Quantity::Rotor => joint.rotor_inertia / joint.stiffness,
            Quantity::Delay => joint.delay,
            Quantity::Offset => joint.offset,
            Quantity::Deadband => joint.deadband,
            Quantity::TorqueLimit => (joint.torque_limit / joint.stiffness).ln(),
            Quantity::SpeedLimit => joint.speed_limit.ln(),
            // No servo has what is the arm's.
            _ => 0.0,
        }
    }

    /// Its value for `joint` in N·m where [`Quantity::of`] is a ratio to the stiffness; the same elsewhere.
    pub fn torque_of(self, joint: &JointServo) -> f64 {
        match self {
            Quantity::Lag => joint.damping,
            Quantity::Coulomb => joint.coulomb,
            Quantity::Stiction => joint.stiction,
            Quantity::Rotor => joint.rotor_inertia,
            Quantity::TorqueLimit => joint.torque_limit.ln(),
            _ => self.of(joint),
        }
    }

    /// Gives `joint` the value `x` of [`Quantity::torque_of`]. A new stiffness leaves all else as it is.
    pub fn set_torque(self, joint: &mut JointServo, x: f64) {
        match self {
            Quantity::Stiffness => joint.stiffness = x.exp(),
            Quantity::Lag => joint.damping = x,
            Quantity::Coulomb => joint.coulomb = x,
            Quantity::Stiction => joint.stiction = x,
            Quantity::Rotor => joint.rotor_inertia = x,
            Quantity::TorqueLimit => joint.torque_limit = x.exp(),
            _ => self.set(joint, x),
        }
    }

    /// Gives `joint` the value `x`. A new stiffness keeps the ratios.
    pub fn set(self, joint: &mut JointServo, x: f64) {
        let stiffness = joint.stiffness;
        match self {
            Quantity::Stiffness => {
                let ratio = x.exp() / stiffness;
                joint.stiffness *= ratio;
                joint.damping *= ratio;
                joint.coulomb *= ratio;
                joint.stiction *= ratio;
                joint.rotor_inertia *= ratio;
                joint.torque_limit *= ratio;
            }
            Quantity::Lag => joint.damping = stiffness * x,
            Quantity::Coulomb => joint.coulomb = stiffness * x,
            Quantity::Stiction => joint.stiction = stiffness * x,
            Quantity::Rotor => joint.rotor_inertia = stiffness * x,
            Quantity::Delay => joint.delay = x,
            Quantity::Offset => joint.offset = x,
            Quantity::Deadband => joint.deadband = x,
            Quantity::TorqueLimit => joint.torque_limit = stiffness * x.exp(),
            Quantity::SpeedLimit => joint.speed_limit = x.exp(),
            _ => {}
        }
    }
}

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
