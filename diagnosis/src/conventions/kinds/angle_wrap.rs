//! `angle_wrap`: positions that jump by a whole turn, since their controller counts within one turn.
//!
//! Tested: a revolute joint's position jumps by one turn, in rad or in degrees, between two samples, while it moves by far less before and after. The reading
//! removes the jumps: [`unwrapped`].

use freeplay_arm::{Arm, JointKind};
use freeplay_recording::{Recording, unwrapped};

use super::super::finding::{Certainty, SetupFinding};
use super::listed;

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
            "The position of {} jumps by a whole turn: its controller counts within one turn only. The program removes the jumps.",
            listed(&names)
        ),
        remedy: "Set unwrap = true under [q] in the mapping.".to_owned(),
        gravity: None,
    };
    names.iter().map(one).collect()
}
