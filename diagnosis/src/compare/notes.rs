//! Remarks for the reader of the numbers.

use freeplay_arm::{Arm, JointKind};
use freeplay_recording::Recording;

use crate::compare::channel_error::ChannelError;
use crate::compare::tally::Tally;
use crate::signals::missing::only;
use crate::signals::motion::Treatment;
use crate::statistics::{UNMOVED, difference, encoder_noise, extremes};

/// Least share of a joint's movement removed by the filter that is worth a note: below 1 % no law changes its parameters by more than their intervals.
const REMOVED: f64 = 0.01;
/// Greatest deviation without a note, as a share: of a recorded velocity from the derivative of the position, and of a joint beyond its range. Such a small
/// error changes no verdict.
const WORTH_A_WORD: f64 = 0.05;

/// The joints of `arm` with positions beyond their limits in `recording`, one sentence each.
pub fn beyond_limits(arm: &Arm, recording: &Recording) -> Vec<String> {
    let mut notes = Vec::new();
    for (index, (joint, q)) in arm.joints().iter().zip(&recording.q).enumerate() {
        let (least, most) = extremes(q);
        let (lower, upper) = (joint.limits.lower, joint.limits.upper);
        let slack = WORTH_A_WORD * (upper - lower);
        if least < lower - slack || most > upper + slack {
            let (unit, hint) = match joint.kind {
                JointKind::Revolute => ("rad", "degrees"),
                JointKind::Prismatic => ("m", "millimetres"),
            };
            notes.push(format!(
                "q{} ranges from {least:.4} to {most:.4} {unit}, but the limits of {} are {lower:.4} to {upper:.4}: is the column in {hint}, or does it have another zero or belong to another joint?",
                index + 1,
                joint.name
            ));
        }
    }
    notes
}

/// The data of notes on the motion, summed over the parts of a recording.
pub(crate) struct MotionTally {
    joints: Vec<JointTally>,
}

#[derive(Clone, Default)]
struct JointTally {
    /// Position, before the filter and after it.
    recorded: Tally,
    smooth: Tally,
    /// Standard deviation of the encoder's noise, or its step: the largest of all parts.
    noise: f64,
    /// Derivative of the position, and recorded velocity minus it.
    derived: Tally,
    off: Tally,
}

impl MotionTally {
    /// An empty tally for `recording`.
    pub fn of(recording: &Recording) -> Self {
        Self { joints: vec![JointTally::default(); recording.joints()] }
    }

    /// Adds the part of `recording` that `treatment` keeps.
    pub fn add(&mut self, recording: &Recording, treatment: &Treatment) {
        for (index, (joint, q)) in self.joints.iter_mut().zip(&recording.q).enumerate() {
            let [smooth, derived, _] = treatment.smooth_with_derivatives(recording, q);
            let recorded = treatment.unfiltered(recording, q);
            if removed(&Tally::of(&recorded), &Tally::of(&smooth)).is_some() {
                joint.noise = joint.noise.max(encoder_noise(&treatment.whole_column(recording, q)));
            }
            joint.recorded.add(&recorded);
            joint.smooth.add(&smooth);
            if let Some(velocity) = recording.qd.as_ref().map(|qd| treatment.smooth(recording, &qd[index])) {
                let present = recording.qd.as_ref().and_then(|qd| treatment.present(recording, &qd[index]));
                let present = present.as_deref();
                let off = difference(&velocity, &derived);
                let (derived, off) = (only(&derived, present), only(&off, present));
                joint.derived.add(&derived);
                joint.off.add(&off);
            }
        }
    }

    /// Notes on joints that are fast for the filter, whose cutoff is `cutoff_hz`, and on inconsistent velocities.
    pub fn notes(&self, cutoff_hz: f64) -> Vec<String> {
        let moving = |joint: &JointTally| joint.recorded.moments.std > UNMOVED * joint.noise;
        let joints = self.joints.iter().enumerate().filter(|(_, joint)| moving(joint));
        let fast = joints.filter_map(|(index, joint)| {
            let share = removed(&joint.recorded, &joint.smooth)?;
            Some(format!(
                "the low-pass at {cutoff_hz:.4} Hz removes {:.0} % of the movement of q{}, which is too fast or too noisy for this cutoff; see --lowpass",
                share * 100.0,
                index + 1
            ))
        });
        fast.chain(self.on_velocities()).collect()
    }

    /// A note on recorded velocities that differ from the derivative of the recorded positions.
    fn on_velocities(&self) -> Option<String> {
        let odd = self.joints.iter().enumerate().filter_map(|(index, joint)| {
            let (off, size) = (joint.off.moments.rms, joint.derived.moments.rms);
            let is_odd = off > WORTH_A_WORD * size && size > 0.0;
            is_odd.then(|| format!("qd{} by {:.0} %", index + 1, 100.0 * off / size))
        });
        let odd: Vec<String> = odd.collect();
        (!odd.is_empty()).then(|| {
            format!(
                "recorded velocities differ from the derivative of the positions, and the comparison uses the derivative: {}",
                odd.join(", ")
            )
        })
    }
}

/// Share of a joint's movement that the filter removes, if it is worth a note: (std before − std after)/std before.
fn removed(recorded: &Tally, smooth: &Tally) -> Option<f64> {
    let (before, after) = (recorded.moments.std, smooth.moments.std);
    let share = 1.0 - after / before;
    (before > 0.0 && share > REMOVED).then_some(share)
}

/// Notes on channels that are missing or can't be judged.
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
            "these channels are constant in this recording, so that they have no relative error: {}",
            constant.join(", ")
        ));
    }
    notes
}
