//! The checks of [`Arm::new`].

use nalgebra::Isometry3;

use crate::arm::Arm;
use crate::arm_error::{ArmError, MAX_DOF};
use crate::dynamics::forward::effective_inertias;
use crate::dynamics::mass_matrix::compose_inertias;
use crate::joint::{Joint, JointKind};
use crate::workspace::Workspace;

pub(crate) fn chain(joints: &[Joint]) -> Result<(), ArmError> {
    if joints.is_empty() {
        return Err(ArmError::NoJoints);
    }
    if joints.len() > MAX_DOF {
        return Err(ArmError::TooManyJoints { count: joints.len() });
    }
    for (i, joint) in joints.iter().enumerate() {
        if joint.name.is_empty() {
            return Err(ArmError::EmptyName { number: i + 1 });
        }
        if joint.name.contains(['\n', '\r']) {
            return Err(ArmError::NameOfLines { number: i + 1, name: joint.name.clone() });
        }
        if joints[..i].iter().any(|other| other.name == joint.name) {
            return Err(ArmError::DuplicateName { name: joint.name.clone() });
        }
    }
    Ok(())
}

/// The joint of a value; `None` for the arm.
type Of<'a> = Option<&'a str>;

fn value(of: Of<'_>, quantity: &str, value: impl ToString, must: &'static str) -> ArmError {
    ArmError::Value {
        joint: of.map(str::to_owned),
        quantity: quantity.to_owned(),
        value: value.to_string(),
        must,
    }
}

pub(crate) fn finite(of: Of<'_>, quantity: &str, values: &[f64]) -> Result<(), ArmError> {
    match values.iter().find(|v| !v.is_finite()) {
        Some(v) => Err(value(of, quantity, v, "finite")),
        None => Ok(()),
    }
}

pub(crate) fn pose(of: Of<'_>, quantity: &str, pose: &Isometry3<f64>) -> Result<(), ArmError> {
    finite(of, quantity, pose.translation.vector.as_slice())?;
    finite(of, quantity, pose.rotation.coords.as_slice())?;
    let norm = pose.rotation.coords.norm();
    if (norm - 1.0).abs() > 1e-9 {
        return Err(value(of, quantity, format!("a quaternion of length {norm}"), "a unit quaternion"));
    }
    Ok(())
}

pub(crate) fn joint(joint: &Joint) -> Result<(), ArmError> {
    let of = Some(joint.name.as_str());
    pose(of, "placement", &joint.placement)?;
    finite(of, "axis", joint.axis.as_slice())?;
    if (joint.axis.norm() - 1.0).abs() > 1e-9 {
        return Err(value(of, "length of the axis", joint.axis.norm(), "1"));
    }
    limits(of, joint)?;
    for (quantity, v) in
        [("viscous friction", joint.friction.viscous), ("Coulomb friction", joint.friction.coulomb)]
    {
        if !(v >= 0.0 && v.is_finite()) {
            return Err(value(of, quantity, v, "finite and not negative"));
        }
    }
    finite(of, "rotor inertia", &[joint.rotor_inertia])?;
    inertia(of, joint)
}

fn limits(of: Of<'_>, joint: &Joint) -> Result<(), ArmError> {
    let l = &joint.limits;
    if l.lower.is_nan() || l.upper.is_nan() || l.lower > l.upper {
        let range = format!("{} … {}", l.lower, l.upper);
        return Err(value(of, "position limit", range, "two numbers, lower ≤ upper"));
    }
    for (quantity, v) in
        [("velocity limit", l.velocity), ("acceleration limit", l.acceleration), ("effort limit", l.effort)]
    {
        if v.is_nan() || v <= 0.0 {
            return Err(value(of, quantity, v, "positive, or infinite for none"));
        }
    }
    Ok(())
}

fn inertia(of: Of<'_>, joint: &Joint) -> Result<(), ArmError> {
    let inertia = &joint.inertia;
    if !(inertia.mass >= 0.0 && inertia.mass.is_finite()) {
        return Err(value(of, "mass (kg)", inertia.mass, "finite and not negative"));
    }
    finite(of, "centre of mass (m)", inertia.com.as_slice())?;
    match inertia.tensor_problem() {
        Some(problem) => Err(value(of, "inertia (kg·m²)", problem, "symmetric and positive semi-definite")),
        None => Ok(()),
    }
}

/// An effective inertia of a joint that is zero in general position is zero everywhere (it is an analytic function of q), so that a few
/// positions suffice.
pub(crate) fn every_joint_moves_inertia(arm: &Arm) -> Result<(), ArmError> {
    let mut ws = Workspace::new(arm);
    let mut felt = vec![0.0_f64; arm.dof()];
    for sample in 1..=3_u8 {
        let q: Vec<f64> = (1..=arm.dof()).map(|i| (1.3 * i as f64 * f64::from(sample)).sin()).collect();
        effective_inertias(arm, &mut ws, &q, |i, value| felt[i] = felt[i].max(value));
    }
    compose_inertias(arm, &mut ws);
    for ((joint, &felt), link) in arm.joints().iter().zip(&felt).zip(&ws.links).rev() {
        // Against the inertia of the same load as one rigid body: a smaller ratio is rounding.
        let rigid = match joint.kind {
            JointKind::Revolute => link.inertia.trace(),
            JointKind::Prismatic => link.mass,
        };
        if felt.is_nan() || felt <= 1e-13 * rigid {
            return Err(ArmError::MovesNoInertia { name: joint.name.clone(), felt });
        }
    }
    Ok(())
}
