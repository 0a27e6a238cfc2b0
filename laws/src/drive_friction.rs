//! Nominal friction of a joint's drive.
//!
//! Law: τ = −F_v v − F_c s(v), with the viscous coefficient F_v \[N·m·s/rad\], the Coulomb level F_c \[N·m\] and the
//! sign s smoothed over a small speed v_ε so that an integrator can follow it: s(v) = tanh(v/v_ε). A joint of the plant that sticks creeps,
//! slower than that, and an encoder may see it: what a model says of a recording has the same sign.
//!
//! Source: Coulomb 1785 and the `<dynamics damping friction>` of URDF. For prismatic joints read N and m.

use freeplay_arm::JointFriction;

/// The friction of one drive.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DriveFriction {
    /// F_v, N·m·s/rad.
    pub viscous: f64,
    /// F_c, N·m.
    pub coulomb: f64,
    /// v_ε, rad/s, > 0: below it the sign is smoothed.
    pub smoothing: f64,
}

impl DriveFriction {
    /// Speed over which the sign is smoothed, rad/s (or m/s).
    pub const SMOOTHING: f64 = 1e-4;

    /// The sign of the velocity `v`, −1 to 1.
    #[inline]
    pub fn sign(v: f64) -> f64 {
        (v / Self::SMOOTHING).tanh()
    }

    /// The friction that an arm file names for a joint.
    pub fn nominal(friction: JointFriction) -> Self {
        Self { viscous: friction.viscous, coulomb: friction.coulomb, smoothing: Self::SMOOTHING }
    }

    /// Torque on the joint, N·m: opposite to the velocity `v`, rad/s.
    #[inline]
    pub fn torque(&self, v: f64) -> f64 {
        -self.resisting(v)
    }

    /// Torque that the drive spends against friction, N·m.
    #[inline]
    pub fn resisting(&self, v: f64) -> f64 {
        let coulomb = if self.coulomb == 0.0 { 0.0 } else { self.coulomb * (v / self.smoothing).tanh() };
        self.viscous * v + coulomb
    }
}
