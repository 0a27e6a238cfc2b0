//! What a person should know beside the numbers.

use freeplay_arm::{Arm, JointKind};
use freeplay_laws::Trajectory;
use freeplay_recording::Recording;

use crate::comparison::ChannelError;
use crate::motion::Treatment;
use crate::statistics::Moments;

/// A filtered-out share of a joint's movement above this is worth a word.
const REMOVED: f64 = 0.01;
/// A recorded velocity that differs from the derivative of the position by more than this share is worth a word.
const VELOCITY: f64 = 0.05;
/// Share of a joint's range by which it may be seen outside of it without a word.
const BEYOND: f64 = 0.05;

/// The joints of `arm` that `recording` has beyond their limits, a sentence each.
pub fn beyond_limits(arm: &Arm, recording: &Recording) -> Vec<String> {
    let mut notes = Vec::new();
    for (index, (joint, q)) in arm.joints().iter().zip(&recording.q).enumerate() {
        let (least, most) = extremes(q);
        let (lower, upper) = (joint.limits.lower, joint.limits.upper);
        let slack = BEYOND * (upper - lower);
        if least < lower - slack || most > upper + slack {
            let (unit, hint) = match joint.kind {
                JointKind::Revolute => ("rad", "degrees"),
                JointKind::Prismatic => ("m", "millimetres"),
            };
            notes.push(format!(
                "q{} goes from {least:.4} to {most:.4} {unit}, but {} may only from {lower:.4} to {upper:.4}: {hint}, another zero or another joint?",
                index + 1,
                joint.name
            ));
        }
    }
    notes
}

/// Notes on the motion, joint by joint: beyond the limits, fast for the filter, velocities that don't fit.
pub(crate) fn on_motion(
    arm: &Arm,
    recording: &Recording,
    treatment: &Treatment,
    motion: &Trajectory,
) -> Vec<String> {
    let mut notes = beyond_limits(arm, recording);
    for index in 0..arm.dof() {
        if let Some(removed) =
            removed_by_filter(recording, treatment, motion, index).filter(|share| *share > REMOVED)
        {
            notes.push(format!(
                "the low-pass at {:.4} Hz takes {:.0} % off the movement of q{}: too fast or too noisy for it; see --lowpass",
                treatment.filter().cutoff_hz(),
                removed * 100.0,
                index + 1
            ));
        }
    }
    notes.extend(on_velocities(recording, treatment, motion));
    notes
}

/// How much of the movement of a joint the filter takes away: (std before − std after)/std before, on the kept points.
fn removed_by_filter(
    recording: &Recording,
    treatment: &Treatment,
    motion: &Trajectory,
    joint: usize,
) -> Option<f64> {
    let before = Moments::of(&treatment.unfiltered(recording, &recording.q[joint])).std;
    (before > 0.0).then(|| 1.0 - Moments::of(&motion.q[joint]).std / before)
}

/// Recorded velocities that are not the derivative of the recorded positions.
fn on_velocities(recording: &Recording, treatment: &Treatment, motion: &Trajectory) -> Option<String> {
    let mut odd = Vec::new();
    for (index, recorded) in recording.qd.iter().flatten().enumerate() {
        let recorded = treatment.smooth(recording, recorded);
        let derived = &motion.v[index];
        let off: Vec<f64> =
            recorded.iter().zip(derived).map(|(recorded, derived)| recorded - derived).collect();
        let (off, size) = (Moments::of(&off).rms, Moments::of(derived).rms);
        if off > VELOCITY * size && size > 0.0 {
            odd.push(format!("qd{} by {:.0} %", index + 1, 100.0 * off / size));
        }
    }
    (!odd.is_empty()).then(|| {
        format!(
            "recorded velocities differ from the derivative of the positions, which is used: {}",
            odd.join(", ")
        )
    })
}

/// Notes on channels that can't be judged or are missing.
pub(crate) fn on_channels(recording: &Recording, channels: &[ChannelError]) -> Vec<String> {
    let mut notes = Vec::new();
    if recording.tau.is_none() {
        let joints = recording.joints();
        notes.push(format!(
            "no torque was recorded (tau1…tau{joints}): the dynamics of the model are not compared"
        ));
    }
    let constant = channels.iter().filter(|channel| channel.nrmse_std.is_none());
    let constant: Vec<&str> = constant.map(|channel| channel.name.as_str()).collect();
    if !constant.is_empty() {
        notes.push(format!(
            "constant in this recording, so that no share can be given: {}",
            constant.join(", ")
        ));
    }
    notes
}

fn extremes(values: &[f64]) -> (f64, f64) {
    values.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(least, most), value| {
        (least.min(*value), most.max(*value))
    })
}
