//! The quantities of a servo and of what an arm carries.

use crate::joint::JointServo;

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
    /// What the encoder reads where the joint is at zero, rad.
    Zero,
    /// Whole angle between the flanks of the joint's gear, behind the encoder, rad.
    Gap,
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

    /// The quantities of a joint that are the arm's, and not its servo's.
    pub(crate) const OF_ARM_AT_JOINT: [Quantity; 3] = [Quantity::LinkMass, Quantity::Zero, Quantity::Gap];

    /// Whether it is the arm's, and not a servo's.
    pub fn is_of_arm(self) -> bool {
        Quantity::OF_ARM_AT_JOINT.contains(&self) || Quantity::OF_WHOLE_ARM.contains(&self)
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
            | Quantity::Deadband
            | Quantity::Gap => 0.0,
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
