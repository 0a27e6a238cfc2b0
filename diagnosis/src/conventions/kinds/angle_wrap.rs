//! `angle_wrap`: positions that jump by a whole turn, since their controller knows one turn only.
//!
//! It asks whether a turning joint's position jumps by one turn, in rad or in degrees, between two samples, while it moves by far
//! less before and after. The reading takes the jumps out.

use freeplay_arm::{Arm, JointKind};
use freeplay_recording::Recording;

use super::super::finding::{Certainty, SetupFinding};
use super::listed;

/// A jump is a whole turn within this share of one.
const NEAR: f64 = 0.1;
/// The steps before and after a jump are less than this share of it.
const STEADY: f64 = 0.2;
/// A turn in rad, and in degrees.
const TURNS: [f64; 2] = [std::f64::consts::TAU, 360.0];

/// `column` without its jumps by whole turns; `None` where it has none.
pub(crate) fn unwrapped(column: &[f64]) -> Option<Vec<f64>> {
    let steps: Vec<f64> = column.windows(2).map(|pair| pair[1] - pair[0]).collect();
    let around = |k: usize| {
        let near = [k.checked_sub(1), Some(k + 1)].into_iter().flatten().filter_map(|k| steps.get(k));
        near.fold(0.0_f64, |most, step| most.max(step.abs()))
    };
    let jump = |k: usize| -> Option<f64> {
        let turn = TURNS.into_iter().find(|turn| (steps[k].abs() / turn - 1.0).abs() < NEAR)?;
        (around(k) < STEADY * turn).then_some(turn * steps[k].signum())
    };
    let jumps: Vec<(usize, f64)> = (0..steps.len()).filter_map(|k| Some((k + 1, jump(k)?))).collect();
    if jumps.is_empty() {
        return None;
    }
    let (mut column, mut sum, mut next) = (column.to_vec(), 0.0, jumps.iter().peekable());
    for (row, x) in column.iter_mut().enumerate() {
        if let Some((_, turn)) = next.next_if(|(at, _)| *at == row) {
            sum += turn;
        }
        *x -= sum;
    }
    Some(column)
}

/// Words and remedy, for each joint of `arm` whose position jumps.
pub(crate) fn found(arm: &Arm, recording: &Recording) -> Vec<SetupFinding> {
    let joints = arm.joints().iter().zip(&recording.q);
    let jumping = joints.filter(|(joint, q)| joint.kind == JointKind::Revolute && unwrapped(q).is_some());
    let names: Vec<String> = jumping.map(|(joint, _)| joint.name.clone()).collect();
    let one = |name: &String| SetupFinding {
        kind: "angle_wrap",
        joint: Some(name.clone()),
        value: std::f64::consts::TAU,
        unit: "rad",
        certainty: Certainty::Sure,
        statement: format!(
            "The position of {} jumps by a whole turn: its controller counts within one turn only. The jumps are taken out.",
            listed(&names)
        ),
        remedy: "Say unwrap = true under [q] in the mapping.".to_owned(),
        gravity: None,
    };
    names.iter().map(one).collect()
}
