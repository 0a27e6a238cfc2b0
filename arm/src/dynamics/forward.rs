//! Forward dynamics: q, v and the drive of each joint → accelerations.

use nalgebra::Vector3;

use crate::arm::Arm;
use crate::dynamics::inverse::{accelerate, along_axis, carried_acceleration, motor_torque};
use crate::joint::JointKind;
use crate::kinematics::{place_links, turn_links};
use crate::link::LinkConstants;
use crate::spatial::{Acceleration, ArticulatedInertia, Wrench};
use crate::workspace::{LinkState, Workspace, WrenchSource};

/// The drive of a joint.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Drive {
    /// A torque (N·m) or force (N); the algorithm computes the acceleration.
    Torque(f64),
    /// A prescribed acceleration (rad/s² or m/s²); the algorithm computes the torque.
    Acceleration(f64),
}

/// Joint accelerations `a` (rad/s² or m/s²) under the torques `tau` at `q`, `v`, with gravity and without joint friction: the solution of
/// M(q) a = tau − h(q, v). The articulated-body algorithm (Featherstone 1983; 2008, §7.3), O(n).
///
/// At a posture where a joint moves no inertia the result is not finite; [`Arm::new`] excludes arms for which this holds at every posture.
///
/// # Panics
/// If a slice or the workspace does not fit the arm.
pub fn aba(arm: &Arm, ws: &mut Workspace, q: &[f64], v: &[f64], tau: &[f64], a: &mut [f64]) {
    ws.check_sizes(arm, [tau.len(), a.len()]);
    place_links(arm, ws, q);
    turn_links(arm, ws, v);
    gather(arm, ws, |i| Drive::Torque(tau[i]));
    spread(arm, ws, |i| Drive::Torque(tau[i]), |i, acceleration, _| a[i] = acceleration);
}

/// Forward dynamics where some joints follow a prescribed motion (Featherstone 2008, §9.2). For a joint with [`Drive::Acceleration`] the
/// function copies that value to `a` and writes the necessary torque to `tau`; for the others it copies the given torque to `tau` and
/// writes the acceleration to `a`. A prescribed joint transmits the full inertia beyond it.
///
/// # Panics
/// If a slice or the workspace does not fit the arm.
pub fn hybrid_aba(
    arm: &Arm,
    ws: &mut Workspace,
    q: &[f64],
    v: &[f64],
    drive: &[Drive],
    a: &mut [f64],
    tau: &mut [f64],
) {
    ws.check_sizes(arm, [drive.len(), a.len(), tau.len()]);
    place_links(arm, ws, q);
    turn_links(arm, ws, v);
    gather(arm, ws, |i| drive[i]);
    spread(
        arm,
        ws,
        |i| drive[i],
        |i, acceleration, torque| {
            a[i] = acceleration;
            tau[i] = torque;
        },
    );
}

/// Calls `report` with the effective inertia (kg·m² or kg) of each joint when all joints beyond it are free, at `q`.
pub(crate) fn effective_inertias(
    arm: &Arm,
    ws: &mut Workspace,
    q: &[f64],
    mut report: impl FnMut(usize, f64),
) {
    place_links(arm, ws, q);
    for link in &mut ws.links {
        link.omega = Vector3::zeros();
        link.drift = Acceleration::default();
    }
    gather(arm, ws, |_| Drive::Torque(0.0));
    for (i, link) in ws.links.iter().enumerate() {
        report(i, 1.0 / link.inverse_effective);
    }
}

/// Adds the link itself to the inertia and the wrench of the links beyond: its inertia, and its velocity-dependent wrench.
#[inline(always)]
fn add_link(joint: &LinkConstants, link: &LinkState, inertia: &mut ArticulatedInertia, wrench: &mut Wrench) {
    let j = joint.inertia.rotated(&link.rotation);
    let h = link.rotation * joint.first_moment;
    inertia.add_body(&j, joint.mass, &h);
    wrench.moment += link.omega.cross(&j.times(&link.omega));
    wrench.force += link.omega.cross(&link.omega.cross(&h));
}

/// Articulated inertias and bias wrenches, from the last link inwards, after `place_links` and `turn_links`.
#[inline(always)]
fn gather(arm: &Arm, ws: &mut Workspace, drive: impl Fn(usize) -> Drive) {
    let mut inertia = ArticulatedInertia::default();
    let mut wrench = Wrench::default();
    for (i, (link, joint)) in ws.links.iter_mut().zip(arm.constants()).enumerate().rev() {
        if !joint.massless {
            add_link(joint, link, &mut inertia, &mut wrench);
        }
        link.articulated = inertia;
        link.wrench = wrench;
        match drive(i) {
            Drive::Acceleration(a) => {
                let mut drift = link.drift;
                accelerate(&mut drift, joint.kind, &link.axis, a);
                wrench.add(&inertia.times(&drift));
            }
            Drive::Torque(tau) => {
                let column = match joint.kind {
                    JointKind::Revolute => inertia.turning_column(&link.axis),
                    JointKind::Prismatic => inertia.sliding_column(&link.axis),
                };
                let inverse_effective =
                    1.0 / (along_axis(joint.kind, &link.axis, &column) + joint.rotor_inertia);
                let residual = tau - along_axis(joint.kind, &link.axis, &wrench);
                inertia.subtract_outer(inverse_effective, &column);
                wrench.add(&inertia.times(&link.drift));
                let push = inverse_effective * residual;
                wrench.moment += column.moment * push;
                wrench.force += column.force * push;
                (link.column, link.inverse_effective, link.residual) = (column, inverse_effective, residual);
            }
        }
        inertia = inertia.about_point(&link.from_parent);
        wrench = wrench.about_point(&link.from_parent);
    }
}

/// Accelerations outwards, after [`gather`]; `report` receives joint number, acceleration and torque.
#[inline(always)]
fn spread(
    arm: &Arm,
    ws: &mut Workspace,
    drive: impl Fn(usize) -> Drive,
    mut report: impl FnMut(usize, f64, f64),
) {
    let mut acceleration = Acceleration { angular: Vector3::zeros(), linear: -arm.gravity() };
    for (i, (link, joint)) in ws.links.iter_mut().zip(arm.constants()).enumerate() {
        acceleration = carried_acceleration(&acceleration, link);
        match drive(i) {
            Drive::Torque(tau) => {
                let column = &link.column;
                let carried =
                    column.moment.dot(&acceleration.angular) + column.force.dot(&acceleration.linear);
                let a = link.inverse_effective * (link.residual - carried);
                accelerate(&mut acceleration, joint.kind, &link.axis, a);
                report(i, a, tau);
            }
            Drive::Acceleration(a) => {
                accelerate(&mut acceleration, joint.kind, &link.axis, a);
                let mut wrench = link.articulated.times(&acceleration);
                wrench.add(&link.wrench);
                report(i, a, motor_torque(joint, &link.axis, &wrench, a));
            }
        }
        link.acceleration = acceleration;
    }
    ws.wrench_source = WrenchSource::Articulated;
}
