//! Sums of sines for one joint.

use std::f64::consts::TAU;

use rand_chacha::ChaCha8Rng;

use super::MotionLimits;
use crate::random::uniform;

/// Duration of the fade-in of the sines, s.
const FADE_IN: f64 = 1.5;

/// q = c + w(t) Σ A_k sin(ω_k t + φ_k), with a smooth step w as fade-in (Swevers et al. 1997 without the common period: a recording is not one lap).
#[derive(Clone, Debug)]
pub(super) struct Fourier {
    centre: f64,
    /// Amplitude, angular frequency, phase.
    terms: Vec<[f64; 3]>,
}

impl Fourier {
    pub fn draw(limits: &MotionLimits, rng: &mut ChaCha8Rng) -> Self {
        let base = uniform(rng, 0.05, 0.15);
        let terms: Vec<[f64; 3]> = (1..=5)
            .map(|k| {
                let omega = TAU * base * (f64::from(k) + uniform(rng, -0.3, 0.3));
                [uniform(rng, 0.3, 1.0) / f64::from(k), omega, uniform(rng, 0.0, TAU)]
            })
            .collect();
        let sum = |weight: fn(f64) -> f64| terms.iter().map(|[a, w, _]| a * weight(*w)).sum::<f64>();
        // The fade-in adds to speed and acceleration: 15/8/T and 5.8/T² of the sum of amplitudes.
        let amplitude = sum(|_| 1.0);
        let speed = sum(|w| w) + 1.9 / FADE_IN * amplitude;
        let acceleration = sum(|w| w * w) + 3.8 / FADE_IN * sum(|w| w) + 5.8 / FADE_IN.powi(2) * amplitude;
        let scale =
            (limits.reach / amplitude).min(limits.speed / speed).min(limits.acceleration / acceleration);
        let terms = terms.into_iter().map(|[a, w, p]| [a * scale, w, p]).collect();
        Self { centre: limits.home, terms }
    }

    pub fn at(&self, t: f64) -> [f64; 3] {
        let mut sum = [0.0; 3];
        for [a, w, p] in &self.terms {
            let (sin, cos) = (w * t + p).sin_cos();
            sum[0] += a * sin;
            sum[1] += a * w * cos;
            sum[2] -= a * w * w * sin;
        }
        let [g, g1, g2] = fade(t / FADE_IN);
        let (g1, g2) = (g1 / FADE_IN, g2 / (FADE_IN * FADE_IN));
        [self.centre + g * sum[0], g1 * sum[0] + g * sum[1], g2 * sum[0] + 2.0 * g1 * sum[1] + g * sum[2]]
    }
}

/// The quintic smooth step 10 s³ − 15 s⁴ + 6 s⁵ and its two derivatives.
pub(super) fn fade(s: f64) -> [f64; 3] {
    if s >= 1.0 {
        return [1.0, 0.0, 0.0];
    }
    let s = s.max(0.0);
    let position = s * s * s * (10.0 + s * (6.0 * s - 15.0));
    let speed = 30.0 * s * s * (1.0 - s) * (1.0 - s);
    [position, speed, 60.0 * s * (1.0 - s) * (1.0 - 2.0 * s)]
}
