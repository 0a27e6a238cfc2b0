//! Energy of the arm.

use nalgebra::Vector3;

use crate::arm::Arm;
use crate::joint::JointKind;
use crate::kinematics::{place_links, turn_links};
use crate::workspace::Workspace;

/// Kinetic energy ½ vᵀ M(q) v, J, as a sum over the links, independent of the mass matrix: ½ m u² + u·(ω × h) + ½ ω·J ω for a link whose
/// origin moves at u, and ½ I v² for its rotor.
///
/// # Panics
/// If the length of `q` or `v` or the workspace does not fit the arm.
pub fn kinetic_energy(arm: &Arm, ws: &mut Workspace, q: &[f64], v: &[f64]) -> f64 {
    place_links(arm, ws, q);
    turn_links(arm, ws, v);
    let mut velocity = Vector3::zeros();
    let mut parent_omega = Vector3::zeros();
    let mut energy = 0.0;
    for ((link, joint), &v) in ws.links.iter().zip(arm.constants()).zip(v) {
        velocity += parent_omega.cross(&link.from_parent);
        if joint.kind == JointKind::Prismatic {
            velocity += link.axis * v;
        }
        parent_omega = link.omega;
        let h = link.rotation * joint.first_moment;
        let turning = link.rotation.tr_mul(&link.omega);
        energy += 0.5 * joint.mass * velocity.norm_squared()
            + velocity.dot(&link.omega.cross(&h))
            + 0.5 * turning.dot(&joint.inertia.times(&turning))
            + 0.5 * joint.rotor_inertia * v * v;
    }
    energy
}

/// Potential energy in the arm's gravity, J; zero when all mass is at the height of the base origin: −Σ g·(m p + h).
///
/// # Panics
/// If the length of `q` or the workspace does not fit the arm.
pub fn potential_energy(arm: &Arm, ws: &mut Workspace, q: &[f64]) -> f64 {
    place_links(arm, ws, q);
    let moment: Vector3<f64> = ws
        .links
        .iter()
        .zip(arm.constants())
        .map(|(link, joint)| link.position * joint.mass + link.rotation * joint.first_moment)
        .sum();
    -arm.gravity().dot(&moment)
}
