//! The joint-space mass matrix: q → M.

use nalgebra::{DMatrix, Vector3};

use crate::arm::Arm;
use crate::dynamics::inverse::{along_axis, bias};
use crate::joint::JointKind;
use crate::kinematics::place_links;
use crate::spatial::{Symmetric3, Wrench};
use crate::workspace::Workspace;

/// The full symmetric n×n mass matrix `m` at `q` (kg·m², kg·m or kg by the kinds of the two joints), by the composite-rigid-body algorithm
/// (Walker & Orin 1982; Featherstone 2008, §6.2): column i contains the torques of all joints for a unit acceleration of joint i alone,
/// with everything beyond joint i as one rigid body.
///
/// # Panics
/// If the length of `q`, the size of `m` or the workspace does not fit the arm.
pub fn crba(arm: &Arm, ws: &mut Workspace, q: &[f64], m: &mut DMatrix<f64>) {
    place_links(arm, ws, q);
    fill(arm, ws, m);
}

/// Computes the mass matrix `m` at `q`, as [`crba`] does, and the bias torques `h` at `q` and `v`, as [`bias`] does. Both share one
/// computation of the link poses.
///
/// # Panics
/// If the length of a slice, the size of `m` or the workspace does not fit the arm.
pub fn mass_and_bias(
    arm: &Arm,
    ws: &mut Workspace,
    q: &[f64],
    v: &[f64],
    m: &mut DMatrix<f64>,
    h: &mut [f64],
) {
    bias(arm, ws, q, v, h);
    fill(arm, ws, m);
}

/// The mass matrix `m`, after `place_links`.
#[inline(always)]
fn fill(arm: &Arm, ws: &mut Workspace, m: &mut DMatrix<f64>) {
    let n = arm.dof();
    assert_eq!(m.shape(), (n, n), "the mass matrix is square, with one row per joint");
    compose_inertias(arm, ws);
    for i in 0..n {
        let link = &ws.links[i];
        let mut wrench = match arm.constants()[i].kind {
            JointKind::Revolute => {
                Wrench { moment: link.inertia.times(&link.axis), force: link.axis.cross(&link.first_moment) }
            }
            JointKind::Prismatic => {
                Wrench { moment: link.first_moment.cross(&link.axis), force: link.axis * link.mass }
            }
        };
        m[(i, i)] =
            along_axis(arm.constants()[i].kind, &link.axis, &wrench) + arm.constants()[i].rotor_inertia;
        for j in (0..i).rev() {
            wrench = wrench.about_point(&ws.links[j + 1].from_parent);
            let element = along_axis(arm.constants()[j].kind, &ws.links[j].axis, &wrench);
            m[(i, j)] = element;
            m[(j, i)] = element;
        }
    }
}

/// Mass, first moment and inertia of each link with all links beyond, about the link's origin, after `place_links`.
pub(crate) fn compose_inertias(arm: &Arm, ws: &mut Workspace) {
    let mut mass = 0.0;
    let mut first_moment = Vector3::zeros();
    let mut inertia = Symmetric3::default();
    for (link, joint) in ws.links.iter_mut().zip(arm.constants()).rev() {
        mass += joint.mass;
        first_moment += link.rotation * joint.first_moment;
        inertia.add(&joint.inertia.rotated(&link.rotation));
        (link.mass, link.first_moment, link.inertia) = (mass, first_moment, inertia);
        inertia = inertia.about_point(&link.from_parent, mass, &first_moment);
        first_moment += link.from_parent * mass;
    }
}
