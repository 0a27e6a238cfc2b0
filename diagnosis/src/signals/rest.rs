//! Joints at rest: the motion does not determine their dry friction.
//!
//! Coulomb friction of a joint at rest has any value between −F and F that balances the other torques (Filippov 1988, "Differential Equations with
//! Discontinuous Righthand Sides", §1; Acary & Brogliato 2008, §1.3). A recorded joint is at rest within the resolution of its encoder: its speed is
//! noise, and the sign of noise is no direction. The prediction for such a joint is therefore the value nearest to the measured torque between two
//! predictions: one for a joint that starts to move forwards and one for a joint that starts to move backwards. This holds for any law of friction.

use freeplay_arm::Arm;
use freeplay_laws::{DriveFriction, Placed, Trajectory};
use freeplay_recording::Recording;

use crate::error::ResidualError;
use crate::signals::channel::Kind;
use crate::signals::motion::Treatment;
use crate::signals::residual::{Residuals, Sharpening, residuals_along};
use crate::statistics::{UNMOVED, encoder_noise};

/// A joint that moves less than this, rad (m), is at rest: it is one step of an encoder of 16 bits, 2π/2¹⁶.
pub(crate) const STILL: f64 = 1e-4;

/// Sets the prediction for joints at rest to the possible value nearest to the measured torque.
///
/// # Errors
/// See [`ResidualError`].
pub(crate) fn clamp_at_rest(
    arm: &Arm,
    effects: &[Placed],
    recording: &Recording,
    treatment: &Treatment,
    (whole, sharpening): (&Trajectory, &Sharpening),
    residuals: &mut Residuals,
) -> Result<(), ResidualError> {
    if !residuals.channels.iter().any(|channel| matches!(channel.kind, Kind::Torque(_))) {
        return Ok(());
    }
    let stands: Vec<Vec<bool>> =
        (0..arm.dof()).map(|joint| standing(recording, treatment, whole, joint)).collect();
    if !stands.iter().flatten().any(|stands| *stands) {
        return Ok(());
    }
    let creeping = |speed: f64| {
        let mut motion = whole.clone();
        for (v, stands) in motion.v.iter_mut().zip(&stands) {
            v.iter_mut().zip(stands).filter(|(_, stands)| **stands).for_each(|(v, _)| *v = speed);
        }
        residuals_along(arm, effects, recording, treatment, &motion, sharpening)
    };
    // Ten times the speed over which the direction is smoothed: friction has its sign there, and is not viscous yet.
    let creep = 10.0 * DriveFriction::SMOOTHING_SPEED;
    let (forwards, backwards) = (creeping(creep)?, creeping(-creep)?);
    let either_way = forwards.channels.iter().zip(&backwards.channels);
    for (channel, (forwards, backwards)) in residuals.channels.iter_mut().zip(either_way) {
        let Kind::Torque(joint) = channel.kind else { continue };
        let stands: Vec<f64> = stands[joint].iter().map(|stands| f64::from(u8::from(*stands))).collect();
        for (k, _) in treatment.keep(&stands).iter().enumerate().filter(|(_, stands)| **stands > 0.0) {
            let (a, b) = (forwards.model[k], backwards.model[k]);
            let nearest = channel.measured[k].clamp(a.min(b), a.max(b));
            if let Some(friction) = &mut channel.friction {
                friction[k] += nearest - channel.model[k];
            }
            channel.model[k] = nearest;
        }
    }
    Ok(())
}

/// The grid points at which `joint` is at rest within the resolution of its encoder.
fn standing(recording: &Recording, treatment: &Treatment, whole: &Trajectory, joint: usize) -> Vec<bool> {
    let read = treatment.whole_column(recording, &recording.q[joint]);
    let least = UNMOVED * encoder_noise(&read);
    let reach = (treatment.rate_hz() / treatment.filter().cutoff_hz() / 2.0) as usize;
    let mut stands = vec![false; read.len()];
    for stretch in &whole.stretches {
        let q = &whole.q[joint][stretch.clone()];
        for k in 0..q.len() {
            let around = &q[k.saturating_sub(reach)..(k + reach + 1).min(q.len())];
            let (low, high) = around.iter().fold((f64::MAX, f64::MIN), |(a, b), q| (a.min(*q), b.max(*q)));
            stands[stretch.start + k] = high - low < least;
        }
    }
    stands
}
