//! `joint_zero`: a joint whose zero is elsewhere: a quarter or half turn, another convention, a home position.
//!
//! It asks in steps of 30 degrees for every turning joint; multiples of 90 are taken as they are, others are fitted. The hypothesis
//! takes the offset off the positions. A small offset is the catalogue's `encoder_offset`.

use std::f64::consts::PI;

use freeplay_arm::JointKind;

use super::super::change::Change;
use super::super::finding::SetupFinding;
use super::brief;
use super::{Ask, Told};

/// An encoder's zero that is off by no more than this is the catalogue's, rad: its law holds up to here.
pub(crate) const LEAST: f64 = 0.3;
/// A small one to start from.
const SMALL: f64 = 0.5 * LEAST;
/// Parts of half a turn that are asked for, how wide they are, rad, and how many of them make a right angle.
const PARTS: i8 = 6;
pub(crate) const STEP: f64 = PI / 6.0;
const RIGHT: i8 = 3;

/// What it asks.
pub(crate) fn asks(ask: &Ask) -> Vec<Change> {
    let turning = (0..ask.arm.dof()).filter(|&joint| ask.arm.joints()[joint].kind == JointKind::Revolute);
    let of_joint = |joint| {
        (1 - PARTS..=PARTS).filter(|part| *part != 0).map(move |part| Change::Zero {
            joint,
            offset: f64::from(part) * STEP,
            is_fitted: part % RIGHT != 0,
        })
    };
    let small = |joint| [SMALL, -SMALL].map(|offset| Change::Zero { joint, offset, is_fitted: true });
    turning.clone().flat_map(of_joint).chain(turning.flat_map(small)).collect()
}

/// Words and remedy.
pub(crate) fn says(told: &Told) -> Vec<SetupFinding> {
    let found = told.of(|change| matches!(change, Change::Zero { .. }));
    let one = |(change, certainty)| {
        let Change::Zero { joint, offset, .. } = change else { return None };
        let (name, degrees) = (told.name(joint), brief(offset.to_degrees()));
        Some(SetupFinding {
            kind: "joint_zero",
            value: offset,
            unit: "rad",
            certainty,
            statement: format!(
                "{name} reads {degrees} degrees where the model has its zero.{}",
                told.rival(&change)
            ),
            remedy: format!(
                "Take {} rad off {name} in the mapping, or turn its frame in the model.",
                brief(offset)
            ),
            joint: Some(name),
            gravity: None,
        })
    };
    found.into_iter().filter_map(one).collect()
}
