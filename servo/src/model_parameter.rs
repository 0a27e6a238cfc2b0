//! The parameters of a servo and of the load and geometry of its arm.

use crate::joint::JointServo;

/// A parameter of the model of an arm on servos. Without a load on a joint, positions identify only ratios to the servo's stiffness; so all
/// parameters but the stiffness itself are such ratios, times or angles.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ModelParameter {
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
    /// Delay of the commands, s; not negative, by causality.
    Delay,
    /// Set-point minus command, rad.
    Offset,
    /// Dead band, rad.
    Deadband,
    /// Natural logarithm of the torque limit over stiffness in rad.
    TorqueLimit,
    /// Natural logarithm of the speed limit in rad/s.
    SpeedLimit,
    /// Mass on the last link in addition to the arm file, kg; of the whole arm.
    Payload,
    /// Offset of its centre of mass from the tool, along x of the last link's frame, m; of the whole arm.
    PayloadX,
    /// The same along y.
    PayloadY,
    /// The same along z.
    PayloadZ,
    /// Natural logarithm of the true over the modelled mass of the joint's link.
    LinkMass,
    /// Encoder reading at the joint's zero, rad.
    Zero,
    /// Full gap between the flanks of the joint's gear, behind the encoder, rad.
    Gap,
    /// Roll of the base, rad; of the whole arm.
    Roll,
    /// Pitch of the base, rad; of the whole arm.
    Pitch,
}

impl ModelParameter {
    /// The parameters of the whole arm, which belong to no link and no servo.
    pub(crate) const OF_WHOLE_ARM: [ModelParameter; 6] = [
        ModelParameter::Payload,
        ModelParameter::PayloadX,
        ModelParameter::PayloadY,
        ModelParameter::PayloadZ,
        ModelParameter::Roll,
        ModelParameter::Pitch,
    ];

    /// The parameters of a joint that belong to the arm, not to its servo.
    pub(crate) const OF_ARM_AT_JOINT: [ModelParameter; 3] =
        [ModelParameter::LinkMass, ModelParameter::Zero, ModelParameter::Gap];

    /// True if the parameter belongs to the arm, not to a servo.
    pub fn is_of_arm(self) -> bool {
        ModelParameter::OF_ARM_AT_JOINT.contains(&self) || ModelParameter::OF_WHOLE_ARM.contains(&self)
    }

    /// True if the parameter locates a body, instead of giving its mass.
    pub fn is_place(self) -> bool {
        matches!(self, ModelParameter::PayloadX | ModelParameter::PayloadY | ModelParameter::PayloadZ)
    }

    /// The least physical value.
    pub fn least(self) -> f64 {
        match self {
            ModelParameter::Lag
            | ModelParameter::Coulomb
            | ModelParameter::Stiction
            | ModelParameter::Rotor
            | ModelParameter::Delay
            | ModelParameter::Deadband
            | ModelParameter::Gap => 0.0,
            _ => f64::NEG_INFINITY,
        }
    }

    /// Its value for `joint`.
    pub fn of(self, joint: &JointServo) -> f64 {
        match self {
            ModelParameter::Stiffness => joint.stiffness.ln(),
            ModelParameter::Lag => joint.damping / joint.stiffness,
            ModelParameter::Coulomb => joint.coulomb / joint.stiffness,
            ModelParameter::Stiction => joint.stiction / joint.stiffness,
            ModelParameter::Rotor => joint.rotor_inertia / joint.stiffness,
            ModelParameter::Delay => joint.delay,
            ModelParameter::Offset => joint.offset,
            ModelParameter::Deadband => joint.deadband,
            ModelParameter::TorqueLimit => (joint.torque_limit / joint.stiffness).ln(),
            ModelParameter::SpeedLimit => joint.speed_limit.ln(),
            // No servo has the arm's parameters.
            _ => 0.0,
        }
    }

    /// The value for `joint` in N·m where [`ModelParameter::of`] gives a ratio to the stiffness; the same value elsewhere.
    pub fn value_in_torque(self, joint: &JointServo) -> f64 {
        match self {
            ModelParameter::Lag => joint.damping,
            ModelParameter::Coulomb => joint.coulomb,
            ModelParameter::Stiction => joint.stiction,
            ModelParameter::Rotor => joint.rotor_inertia,
            ModelParameter::TorqueLimit => joint.torque_limit.ln(),
            _ => self.of(joint),
        }
    }

    /// Sets the value `x` of [`ModelParameter::value_in_torque`] in `joint`. A new stiffness leaves the other values unchanged.
    pub fn set_torque(self, joint: &mut JointServo, x: f64) {
        match self {
            ModelParameter::Stiffness => joint.stiffness = x.exp(),
            ModelParameter::Lag => joint.damping = x,
            ModelParameter::Coulomb => joint.coulomb = x,
            ModelParameter::Stiction => joint.stiction = x,
            ModelParameter::Rotor => joint.rotor_inertia = x,
            ModelParameter::TorqueLimit => joint.torque_limit = x.exp(),
            _ => self.set(joint, x),
        }
    }

    /// Sets the value `x` in `joint`. A new stiffness keeps the ratios.
    pub fn set(self, joint: &mut JointServo, x: f64) {
        let stiffness = joint.stiffness;
        match self {
            ModelParameter::Stiffness => {
                let ratio = x.exp() / stiffness;
                joint.stiffness *= ratio;
                joint.damping *= ratio;
                joint.coulomb *= ratio;
                joint.stiction *= ratio;
                joint.rotor_inertia *= ratio;
                joint.torque_limit *= ratio;
            }
            ModelParameter::Lag => joint.damping = stiffness * x,
            ModelParameter::Coulomb => joint.coulomb = stiffness * x,
            ModelParameter::Stiction => joint.stiction = stiffness * x,
            ModelParameter::Rotor => joint.rotor_inertia = stiffness * x,
            ModelParameter::Delay => joint.delay = x,
            ModelParameter::Offset => joint.offset = x,
            ModelParameter::Deadband => joint.deadband = x,
            ModelParameter::TorqueLimit => joint.torque_limit = stiffness * x.exp(),
            ModelParameter::SpeedLimit => joint.speed_limit = x.exp(),
            _ => {}
        }
    }
}
