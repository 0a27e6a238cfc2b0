//! The check that the nominal damping of the joints can be integrated.
//!
//! A joint of inertia I and damping c loses its speed with the time constant I/c. A sub-step h removes the share c h/I of the speed at
//! once: the integration is unstable above 2. The bound for a transmission's flanks applies here, too.

use freeplay_arm::{Arm, JointKind};

use crate::SystemError;
use crate::rotor::{GREATEST_LOSS, least_inertias, mobility, with_rotors};

/// Refuses a damping that is too high for the sub-steps, for a motion of `arm` with `rotors` through `postures`.
///
/// # Errors
/// [`SystemError::DampingTooStiff`]
pub(crate) fn check_damping(
    arm: &Arm,
    rotors: &[(usize, f64)],
    postures: &[Vec<f64>],
    step: f64,
    substeps: u32,
) -> Result<(), SystemError> {
    let arm = &with_rotors(arm, rotors)?;
    let damped: Vec<usize> =
        (0..arm.dof()).filter(|&index| arm.joints()[index].friction.viscous > 0.0).collect();
    let free = mobility(arm, &damped, postures)?;
    for (&index, inertia) in damped.iter().zip(least_inertias(&free)) {
        let joint = &arm.joints()[index];
        let loss = joint.friction.viscous * step / inertia;
        if loss > GREATEST_LOSS {
            let units = match joint.kind {
                JointKind::Revolute => ["N·m·s/rad", "kg·m²"],
                JointKind::Prismatic => ["N·s/m", "kg"],
            };
            return Err(SystemError::DampingTooStiff {
                joint: joint.name.clone(),
                damping: joint.friction.viscous,
                inertia,
                units,
                step,
                needed: (f64::from(substeps) * loss / GREATEST_LOSS).ceil(),
            });
        }
    }
    Ok(())
}
