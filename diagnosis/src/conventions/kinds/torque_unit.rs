//! `torque_unit`: torques in another unit, of all joints or of single ones: N·mm, amperes, the motor's side of the gear, counts.
//!
//! Tested for every joint: its torque is the model's times a constant; for joints together where they share one. The hypothesis divides by the constant. A
//! constant near one is the catalogue's `torque_gain`.

use super::super::change::Change;
use super::super::finding::{Certainty, SetupFinding};
use super::super::outcome::Outcome;
use super::{Ask, Results, brief, listed};
use crate::sorting::sort;

/// Between a half and two, a wrong gain or mass explains a scale; no unit does.
const NEAR: f64 = 2.0;
/// Relative tolerance within which two ratios are the same: torque constants are given to two figures.
const SAME: f64 = 0.02;
/// A kilogram-force in N: standard gravity (3rd CGPM 1901).
const KILOGRAM_FORCE: f64 = 9.806_65;

/// Returns true for a scale too near one for a unit.
pub(crate) fn is_small(scale: f64) -> bool {
    scale > 1.0 / NEAR && scale < NEAR
}

/// Round factors near `scale` that are unlikely by chance: whole numbers and their inverses, kilograms.
pub(crate) fn rounded(scale: f64) -> Vec<f64> {
    let mut near = Vec::new();
    if scale >= NEAR / 1.2 {
        near.push(scale.round());
    }
    if scale > 0.0 && scale <= 1.2 / NEAR {
        near.push(1.0 / (1.0 / scale).round());
        near.push(1.0 / KILOGRAM_FORCE);
    }
    near.retain(|round| (round / scale - 1.0).abs() < SAME);
    near
}

/// Returns true if `change` gives a joint the torque unit that one of `others` gives another joint.
pub(crate) fn is_shared(outcome: &Outcome, change: &Change, others: &[Change]) -> bool {
    let Change::SameScale(joint, _) = *change else { return false };
    let is_scale = |other: &&Change| matches!(other, Change::Scale(_) | Change::SameScale(..));
    let scales = others.iter().filter(is_scale).filter_map(Change::joint);
    scales.into_iter().any(|other| (outcome.scale[other] / outcome.scale[joint] - 1.0).abs() < SAME)
}

/// The tested changes.
pub(crate) fn asks(ask: &Ask) -> Vec<Change> {
    if !ask.has_torques {
        return Vec::new();
    }
    let n = ask.arm.dof();
    let mut all: Vec<Change> = (0..n).map(Change::Scale).collect();
    let scales = &ask.best.scale;
    let mut known: Vec<f64> = scales.iter().copied().filter(|scale| !is_small(*scale)).collect();
    sort(&mut known);
    known.dedup();
    all.extend((0..n).flat_map(|joint| known.iter().map(move |factor| Change::SameScale(joint, *factor))));
    all.push(Change::CommonScale);
    all
}

/// Words and remedy; one statement for all joints that share a constant.
pub(crate) fn findings(results: &Results) -> Vec<SetupFinding> {
    let found =
        results.of(|change| matches!(change, Change::Scale(_) | Change::SameScale(..) | Change::CommonScale));
    let mut joints: Vec<(usize, f64)> = Vec::new();
    for change in found {
        let of = |joint: usize| (joint, results.best.scale[joint]);
        match change.joint() {
            Some(joint) => joints.push(of(joint)),
            None => joints.extend((0..results.arm.dof()).map(of)),
        }
    }
    joints.sort_by_key(|(joint, ..)| *joint);
    let Some(&(_, first)) = joints.first() else { return Vec::new() };
    let is_one = joints.iter().all(|(_, scale)| (scale / first - 1.0).abs() < SAME);
    let is_all = joints.len() == results.arm.dof();
    if is_one {
        return of_one(results, &joints, first, is_all);
    }
    of_several(results, &joints, is_all)
}

fn of_one(results: &Results, joints: &[(usize, f64)], scale: f64, is_all: bool) -> Vec<SetupFinding> {
    let names: Vec<String> = joints.iter().map(|(joint, ..)| results.name(*joint)).collect();
    let whose = whose(&names, is_all);
    let statement = format!(
        "{whose} {} the model's at every load. {}",
        times(scale, names.len()),
        guess(scale, names.len())
    );
    let remedy = format!("Scale these torques by {} in the mapping.", brief(1.0 / scale));
    let one = |joint: Option<String>| finding(joint, scale, &statement, &remedy);
    if is_all && names.len() > 1 {
        return vec![one(None)];
    }
    names.into_iter().map(|name| one(Some(name))).collect()
}

