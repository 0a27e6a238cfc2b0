//! Inverse dynamics: q, v, a → tau, and the wrench across each joint.

use nalgebra::Vector3;

use crate::arm::Arm;
use crate::joint::JointKind;
use crate::kinematics::{place_links, turn_links};
use crate::link::LinkConstants;
use crate::spatial::{Acceleration, Wrench};
use crate::workspace::{LinkState, Workspace, WrenchSource};

/// Joint torques `tau` (N·m or N) that give the accelerations `a` at `q`, `v`, with gravity and without joint friction: tau = M(q) a + h(q,
/// v). The recursive Newton–Euler algorithm (Luh, Walker & Paul 1980; Featherstone 2008, §5.3), with classical accelerations of the link
/// origins in world axes.
///
/// # Panics
/// If a slice or the workspace does not fit the arm.
pub fn rnea(arm: &Arm, ws: &mut Workspace, q: &[f64], v: &[f64], a: &[f64], tau: &mut [f64]) {
    ws.check_sizes(arm, [a.len(), tau.len()]);
    place_links(arm, ws, q);
    turn_links(arm, ws, v);
    newton_euler(arm, ws, |i| a[i], tau);
}

/// The torques `out` (N·m or N) that keep the velocity `v` constant at `q`: [`rnea`] with a = 0, also called h or nle.
///
/// # Panics
/// If a slice or the workspace does not fit the arm.
pub fn bias(arm: &Arm, ws: &mut Workspace, q: &[f64], v: &[f64], out: &mut [f64]) {
    ws.check_sizes(arm, [out.len()]);
    place_links(arm, ws, q);
    turn_links(arm, ws, v);
    newton_euler(arm, ws, |_| 0.0, out);
}

/// The torques `out` (N·m or N) that hold the arm still at `q`: [`rnea`] with v = a = 0.
///
/// # Panics
/// If a slice or the workspace does not fit the arm.
pub fn gravity_torque(arm: &Arm, ws: &mut Workspace, q: &[f64], out: &mut [f64]) {
    ws.check_sizes(arm, [out.len()]);
    place_links(arm, ws, q);
    let mut carried = Wrench::default();
    for i in (0..arm.dof()).rev() {
        let (link, joint) = (&mut ws.links[i], &arm.constants()[i]);
        let force = arm.gravity() * -joint.mass;
        let moment = -(link.rotation * joint.first_moment).cross(arm.gravity());
        link.wrench = Wrench { moment: moment + carried.moment, force: force + carried.force };
        out[i] = along_axis(joint.kind, &link.axis, &link.wrench);
        carried = link.wrench.about_point(&link.from_parent);
    }
    ws.wrench_source = WrenchSource::Transmitted;
}

/// Force (N) and moment (N·m) across joint number `joint` (from 0) onto its link, motor torque included, in the link frame of that joint;
/// the moment is about its origin. Call it directly after [`rnea`], [`bias`], [`gravity_torque`], [`crate::aba`] or [`crate::hybrid_aba`].
///
/// # Panics
/// If `joint` is not below the number of joints.
pub fn joint_reaction(ws: &Workspace, joint: usize) -> (Vector3<f64>, Vector3<f64>) {
    let link = &ws.links[joint];
    let mut wrench = link.wrench;
    if ws.wrench_source == WrenchSource::Articulated {
        wrench.add(&link.articulated.times(&link.acceleration));
    }
    (link.rotation.tr_mul(&wrench.force), link.rotation.tr_mul(&wrench.moment))
}

/// The part of a wrench that the joint's motor must provide.
#[inline(always)]
pub(crate) fn along_axis(kind: JointKind, axis: &Vector3<f64>, wrench: &Wrench) -> f64 {
    match kind {
        JointKind::Revolute => axis.dot(&wrench.moment),
        JointKind::Prismatic => axis.dot(&wrench.force),
    }
}

/// Motor torque for a wrench across its joint and the acceleration `a` of its rotor.
#[inline(always)]
pub(crate) fn motor_torque(joint: &LinkConstants, axis: &Vector3<f64>, wrench: &Wrench, a: f64) -> f64 {
    let transmitted = along_axis(joint.kind, axis, wrench);
    // Without a rotor the result stays the same to the sign of zero.
    if joint.rotor_inertia == 0.0 { transmitted } else { transmitted + joint.rotor_inertia * a }
}

/// Acceleration of a link from its parent's, without the part of the joint's own acceleration.
#[inline(always)]
pub(crate) fn carried_acceleration(parent: &Acceleration, link: &LinkState) -> Acceleration {
    Acceleration {
        angular: parent.angular + link.drift.angular,
        linear: parent.linear + parent.angular.cross(&link.from_parent) + link.drift.linear,
    }
}

/// Adds the joint's own acceleration `a`.
#[inline(always)]
pub(crate) fn accelerate(acceleration: &mut Acceleration, kind: JointKind, axis: &Vector3<f64>, a: f64) {
    match kind {
        JointKind::Revolute => acceleration.angular += axis * a,
        JointKind::Prismatic => acceleration.linear += axis * a,
    }
}

/// The wrench that gives a link its acceleration; Newton–Euler about the link origin.
#[inline(always)]
fn link_wrench(joint: &LinkConstants, link: &LinkState) -> Wrench {
    let Acceleration { angular, linear } = &link.acceleration;
    let h = link.rotation * joint.first_moment;
    let turned_h = link.omega.cross(&h);
    let force = linear * joint.mass + angular.cross(&h) + link.omega.cross(&turned_h);
    // Rotating the vectors into the link frame is cheaper than rotating the tensor to the world for two products.
    let omega = link.rotation.tr_mul(&link.omega);
    let local =
        joint.inertia.times(&link.rotation.tr_mul(angular)) + omega.cross(&joint.inertia.times(&omega));
    Wrench { moment: link.rotation * local + h.cross(linear), force }
}

/// Accelerations outwards, wrenches inwards, after `place_links` and `turn_links`.
#[inline(always)]
fn newton_euler(arm: &Arm, ws: &mut Workspace, a: impl Fn(usize) -> f64, tau: &mut [f64]) {
    let mut acceleration = Acceleration { angular: Vector3::zeros(), linear: -arm.gravity() };
    for (i, (link, joint)) in ws.links.iter_mut().zip(arm.constants()).enumerate() {
        acceleration = carried_acceleration(&acceleration, link);
        accelerate(&mut acceleration, joint.kind, &link.axis, a(i));
        link.acceleration = acceleration;
        link.wrench = link_wrench(joint, link);
    }
    let mut carried = Wrench::default();
    for (i, ((link, joint), tau)) in ws.links.iter_mut().zip(arm.constants()).zip(tau).enumerate().rev() {
        link.wrench.add(&carried);
        *tau = motor_torque(joint, &link.axis, &link.wrench, a(i));
        carried = link.wrench.about_point(&link.from_parent);
    }
    ws.wrench_source = WrenchSource::Transmitted;
}
