//! `angle_unit`: positions in degrees (slides in millimetres).
//!
//! Tested: all positions are 180/π (1000) times too large. Torques or the tool decide if the recording has them; otherwise the speeds and limits of the joints.
//! The hypothesis divides the positions.

use std::f64::consts::PI;

use freeplay_arm::{Arm, JointKind};

use super::super::change::{Change, reading};
use super::super::finding::{Certainty, SetupFinding};
use super::{Ask, Results};
use crate::statistics::variance;

/// Factor by which a joint may exceed its limits: beyond it the cause is no overshoot but another unit. Limits of speed are placeholders in many files.
const BEYOND: f64 = 2.0;
/// Root mean square of a speed that no arm reaches, rad/s (m/s): joints of the fastest arms turn at 20 rad/s at most; it replaces unknown limits.
const FASTEST: f64 = 30.0;

/// The tested changes. If all revolute joints stay within half a turn when read in rad, the unit degrees would mean a motion below about 3 degrees, and is not
/// tested.
pub(crate) fn asks(ask: &Ask) -> Vec<Change> {
    let wide = ask.arm.joints().iter().zip(ask.positions).any(|(joint, q)| {
        let least = q.iter().copied().fold(f64::INFINITY, f64::min);
        joint.kind == JointKind::Prismatic || q.iter().any(|q| q - least > PI)
    });
    wide.then_some(Change::AngleUnit).into_iter().collect()
}

/// Words and remedy.
pub(crate) fn findings(results: &Results) -> Vec<SetupFinding> {
    let found = results.of(|change| *change == Change::AngleUnit);
    found.into_iter().map(|_| finding(results.arm, Certainty::Sure)).collect()
}

fn finding(arm: &Arm, certainty: Certainty) -> SetupFinding {
    let slides = arm.joints().iter().all(|joint| joint.kind == JointKind::Prismatic);
    let unit = if slides { "millimetres" } else { "degrees" };
    SetupFinding {
        kind: "angle_unit",
        joint: None,
        value: if slides { 1e3 } else { 180.0 / PI },
        unit: "1",
        certainty,
        statement: format!("The joint positions are in {unit}, not in {}.", if slides { "m" } else { "rad" }),
        remedy: format!(
            "Set the unit in the mapping: unit = \"{}\" under [q].",
            if slides { "mm" } else { "deg" }
        ),
        gravity: None,
    }
}

/// By the motion alone: positions and velocities, `[joint][row]`, that no arm reaches in rad (m); without joints whose position `jumps`, since it may be wrong
/// by whole turns.
pub(crate) fn by_motion(arm: &Arm, motion: &[Vec<Vec<f64>>; 3], jumps: &[bool]) -> Option<SetupFinding> {
    let [q, v, _] = motion;
    let most = |column: &[f64]| column.iter().fold(0.0_f64, |most, x| most.max(x.abs()));
    let smooth = arm.joints().iter().enumerate().filter(|(k, _)| !jumps[*k]);
    let read = reading(arm, &[Change::AngleUnit]).positions;
    let (mut known, mut beyond, mut fast) = (0, 0, 0);
    for (k, joint) in smooth {
        let limits = &joint.limits;
        let farthest = limits.lower.abs().max(limits.upper.abs());
        known += usize::from(farthest.is_finite() || limits.velocity.is_finite());
        let turn = if joint.kind == JointKind::Revolute { PI } else { 0.0 };
        let is_far = most(&q[k]) > BEYOND * farthest.max(turn);
        // The motion must be possible in degrees (millimetres).
        let unit = read[k].unit;
        let fits = most(&q[k]) * unit <= farthest && most(&v[k]) * unit <= limits.velocity;
        beyond += usize::from(is_far && fits);
        fast += usize::from(variance(&v[k]).sqrt() > FASTEST);
    }
    let certainty = match (known, beyond, fast) {
        (_, 1.., _) => Certainty::Sure,
        (0, _, 1..) => Certainty::Sure,
        _ => return None,
    };
    Some(finding(arm, certainty))
}
