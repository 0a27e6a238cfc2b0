//! `angle_unit`: positions in degrees (slides in millimetres).
//!
//! It asks whether all positions are 180/π (1000) times too large. By torques or the tool where there are some; else by the
//! speeds and limits of the joints. The hypothesis divides them.

use std::f64::consts::PI;

use freeplay_arm::{Arm, JointKind};

use super::super::change::Change;
use super::super::finding::{Certainty, SetupFinding};
use super::{Ask, Told};

/// A joint goes beyond its limits, or faster than it can, by this factor: no overshoot, another unit.
const BEYOND: f64 = 2.0;
/// Without limits: no arm turns this fast, rad/s.
const FASTEST: f64 = 30.0;

/// What it asks.
pub(crate) fn asks(_: &Ask) -> Vec<Change> {
    vec![Change::AngleUnit]
}

/// Words and remedy.
pub(crate) fn says(told: &Told) -> Vec<SetupFinding> {
    let found = told.of(|change| *change == Change::AngleUnit);
    found.into_iter().map(|(_, certainty)| finding(told.arm, certainty)).collect()
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
            "Say the unit in the mapping: under [q], unit = \"{}\".",
            if slides { "mm" } else { "deg" }
        ),
        gravity: None,
    }
}

/// By the motion alone: positions `q` with the speeds `v`, `[joint][row]`, where neither torque nor tool was recorded.
pub(crate) fn by_motion(arm: &Arm, q: &[Vec<f64>], v: &[Vec<f64>]) -> Option<SetupFinding> {
    let most = |column: &[f64]| column.iter().fold(0.0_f64, |most, x| most.max(x.abs()));
    let turning = arm.joints().iter().enumerate().filter(|(_, joint)| joint.kind == JointKind::Revolute);
    let (mut known, mut beyond, mut fast) = (0, 0, 0);
    for (k, joint) in turning {
        let limits = &joint.limits;
        let farthest = limits.lower.abs().max(limits.upper.abs());
        known += usize::from(farthest.is_finite() || limits.velocity.is_finite());
        let is_far = most(&q[k]) > BEYOND * farthest.max(PI) || most(&v[k]) > BEYOND * limits.velocity;
        // In degrees it has to be possible.
        let fits = most(&q[k]).to_radians() <= farthest && most(&v[k]).to_radians() <= limits.velocity;
        beyond += usize::from(is_far && fits);
        fast += usize::from(most(&v[k]) > FASTEST);
    }
    let certainty = match (known, beyond, fast) {
        (_, 1.., _) => Certainty::Sure,
        (0, _, 1..) => Certainty::Sure,
        _ => return None,
    };
    Some(finding(arm, certainty))
}
