//! The kinds of set-up faults, one file each with the same sections: the tested hypotheses, their change, words, remedy.
//!
//! A [`Change`] holds the change of a hypothesis. Each kind lists the changes that the search tries, and returns a [`SetupFinding`] for each certain or likely
//! change.

pub(crate) mod angle_unit;
pub(crate) mod angle_wrap;
pub(crate) mod another_arm;
pub(crate) mod clock_offset;
pub(crate) mod frozen_channel;
mod gravity_compensated;
mod gravity_direction;
mod joint_coordinates;
mod joint_direction;
mod joint_order;
pub(crate) mod joint_zero;
pub(crate) mod time_unit;
mod torque_sign;
pub(crate) mod torque_unit;

use freeplay_arm::Arm;

use super::change::{Change, physics};
use super::finding::SetupFinding;
use super::outcome::Outcome;

/// Input of a kind for listing its hypotheses.
pub(crate) struct Ask<'a> {
    pub arm: &'a Arm,
    pub has_torques: bool,
    pub has_tool: bool,
    /// Recorded positions, `[joint][row]`.
    pub positions: &'a [Vec<f64>],
    /// The best set so far.
    pub best: &'a Outcome,
}

/// Input of a kind for its findings.
pub(crate) struct Results<'a> {
    pub arm: &'a Arm,
    /// The best set.
    pub best: &'a Outcome,
    /// The certain changes of the best set, of all kinds.
    pub certain: &'a [Change],
    /// Alternatives that explain the same as a change, in words.
    pub rivals: &'a [(Change, String)],
}

impl Results<'_> {
    /// The name of a joint.
    pub fn name(&self, joint: usize) -> String {
        self.arm.joints()[joint].name.clone()
    }

    /// The certain changes for which `is` returns true.
    pub fn of(&self, is: impl Fn(&Change) -> bool) -> Vec<Change> {
        self.certain.iter().copied().filter(is).collect()
    }

    /// The alternative that explains the same as `change`, as a sentence; empty if there is none.
    pub fn rival(&self, change: &Change) -> String {
        let rival = self.rivals.iter().find(|(of, _)| of == change);
        rival.map_or_else(String::new, |(_, words)| {
            format!(" Alternatively, {words}: this recording cannot distinguish the two.")
        })
    }
}

/// A kind that the search tests.
struct Kind {
    asks: fn(&Ask) -> Vec<Change>,
    findings: fn(&Results) -> Vec<SetupFinding>,
}

/// In the order in which a person would correct them.
const KINDS: [Kind; 10] = [
    Kind { asks: angle_unit::asks, findings: angle_unit::findings },
    Kind { asks: joint_order::asks, findings: joint_order::findings },
    Kind { asks: joint_direction::asks, findings: joint_direction::findings },
    Kind { asks: joint_zero::asks, findings: joint_zero::findings },
    Kind { asks: joint_coordinates::asks, findings: joint_coordinates::findings },
    Kind { asks: torque_sign::asks, findings: torque_sign::findings },
    Kind { asks: torque_unit::asks, findings: torque_unit::findings },
    Kind { asks: gravity_direction::asks, findings: gravity_direction::findings },
    Kind { asks: gravity_compensated::asks, findings: gravity_compensated::findings },
    Kind { asks: clock_offset::asks, findings: clock_offset::findings },
];

/// All hypotheses, physics beside the reading included.
pub(crate) fn asks(ask: &Ask) -> Vec<Change> {
    let mut all: Vec<Change> = KINDS.iter().flat_map(|kind| (kind.asks)(ask)).collect();
    if ask.has_torques {
        all.extend(physics(ask.arm.dof()));
    }
    all
}

/// The findings of the certain changes.
pub(crate) fn findings(results: &Results) -> Vec<SetupFinding> {
    KINDS.iter().flat_map(|kind| (kind.findings)(results)).collect()
}

/// Returns true if a change is so small that it belongs to the catalogue of effects, whose law describes it better.
pub(crate) fn is_small(arm: &Arm, outcome: &Outcome, change: &Change) -> bool {
    match *change {
        Change::Zero { offset, .. } => offset.abs() <= joint_zero::LEAST,
        Change::Scale(joint) => torque_unit::is_small(outcome.scale[joint]),
        Change::SameScale(_, factor) => torque_unit::is_small(factor),
        Change::CommonScale => torque_unit::is_small(outcome.scale[0]),
        Change::AnyGravity => gravity_direction::angle(arm, outcome) <= gravity_direction::LEAST,
        Change::Delay(_, delay) => delay.abs() <= clock_offset::LEAST,
        _ => false,
    }
}

/// A change in a few words, as an alternative.
pub(crate) fn briefly(arm: &Arm, change: &Change) -> String {
    let name = |joint: usize| arm.joints()[joint].name.as_str();
    match *change {
        Change::Direction { joint, with_torque: true } => {
            format!("{} and its torque both have the opposite direction", name(joint))
        }
        Change::Direction { joint, with_torque: false } => {
            format!("{} has the opposite direction, but its torque does not", name(joint))
        }
        Change::Zero { joint, offset, .. } => {
            format!("the zero of {} is {:.0} degrees off", name(joint), offset.to_degrees())
        }
        Change::CommonSign => "all torques have the opposite sign".to_owned(),
        Change::TorqueSign(joint) => format!("the torque of {} has the opposite sign", name(joint)),
        Change::Relative { joint, other, .. } => {
            format!("{} is recorded relative to {}", name(joint), name(other))
        }
        Change::Exchange(a, b) => format!("{} and {} are exchanged", name(a), name(b)),
        Change::Compensated => "the torques contain no gravity".to_owned(),
        _ => "another reading explains the recording as well".to_owned(),
    }
}

/// The `names` as a list in words: `elbow`, `elbow and wrist`, `a, b and c`.
pub(crate) fn listed(names: &[String]) -> String {
    match names {
        [] => String::new(),
        [one] => one.clone(),
        [most @ .., last] => format!("{} and {last}", most.join(", ")),
    }
}

/// A number with about three digits.
pub(crate) fn brief(value: f64) -> String {
    if value == 0.0 || !value.is_finite() {
        return format!("{value}");
    }
    let digits = (2.0 - value.abs().log10().floor()).clamp(0.0, 9.0) as usize;
    let text = format!("{value:.digits$}");
    if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.').to_owned() } else { text }
}
