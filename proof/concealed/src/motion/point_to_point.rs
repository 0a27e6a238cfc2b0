//! From point to point, all joints together, with dwells.

use rand_chacha::ChaCha8Rng;

use super::MotionLimits;
use super::fourier::fade;
use crate::random::uniform;

/// Share of a trapezoid's time for acceleration, and again for deceleration.
const RAMP: f64 = 0.3;

/// One move and the dwell after it.
#[derive(Clone, Debug)]
struct Move {
    begin: f64,
    duration: f64,
    from: Vec<f64>,
    to: Vec<f64>,
}

/// Moves with a common speed profile: a trapezoid, or the smooth quintic.
#[derive(Clone, Debug)]
pub(super) struct PointToPoint {
    moves: Vec<Move>,
    trapezoid: bool,
}

impl PointToPoint {
    pub fn draw(limits_of_joints: &[MotionLimits], duration: f64, rng: &mut ChaCha8Rng) -> Self {
        let trapezoid = uniform(rng, 0.0, 1.0) < 0.5;
        // Largest speed and acceleration of the profile over a unit distance in a unit time.
        let (speed, acceleration) =
            if trapezoid { (1.0 / (1.0 - RAMP), 1.0 / (RAMP * (1.0 - RAMP))) } else { (1.875, 5.774) };
        let mut from: Vec<f64> = limits_of_joints.iter().map(|limits| limits.home).collect();
        let mut moves = Vec::new();
        let mut begin = 0.3;
        while begin < duration {
            let to: Vec<f64> = limits_of_joints
                .iter()
                .map(|limits| limits.home + limits.reach * uniform(rng, -1.0, 1.0))
                .collect();
            let least = limits_of_joints.iter().zip(from.iter().zip(&to)).fold(
                0.15_f64,
                |least, (limits, (a, b))| {
                    let way = (b - a).abs();
                    least
                        .max(way * speed / limits.speed)
                        .max((way * acceleration / limits.acceleration).sqrt())
                },
            );
            let duration = least * uniform(rng, 1.0, 2.5);
            let dwell = if uniform(rng, 0.0, 1.0) < 0.7 { uniform(rng, 0.1, 0.7) } else { 0.0 };
            moves.push(Move { begin, duration, from: from.clone(), to: to.clone() });
            begin += duration + dwell;
            from = to;
        }
        Self { moves, trapezoid }
    }

    pub fn at(&self, t: f64, mut set: impl FnMut(usize, [f64; 3])) {
        let index = self.moves.partition_point(|step| step.begin <= t).saturating_sub(1);
        let step = &self.moves[index];
        let s = (t - step.begin) / step.duration;
        let [p, v, a] = if self.trapezoid { trapezoid(s) } else { fade(s) };
        for (i, (from, to)) in step.from.iter().zip(&step.to).enumerate() {
            let way = to - from;
            set(i, [from + way * p, way * v / step.duration, way * a / step.duration.powi(2)]);
        }
    }
}

/// A unit distance in a unit time with a trapezoidal speed, and its two derivatives.
fn trapezoid(s: f64) -> [f64; 3] {
    let (top, acceleration) = (1.0 / (1.0 - RAMP), 1.0 / (RAMP * (1.0 - RAMP)));
    if s <= 0.0 {
        [0.0; 3]
    } else if s < RAMP {
        [0.5 * acceleration * s * s, acceleration * s, acceleration]
    } else if s <= 1.0 - RAMP {
        [top * (s - 0.5 * RAMP), top, 0.0]
    } else if s < 1.0 {
        let left = 1.0 - s;
        [1.0 - 0.5 * acceleration * left * left, acceleration * left, -acceleration]
    } else {
        [1.0, 0.0, 0.0]
    }
}
