//! The division of a joint's inertia between its motor and its link, for a joint with a transmission.
//!
//! A rotor inertia in the arm file belongs to the motor's side. Without one, the file's inertia of the joint includes the rotor: a share of
//! it moves from the link to the motor, so that the arm with a stiff transmission equals the original arm. The share is half of the least
//! inertia of the joint with all others free, 1/(M⁻¹)ⱼⱼ, along the planned motion. It is smaller if several such joints together would make
//! the mass matrix indefinite.
//! Source: Spong 1987, J. Dyn. Syst. Meas. Control 109:310 (the rotor counts on its own joint alone).

use freeplay_arm::{Arm, Joint, Workspace, crba};
use freeplay_laws::{ArmParts, LawError, Transmission};
use nalgebra::DMatrix;

use crate::SystemError;

/// The rotor's share of the least inertia of a joint whose file gives no rotor inertia.
pub const ROTOR_SHARE: f64 = 0.5;

/// The greatest angle by which a transmission may oscillate in a sub-step, rad: leapfrog is stable up to 2, and its frequency error here is
/// 1 %.
const GREATEST_SWING: f64 = 0.5;
/// The greatest share by which a transmission's damping may slow its flanks in a sub-step; the extrapolated velocity is stable up to 1.
pub(crate) const GREATEST_LOSS: f64 = 0.5;

/// The two sides of one transmission.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Sides {
    /// Inertia on the motor's side, kg·m² (kg).
    pub motor: f64,
    /// Least inertia on the link's side with all other joints free, kg·m² (kg).
    pub link: f64,
}

/// `arm` with `rotors`, inertias by joint index in kg·m² (kg), in addition to those of its file.
///
/// # Errors
/// [`SystemError::Law`] if the result is an impossible arm.
pub(crate) fn with_rotors(arm: &Arm, rotors: &[(usize, f64)]) -> Result<Arm, SystemError> {
    let mut parts = ArmParts::of(arm);
    for &(joint, inertia) in rotors {
        parts.joints[joint].rotor_inertia += inertia;
    }
    Ok(parts.into_arm(arm.name())?)
}

/// The arm on the links' side of the transmissions at `joints`, and the inertias of their sides, for a motion through `postures`.
///
/// # Errors
/// [`SystemError::Law`] if the links alone are an impossible arm.
pub(crate) fn share_out(
    arm: &Arm,
    joints: &[usize],
    postures: &[Vec<f64>],
) -> Result<(Arm, Vec<Sides>), SystemError> {
    let named = |joint: &usize| arm.joints()[*joint].rotor_inertia > 0.0;
    let unnamed: Vec<usize> = joints.iter().copied().filter(|joint| !named(joint)).collect();
    let mut rotors: Vec<f64> = joints.iter().map(|&joint| arm.joints()[joint].rotor_inertia).collect();
    let without = less(arm, joints.iter().copied().zip(rotors.iter().map(|rotor| rotor.max(0.0))))?;
    let felt = mobility(&without, &unnamed, postures)?;
    let least = least_inertias(&felt);
    let share = if unnamed.is_empty() { 0.0 } else { ROTOR_SHARE / greatest_together(&felt, &least) };
    for (joint, least) in unnamed.iter().zip(&least) {
        if let Some(at) = joints.iter().position(|other| other == joint) {
            rotors[at] = share * least;
        }
    }
    let links = less(arm, joints.iter().copied().zip(rotors.iter().copied()))?;
    let free = mobility(&links, joints, postures)?;
    let sides = rotors.into_iter().zip(least_inertias(&free)).map(|(motor, link)| Sides { motor, link });
    Ok((links, sides.collect()))
}

/// `arm` with the inertias `taken` from its joints' own rows.
fn less(arm: &Arm, taken: impl Iterator<Item = (usize, f64)>) -> Result<Arm, SystemError> {
    let mut joints: Vec<Joint> = arm.joints().to_vec();
    taken.for_each(|(joint, inertia)| joints[joint].rotor_inertia -= inertia);
    Arm::new(arm.name(), joints, *arm.tool(), *arm.gravity())
        .map_err(|error| SystemError::Law(LawError::Changed(error)))
}

/// The rows and columns `joints` of M⁻¹ in each of `postures`.
pub(crate) fn mobility(
    arm: &Arm,
    joints: &[usize],
    postures: &[Vec<f64>],
) -> Result<Vec<DMatrix<f64>>, SystemError> {
    let mut ws = Workspace::new(arm);
    let mut mass = DMatrix::zeros(arm.dof(), arm.dof());
    let inverse = |posture: &Vec<f64>| {
        crba(arm, &mut ws, posture, &mut mass);
        let whole = mass.clone().cholesky().ok_or(SystemError::NoInertiaLeft)?.inverse();
        Ok(DMatrix::from_fn(joints.len(), joints.len(), |i, j| whole[(joints[i], joints[j])]))
    };
    postures.iter().map(inverse).collect()
}

/// The least inertia of each joint with all others free, kg·m² (kg), where `mobilities` are those of [`mobility`].
pub(crate) fn least_inertias(mobilities: &[DMatrix<f64>]) -> Vec<f64> {
    let joints = mobilities.first().map_or(0, DMatrix::nrows);
    (0..joints).map(|joint| 1.0 / greatest(mobilities, |w| w[(joint, joint)])).collect()
}

/// Greatest ratio of the mobility of all joints together to that of a single joint: the greatest eigenvalue of any of the `mobilities`,
/// each scaled by the `least` inertias.
pub(crate) fn greatest_together(mobilities: &[DMatrix<f64>], least: &[f64]) -> f64 {
    let together = |w: &DMatrix<f64>| {
        DMatrix::from_fn(least.len(), least.len(), |i, j| w[(i, j)] * (least[i] * least[j]).sqrt())
            .symmetric_eigenvalues()
            .max()
    };
    greatest(mobilities, together)
}

fn greatest(matrices: &[DMatrix<f64>], value: impl Fn(&DMatrix<f64>) -> f64) -> f64 {
    matrices.iter().map(value).fold(0.0, f64::max)
}

/// Refuses sub-steps of `step` s in which the oscillation of the transmission `law` of the joint called `name` is not resolved.
///
/// # Errors
/// [`SystemError::TransmissionTooStiff`] with the frequency and the sufficient number of sub-steps.
pub(crate) fn check_step(
    name: &str,
    law: &Transmission,
    sides: &Sides,
    period: f64,
    substeps: u32,
) -> Result<(), SystemError> {
    let step = period / f64::from(substeps);
    let mobility = 1.0 / sides.motor + 1.0 / sides.link;
    let (swing, loss) = ((law.stiffness * mobility).sqrt(), law.damping * mobility);
    let needed = (period * (swing / GREATEST_SWING).max(loss / GREATEST_LOSS)).ceil();
    if needed <= f64::from(substeps) {
        return Ok(());
    }
    Err(SystemError::TransmissionTooStiff {
        joint: name.to_owned(),
        frequency: swing / std::f64::consts::TAU,
        step,
        needed,
        motor: sides.motor,
    })
}
