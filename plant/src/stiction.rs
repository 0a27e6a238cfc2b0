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

use crate::SystemError;
use crate::rotor::{GREATEST_LOSS, greatest_together, least_inertias, mobility};

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
    let least = least_inertias(&free);
    let together = if joined.is_empty() { 1.0 } else { greatest_together(&free, &least) };
    let mut inertias: Vec<f64> = motors.iter().map(|motor| motor.unwrap_or(0.0)).collect();
    joined.iter().zip(least).for_each(|(&joint, least)| inertias[joint] = least / together);
    Ok(inertias.into_iter().map(|inertia| GREATEST_LOSS * inertia / step).collect())
}
