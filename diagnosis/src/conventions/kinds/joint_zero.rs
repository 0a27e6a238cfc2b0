//! `joint_zero`: a joint with another zero: a quarter or half turn, another convention, a home position.
//!
//! Tested in steps of 30 degrees for every revolute joint; multiples of 90 stay exact, others are fitted. The hypothesis subtracts the offset from the
//! positions. A small offset is the catalogue's `encoder_offset`.

use std::f64::consts::PI;

use freeplay_arm::JointKind;

/// Greatest encoder offset of the catalogue, rad.
pub(crate) use freeplay_laws::catalogue::MOST_ENCODER_OFFSET as LEAST;

use super::super::change::Change;
use super::super::finding::{Certainty, SetupFinding};
use super::{Ask, Results, brief};

/// The name of this kind of finding.
const KIND: &str = "joint_zero";
/// Number of tested parts of half a turn: a fit that starts within 15 degrees of an offset finds it, and right angles are among them.
const PARTS: i8 = 6;

/// The width of such a part, rad.
pub(crate) fn step() -> f64 {
    PI / f64::from(PARTS)
}

/// The tested changes.
pub(crate) fn asks(ask: &Ask) -> Vec<Change> {
    let turning = (0..ask.arm.dof()).filter(|&joint| ask.arm.joints()[joint].kind == JointKind::Revolute);
    let of_joint = |joint| {
        (1 - PARTS..=PARTS).filter(|part| *part != 0).map(move |part| Change::Zero {
            joint,
            offset: f64::from(part) * step(),
            is_fitted: part % (PARTS / 2) != 0,
        })
    };
    let small =
        |joint| [0.5 * LEAST, -0.5 * LEAST].map(|offset| Change::Zero { joint, offset, is_fitted: true });
    turning.clone().flat_map(of_joint).chain(turning.flat_map(small)).collect()
}

/// Words and remedy.
pub(crate) fn findings(results: &Results) -> Vec<SetupFinding> {
    let found = results.of(|change| matches!(change, Change::Zero { .. }));
    let one = |change: Change| {
        let Change::Zero { joint, offset, .. } = change else { return None };
        Some(finding(&results.name(joint), offset, &results.rival(&change)))
    };
    found.into_iter().filter_map(one).collect()
}

/// The finding that the joint `name` reads `offset` rad where the model has its zero, with a sentence on its `rival`.
fn finding(name: &str, offset: f64, rival: &str) -> SetupFinding {
    SetupFinding {
        kind: KIND,
        value: offset,
        unit: "rad",
        certainty: Certainty::Sure,
        statement: format!("{}{rival}", statement(name, offset)),
        remedy: format!(
            "Subtract {} rad from {name} in the mapping, or rotate its frame in the model.",
            brief(offset)
        ),
        joint: Some(name.to_owned()),
        gravity: None,
    }
}

fn statement(name: &str, offset: f64) -> String {
    format!("{name} reads {} degrees where the model has its zero.", brief(offset.to_degrees()))
}

/// Half the width of the range in which a fitted zero is uncertain, rad: as far as the catalogue has an effect for the same change.
pub(crate) fn unsure() -> f64 {
    LEAST
}

/// Returns true if a `zero` was fitted: it is no multiple of a quarter turn.
pub(crate) fn is_fitted(zero: f64) -> bool {
    let quarters = zero / (0.5 * PI);
    (quarters - quarters.round()).abs() > f64::EPSILON.sqrt()
}

/// Changes those of `findings` that concern the zero of the joint `name`: it reads `offset` rad there.
pub(crate) fn restate(findings: &mut [SetupFinding], name: &str, offset: f64) {
    let is_own = |one: &&mut SetupFinding| one.kind == KIND && one.joint.as_deref() == Some(name);
    for one in findings.iter_mut().filter(is_own) {
        let rival = one.statement.strip_prefix(&statement(name, one.value)).unwrap_or_default().to_owned();
        *one = SetupFinding { certainty: one.certainty, ..finding(name, offset, &rival) };
    }
}
