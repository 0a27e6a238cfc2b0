//! Arms for several tests.

use freeplay_arm::{Arm, Inertia, Joint, JointFriction, JointKind, Limits};
use nalgebra::{Isometry3, Matrix3, Unit, Vector3};

/// Moment of inertia of the pendulum about its joint, kg·m².
pub const INERTIA: f64 = 0.02;
/// Mass of the pendulum, kg, and distance of its centre from the joint, m.
pub const MASS: f64 = 0.5;
pub const LEVER: f64 = 0.1;

fn joint(name: &str, axis: Vector3<f64>, placement: Isometry3<f64>) -> Joint {
    Joint {
        name: name.to_owned(),
        kind: JointKind::Revolute,
        axis: Unit::new_normalize(axis),
        placement,
        limits: Limits::NONE,
        friction: JointFriction::default(),
        rotor_inertia: 0.0,
        inertia: Inertia {
            mass: MASS,
            com: Vector3::new(LEVER, 0.0, 0.0),
            about_com: Matrix3::identity() * (INERTIA - MASS * LEVER * LEVER),
        },
    }
}

/// A pendulum about a horizontal axis, horizontal at zero, under the gravity `g`, m/s².
pub fn pendulum(g: f64) -> Arm {
    let joints = vec![joint("only", Vector3::new(0.0, -1.0, 0.0), Isometry3::identity())];
    Arm::new("pendulum", joints, Isometry3::translation(0.2, 0.0, 0.0), Vector3::new(0.0, 0.0, -g)).unwrap()
}

/// Two such links in series.
pub fn two_links(g: f64) -> Arm {
    let axis = Vector3::new(0.0, -1.0, 0.0);
    let joints = vec![
        joint("first", axis, Isometry3::identity()),
        joint("second", axis, Isometry3::translation(0.2, 0.0, 0.0)),
    ];
    Arm::new("two", joints, Isometry3::translation(0.2, 0.0, 0.0), Vector3::new(0.0, 0.0, -g)).unwrap()
}

/// `count` stamps `step` s apart.
pub fn stamps(count: usize, step: f64) -> Vec<f64> {
    (0..count).map(|row| row as f64 * step).collect()
}
