//! The parameters of a joint's servo that a fit estimates, each with its prior.

use crate::beginning::Sight;
use crate::model_parameter::ModelParameter;
use crate::servo_arm::ServoArm;
use crate::unknowns::Unknown;

/// Step of a finite difference, relative to the size of its parameter. Dry friction makes a rollout a chain of small slips, whose
/// derivative is rough below a few hundredths of that size; far above it the rollout is no longer linear.
pub const DIFFERENCE_STEP: f64 = 0.03;

/// The unknowns of every servo with priors from `sights` alone. `zero` is the standard deviation between the zeros of commands and encoder
/// besides rounding, rad. The priors are weak: each parameter may be as large as the whole error, or the whole lag.
pub fn unknowns(sights: &[Sight], model: &ServoArm, zero: f64) -> Vec<Unknown> {
    let longest = sights.iter().map(|sight| sight.lag).fold(1e-3, f64::max);
    let of_joint = |(joint, sight): (usize, &Sight)| {
        let error = sight.error.max(sight.tick).max(zero);
        // A joint without moving commands has no measurable lag; its servo is assumed as slow as the slowest.
        let lag = if sight.error > 2.0 * sight.tick { sight.lag.max(1e-3) } else { longest };
        let servo = &model.joints[joint];
        let is_like_others =
            sight.stiffness.is_none() && sights.iter().any(|other| other.stiffness.is_some());
        // If no load determines the stiffness, servos of one arm agree within a factor of two; else the prior covers a factor of ten either
        // way.
        let width = if is_like_others { std::f64::consts::LN_2 } else { std::f64::consts::LN_10 };
        let believed = [
            (ModelParameter::Stiffness, servo.stiffness.ln(), width, 1.0),
            (ModelParameter::Lag, 0.5 * lag, lag, lag),
            (ModelParameter::Coulomb, 0.0, error, error),
            (ModelParameter::Stiction, 0.0, error, error),
            (ModelParameter::Rotor, 0.0, lag * lag, lag * lag),
            (ModelParameter::Delay, 0.0, lag, lag),
            // Commands and encoder have the same zero, except for rounding.
            (ModelParameter::Offset, 0.0, sight.tick / 12.0_f64.sqrt() + zero, error),
        ];
        believed.map(|(parameter, expected, deviation, size)| Unknown {
            joint,
            parameter,
            expected,
            deviation,
            step: DIFFERENCE_STEP * size,
            is_torque: false,
            least: parameter.least(),
        })
    };
    sights.iter().enumerate().flat_map(of_joint).collect()
}
