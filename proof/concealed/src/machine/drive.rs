//! Friction of a drive at its own speed: dry friction as a set, the rest as a torque.
//!
//! Dry friction is set-valued (Moreau 1988). In sliding it is F₊ against v > 0 and F₋ against v < 0; in sticking it is the value between −F₊ and F₋ that keeps
//! v at zero. The law does not smooth the sign, unlike those of the catalogue.

use std::f64::consts::E;

/// A term a sin(N q + φ).
#[derive(Clone, Copy, Debug)]
pub(crate) struct Wave {
    pub amplitude: f64,
    pub periods: f64,
    pub phase: f64,
}

impl Wave {
    fn at(&self, q: f64) -> f64 {
        self.amplitude * (self.periods * q + self.phase).sin()
    }
}

/// A smooth notch of torque around one position, repeated every `pitch` if that is finite.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Notch {
    pub amplitude: f64,
    pub position: f64,
    pub width: f64,
    pub pitch: f64,
}

impl Notch {
    fn distance(&self, q: f64) -> f64 {
        let x = q - self.position;
        if self.pitch.is_finite() { x - self.pitch * (x / self.pitch).round() } else { x }
    }

    /// Torque on the joint towards the position, with its largest amount `amplitude` at one width from it.
    fn pull(&self, q: f64) -> f64 {
        let x = self.distance(q) / self.width;
        -self.amplitude * x * (0.5 * (1.0 - x * x)).exp()
    }

    /// Torque on the joint against motion while the bad tooth passes.
    fn drag(&self, q: f64, v: f64) -> f64 {
        let x = self.distance(q) / self.width;
        -self.amplitude * (-x * x).exp() * v.signum()
    }
}

/// The true friction and ripple of one joint's drive.
#[derive(Clone, Debug, Default)]
pub(crate) struct Drive {
    /// N·m·s/rad.
    pub viscous: f64,
    /// Of constant size for v > 0 and v < 0, N·m.
    pub dry: [f64; 2],
    /// F and v_s of F exp(−(v/v_s)²).
    pub stribeck: Option<(f64, f64)>,
    /// μ of μ|τ_L|.
    pub load: f64,
    /// Friction that depends on position.
    pub uneven: Option<Wave>,
    /// α and T of 1 + α exp(−t/T).
    pub drift: Option<(f64, f64)>,
    /// c of c v|v|.
    pub drag: f64,
    /// Torque that depends on position.
    pub ripple: Option<Wave>,
    /// A magnet.
    pub detent: Option<Notch>,
    /// A bad tooth.
    pub tooth: Option<Notch>,
    /// Amplitude and frequency (Hz) of an external torque.
    pub disturbance: Option<(f64, f64)>,
    /// Largest torque that the drive can measure, N·m.
    pub limit: f64,
    /// True over measured torque.
    pub gain: f64,
    /// Offset of the measurement: reading minus true torque, N·m.
    pub offset: f64,
}

impl Drive {
    fn drift_at(&self, t: f64) -> f64 {
        self.drift.map_or(1.0, |(amount, time)| 1.0 + amount * (-t.max(0.0) / time).exp())
    }

    /// F₊ and F₋, N·m, never negative, at position `q`, speed `v`, transmitted torque `load` and time `t`.
    pub fn dry_friction(&self, q: f64, v: f64, load: f64, t: f64) -> [f64; 2] {
        let mut both = self.load * load.abs();
        if let Some((extra, speed)) = self.stribeck {
            both += extra * (-(v / speed) * (v / speed)).exp();
        }
        if let Some(wave) = &self.uneven {
            both += wave.at(q);
        }
        let drift = self.drift_at(t);
        self.dry.map(|dry| ((dry + both) * drift).max(0.0))
    }

    /// Torque on the drive other than dry friction, N·m.
    pub fn torque(&self, q: f64, v: f64, t: f64) -> f64 {
        let mut torque = -self.viscous * self.drift_at(t) * v - self.drag * v * v.abs();
        if let Some(wave) = &self.ripple {
            torque -= wave.at(q);
        }
        if let Some(notch) = &self.detent {
            torque += notch.pull(q);
        }
        if let Some(notch) = &self.tooth {
            torque += notch.drag(q, v);
        }
        if let Some((amplitude, frequency)) = self.disturbance {
            torque += amplitude * (std::f64::consts::TAU * frequency * t).sin();
        }
        torque
    }

    /// The measured torque, N·m, for the torque by the motor's current. A measurement at its limit stays there while the motor gives more, as in the catalogue:
    /// where the model asks for more, a recording shows the limit.
    pub fn measured(&self, by_current: f64) -> f64 {
        (by_current / self.gain + self.offset).clamp(-self.limit, self.limit)
    }
}

/// The largest slope of the pull of a [`Notch`] over amplitude and width: √e.
pub(crate) fn steepest_pull() -> f64 {
    E.sqrt()
}
