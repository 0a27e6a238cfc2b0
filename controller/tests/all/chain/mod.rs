//! Arms with any number of joints.

use freeplay_arm::{Arm, Inertia, Joint, JointFriction, JointKind, Limits};
use nalgebra::{Isometry3, Matrix3, Unit, Vector3};

/// A chain of `n` joints about alternating axes, with links of 0.3 m, all with the same limits.
pub fn chain(n: usize, limits: Limits) -> Arm {
    let joints = (0..n)
        .map(|i| Joint {
            name: format!("joint_{i}"),
            kind: JointKind::Revolute,
            axis: Unit::new_normalize(Vector3::ith(i % 3, 1.0)),
            placement: Isometry3::translation(0.1, 0.05, 0.3),
            limits,
            friction: JointFriction { viscous: 0.0, coulomb: 0.0 },
            rotor_inertia: 0.0,
            inertia: Inertia {
                mass: 1.0,
                com: Vector3::new(0.05, 0.0, 0.1),
                about_com: Matrix3::identity() * 0.01,
            },
        })
        .collect();
    Arm::new("chain", joints, Isometry3::translation(0.1, 0.0, 0.2), Vector3::new(0.0, 0.0, -9.81)).unwrap()
}
