//! `joint_coordinates`: a joint recorded relative to the horizon, or to the joint before (a parallel linkage).
//!
//! Tested for every joint: its position includes that of the joint before, plus or minus. The hypothesis subtracts it.

use freeplay_arm::JointKind;

use super::super::change::Change;
use super::super::finding::{Certainty, SetupFinding};
use super::{Ask, Results};

/// The tested changes.
pub(crate) fn asks(ask: &Ask) -> Vec<Change> {
    let turns = |joint: usize| ask.arm.joints()[joint].kind == JointKind::Revolute;
    let pairs = (1..ask.arm.dof()).filter(|&joint| turns(joint) && turns(joint - 1));
    let both = |joint| [1.0, -1.0].map(|factor| Change::Relative { joint, other: joint - 1, factor });
    pairs.flat_map(both).collect()
}

/// Words and remedy.
pub(crate) fn findings(results: &Results) -> Vec<SetupFinding> {
    let found = results.of(|change| matches!(change, Change::Relative { .. }));
    let one = |change: Change| {
        let Change::Relative { joint, other, factor } = change else { return None };
        let (name, other) = (results.name(joint), results.name(other));
        let (sum, back) = if factor > 0.0 { ("plus", "Subtract") } else { ("minus", "Add") };
        Some(SetupFinding {
            kind: "joint_coordinates",
            value: factor,
            unit: "1",
            certainty: Certainty::Sure,
            statement: format!(
                "The position of {name} is recorded relative to the arm's base, not to {other}: the recorded value is the model's {name} {sum} {other}.{}",
                results.rival(&change)
            ),
            remedy: format!("{back} the position of {other} in the mapping."),
            joint: Some(name),
            gravity: None,
        })
    };
    found.into_iter().filter_map(one).collect()
}
