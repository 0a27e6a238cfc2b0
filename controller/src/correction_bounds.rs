//! Bounds of a joint's correction: the limits of the joint minus the desired motion of one instant.
//!
//! With q_d, v_d, a_d the desired motion, Δq the correction there and Δq₋₁, Δq₋₂ those of the two ticks before:
//!
//! - position: `q_min ≤ q_d + Δq ≤ q_max`,
//! - speed: `|Δq − Δq₋₁| ≤ (v_max − |v_d|) T`,
//! - acceleration: `|a_d + (Δq − 2Δq₋₁ + Δq₋₂)/T²| ≤ a_max`.
//!
//! A desired motion that uses a whole limit would forbid the correction even to come to rest. The bounds therefore leave at least
//! [`LEAST_SHARE`] of each limit to the correction.

use freeplay_arm::Limits;

/// Largest correction of a joint, rad or m; larger values are not corrections.
pub const LARGEST_CORRECTION: f64 = 0.1;
/// Share of the speed and acceleration limits that the correction may always use.
pub const LEAST_SHARE: f64 = 0.01;

/// Bounds of one joint at one instant, rad (m).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CorrectionBounds {
    /// Least and largest correction.
    pub place: [f64; 2],
    /// Largest change of the correction in a tick.
    pub change: f64,
    /// Least and largest second difference of the correction from tick to tick.
    pub second_difference: [f64; 2],
    /// Second difference with which the correction can always brake.
    pub braking: f64,
}

impl CorrectionBounds {
    /// Bounds of zero, before any limits are known.
    pub const NONE: CorrectionBounds =
        CorrectionBounds { place: [0.0; 2], change: 0.0, second_difference: [0.0; 2], braking: 0.0 };

    /// Bounds by `limits` at the desired position, velocity and acceleration `[q, v, a]`, in ticks of `period` seconds. NaN inputs give
    /// NaN bounds.
    pub fn of(limits: &Limits, [q, v, a]: [f64; 3], period: f64) -> CorrectionBounds {
        let least = LEAST_SHARE * limits.acceleration;
        // `f64::max` would drop a NaN.
        let at_least = |least: f64, value: f64| if value < least { least } else { value };
        let square = period * period;
        let clamped = |limit: f64| (limit - q).clamp(-LARGEST_CORRECTION, LARGEST_CORRECTION);
        CorrectionBounds {
            place: [clamped(limits.lower), clamped(limits.upper)],
            change: at_least(LEAST_SHARE * limits.velocity, limits.velocity - v.abs()) * period,
            second_difference: [
                -at_least(least, limits.acceleration + a) * square,
                at_least(least, limits.acceleration - a) * square,
            ],
            braking: least * square,
        }
    }

    /// The interval of all limits for the correction of the first instant; `last` and `before` are the corrections of the two ticks
    /// before. Towards a position limit the correction is no faster than it can brake with [`LEAST_SHARE`] of the acceleration.
    pub fn interval(&self, last: f64, before: f64) -> (f64, f64) {
        let [lower, upper] = self.place;
        let coasting = 2.0 * last - before;
        let numbers = [lower, upper, self.change, self.second_difference[0], self.second_difference[1]];
        if numbers.into_iter().any(f64::is_nan) {
            return (f64::NAN, f64::NAN);
        }
        let down = self.change.min(longest_step(last - lower, self.braking));
        let up = self.change.min(longest_step(upper - last, self.braking));
        (
            (last - down).max(coasting + self.second_difference[0]),
            (last + up).min(coasting + self.second_difference[1]),
        )
    }
}

/// The longest step of one tick towards a limit at `distance` from which steps that shrink by `braking` a tick still end before the
/// limit: the s with `s²/(2 braking) + s/2 = distance`. Beyond the limit, the function returns the step back to it.
fn longest_step(distance: f64, braking: f64) -> f64 {
    if distance <= 0.0 || braking.is_infinite() {
        distance
    } else {
        (0.25 * braking * braking + 2.0 * distance * braking).sqrt() - 0.5 * braking
    }
}
