//! How dry friction stops a joint and holds it.
//!
//! Coulomb's friction of a joint that stands is any torque between −F and F, as much as it takes; a sign that is smoothed over a small speed lets a
//! loaded joint creep, and a light one, which friction stops within a sub-step, never stands at all. So the share s of F that acts is a state. Each
//! sub-step of length h moves it by what would stop the velocity v⁺ at its end, and keeps it between −1 and 1: s ← [s + B v⁺/F], B = β I/h. A
//! joint of inertia I that sticks then loses the share β of its velocity in a sub-step, and a joint that slides has s = ±1. This is the projection by
//! which time-stepping methods solve dry friction, one step of it a sub-step (Moreau 1988, "Unilateral Contact and Dry Friction in Finite Freedom
//! Dynamics"; Alart & Curnier 1991, Comput. Methods Appl. Mech. Eng. 92:353).
//!
//! Where other joints are free, I is less than the mass matrix has: 1/(M⁻¹)ⱼⱼ. Where several joints stick at once, each takes part of the others'
//! velocity, at most λ times as much as its own, with λ the greatest eigenvalue of M⁻¹ scaled to ones on its diagonal; β is divided by it.

use freeplay_arm::Arm;
use nalgebra::DMatrix;

use crate::SystemError;
use crate::rotor::{GREATEST_LOSS, mobility};

/// The torques that stop a unit of velocity of each joint of `arm` within a sub-step of `step` s, N·m·s/rad (N·s/m), where the joints that `motors`
/// names have a motor of that inertia, kg·m² (kg), behind a transmission, for a motion through `postures`.
///
/// # Errors
/// [`SystemError::NoInertiaLeft`]
pub(crate) fn stopping_torques(
    arm: &Arm,
    motors: &[Option<f64>],
    postures: &[Vec<f64>],
    step: f64,
) -> Result<Vec<f64>, SystemError> {
    let joined: Vec<usize> = (0..arm.dof()).filter(|&joint| motors[joint].is_none()).collect();
    let free = mobility(arm, &joined, postures)?;
    let most = |at: usize| free.iter().map(|free| free[(at, at)]).fold(0.0, f64::max);
    let most: Vec<f64> = (0..joined.len()).map(most).collect();
    let together = |free: &DMatrix<f64>| {
        DMatrix::from_fn(most.len(), most.len(), |i, j| free[(i, j)] / (most[i] * most[j]).sqrt())
            .symmetric_eigenvalues()
            .max()
    };
    let together = free.iter().filter(|_| !most.is_empty()).map(together).fold(1.0, f64::max);
    let inertias = motors.iter().enumerate().map(|(joint, motor)| match motor {
        Some(motor) => *motor,
        None => joined.iter().position(|at| *at == joint).map_or(0.0, |at| 1.0 / (together * most[at])),
    });
    Ok(inertias.map(|inertia| GREATEST_LOSS * inertia / step).collect())
}
