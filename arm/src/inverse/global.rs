//! The search from several seeds.

use nalgebra::Isometry3;

use super::{IkError, IkReport, IkTask, inverse_kinematics};
use crate::arm::Arm;
use crate::joint::JointKind;
use crate::workspace::Workspace;

/// Like [`inverse_kinematics`] without a seed: tries a fixed sequence of seeds inside the limits, shifts revolute joints by whole turns
/// into their limits, and returns the solution with the largest [`IkReport::limit_margin`], the first of equals. The same target always
/// gives the same answer.
///
/// # Errors
/// The error of the best seed: a solution outside the limits, else the smallest remaining error.
///
/// # Panics
/// If `out` or the workspace does not fit the arm.
pub fn inverse_kinematics_global(
    arm: &Arm,
    ws: &mut Workspace,
    target: &Isometry3<f64>,
    out: &mut [f64],
    task: IkTask,
) -> Result<IkReport, IkError> {
    ws.check_sizes(arm, [out.len()]);
    let n = arm.dof();
    let (mut seed, mut q) = (vec![0.0; n], vec![0.0; n]);
    let mut best: Result<IkReport, IkError> = Err(IkError::NotFinite);
    for number in 0..SEEDS {
        seed_inside_limits(arm, number, &mut seed);
        let found = match inverse_kinematics(arm, ws, target, &seed, &mut q, task) {
            Err(IkError::OutsideLimits { .. }) => {
                turn_into_limits(arm, &mut q);
                // From a solution this takes no step, but evaluates the shifted joints.
                let turned = q.clone();
                inverse_kinematics(arm, ws, target, &turned, &mut q, task)
            }
            other => other,
        };
        if better(&found, &best) {
            best = found;
            out.copy_from_slice(&q);
        }
    }
    best
}

/// Number of seeds of the global search.
const SEEDS: usize = 64;

/// Adds whole turns to the revolute joints outside their limits.
fn turn_into_limits(arm: &Arm, q: &mut [f64]) {
    const TURN: f64 = std::f64::consts::TAU;
    for (joint, q) in arm.joints().iter().zip(q) {
        let limits = &joint.limits;
        if joint.kind != JointKind::Revolute || (*q >= limits.lower && *q <= limits.upper) {
            continue;
        }
        let turned = if *q < limits.lower {
            *q + ((limits.lower - *q) / TURN).ceil() * TURN
        } else {
            *q - ((*q - limits.upper) / TURN).ceil() * TURN
        };
        if turned >= limits.lower && turned <= limits.upper {
            *q = turned;
        }
    }
}

/// Seed number `number`: first the middle of the limits, then points of the additive sequence with the roots of x^(n+1) = x + 1 (Roberts
/// 2018), which fill the box evenly. The range of a joint without limits is ±π rad or ±1 m.
fn seed_inside_limits(arm: &Arm, number: usize, seed: &mut [f64]) {
    let n = arm.dof() as f64;
    let mut root = 2.0_f64;
    for _ in 0..60 {
        root = (1.0 + root).powf(1.0 / (n + 1.0));
    }
    for (i, (joint, seed)) in arm.joints().iter().zip(seed).enumerate() {
        let reach = match joint.kind {
            JointKind::Revolute => std::f64::consts::PI,
            JointKind::Prismatic => 1.0,
        };
        let lower = if joint.limits.lower.is_finite() {
            joint.limits.lower
        } else {
            joint.limits.upper.min(reach) - 2.0 * reach
        };
        let upper = if joint.limits.upper.is_finite() { joint.limits.upper } else { lower + 2.0 * reach };
        let share = (0.5 + number as f64 * root.powi(-(i as i32 + 1))).fract();
        *seed = lower + share * (upper - lower);
    }
}

/// True if `found` is better than `best`.
fn better(found: &Result<IkReport, IkError>, best: &Result<IkReport, IkError>) -> bool {
    let left = |error: &IkError| match error {
        IkError::OutsideLimits { .. } => 0.0,
        IkError::Singular { position_error, rotation_error, .. }
        | IkError::Unreachable { position_error, rotation_error, .. } => position_error + rotation_error,
        IkError::NotFinite => f64::INFINITY,
    };
    match (found, best) {
        // A tiny difference of margins must not decide: it may be rounding.
        (Ok(found), Ok(best)) => found.limit_margin > best.limit_margin + 1e-9,
        (Ok(_), Err(_)) => true,
        (Err(_), Ok(_)) => false,
        (Err(found), Err(best)) => left(found) < left(best),
    }
}
