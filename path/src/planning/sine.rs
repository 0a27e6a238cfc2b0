//! A motion for any arm: every joint performs a sine about the middle of its range with its own frequency.
//!
//! Joint i (from 1): `q = m + A w(t) sin(2π i t / T)`. The window `w` rises by the quintic time law in the first
//! eighth of the lap T and falls in the last, so that each lap goes from rest to rest and laps join smoothly.

use std::f64::consts::TAU;

use freeplay_arm::{Joint, JointKind, Limits};

use crate::planning::shape::quintic;

/// Share of a lap in which the window rises; it falls over the same share.
const RAMP: f64 = 0.125;
/// Amplitude of the slowest joint without a closer limit, rad.
const SWING: f64 = 0.3;
/// The same for a prismatic joint, m.
const STROKE: f64 = 0.05;
/// Greatest share of a joint's range, velocity and acceleration limits for the default amplitude.
const SHARE: f64 = 0.5;

/// The sine motion of one joint.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Swing {
    middle: f64,
    amplitude: f64,
    /// Periods per lap.
    cycles: f64,
    period: f64,
}

impl Swing {
    /// The sine motion of the joint with this index (from 0); its limits give the default of `middle` and `amplitude`.
    pub fn of(
        joint: &Joint,
        index: usize,
        period: f64,
        middle: Option<f64>,
        amplitude: Option<f64>,
    ) -> Swing {
        let cycles = (index + 1) as f64;
        Swing {
            middle: middle.unwrap_or_else(|| middle_of(&joint.limits)),
            amplitude: amplitude.unwrap_or_else(|| modest_amplitude(joint, cycles, period)),
            cycles,
            period,
        }
    }

    /// Position, velocity and acceleration at time `t` of a lap.
    pub fn at(&self, t: f64) -> [f64; 3] {
        let [w, w1, w2] = window(t / self.period).map(|x| x * self.amplitude);
        let (rate, omega) = (1.0 / self.period, TAU * self.cycles / self.period);
        let (sin, cos) = (omega * t).sin_cos();
        [
            self.middle + w * sin,
            w1 * rate * sin + w * omega * cos,
            w2 * rate * rate * sin + 2.0 * w1 * rate * omega * cos - w * omega * omega * sin,
        ]
    }
}

/// Ends of the smooth pieces of a lap.
pub(crate) fn breaks(period: f64) -> Vec<f64> {
    [0.0, RAMP, 1.0 - RAMP, 1.0].map(|s| s * period).to_vec()
}

/// The middle of a joint's range; 0, or the limit nearest to it, if the range is not bounded on both sides.
pub(crate) fn middle_of(limits: &Limits) -> f64 {
    let middle = limits.lower / 2.0 + limits.upper / 2.0;
    if middle.is_finite() { middle } else { 0.0_f64.min(limits.upper).max(limits.lower) }
}

/// The window and its first two derivatives, as functions of the share `s` of the lap.
fn window(s: f64) -> [f64; 3] {
    let (u, sign) = if s < 0.5 { (s / RAMP, 1.0) } else { ((1.0 - s) / RAMP, -1.0) };
    if u >= 1.0 {
        return [1.0, 0.0, 0.0];
    }
    let [law, rate, rate2] = quintic(u.max(0.0));
    [law, sign * rate / RAMP, rate2 / (RAMP * RAMP)]
}

/// An amplitude that falls with the frequency and uses at most [`SHARE`] of the limits.
fn modest_amplitude(joint: &Joint, cycles: f64, period: f64) -> f64 {
    // Extremes of the quintic law: its rate is at most 15/8, its second derivative at most 10/√3.
    let (ramp_rate, ramp_rate2) = (1.875 / (RAMP * period), 5.7736 / (RAMP * period).powi(2));
    let omega = TAU * cycles / period;
    let usual = match joint.kind {
        JointKind::Revolute => SWING,
        JointKind::Prismatic => STROKE,
    } / cycles;
    let limits = &joint.limits;
    let by_range = (limits.upper - limits.lower) / 2.0;
    let by_velocity = limits.velocity / (omega + ramp_rate);
    let by_acceleration = limits.acceleration / (omega * omega + 2.0 * omega * ramp_rate + ramp_rate2);
    usual.min(SHARE * by_range.min(by_velocity).min(by_acceleration))
}
