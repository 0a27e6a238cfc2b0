//! The elements beyond a rigid arm, in terms that multibody tools share.

/// One element. Joints are indices from the base; units are SI: N·m, rad for joints that turn, N, m for those that slide.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Element {
    /// Inertia of a rotor on the joint's own row of the mass matrix, beside [`crate::Joint::rotor_inertia`].
    RotorInertia {
        /// The joint.
        joint: usize,
        /// kg·m² (kg).
        inertia: f64,
    },
    /// Torque against the velocity v: linear·v + quadratic·v|v|, beside [`crate::JointFriction`].
    Damping {
        /// The joint.
        joint: usize,
        /// N·m·s/rad.
        linear: f64,
        /// N·m·s²/rad².
        quadratic: f64,
    },
    /// Coulomb friction, beside [`crate::JointFriction`].
    DryFriction {
        /// The joint.
        joint: usize,
        /// Level, N·m; negative where the arm names too much.
        level: f64,
    },
    /// A torque that the drive spends whatever the joint does.
    ConstantTorque {
        /// The joint.
        joint: usize,
        /// N·m.
        torque: f64,
    },
    /// A spring from the link before to the joint's own: the drive spends stiffness·(q − rest).
    Spring {
        /// The joint.
        joint: usize,
        /// N·m/rad.
        stiffness: f64,
        /// Position without torque, rad.
        rest: f64,
    },
    /// A gear between motor and link that gives way. Several on one joint are in series.
    Gear {
        /// The joint.
        joint: usize,
        /// Torque per angle with the flanks in touch, N·m/rad; `None`: rigid flanks.
        stiffness: Option<f64>,
        /// Torque per speed with the flanks in touch, N·m·s/rad.
        damping: f64,
        /// Whole angle between the flanks, rad.
        gap: f64,
        /// Coulomb friction on the link's side of the gap, N·m.
        friction: f64,
    },
    /// Radial play of a joint that turns: the journal moves freely across the axis within the clearance.
    RadialPlay {
        /// The joint.
        joint: usize,
        /// Radial clearance, m.
        clearance: f64,
    },
    /// A shaft that turns at u = v₁ + ratio·v₂ and loads both joints by X = inertia·u̇ + viscous·u + coulomb·sign(u): τ₁ = X, τ₂ = ratio·X.
    Shaft {
        /// The two joints.
        joints: [usize; 2],
        /// Speed of the shaft per speed of the second joint.
        ratio: f64,
        /// kg·m².
        inertia: f64,
        /// N·m·s/rad.
        viscous: f64,
        /// N·m.
        coulomb: f64,
        /// Whether each joint's own share of inertia and viscous friction is in the joint's own numbers already.
        own_shares_named: bool,
    },
    /// A torque measurement that reads 1/gain of the true torque.
    TorqueGain {
        /// The joint.
        joint: usize,
        /// True over measured torque.
        gain: f64,
    },
    /// A torque measurement that reads too much.
    TorqueOffset {
        /// The joint.
        joint: usize,
        /// N·m.
        offset: f64,
    },
    /// A drive that gives no more than so much torque.
    TorqueLimit {
        /// The joint.
        joint: usize,
        /// N·m.
        limit: f64,
    },
    /// A stop that the joint can't pass.
    Stop {
        /// The joint.
        joint: usize,
        /// Least position, rad; minus infinity where there is no stop.
        lower: f64,
        /// Greatest position, rad; infinity where there is no stop.
        upper: f64,
    },
    /// An encoder that reads this where the joint is at zero.
    EncoderZero {
        /// The joint.
        joint: usize,
        /// rad.
        offset: f64,
    },
    /// A position servo: τ = stiffness·(command + offset − q) − damping·q̇, within ± the limit.
    Servo {
        /// The joint.
        joint: usize,
        /// N·m/rad.
        stiffness: f64,
        /// N·m·s/rad.
        damping: f64,
        /// Set-point minus command, rad.
        offset: f64,
        /// N·m; infinite if none.
        limit: f64,
    },
    /// A drive that acts on a command only after this time.
    CommandDelay {
        /// The joint.
        joint: usize,
        /// s.
        delay: f64,
    },
    /// A channel of the measurement that is late.
    Delay {
        /// Which one.
        channel: Channel,
        /// s.
        delay: f64,
    },
}

/// A channel of a measurement.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Channel {
    /// Positions and velocities of the motors.
    Motor,
    /// Torques of the drives.
    Torque,
    /// Position of the tool.
    Tool,
}
