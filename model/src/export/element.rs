//! The elements beyond a rigid arm, in terms that are common to multibody tools.

/// One element. Joints are indices from the base; units are SI: N·m, rad for joints that turn, N, m for those that slide.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Element {
    /// Inertia of a rotor on the joint's own row of the mass matrix, in addition to [`freeplay_arm::Joint::rotor_inertia`].
    RotorInertia {
        /// The joint.
        joint: usize,
        /// kg·m² (kg).
        inertia: f64,
    },
    /// Torque against the velocity v: linear·v + quadratic·v|v|, in addition to [`freeplay_arm::JointFriction`].
    Damping {
        /// The joint.
        joint: usize,
        /// N·m·s/rad.
        linear: f64,
        /// N·m·s²/rad².
        quadratic: f64,
    },
    /// Coulomb friction, in addition to [`freeplay_arm::JointFriction`].
    DryFriction {
        /// The joint.
        joint: usize,
        /// Level, N·m; negative where the arm file has too much friction.
        level: f64,
    },
    /// Constant torque of the drive, independent of the motion.
    ConstantTorque {
        /// The joint.
        joint: usize,
        /// N·m.
        torque: f64,
    },
    /// A spring from the previous link to the joint's own link: the drive spends stiffness·(q − rest).
    Spring {
        /// The joint.
        joint: usize,
        /// N·m/rad.
        stiffness: f64,
        /// Position without torque, rad.
        rest: f64,
    },
    /// An elastic gear between motor and link. Several gears on one joint are in series.
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
        /// True if the joint's own parameters include its share of inertia and viscous friction already.
        own_shares_named: bool,
    },
    /// A torque measurement with a gain error: it gives 1/gain of the true torque.
    TorqueGain {
        /// The joint.
        joint: usize,
        /// True over measured torque.
        gain: f64,
    },
    /// A torque measurement with an offset.
    TorqueOffset {
        /// The joint.
        joint: usize,
        /// N·m.
        offset: f64,
    },
    /// A torque limit of the drive.
    TorqueLimit {
        /// The joint.
        joint: usize,
        /// N·m.
        limit: f64,
    },
    /// A hard stop.
    Stop {
        /// The joint.
        joint: usize,
        /// Least position, rad; minus infinity where there is no stop.
        lower: f64,
        /// Greatest position, rad; infinity where there is no stop.
        upper: f64,
    },
    /// The reading of an encoder where the joint is at zero.
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
    /// A delay between a command and its action.
    CommandDelay {
        /// The joint.
        joint: usize,
        /// s.
        delay: f64,
    },
    /// A measured channel with a delay.
    Delay {
        /// The channel.
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
