//! Dry friction that stops a joint and holds it.
//!
//! Coulomb friction of a joint at rest is any torque between −F and F that holds the joint. With a sign smoothed over a small speed a
//! loaded joint creeps, and a light one, which friction stops within a sub-step, never comes to rest. The share s of F that acts is
//! therefore a state variable. Each sub-step of length h changes it by the share that would stop the velocity v⁺ at its end, and clamps it
//! to −1…1: s ← [s + B v⁺/F], B = β I/h. A sticking joint of inertia I then loses the share β of its velocity in a sub-step, and a sliding
//! joint has s = ±1. This is the projection of time-stepping methods for dry friction, with one iteration per sub-step (Moreau 1988,
//! "Unilateral Contact and Dry Friction in Finite Freedom Dynamics"; Alart & Curnier 1991, Comput. Methods Appl. Mech. Eng. 92:353).
//!
//! With other joints free, I is less than the diagonal of the mass matrix: 1/(M⁻¹)ⱼⱼ. If several joints stick at once, each receives part
//! of the others' velocity, at most λ times as much as its own, with λ the greatest eigenvalue of M⁻¹ scaled to ones on its diagonal; β is
//! therefore divided by λ.

use freeplay_arm::Arm;

use crate::SystemError;
use crate::rotor::{GREATEST_LOSS, greatest_together, least_inertias, mobility};

/// The torques that stop a unit of velocity of each joint of `arm` within a sub-step of `step` s, N·m·s/rad (N·s/m), for a motion through
/// `postures`. A joint with an entry in `motors` has a motor of that inertia, kg·m² (kg), behind a transmission.
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
