//! `frozen_channel`: a torque or a position with a constant value while its joint moves.
//!
//! Tested: a channel has the same value in every row, although the joint moves: by its own position for a torque; by its command, its velocity or its link
//! encoder for a position. There is no correction.

use freeplay_arm::Arm;
use freeplay_recording::Recording;

use super::super::finding::{Certainty, SetupFinding};
use crate::statistics::span;

/// Least range of a joint that certainly moves, rad (m), or its least speed, rad/s (m/s): about a degree, above the noise of a velocity at rest.
const MOVES: f64 = 0.02;

fn is_still(column: &[f64]) -> bool {
    column.first().is_some_and(|first| first.is_finite() && column.iter().all(|x| x == first))
}

/// Words and remedy for each frozen channel; true for a position, without which no comparison is possible.
pub(crate) fn found(arm: &Arm, recording: &Recording) -> Vec<(SetupFinding, bool)> {
    let mut all = Vec::new();
    for (joint, q) in recording.q.iter().enumerate().take(arm.dof()) {
        let of =
            |columns: &Option<Vec<Vec<f64>>>| columns.as_ref().map_or(0.0, |columns| span(&columns[joint]));
        let link = recording.q_link.get(joint).and_then(Option::as_ref).map_or(0.0, |column| span(column));
        let moves = of(&recording.q_ref).max(of(&recording.qd)).max(link);
        if is_still(q) && moves > MOVES {
            all.push((
                finding(arm, joint, "position", q[0], "its command or velocity shows that it moves"),
                true,
            ));
        }
        let torque = recording.tau.as_ref().map(|columns| &columns[joint]);
        if let Some(torque) = torque.filter(|torque| is_still(torque))
            && span(q) > MOVES
        {
            all.push((finding(arm, joint, "torque", torque[0], "the joint moves"), false));
        }
    }
    all
}

/// A constant position while all other channels show that its joint moves, detected by the residual of every reading.
pub(crate) fn suspected(arm: &Arm, recording: &Recording) -> Option<SetupFinding> {
    let joint = (0..arm.dof()).find(|&joint| is_still(&recording.q[joint]))?;
    Some(finding(arm, joint, "position", recording.q[joint][0], "the other channels show that it moves"))
}

fn finding(arm: &Arm, joint: usize, what: &str, value: f64, why: &str) -> SetupFinding {
    let name = arm.joints()[joint].name.clone();
    SetupFinding {
        kind: "frozen_channel",
        value,
        unit: "1",
        certainty: Certainty::Sure,
        statement: format!(
            "The {what} of {name} is {value} in every row, although {why}: the channel is frozen."
        ),
        remedy: format!("Record the {what} of {name} again, or leave its column out."),
        joint: Some(name),
        gravity: None,
    }
}
