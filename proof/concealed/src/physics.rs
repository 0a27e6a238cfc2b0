//! One effect: its kind and its parameters in the meaning of the catalogue, SI units.
//!
//! Torques are torques at the joint, N·m (N for a slide); `v` is the speed of the motor side, q its position. "Extra" means in addition to the data sheet. The
//! laws in `machine/` state where they deliberately differ from those of the catalogue.

use serde::Serialize;

/// An effect at a joint (index from 0), or of the whole arm.
#[derive(Clone, Debug, PartialEq)]
pub struct Effect {
    /// The joint; `None` for an effect of the whole arm.
    pub joint: Option<usize>,
    /// The kind and its parameters.
    pub physics: Physics,
}

/// Every kind of physics that a machine can have; as JSON, `kind` and `parameters` in the names of the catalogue.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(tag = "kind", content = "parameters", rename_all = "snake_case")]
#[allow(
    missing_docs,
    reason = "the parameters' meaning is the catalogue's; it stands at each kind in one sentence"
)]
pub enum Physics {
    /// Journal free in the plane across the axis within the radial clearance, m; stiffness N/m^1.5.
    JointClearance { clearance: f64, stiffness: f64, restitution: f64, friction: f64 },
    /// As above with a film of oil, Pa·s, in a bearing of 10 mm radius and 40 mm length.
    LubricatedClearance { clearance: f64, viscosity: f64 },
    /// Motor and link free against each other within the whole gap, rad; N·m/rad beyond.
    Backlash { gap: f64, stiffness: f64 },
    /// Motor and link tied by a spring, N·m/rad, and a damper, N·m·s/rad.
    JointElasticity { stiffness: f64, damping: f64 },
    /// Extra friction of constant size, N·m; may be negative.
    CoulombFriction { coulomb: f64 },
    /// Extra friction in proportion to speed, N·m·s/rad.
    ViscousFriction { viscous: f64 },
    /// Extra friction F exp(−(v/v_s)²), N·m and rad/s.
    StribeckFriction { extra: f64, velocity: f64 },
    /// Extra friction of one size for v > 0 and another for v < 0, N·m, both against the motion.
    AsymmetricFriction { positive: f64, negative: f64 },
    /// Offset of the torque measurement: reading minus true torque, N·m.
    TorqueOffset { offset: f64 },
    /// Extra friction in proportion to the torque that the joint transmits.
    LoadDependentFriction { coefficient: f64 },
    /// The joint's Coulomb friction as bristles: stiffness N·m/rad, damping N·m·s/rad.
    PreslidingFriction { stiffness: f64, damping: f64 },
    /// Extra friction a sin(Nq + φ), N·m.
    PositionDependentFriction { amplitude: f64, periods: f64, phase: f64 },
    /// All friction of the joint times 1 + α exp(−t/T).
    FrictionDrift { amount: f64, time_constant: f64 },
    /// Friction c v|v|, N·m·s²/rad².
    QuadraticDrag { coefficient: f64 },
    /// Inertia that acts on this joint alone, kg·m².
    RotorInertia { inertia: f64 },
    /// A point mass, kg, at a place in the frame of the last link, m.
    Payload { mass: f64, com: [f64; 3] },
    /// Mass and inertia of one link, scaled by this factor.
    LinkMass { scale: f64 },
    /// The base turned by roll about x, then pitch about y, rad.
    BaseTilt { roll: f64, pitch: f64 },
    /// A spring between a link and the one before, N·m/rad, slack at `rest`.
    JointSpring { stiffness: f64, rest: f64 },
    /// True torque over measured torque.
    TorqueGain { gain: f64 },
    /// Limit of the measured torque, N·m; the motor may give more.
    ActuatorSaturation { limit: f64 },
    /// Torque a sin(Nq + φ) that the drive has to overcome, N·m.
    TorqueRipple { amplitude: f64, periods: f64, phase: f64 },
    /// A geared shaft that turns with v_i + s v_j and has inertia and friction of its own.
    JointCoupling { with: String, inertia: f64, viscous: f64, coulomb: f64, sign: f64 },
    /// Offset of the encoder: reading minus true position, rad.
    EncoderOffset { offset: f64 },
    /// Error of the encoder: reading minus true position, a sin(q + φ), rad.
    EncoderEccentricity { amplitude: f64, phase: f64 },
    /// The link moved by the joint is longer by this, m, along the way to the next joint or to the tool.
    LinkLength { offset: f64 },
    /// The link moved by the joint bends: force over deflection at its far end, N/m.
    LinkFlexure { stiffness: f64 },
    /// Delay of the torques, or of the tool, behind the encoders, s.
    TimeDelay { delay: f64, channel: &'static str },
    /// The torque of a joint is filtered, Hz.
    SensorLowpass { cutoff: f64 },
    /// A force on the tool, N in the base frame, from `start` to `end`, s.
    ExternalForce { force: [f64; 3], start: f64, end: f64 },

    /// Outside the catalogue: a magnet holds the joint at one position; torque −a (x/w) exp(½ − ½(x/w)²).
    MagneticDetent { amplitude: f64, position: f64, width: f64 },
    /// Outside the catalogue: a pendulum hangs at the last link, kg, m.
    SloshingLoad { mass: f64, length: f64, damping: f64 },
    /// Outside the catalogue: a cable pulls as a spring until it slips by a jump.
    CableStickSlip { stiffness: f64, stick: f64, slip: f64 },
    /// Outside the catalogue: the base rocks about its x and y axes on springs.
    MountResonance { frequency: f64, damping: f64 },
    /// Outside the catalogue: a load at the tool drops off, kg, s.
    LoadDrop { mass: f64, at: f64 },
    /// Outside the catalogue: a torque a sin(2π f t), N·m, Hz.
    PeriodicDisturbance { amplitude: f64, frequency: f64 },
    /// Outside the catalogue: the encoder jumps at one moment, rad, s.
    EncoderSlip { jump: f64, at: f64 },
    /// Outside the catalogue: every tooth of one gear wheel but one is sound: a dip in torque once a turn of the wheel.
    BrokenTooth { amplitude: f64, turns: f64, width: f64 },
}

impl Physics {
    /// The kind's name.
    pub fn kind(&self) -> String {
        let value = serde_json::to_value(self).unwrap_or_default();
        value["kind"].as_str().unwrap_or_default().to_owned()
    }

