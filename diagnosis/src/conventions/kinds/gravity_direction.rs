//! `gravity_direction`: an arm that hangs from a ceiling or stands out from a wall, while its model stands upright.
//!
//! Tested: the six faces of a cube and any direction, as three linear parameters in the base frame, never two angles. The hypothesis rotates gravity in the
//! model. A small angle is the catalogue's `base_tilt`.

use freeplay_arm::Arm;
use nalgebra::Vector3;

use super::super::change::Change;
use super::super::finding::{Certainty, SetupFinding};
use super::super::outcome::Outcome;
use super::{Ask, Results, brief};

/// Greatest tilt of a base in the catalogue, rad: mountings are rotated by 30 degrees and more.
pub(crate) const LEAST: f64 = 0.44;

/// The angle between the gravity of `outcome` and the model's, rad.
pub(crate) fn angle(arm: &Arm, outcome: &Outcome) -> f64 {
    outcome.gravity.angle(arm.gravity())
}

/// The tested changes.
pub(crate) fn asks(ask: &Ask) -> Vec<Change> {
    let size = ask.arm.gravity().norm();
    if !ask.has_torques || size == 0.0 {
        return Vec::new();
    }
    let axes = [Vector3::x(), Vector3::y(), Vector3::z()];
    let faces = axes.into_iter().flat_map(|axis| [axis * size, axis * -size]);
    let others = faces.filter(|face| face.angle(ask.arm.gravity()) > LEAST);
    others.map(Change::Gravity).chain([Change::AnyGravity]).collect()
}

/// Words and remedy.
pub(crate) fn findings(results: &Results) -> Vec<SetupFinding> {
    let found = results.of(|change| matches!(change, Change::Gravity(_) | Change::AnyGravity));
    let Some(&change) = found.first() else { return Vec::new() };
    let (gravity, angle) = (results.best.gravity, angle(results.arm, results.best));
    let numbers: Vec<String> = gravity.iter().map(|x| format!("{}", (x * 1e4).round() / 1e4)).collect();
    let standing = if angle > 2.8 {
        "The arm hangs upside down compared with its model"
    } else if (angle - std::f64::consts::FRAC_PI_2).abs() < 0.1 {
        "The arm is mounted on a wall"
    } else {
        "The arm's base is tilted"
    };
    vec![SetupFinding {
        kind: "gravity_direction",
        joint: None,
        value: angle,
        unit: "rad",
        certainty: Certainty::Sure,
        statement: format!(
            "{standing}: its torques show gravity rotated by {} degrees, [{}] m/s² in the base frame.{}",
            brief(angle.to_degrees()),
            numbers.join(", "),
            results.rival(&change)
        ),
        remedy: format!("Write gravity = [{}] into the arm file.", numbers.join(", ")),
        gravity: Some([gravity.x, gravity.y, gravity.z]),
    }]
}
