//! Damped Newton steps from a seed.
//!
//! The step Jᵀ(JJᵀ + λ1)⁻¹e reduces the error e of the tool (position, then rotation vector, world axes); it is the smallest solution of
//! the damped problem (Levenberg 1944). The damping λ = |e|²·10⁻² falls with the error, which keeps convergence quadratic and the step
//! finite at singular postures (Sugihara 2011, IEEE Trans. Robotics 27:984). The method solves a 6×6 system for any number of joints, so
//! that it allocates nothing.

use nalgebra::{Cholesky, Isometry3, Matrix6, SymmetricEigen, Vector3, Vector6};

use super::{IkError, IkOptions, IkReport, IkTask};
use crate::arm::Arm;
use crate::joint::Limits;
use crate::kinematics::{forward_kinematics, jacobian_column};
use crate::workspace::Workspace;

/// Joint positions `out` that bring the tool to `target` (pose of `tool0` in the base frame), from `seed` and on its branch, with
/// the default [`IkOptions`]. An arm with more joints than the task has conditions takes the smallest steps.
///
/// # Errors
/// [`IkError`]; `out` then holds the best positions reached.
///
/// # Panics
/// If a slice or the workspace does not fit the arm.
pub fn inverse_kinematics(
    arm: &Arm,
    ws: &mut Workspace,
    target: &Isometry3<f64>,
    seed: &[f64],
    out: &mut [f64],
    task: IkTask,
) -> Result<IkReport, IkError> {
    inverse_kinematics_with(arm, ws, target, seed, out, task, &IkOptions::default())
}

/// [`inverse_kinematics`] with `options`.
///
/// # Errors
/// As for [`inverse_kinematics`].
///
/// # Panics
/// As for [`inverse_kinematics`].
pub fn inverse_kinematics_with(
    arm: &Arm,
    ws: &mut Workspace,
    target: &Isometry3<f64>,
    seed: &[f64],
    out: &mut [f64],
    task: IkTask,
    options: &IkOptions,
) -> Result<IkReport, IkError> {
    ws.check_sizes(arm, [seed.len(), out.len()]);
    out.copy_from_slice(seed);
    let finite = |values: &[f64]| values.iter().all(|x| x.is_finite());
    if !(finite(seed)
        && finite(target.translation.vector.as_slice())
        && finite(target.rotation.coords.as_slice()))
    {
        return Err(IkError::NotFinite);
    }
    let report = newton(arm, ws, target, out, task, options)?;
    check_limits(arm, out)?;
    Ok(report)
}

/// Damping per squared error, 1/(m² or rad²).
const DAMPING: f64 = 1e-2;

/// A smallest singular value below this counts as singular, m or rad per rad or m.
const SINGULAR: f64 = 1e-4;

/// The error of the tool against the target, after the forward kinematics of `q`.
struct ToolError {
    vector: Vector6<f64>,
    position: f64,
    rotation: f64,
}

fn tool_error(
    arm: &Arm,
    ws: &mut Workspace,
    target: &Isometry3<f64>,
    q: &[f64],
    task: IkTask,
) -> (ToolError, Vector3<f64>) {
    let tool = forward_kinematics(arm, ws, q);
    let linear = target.translation.vector - tool.translation.vector;
    let angular = match task {
        IkTask::Pose => rotation_vector(&(target.rotation * tool.rotation.inverse()).into_inner()),
        IkTask::Position => Vector3::zeros(),
    };
    let vector = Vector6::new(linear.x, linear.y, linear.z, angular.x, angular.y, angular.z);
    (ToolError { vector, position: linear.norm(), rotation: angular.norm() }, tool.translation.vector)
}

/// Rotation vector of a unit quaternion, by the shorter way; accurate to rounding for small angles, unlike a formula with an arc cosine.
fn rotation_vector(quaternion: &nalgebra::Quaternion<f64>) -> Vector3<f64> {
    let imaginary = quaternion.imag();
    let sine = imaginary.norm();
    if sine == 0.0 {
        return Vector3::zeros();
    }
    let half = sine.atan2(quaternion.w.abs()) * quaternion.w.signum();
    imaginary * (2.0 * half / sine)
}

