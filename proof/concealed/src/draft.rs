//! An initial guess of an effect, and the possible sizes of a machine's effects.

use std::f64::consts::TAU;

use freeplay_arm::Arm;
use rand_chacha::ChaCha8Rng;

use crate::arms::Load;
use crate::calibrate::Floor;
use crate::kinds::Seat;
use crate::physics::Physics;
use crate::random::{log_uniform, pick, sign, uniform};

/// Inputs of a guess.
pub(crate) struct Context<'a> {
    pub arm: &'a Arm,
    pub load: &'a Load,
    pub floor: &'a Floor,
    pub duration: f64,
    /// Wanted size of the effect, in multiples of the floor.
    pub target: f64,
}

impl Context<'_> {
    /// An effect of `kind` at `seat`, of about the wanted size; `None` for an unknown kind or a seat that does not admit it.
    pub fn guess(&self, kind: &str, seat: Seat, rng: &mut ChaCha8Rng) -> Option<Physics> {
        match seat {
            Some(joint) => self
                .friction(kind, joint, rng)
                .or_else(|| self.drive(kind, joint, rng))
                .or_else(|| self.structure(kind, joint, rng))
                .or_else(|| self.odd(kind, joint, rng)),
            None => self.whole(kind, rng),
        }
    }

    /// Wanted size of the effect as a torque at `joint`, N·m.
    fn target_torque(&self, joint: usize) -> f64 {
        self.target * self.floor.torque[joint]
    }

    /// Wanted size of the effect as an angle at `joint` (m for a slide).
    fn target_angle(&self, joint: usize) -> f64 {
        self.target * self.floor.tool / self.floor.lever[joint]
    }

    /// The damper parallel to a spring of `stiffness` at `joint` for the damping ratio `ratio` of motor against link.
    fn damping(&self, joint: usize, stiffness: f64, ratio: f64) -> f64 {
        // Motor and link have 0.4 and 0.6 of the inertia or more.
        2.0 * ratio * (stiffness * 0.24 * self.floor.effective_inertia[joint]).sqrt()
    }

    fn speed(&self, joint: usize) -> f64 {
        self.floor.speed[joint].max(1e-3 * self.arm.joints()[joint].limits.velocity)
    }

    fn friction(&self, kind: &str, joint: usize, rng: &mut ChaCha8Rng) -> Option<Physics> {
        let (torque, speed) = (self.target_torque(joint), self.speed(joint));
        let dry = self.arm.joints()[joint].friction.coulomb;
        Some(match kind {
            "coulomb_friction" => {
                // In some cases less friction than on the data sheet, if the joint has enough.
                let less = torque < 0.6 * dry && uniform(rng, 0.0, 1.0) < 0.25;
                Physics::CoulombFriction { coulomb: if less { -torque } else { torque } }
            }
            "viscous_friction" => Physics::ViscousFriction { viscous: torque / speed },
            "stribeck_friction" => {
                let velocity = speed * log_uniform(rng, 0.08, 0.4);
                Physics::StribeckFriction { extra: 2.5 * torque, velocity }
            }
            "asymmetric_friction" => {
                let share = uniform(rng, 0.1, 0.5);
                let (large, small) = (1.3 * torque, 1.3 * torque * share);
                if uniform(rng, 0.0, 1.0) < 0.5 {
                    Physics::AsymmetricFriction { positive: large, negative: small }
                } else {
                    Physics::AsymmetricFriction { positive: small, negative: large }
                }
            }
            "load_dependent_friction" => {
                Physics::LoadDependentFriction { coefficient: torque / self.floor.load[joint].max(1e-6) }
            }
            "presliding_friction" => {
                // Bristles that bend by a share of the joint's range of motion.
                let bend = uniform(rng, 0.02, 0.06) * self.floor.way[joint];
                let stiffness = dry / bend;
                Physics::PreslidingFriction { stiffness, damping: 0.02 * dry / speed }
            }
            "position_dependent_friction" => {
                // The joint's range of motion has to contain at least one whole wave.
                let least = 2.0 / self.floor.way[joint].max(0.1);
                let periods = pick(rng, &[1.0_f64, 2.0, 3.0, 4.0, 6.0, 8.0]).max(least.ceil());
                let phase = uniform(rng, 0.0, TAU);
                Physics::PositionDependentFriction { amplitude: 1.4 * torque, periods, phase }
            }
            "friction_drift" => {
                let time_constant = self.duration * uniform(rng, 0.2, 0.6);
                let friction = self.floor.friction[joint].max(1e-6);
                Physics::FrictionDrift { amount: 2.0 * torque / friction, time_constant }
            }
            "quadratic_drag" => Physics::QuadraticDrag { coefficient: torque / (speed * speed) },
            _ => return None,
        })
    }

    fn drive(&self, kind: &str, joint: usize, rng: &mut ChaCha8Rng) -> Option<Physics> {
        let torque = self.target_torque(joint);
        let load = self.floor.load[joint].max(1e-6);
        Some(match kind {
            "torque_offset" => Physics::TorqueOffset { offset: sign(rng) * torque },
            "rotor_inertia" => {
                Physics::RotorInertia { inertia: torque / self.floor.acceleration[joint].max(1e-6) }
            }
            "torque_gain" => Physics::TorqueGain { gain: 1.0 + sign(rng) * (torque / load).min(0.4) },
            "actuator_saturation" => {
                Physics::ActuatorSaturation { limit: self.floor.peak[joint] / (1.0 + torque / load) }
            }
            "torque_ripple" => Physics::TorqueRipple {
                amplitude: 1.4 * torque,
                periods: pick(rng, &[6.0, 8.0, 12.0, 16.0, 24.0, 36.0]),
                phase: uniform(rng, 0.0, TAU),
            },
            "joint_coupling" => {
                let n = self.arm.dof();
                // A gear couples neighbouring axes.
                let other = if joint == 0 || (joint + 1 < n && uniform(rng, 0.0, 1.0) < 0.5) {
                    joint + 1
                } else {
                    joint - 1
                };
                Physics::JointCoupling {
                    with: self.arm.joints()[other].name.clone(),
                    inertia: 0.4 * torque / self.floor.acceleration[joint].max(1e-6),
                    viscous: 0.4 * torque / self.speed(joint),
                    coulomb: 0.6 * torque,
                    sign: sign(rng),
                }
            }
            "joint_spring" => {
                let way = self.floor.way[joint].max(1e-3);
                Physics::JointSpring {
                    stiffness: torque / way,
                    rest: self.floor.middle[joint] + way * uniform(rng, -1.0, 1.0),
                }
            }
            "sensor_lowpass" => Physics::SensorLowpass { cutoff: 15.0 },
            _ => return None,
        })
    }

    fn structure(&self, kind: &str, joint: usize, rng: &mut ChaCha8Rng) -> Option<Physics> {
        let angle = self.target_angle(joint);
        let load = self.floor.load[joint].max(1e-3);
        let wanted = self.target * self.floor.tool;
        Some(match kind {
            "backlash" => {
                Physics::Backlash { gap: 2.0 * angle, stiffness: load / angle * log_uniform(rng, 5.0, 20.0) }
            }
            "joint_elasticity" => {
                let stiffness = load / angle;
                // The damping ratio, approximately.
                let ratio = uniform(rng, 0.05, 0.15);
                Physics::JointElasticity { stiffness, damping: self.damping(joint, stiffness, ratio) }
            }
            "joint_clearance" => Physics::JointClearance {
                clearance: wanted,
                stiffness: log_uniform(rng, 5e8, 5e9),
                restitution: uniform(rng, 0.6, 0.9),
                friction: uniform(rng, 0.01, 0.1),
            },
            "lubricated_clearance" => {
                Physics::LubricatedClearance { clearance: wanted, viscosity: log_uniform(rng, 0.2, 4.0) }
            }
            "link_mass" => Physics::LinkMass { scale: 1.0 + sign(rng) * uniform(rng, 0.1, 0.3) },
            "encoder_offset" => Physics::EncoderOffset { offset: sign(rng) * angle },
            "encoder_eccentricity" => {
                Physics::EncoderEccentricity { amplitude: 1.4 * angle, phase: uniform(rng, 0.0, TAU) }
            }
            "link_length" => Physics::LinkLength { offset: sign(rng) * wanted },
            "link_flexure" => Physics::LinkFlexure { stiffness: 60.0 / wanted },
            _ => return None,
        })
    }

    fn odd(&self, kind: &str, joint: usize, rng: &mut ChaCha8Rng) -> Option<Physics> {
        let torque = self.target_torque(joint);
        let way = self.floor.way[joint].max(1e-3);
        Some(match kind {
            "magnetic_detent" => Physics::MagneticDetent {
                amplitude: 2.5 * torque,
                position: self.floor.middle[joint] + way * uniform(rng, -0.6, 0.6),
                width: way * uniform(rng, 0.08, 0.2),
            },
            "cable_stick_slip" => {
                let stick = 1.3 * torque;
                Physics::CableStickSlip {
                    stiffness: stick / (way * uniform(rng, 0.3, 0.8)),
                    stick,
                    slip: -0.3 * stick,
                }
            }
            "periodic_disturbance" => Physics::PeriodicDisturbance {
                amplitude: 1.4 * torque,
                frequency: log_uniform(rng, 1.5, 8.0),
            },
            "encoder_slip" => Physics::EncoderSlip {
                jump: sign(rng) * 1.4 * self.target_angle(joint),
                at: self.duration * uniform(rng, 0.3, 0.6),
            },
            "broken_tooth" => Physics::BrokenTooth {
                amplitude: 3.0 * torque,
                turns: pick(rng, &[5.0, 8.0, 12.0]),
                width: uniform(rng, 0.06, 0.12),
            },
            _ => return None,
        })
    }

    fn whole(&self, kind: &str, rng: &mut ChaCha8Rng) -> Option<Physics> {
        let place = self.load.place;
        Some(match kind {
            "payload" => {
                let mut off = |size: f64| size * uniform(rng, -1.0, 1.0);
                let com = [place.x + off(0.04), place.y + off(0.04), place.z + off(0.04)];
                Physics::Payload { mass: 0.3 * self.load.mass, com }
            }
            "base_tilt" => {
                let direction = uniform(rng, 0.0, TAU);
                Physics::BaseTilt { roll: 0.03 * direction.cos(), pitch: 0.03 * direction.sin() }
            }
            "time_delay" => Physics::TimeDelay { delay: 4e-3, channel: pick(rng, &["torque", "tool"]) },
            "external_force" => {
                let start = self.duration * uniform(rng, 0.1, 0.5);
                let end = start + self.duration * uniform(rng, 0.12, 0.3);
                let [a, b] = [uniform(rng, 0.0, TAU), uniform(rng, -0.8, 0.8)];
                let force = [20.0 * a.cos() * b.cos(), 20.0 * a.sin() * b.cos(), 20.0 * b.sin()];
                Physics::ExternalForce { force, start, end }
            }
            "load_drop" => {
                Physics::LoadDrop { mass: 0.5 * self.load.mass, at: self.duration * uniform(rng, 0.3, 0.6) }
            }
            "sloshing_load" => Physics::SloshingLoad {
                mass: 0.5 * self.load.mass,
                length: uniform(rng, 0.1, 0.25),
                damping: 0.05,
            },
            "mount_resonance" => Physics::MountResonance {
                frequency: uniform(rng, 6.0, 12.0),
                damping: uniform(rng, 0.02, 0.06),
            },
            _ => return None,
        })
    }

    /// The effect with its size limited to the possible range.
    pub fn bounded(&self, physics: Physics, seat: Seat) -> Physics {
        let mut bounded = physics;
        let dry = seat.map_or(0.0, |joint| self.arm.joints()[joint].friction.coulomb);
        match &mut bounded {
            Physics::CoulombFriction { coulomb: x } => *x = x.max(-0.9 * dry),
            // Friction at standstill is one to three times that at speed (Armstrong-Hélouvry et al. 1994); a machine with more moves in leaps.
            Physics::StribeckFriction { extra: x, .. } => *x = x.min(2.0 * dry),
            // Friction cannot be negative.
            Physics::PositionDependentFriction { amplitude: x, .. } => *x = x.min(0.95 * dry),
            Physics::JointClearance { clearance: x, .. }
            | Physics::LubricatedClearance { clearance: x, .. } => {
                *x = x.clamp(2e-5, 3e-3);
            }
            Physics::Backlash { gap: x, .. } => *x = x.min(0.05),
            Physics::JointElasticity { stiffness, damping } => {
                // The servo has to remain stable: a resonance of 5 Hz or more.
                let least =
                    seat.map_or(0.0, |joint| self.floor.effective_inertia[joint] * (TAU * 5.0).powi(2));
                *stiffness = stiffness.max(least);
                *damping = damping.max(seat.map_or(0.0, |joint| self.damping(joint, *stiffness, 0.05)));
            }
            // The cross-coupling of a shared shaft stays below the own inertia of each joint.
            Physics::JointCoupling { with, inertia, .. } => {
                let other = self
                    .arm
                    .joint_index(with)
                    .map_or(f64::INFINITY, |other| self.floor.effective_inertia[other]);
                *inertia = inertia.min(0.4 * other);
            }
            Physics::LoadDependentFriction { coefficient: x } => *x = x.min(0.4),
            Physics::FrictionDrift { amount: x, .. } => *x = x.min(4.0),
            Physics::LinkMass { scale: x } => *x = x.clamp(0.4, 2.5),
            Physics::TorqueGain { gain: x } => *x = x.clamp(0.55, 1.8),
            // An encoder with a larger offset is broken.
            Physics::EncoderOffset { offset: x } => *x = x.clamp(-0.25, 0.25),
            Physics::EncoderEccentricity { amplitude: x, .. } => *x = x.min(0.08),
            Physics::TimeDelay { delay: x, .. } => *x = x.min(0.019),
            Physics::SensorLowpass { cutoff: x } => *x = x.clamp(1.0, 80.0),
            Physics::LoadDrop { mass: x, .. } | Physics::SloshingLoad { mass: x, .. } => {
                *x = x.min(self.load.mass)
            }
            Physics::MountResonance { frequency: x, .. } => *x = x.clamp(3.0, 40.0),
            Physics::LinkFlexure { stiffness: x } => *x = x.max(2e3),
            Physics::BaseTilt { roll, pitch } => {
                let size = roll.hypot(*pitch);
                let scale = (0.4 / size).min(1.0);
                *roll *= scale;
                *pitch *= scale;
            }
            // Some of the motion has to be below the limit.
            Physics::ActuatorSaturation { limit: x } => {
                *x = x.max(seat.map_or(0.0, |joint| 0.45 * self.floor.peak[joint]));
            }
            _ => {}
        }
        bounded
    }
}
