//! Nominal friction of a joint's drive.
//!
//! Law: τ = −F_v v − F_c s, with the viscous coefficient F_v \[N·m·s/rad\], the Coulomb level F_c \[N·m\] and the sign s of the velocity.
//! In a simulation s is a state variable between −1 and 1, with which a joint sticks: see [`crate::DriveState::sign`]. A recorded velocity
//! is never exactly zero because of noise; for it s is smoothed over a small speed v_ε: s(v) = tanh(v/v_ε).
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
}

impl DriveFriction {
    /// v_ε, rad/s (m/s): the speed for smoothing the sign of a recorded velocity.
    pub const SMOOTHING_SPEED: f64 = 1e-4;

    /// The sign of the recorded velocity `v`, −1 to 1.
    #[inline]
    pub fn sign(v: f64) -> f64 {
        (v / Self::SMOOTHING_SPEED).tanh()
    }

    /// The friction of a joint in an arm file.
    pub fn nominal(friction: JointFriction) -> Self {
        Self { viscous: friction.viscous, coulomb: friction.coulomb }
    }

    /// Torque that the drive spends against friction at the recorded velocity `v`, rad/s: N·m.
    #[inline]
    pub fn resisting(&self, v: f64) -> f64 {
        let sign = if self.coulomb == 0.0 { 0.0 } else { Self::sign(v) };
        self.resisting_towards(sign, v)
    }

    /// Torque that the drive spends against friction at the velocity `v`, rad/s, whose sign is `sign`, −1 to 1: N·m.
    #[inline]
    pub fn resisting_towards(&self, sign: f64, v: f64) -> f64 {
        self.viscous * v + self.coulomb * sign
    }
}
