//! Kinematics against finite differences, and the link poses against the chain of placements.

use crate::common::{Random, close, size};
use freeplay_arm::{Arm, JointKind, Workspace, forward_kinematics, jacobian, tool_bias_acceleration};
use nalgebra::{DMatrix, DVector, Isometry3, Translation3, Unit, UnitQuaternion, Vector3, Vector6};

/// The pose of the tool as a product of poses joint after joint: an algorithm independent of the crate's.
fn chained(arm: &Arm, q: &[f64]) -> Isometry3<f64> {
    let mut pose = Isometry3::identity();
    for (joint, &q) in arm.joints().iter().zip(q) {
        pose *= joint.placement;
        pose *= match joint.kind {
            JointKind::Revolute => Isometry3::from_parts(
                Translation3::identity(),
                UnitQuaternion::from_axis_angle(&joint.axis, q),
            ),
            JointKind::Prismatic => Isometry3::from_parts(
                Translation3::from(joint.axis.into_inner() * q),
                UnitQuaternion::identity(),
            ),
        };
    }
    pose * arm.tool()
}

/// The motion from `from` to `to`: displacement and rotation vector, world axes.
fn twist(from: &Isometry3<f64>, to: &Isometry3<f64>) -> Vector6<f64> {
    let linear = to.translation.vector - from.translation.vector;
    let angular = (to.rotation * from.rotation.inverse()).scaled_axis();
    Vector6::new(linear.x, linear.y, linear.z, angular.x, angular.y, angular.z)
}

#[test]
fn tool_pose_is_the_product_of_the_poses_along_the_chain() {
    let mut worst = 0.0_f64;
    for dof in 1..=12 {
        let mut random = Random(dof);
        let arm = random.arm(dof as usize);
        let mut ws = Workspace::new(&arm);
        let q = random.values(arm.dof(), 3.0);
        let pose = forward_kinematics(&arm, &mut ws, &q);
        let expected = chained(&arm, &q);
        assert!(expected.translation.vector.norm() > 0.01);
        worst = worst.max(twist(&expected, &pose).norm());
        let last = ws.link_pose(arm.dof() - 1) * arm.tool();
        worst = worst.max(twist(&expected, &last).norm());
    }
    close("tool pose", worst, 1e-14);
}

/// An axis next to a coordinate axis, closer than the rounding of its largest component, is still not that axis.
#[test]
fn an_axis_near_a_coordinate_axis_keeps_its_tilt() {
    let mut random = Random(77);
    let mut joint = random.joint(1);
    joint.kind = JointKind::Revolute;
    joint.axis = Unit::new_normalize(Vector3::new(1.0, 1e-9, 0.0));
    assert_eq!(joint.axis.x, 1.0);
    let arm =
        Arm::new("tilted", vec![joint], Isometry3::translation(0.0, 0.0, 1.0), Vector3::zeros()).unwrap();
    let pose = forward_kinematics(&arm, &mut Workspace::new(&arm), &[2.0]);
    close("tilted axis", twist(&chained(&arm, &[2.0]), &pose).norm(), 1e-15);
}

#[test]
fn jacobian_is_the_derivative_of_the_pose() {
    let mut worst = 0.0_f64;
    for dof in 1..=12 {
        let mut random = Random(50 + dof);
        let arm = random.arm(dof as usize);
        let n = arm.dof();
        let mut ws = Workspace::new(&arm);
        let q = random.values(n, 3.0);
        let mut j = DMatrix::zeros(6, n);
        jacobian(&arm, &mut ws, &q, &mut j);
        for i in 0..n {
            let h = 1e-5;
            let (mut ahead, mut behind) = (q.clone(), q.clone());
            ahead[i] += h;
            behind[i] -= h;
            let (ahead, behind) = (chained(&arm, &ahead), chained(&arm, &behind));
            let difference = twist(&behind, &ahead) / (2.0 * h);
            assert!(difference.norm() > 0.1, "the joint moves the tool");
            worst = worst.max((difference - j.column(i)).norm());
        }
    }
    close("Jacobian against central differences", worst, 1e-9);
}

#[test]
fn bias_acceleration_is_the_derivative_of_the_jacobian_along_the_motion() {
    let (mut worst, mut curved) = (0.0_f64, 0);
    for dof in 2..=12 {
        let mut random = Random(90 + dof);
        let arm = random.arm(dof as usize);
        let n = arm.dof();
        let mut ws = Workspace::new(&arm);
        let (q, v) = (random.values(n, 3.0), random.values(n, 1.0));
        let h = 1e-5;
        let mut at = |t: f64| {
            let moved: Vec<f64> = q.iter().zip(&v).map(|(q, v)| q + t * v).collect();
            let mut j = DMatrix::zeros(6, n);
            jacobian(&arm, &mut ws, &moved, &mut j);
            j * DVector::from_vec(v.clone())
        };
        let difference = (at(h) - at(-h)) / (2.0 * h);
        let bias = tool_bias_acceleration(&arm, &mut ws, &q, &v);
        curved += usize::from(size(difference.as_slice()) > 1e-3);
        worst = worst.max((difference - bias).norm());
    }
    assert!(curved >= 9, "the motion is curved, but for arms of slides");
    close("J̇ v against central differences", worst, 1e-8);
}
