//! `joint_direction`: a joint with an inverted direction, with or without its torque.
//!
//! Tested for every joint that leaves its zero: both forms. The hypothesis inverts the sign of its positions, and in one form that of its torques, too.

use super::super::change::Change;
use super::super::finding::{Certainty, SetupFinding};
use super::{Ask, Results};
use crate::signals::rest::STILL;
use crate::statistics::Moments;

/// The tested changes.
pub(crate) fn asks(ask: &Ask) -> Vec<Change> {
    let of_joint = |joint| {
        let alone = (ask.has_torques).then_some(Change::Direction { joint, with_torque: false });
        std::iter::once(Change::Direction { joint, with_torque: true }).chain(alone)
    };
    // A joint that stays at zero has no direction.
    let is_away = |joint: &usize| Moments::of(&ask.positions[*joint]).rms > STILL;
    (0..ask.arm.dof()).filter(is_away).flat_map(of_joint).collect()
}

/// Words and remedy.
pub(crate) fn findings(results: &Results) -> Vec<SetupFinding> {
    let found = results.of(|change| matches!(change, Change::Direction { .. }));
    let one = |change: Change| {
        let Change::Direction { joint, with_torque } = change else { return None };
        let name = results.name(joint);
        let torque =
            if !results.best.changes.is_empty() && with_torque { ", and so has its torque" } else { "" };
        let rival = results.rival(&change);
        Some(SetupFinding {
            kind: "joint_direction",
            value: -1.0,
            unit: "1",
            certainty: Certainty::Sure,
            statement: format!("{name} has the opposite direction to that in the model{torque}.{rival}"),
            remedy: format!(
                "Invert the sign of {name}{} in the mapping, or reverse its axis in the model.",
                if with_torque { " and of its torque" } else { "" }
            ),
            joint: Some(name),
            gravity: None,
        })
    };
    found.into_iter().filter_map(one).collect()
}
