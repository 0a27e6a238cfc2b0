//! `torque_sign`: a torque with an inverted sign.
//!
//! Tested for every joint, and for all joints together. The hypothesis inverts the sign of the torque.

use super::super::change::{Change, reading};
use super::super::finding::{Certainty, SetupFinding};
use super::{Ask, Results, listed};

/// The tested changes.
pub(crate) fn asks(ask: &Ask) -> Vec<Change> {
    let joints = if ask.has_torques { ask.arm.dof() } else { 0 };
    // The sign of a single joint is the common one.
    let common = (joints > 1).then_some(Change::CommonSign);
    (0..joints).map(Change::TorqueSign).chain(common).collect()
}

/// Words and remedy: one finding for all joints, or one each.
pub(crate) fn findings(results: &Results) -> Vec<SetupFinding> {
    let found = results.of(|change| matches!(change, Change::TorqueSign(_) | Change::CommonSign));
    let Some(&first) = found.first() else { return Vec::new() };
    let torques = reading(results.arm, &found).torques;
    let joints: Vec<usize> = (0..torques.len()).filter(|&joint| torques[joint].factor < 0.0).collect();
    let is_all = joints.len() == results.arm.dof();
    let names: Vec<String> = joints.iter().map(|&joint| results.name(joint)).collect();
    let whose = if is_all {
        "All torques".to_owned()
    } else {
        format!("The torque{} of {}", if names.len() > 1 { "s" } else { "" }, listed(&names))
    };
    let verb = if names.len() > 1 { "have" } else { "has" };
    let statement = format!(
        "{whose} {verb} the opposite sign to the model's: a positive torque must drive the joint in its positive direction.{}",
        results.rival(&first)
    );
    let finding = |joint: Option<String>| SetupFinding {
        kind: "torque_sign",
        joint,
        value: -1.0,
        unit: "1",
        certainty: Certainty::Sure,
        statement: statement.clone(),
        remedy: "Invert the sign of these torques in the mapping: a scale of -1.".to_owned(),
        gravity: None,
    };
    if is_all && names.len() > 1 {
        return vec![finding(None)];
    }
    names.into_iter().map(|name| finding(Some(name))).collect()
}
