//! `another_arm`: no reading reconciles recording and model.
//!
//! Tested after all other hypotheses: most channels still have most of their variance unexplained; or links of any inertia explain more than the best reading
//! with the model's links within the error of a data sheet.

use super::super::finding::{Certainty, SetupFinding};
use super::super::outcome::{Outcome, SPOKEN};

/// Share of a channel's variance beyond which the channel counts as unexplained: the residual is then more than half of its deviation, √0.3.
pub(crate) const UNEXPLAINED: f64 = 0.3;
/// The same share where a tool is tracked: its position is geometry, which no friction blurs.
const AWAY: f64 = 0.02;

/// Words and remedy; the first `joints` residuals are torques, unless they are silent: without gravity.
pub(crate) fn found(best: &Outcome, joints: usize, is_silent: bool, has_tool: bool) -> Option<SetupFinding> {
    let (torques, tool) = best.left.split_at(if best.left.len() >= joints { joints } else { 0 });
    let speaks =
        torques.iter().zip(&best.spoken).filter(|(left, spoken)| left.is_finite() && **spoken > SPOKEN);
    let judged: Vec<f64> = speaks.map(|(left, _)| *left).collect();
    let odd = judged.iter().filter(|left| **left > UNEXPLAINED).count();
    let is_away = has_tool && tool.iter().sum::<f64>() / 3.0 > AWAY;
    let is_odd = 2 * odd > judged.len();
    let certainty = match (!is_silent && !judged.is_empty(), has_tool) {
        (_, true) if is_away => Certainty::Sure,
        (true, false) if is_odd => Certainty::Likely,
        _ => return None,
    };
    let left =
        100.0 * best.left.iter().filter(|left| left.is_finite()).fold(0.0_f64, |most, left| most.max(*left));
    Some(finding(left.min(100.0) / 100.0, certainty))
}

/// The finding that another arm explains more than any reading of this one.
pub(crate) fn by_evidence() -> SetupFinding {
    finding(0.0, Certainty::Sure)
}

fn finding(value: f64, certainty: Certainty) -> SetupFinding {
    SetupFinding {
        kind: "another_arm",
        joint: None,
        value,
        unit: "1",
        certainty,
        statement: "No reading of the recording (units, signs, order, zeros, gravity, clock) agrees with this model. Is the recording from another arm?"
            .to_owned(),
        remedy: "Check that the model file and the recording belong to the same robot, and the same tool.".to_owned(),
        gravity: None,
    }
}
