//! Slow sweeps back and forth at constant speed, for one joint.

use rand_chacha::ChaCha8Rng;

use super::MotionLimits;
use crate::random::{log_uniform, sign, uniform};

/// Back and forth: speed ±v, with a reversal at constant acceleration in the time `turn`; period 2 (`straight` + `turn`). Every second pair of sweeps has
/// another speed, so that the recording contains friction at more than one speed.
#[derive(Clone, Debug)]
pub(super) struct Sweep {
    centre: f64,
    direction: f64,
    speeds: [f64; 2],
    straight: [f64; 2],
    turn: f64,
}

impl Sweep {
    pub fn draw(limits: &MotionLimits, rng: &mut ChaCha8Rng) -> Self {
        let way = limits.reach * uniform(rng, 0.35, 1.0);
        let mut speed = || log_uniform(rng, 0.1, 0.6) * limits.speed;
        let speeds = [speed(), speed()];
        let turn = uniform(rng, 0.12, 0.3).max(2.0 * speeds[0].max(speeds[1]) / limits.acceleration);
        // The reversal of the faster sweep takes the distance speed · turn / 4 at each end.
        let straight = speeds.map(|v| ((way - 0.25 * v * turn) / v).max(0.3));
        let direction = sign(rng);
        Self { centre: limits.home - 0.5 * direction * way, direction, speeds, straight, turn }
    }

    /// Starts at rest at one end; a lap is four half turns and four straights, two at each speed.
    pub fn at(&self, t: f64) -> [f64; 3] {
        let lap: f64 = self.straight.iter().map(|s| 2.0 * (s + self.turn)).sum();
        let mut t = t.rem_euclid(lap);
        for (speed, straight) in self.speeds.iter().zip(self.straight) {
            let there_and_back = 2.0 * (straight + self.turn);
            if t < there_and_back {
                return self.there_and_back(t, *speed, straight);
            }
            t -= there_and_back;
        }
        self.there_and_back(0.0, self.speeds[0], self.straight[0])
    }

    fn there_and_back(&self, t: f64, speed: f64, straight: f64) -> [f64; 3] {
        let half = straight + self.turn;
        let [p, v, a] = one_way(t.min(2.0 * half - t), speed, straight, self.turn);
        let v = if t > half { -v } else { v };
        [self.centre + self.direction * p, self.direction * v, self.direction * a]
    }
}

/// From rest at one end to rest at the other: half a reversal, the straight, half a reversal.
fn one_way(t: f64, speed: f64, straight: f64, turn: f64) -> [f64; 3] {
    let (half, a) = (0.5 * turn, 2.0 * speed / turn);
    if t < half {
        [0.5 * a * t * t, a * t, a]
    } else if t < half + straight {
        [0.5 * speed * half + speed * (t - half), speed, 0.0]
    } else {
        let left = straight + turn - t;
        [speed * (half + straight) - 0.5 * a * left * left, a * left, -a]
    }
}