/// Damped Newton steps on `q` until the tool is at the target.
fn newton(
    arm: &Arm,
    ws: &mut Workspace,
    target: &Isometry3<f64>,
    q: &mut [f64],
    task: IkTask,
    options: &IkOptions,
) -> Result<IkReport, IkError> {
    let (mut error, mut tool) = tool_error(arm, ws, target, q, task);
    let mut damping_scale = 1.0;
    let mut iterations = 0;
    while !(error.position <= options.position_tolerance && error.rotation <= options.rotation_tolerance) {
        if iterations == options.max_iterations {
            return Err(failure(arm, ws, q, &error, task, iterations));
        }
        iterations += 1;
        let damping = DAMPING * damping_scale * error.vector.norm_squared();
        if !step(arm, ws, &tool, &error.vector, task, damping) {
            return Err(failure(arm, ws, q, &error, task, iterations));
        }
        let largest = ws.step.iter().fold(0.0_f64, |worst, s| worst.max(s.abs()));
        let share = if largest > options.max_step { options.max_step / largest } else { 1.0 };
        move_by(q, &ws.step, share);
        let (new_error, new_tool) = tool_error(arm, ws, target, q, task);
        if new_error.vector.norm() < error.vector.norm() {
            damping_scale = f64::max(damping_scale * 0.3, 1e-6);
            (error, tool) = (new_error, new_tool);
        } else {
            // Undo the step; the next one is shorter and nearer to steepest descent. At rounding level the iteration ends.
            move_by(q, &ws.step, -share);
            damping_scale *= 8.0;
            (error, tool) = tool_error(arm, ws, target, q, task);
            if damping_scale > 1e12 {
                return Err(failure(arm, ws, q, &error, task, iterations));
            }
        }
    }
    let (position_error, rotation_error) = (error.position, error.rotation);
    let conditioning = conditioning(arm, ws, &tool, task);
    let limit_margin = limit_margin(arm, q);
    Ok(IkReport { iterations, position_error, rotation_error, conditioning, limit_margin })
}

fn move_by(q: &mut [f64], step: &[f64], share: f64) {
    for (q, step) in q.iter_mut().zip(step) {
        *q += share * step;
    }
}

/// Writes Jᵀ(JJᵀ + λ1)⁻¹e to the workspace's step; returns `false` if even the damped matrix is singular.
fn step(
    arm: &Arm,
    ws: &mut Workspace,
    tool: &Vector3<f64>,
    error: &Vector6<f64>,
    task: IkTask,
    damping: f64,
) -> bool {
    // The least damping keeps the matrix invertible at rounding level for a Jacobian with entries around one.
    let gram = gram(arm, ws, tool, task) + Matrix6::identity() * damping.max(1e-15);
    let Some(cholesky) = Cholesky::new(gram) else { return false };
    let weights = cholesky.solve(error);
    for joint in 0..arm.dof() {
        ws.step[joint] = jacobian_column(arm, ws, joint, tool).dot(&weights);
    }
    true
}

/// JJᵀ of the task; for a position task, the rows of the rotation are those of the identity.
fn gram(arm: &Arm, ws: &Workspace, tool: &Vector3<f64>, task: IkTask) -> Matrix6<f64> {
    let mut gram = Matrix6::zeros();
    for joint in 0..arm.dof() {
        let mut column = jacobian_column(arm, ws, joint, tool);
        if task == IkTask::Position {
            column.fixed_rows_mut::<3>(3).fill(0.0);
        }
        gram.ger(1.0, &column, &column, 1.0);
    }
    if task == IkTask::Position {
        gram.fixed_view_mut::<3, 3>(3, 3).fill_with_identity();
    }
    gram
}

/// Smallest singular value of the task's Jacobian.
fn conditioning(arm: &Arm, ws: &Workspace, tool: &Vector3<f64>, task: IkTask) -> f64 {
    let gram = gram(arm, ws, tool, task);
    // Joint positions of 1e300 m overflow, and the eigenvalue iteration does not terminate on NaN.
    if !gram.iter().all(|x| x.is_finite()) {
        return 0.0;
    }
    SymmetricEigen::new(gram).eigenvalues.min().max(0.0).sqrt()
}

fn failure(
    arm: &Arm,
    ws: &mut Workspace,
    q: &[f64],
    error: &ToolError,
    task: IkTask,
    iterations: usize,
) -> IkError {
    let (position_error, rotation_error) = (error.position, error.rotation);
    let tool = forward_kinematics(arm, ws, q).translation.vector;
    let conditioning = conditioning(arm, ws, &tool, task);
    if position_error < 1e-4 && rotation_error < 1e-4 && conditioning < SINGULAR {
        IkError::Singular { position_error, rotation_error, conditioning }
    } else {
        IkError::Unreachable { position_error, rotation_error, iterations }
    }
}

/// Distance to the nearer limit over the range. For a joint without a range: 0.5 within its limits, −0.5 outside.
fn margin(q: f64, lower: f64, upper: f64) -> f64 {
    let range = upper - lower;
    if range.is_finite() && range > 0.0 {
        (q - lower).min(upper - q) / range
    } else if q >= lower && q <= upper {
        0.5
    } else {
        -0.5
    }
}

fn limit_margin(arm: &Arm, q: &[f64]) -> f64 {
    arm.joints()
        .iter()
        .zip(q)
        .map(|(joint, &q)| margin(q, joint.limits.lower, joint.limits.upper))
        .fold(0.5, f64::min)
}

fn check_limits(arm: &Arm, q: &[f64]) -> Result<(), IkError> {
    let mut worst = (0.0, Ok(()));
    for (number, (joint, &value)) in arm.joints().iter().zip(q).enumerate() {
        let Limits { lower, upper, .. } = joint.limits;
        let beyond = (lower - value).max(value - upper);
        if beyond > worst.0 {
            worst = (beyond, Err(IkError::OutsideLimits { joint: number, value, lower, upper }));
        }
    }
    worst.1
}