    /// The parameters, by name.
    pub fn parameters(&self) -> serde_json::Value {
        serde_json::to_value(self).map(|mut value| value["parameters"].take()).unwrap_or_default()
    }

    /// The same effect, scaled so that its trace is about `factor` times as large.
    #[must_use]
    pub fn scaled(&self, factor: f64) -> Physics {
        let mut scaled = self.clone();
        match &mut scaled {
            Physics::JointClearance { clearance: x, .. }
            | Physics::LubricatedClearance { clearance: x, .. }
            | Physics::Backlash { gap: x, .. }
            | Physics::CoulombFriction { coulomb: x }
            | Physics::ViscousFriction { viscous: x }
            | Physics::StribeckFriction { extra: x, .. }
            | Physics::TorqueOffset { offset: x }
            | Physics::LoadDependentFriction { coefficient: x }
            | Physics::PositionDependentFriction { amplitude: x, .. }
            | Physics::FrictionDrift { amount: x, .. }
            | Physics::QuadraticDrag { coefficient: x }
            | Physics::RotorInertia { inertia: x }
            | Physics::Payload { mass: x, .. }
            | Physics::JointSpring { stiffness: x, .. }
            | Physics::TorqueRipple { amplitude: x, .. }
            | Physics::EncoderOffset { offset: x }
            | Physics::EncoderEccentricity { amplitude: x, .. }
            | Physics::LinkLength { offset: x }
            | Physics::TimeDelay { delay: x, .. }
            | Physics::MagneticDetent { amplitude: x, .. }
            | Physics::SloshingLoad { mass: x, .. }
            | Physics::LoadDrop { mass: x, .. }
            | Physics::PeriodicDisturbance { amplitude: x, .. }
            | Physics::EncoderSlip { jump: x, .. }
            | Physics::BrokenTooth { amplitude: x, .. } => *x *= factor,
            Physics::JointElasticity { stiffness: x, .. }
            | Physics::PreslidingFriction { stiffness: x, .. }
            | Physics::LinkFlexure { stiffness: x }
            | Physics::ActuatorSaturation { limit: x }
            | Physics::SensorLowpass { cutoff: x } => *x /= factor,
            Physics::LinkMass { scale: x } | Physics::TorqueGain { gain: x } => {
                *x = 1.0 + (*x - 1.0) * factor
            }
            Physics::AsymmetricFriction { positive: x, negative: y }
            | Physics::BaseTilt { roll: x, pitch: y }
            | Physics::CableStickSlip { stick: x, slip: y, .. } => {
                *x *= factor;
                *y *= factor;
            }
            Physics::JointCoupling { inertia, viscous, coulomb, .. } => {
                [inertia, viscous, coulomb].into_iter().for_each(|x| *x *= factor);
            }
            Physics::ExternalForce { force, .. } => force.iter_mut().for_each(|x| *x *= factor),
            // A softer mount rocks more: the amplitude grows with the inverse square of the frequency.
            Physics::MountResonance { frequency, .. } => *frequency /= factor.sqrt(),
        }
        if let Physics::CableStickSlip { stiffness, .. } = &mut scaled {
            *stiffness *= factor;
        }
        scaled
    }
}