fn of_several(results: &Results, joints: &[(usize, f64)], is_all: bool) -> Vec<SetupFinding> {
    let names: Vec<String> = joints.iter().map(|(joint, ..)| results.name(*joint)).collect();
    let constants: Vec<String> = joints.iter().map(|(_, scale)| brief(1.0 / scale)).collect();
    let question = if joints.iter().all(|(_, scale)| *scale < 1.0) {
        "Are they motor currents in amperes, or torques on the motor's side of the gears?"
    } else {
        "Are they counts of the drives?"
    };
    let scales: Vec<String> = joints.iter().map(|(_, scale)| brief(*scale)).collect();
    let statement = format!(
        "{} are {} times the model's, at every load. {question} Constants that fit: {} N·m per unit.",
        whose(&names, is_all),
        listed(&scales),
        constants.join(", ")
    );
    let remedy = format!("Scale these torques by {} in the mapping.", constants.join(", "));
    let each = names.into_iter().zip(joints);
    each.map(|(name, (_, scale))| finding(Some(name), *scale, &statement, &remedy)).collect()
}

fn finding(joint: Option<String>, scale: f64, statement: &str, remedy: &str) -> SetupFinding {
    SetupFinding {
        kind: "torque_unit",
        joint,
        value: scale,
        unit: "1",
        certainty: Certainty::Sure,
        statement: statement.to_owned(),
        remedy: remedy.to_owned(),
        gravity: None,
    }
}

fn whose(names: &[String], is_all: bool) -> String {
    match (is_all, names.len()) {
        (true, 2..) => "All torques".to_owned(),
        (_, 1) => format!("The torque of {}", names[0]),
        _ => format!("The torques of {}", listed(names)),
    }
}

fn times(scale: f64, count: usize) -> String {
    let verb = if count > 1 { "are" } else { "is" };
    if scale >= 1.0 {
        format!("{verb} {} times", brief(scale))
    } else {
        format!("{verb} 1/{} of", brief(1.0 / scale))
    }
}

/// The scale itself, or that of newton millimetres if it is near: a unit has no tolerance.
pub(crate) fn exact(scale: f64) -> f64 {
    if (scale.abs() / 1e3 - 1.0).abs() < SAME { 1e3_f64.copysign(scale) } else { scale }
}

/// A guess of the cause of a torque that is `scale` times as large.
fn guess(scale: f64, count: usize) -> String {
    let is = |value: f64| (scale / value - 1.0).abs() < SAME;
    let (they, drives) = if count > 1 { ("they", "these drives") } else { ("it", "this drive") };
    let are = if count > 1 { "Are" } else { "Is" };
    if is(1e3) {
        format!("{are} {they} in N·mm?")
    } else if is(1.0 / KILOGRAM_FORCE) {
        format!(
            "{are} {they} in amperes (a torque constant of {} N·m/A), or in kilograms of force (kgf·m)?",
            brief(1.0 / scale)
        )
    } else if scale >= 1.0 {
        format!("Does the feedback of {drives} lack a division by {}, or is it in counts?", brief(scale))
    } else {
        format!(
            "{are} {they} in amperes (a torque constant of {} N·m/A), or on the motor's side of a gear of {}?",
            brief(1.0 / scale),
            brief(1.0 / scale)
        )
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector3;

    use super::is_shared;
    use crate::conventions::change::Change;
    use crate::conventions::outcome::Outcome;

    /// A unit that no other joint has is a parameter of its own, in whatever way the search found it.
    #[test]
    fn a_unit_is_shared_with_another_joint() {
        let outcome = |scale: [f64; 2]| Outcome {
            changes: Vec::new(),
            evidence: 0.0,
            likelihood: Vec::new(),
            left: Vec::new(),
            spoken: Vec::new(),
            sizes: Vec::new(),
            floors: Vec::new(),
            gravity: Vector3::zeros(),
            scale: scale.to_vec(),
            sources: Vec::new(),
        };
        let other = [Change::Scale(0)];
        assert!(is_shared(&outcome([3.0, 3.0]), &Change::SameScale(1, 3.0), &other));
        assert!(!is_shared(&outcome([3.0, 7.0]), &Change::SameScale(1, 7.0), &other));
        assert!(!is_shared(&outcome([3.0, 7.0]), &Change::SameScale(1, 7.0), &[]));
    }
}
