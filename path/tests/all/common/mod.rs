//! Arms for the tests.

use freeplay_arm::{Arm, Inertia, Joint, JointFriction, JointKind, Limits};
use nalgebra::{Isometry3, Matrix3, Translation3, Unit, UnitQuaternion, Vector3};

/// The arm of the reference runs.
pub fn paper_arm() -> Arm {
    freeplay_model::paper_arm().arm
}

/// The same arm without any limit.
pub fn unlimited_paper_arm() -> Arm {
    let arm = paper_arm();
    let joints = arm.joints().iter().map(|joint| Joint { limits: Limits::NONE, ..joint.clone() });
    Arm::new("unlimited", joints.collect(), *arm.tool(), *arm.gravity()).expect("a valid arm")
}

/// A joint about (or along) `axis`, placed at `offset` from the previous one, with a link of 1 kg.
pub fn joint(name: &str, kind: JointKind, axis: Vector3<f64>, offset: [f64; 3]) -> Joint {
    Joint {
        name: name.to_owned(),
        kind,
        axis: Unit::new_normalize(axis),
        placement: shift(offset),
        limits: Limits::NONE,
        friction: JointFriction { viscous: 0.0, coulomb: 0.0 },
        rotor_inertia: 0.0,
        inertia: Inertia { mass: 1.0, com: Vector3::zeros(), about_com: Matrix3::identity() * 0.01 },
    }
}

pub fn shift(offset: [f64; 3]) -> Isometry3<f64> {
    Isometry3::from_parts(Translation3::from(Vector3::from(offset)), UnitQuaternion::identity())
}

pub fn chain(joints: Vec<Joint>, tool: [f64; 3]) -> Arm {
    Arm::new("test", joints, shift(tool), Vector3::new(0.0, 0.0, -9.81)).expect("a valid arm")
}

/// One revolute joint about y with limits.
pub fn pendulum() -> Arm {
    let mut only = joint("pivot", JointKind::Revolute, Vector3::y(), [0.0; 3]);
    only.limits = Limits { lower: -1.0, upper: 2.0, velocity: 0.5, acceleration: 4.0, effort: 10.0 };
    chain(vec![only], [0.5, 0.0, 0.0])
}

/// Three parallel vertical axes: the tool stays in the plane z = 0.
pub fn planar() -> Arm {
    let names = ["a", "b", "c"];
    let joints = names.iter().zip([0.0, 0.5, 0.4]);
    let joints = joints.map(|(name, x)| joint(name, JointKind::Revolute, Vector3::z(), [x, 0.0, 0.0]));
    chain(joints.collect(), [0.3, 0.0, 0.0])
}

/// Three joints that position the tool in space: a rotating column, a lift, and a slide.
pub fn cylindrical() -> Arm {
    let joints = vec![
        joint("column", JointKind::Revolute, Vector3::z(), [0.0; 3]),
        joint("lift", JointKind::Prismatic, Vector3::z(), [0.0; 3]),
        joint("slide", JointKind::Prismatic, Vector3::x(), [0.2, 0.0, 0.0]),
    ];
    chain(joints, [0.1, 0.0, 0.0])
}

/// Seven joints, one of them redundant.
pub fn redundant() -> Arm {
    let (x, y, z) = (Vector3::x(), Vector3::y(), Vector3::z());
    let joints = vec![
        joint("1", JointKind::Revolute, z, [0.0, 0.0, 0.3]),
        joint("2", JointKind::Revolute, y, [0.0, 0.0, 0.2]),
        joint("3", JointKind::Revolute, z, [0.0, 0.0, 0.3]),
        joint("4", JointKind::Revolute, y, [0.0, 0.0, 0.3]),
        joint("5", JointKind::Revolute, x, [0.3, 0.0, 0.0]),
        joint("6", JointKind::Revolute, y, [0.3, 0.0, 0.0]),
        joint("7", JointKind::Revolute, x, [0.05, 0.0, 0.0]),
    ];
    chain(joints, [0.1, 0.0, 0.0])
}
