//! Poses and velocities: q → poses; q → Jacobian; q, v → the tool's velocity-dependent acceleration.

use nalgebra::{DMatrix, Isometry3, Matrix3, Vector3, Vector6};

use crate::arm::Arm;
use crate::joint::JointKind;
use crate::spatial::Acceleration;
use crate::workspace::{Workspace, isometry};

/// Pose of the tool frame `tool0` in the base frame. The workspace keeps the poses of the links: [`Workspace::link_pose`].
///
/// # Panics
/// If the length of `q` or the workspace does not fit the arm.
pub fn forward_kinematics(arm: &Arm, ws: &mut Workspace, q: &[f64]) -> Isometry3<f64> {
    place_links(arm, ws, q);
    let (rotation, position) = tool_frame(arm, ws);
    isometry(&rotation, position)
}

/// The 6×n matrix `out` with v_tool = out · v: linear velocity of the tool origin in the first three rows, angular velocity in
/// the last three, both in world axes.
///
/// # Panics
/// If the length of `q`, the size of `out` or the workspace does not fit the arm.
pub fn jacobian(arm: &Arm, ws: &mut Workspace, q: &[f64], out: &mut DMatrix<f64>) {
    assert_eq!(out.shape(), (6, arm.dof()), "the Jacobian of an arm is 6 × its number of joints");
    place_links(arm, ws, q);
    let (_, tool) = tool_frame(arm, ws);
    for joint in 0..arm.dof() {
        out.column_mut(joint).copy_from(&jacobian_column(arm, ws, joint, &tool));
    }
}

/// J̇·v: the acceleration of the tool at v without joint accelerations; linear (m/s², of the tool origin) first, then angular (rad/s²),
/// world axes. It does not include gravity.
///
/// # Panics
/// If the length of `q` or `v` or the workspace does not fit the arm.
pub fn tool_bias_acceleration(arm: &Arm, ws: &mut Workspace, q: &[f64], v: &[f64]) -> Vector6<f64> {
    place_links(arm, ws, q);
    turn_links(arm, ws, v);
    let mut last = Acceleration::default();
    for link in &ws.links {
        last = Acceleration {
            angular: last.angular + link.drift.angular,
            linear: last.linear + last.angular.cross(&link.from_parent) + link.drift.linear,
        };
    }
    let link = &ws.links[arm.dof() - 1];
    let lever = link.rotation * arm.tool().translation.vector;
    let linear = last.linear + last.angular.cross(&lever) + link.omega.cross(&link.omega.cross(&lever));
    Vector6::new(linear.x, linear.y, linear.z, last.angular.x, last.angular.y, last.angular.z)
}

/// Rotation and position of the tool, after [`place_links`].
pub(crate) fn tool_frame(arm: &Arm, ws: &Workspace) -> (Matrix3<f64>, Vector3<f64>) {
    let link = &ws.links[arm.dof() - 1];
    let rotation = link.rotation * arm.tool().rotation.to_rotation_matrix().matrix();
    (rotation, link.position + link.rotation * arm.tool().translation.vector)
}

/// Column `joint` of the Jacobian at the point `tool`, after [`place_links`].
pub(crate) fn jacobian_column(arm: &Arm, ws: &Workspace, joint: usize, tool: &Vector3<f64>) -> Vector6<f64> {
    let link = &ws.links[joint];
    let (linear, angular) = match arm.constants()[joint].kind {
        JointKind::Revolute => (link.axis.cross(&(tool - link.position)), link.axis),
        JointKind::Prismatic => (link.axis, Vector3::zeros()),
    };
    Vector6::new(linear.x, linear.y, linear.z, angular.x, angular.y, angular.z)
}

/// Rotation, position and axis of every link at `q`.
#[inline(always)]
pub(crate) fn place_links(arm: &Arm, ws: &mut Workspace, q: &[f64]) {
    ws.check_sizes(arm, [q.len()]);
    let mut rotation = Matrix3::identity();
    let mut position = Vector3::zeros();
    for ((link, joint), &q) in ws.links.iter_mut().zip(arm.constants()).zip(q) {
        link.axis = rotation * joint.axis;
        link.from_parent = rotation * (joint.offset + joint.slide * q);
        if let Some(placed) = &joint.placed {
            rotation *= placed;
        }
        if joint.kind == JointKind::Revolute {
            rotation = joint.turn.applied(&rotation, q);
        }
        position += link.from_parent;
        link.rotation = rotation;
        link.position = position;
    }
}

/// Angular velocity of every link at `v`, and the velocity-dependent part of each link's acceleration, after [`place_links`]. With r the
/// vector from the parent's origin and s the axis, it is ω×(s q̇) for the angular part of a revolute joint and ω×(ω×r), for a prismatic
/// joint + 2 ω×(s q̇) (Coriolis 1835), for the linear part; ω is the parent's.
#[inline(always)]
pub(crate) fn turn_links(arm: &Arm, ws: &mut Workspace, v: &[f64]) {
    ws.check_sizes(arm, [v.len()]);
    let mut omega = Vector3::zeros();
    for ((link, joint), &v) in ws.links.iter_mut().zip(arm.constants()).zip(v) {
        let motion = link.axis * v;
        let centripetal = omega.cross(&omega.cross(&link.from_parent));
        match joint.kind {
            JointKind::Revolute => {
                link.drift = Acceleration { angular: omega.cross(&motion), linear: centripetal };
                omega += motion;
            }
            JointKind::Prismatic => {
                let linear = centripetal + omega.cross(&motion) * 2.0;
                link.drift = Acceleration { angular: Vector3::zeros(), linear };
            }
        }
        link.omega = omega;
    }
}
