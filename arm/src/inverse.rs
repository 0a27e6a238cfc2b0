//! Inverse kinematics: tool pose → q, by damped Newton steps from a seed.
//!
//! The error e of the tool (position, then rotation vector, world axes) is reduced by the step Jᵀ(JJᵀ + λ1)⁻¹e, the least one
//! that solves the damped problem (Levenberg 1944). The damping λ = |e|²·10⁻² falls with the error, which keeps convergence quadratic
//! and the step finite at singular postures (Sugihara 2011, IEEE Trans. Robotics 27:984). Only a 6×6 system is solved, whatever
//! the number of joints, so nothing is allocated.

use nalgebra::{Cholesky, Isometry3, Matrix6, SymmetricEigen, Vector3, Vector6};
use thiserror::Error;

use crate::arm::Arm;
use crate::joint::{JointKind, Limits};
use crate::kinematics::{forward_kinematics, jacobian_column};
use crate::workspace::Workspace;

/// What the tool has to reach.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum IkTask {
    /// Position and orientation: six conditions.
    Pose,
    /// The position alone: three conditions, for arms with fewer than six joints.
    Position,
}

/// When to stop, and how far to go in one step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct IkOptions {
    /// Most iterations from one seed.
    pub max_iterations: usize,
    /// Position error that counts as reached, m.
    pub position_tolerance: f64,
    /// Orientation error that counts as reached, rad.
    pub rotation_tolerance: f64,
    /// Largest change of one joint in one step, rad or m; it keeps the solution on the branch of the seed.
    pub max_step: f64,
}

impl Default for IkOptions {
    /// 100 iterations, 1e-12 m, 1e-12 rad, steps of at most 0.3 rad or m.
    fn default() -> IkOptions {
        IkOptions { max_iterations: 100, position_tolerance: 1e-12, rotation_tolerance: 1e-12, max_step: 0.3 }
    }
}

/// What a solution looks like.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct IkReport {
    /// Newton steps taken from the seed that led there.
    pub iterations: usize,
    /// Position error left, m.
    pub position_error: f64,
    /// Orientation error left, rad; 0 for [`IkTask::Position`].
    pub rotation_error: f64,
    /// Smallest singular value of the task's Jacobian at the solution (m and rad mixed): near zero at a singular posture.
    pub conditioning: f64,
    /// Smallest distance to a position limit, as a share of that joint's range (0 at a limit, 0.5 in the middle); 0.5 without limits.
    pub limit_margin: f64,
}

/// Why no joint positions were found. `out` then holds the best positions reached.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum IkError {
    /// The iteration came to rest away from the target.
    #[error(
        "the target is out of reach from here: {position_error:.3e} m and {rotation_error:.3e} rad are left after {iterations} steps; \
         try another seed or move the target nearer"
    )]
    Unreachable {
        /// Position error left, m.
        position_error: f64,
        /// Orientation error left, rad.
        rotation_error: f64,
        /// Steps taken.
        iterations: usize,
    },
    /// Close to the target, but at a posture where the tool cannot move in the direction that is left.
    #[error(
        "the target lies at a singular posture (smallest singular value {conditioning:.1e}): {position_error:.3e} m and \
         {rotation_error:.3e} rad are left; loosen the tolerance or move the target away from it"
    )]
    Singular {
        /// Position error left, m.
        position_error: f64,
        /// Orientation error left, rad.
        rotation_error: f64,
        /// Smallest singular value of the Jacobian there.
        conditioning: f64,
    },
    /// A solution that a joint may not take.
    #[error(
        "joint number {joint} (from 0) would have to stand at {value:.6}, outside {lower:.6} … {upper:.6}; try another seed"
    )]
    OutsideLimits {
        /// The joint that exceeds its limit most, by its position in the chain from 0.
        joint: usize,
        /// Its position, rad or m.
        value: f64,
        /// Its lower limit.
        lower: f64,
        /// Its upper limit.
        upper: f64,
    },
    /// A target or seed that is not a number.
    #[error("the target and the seed must be finite numbers")]
    NotFinite,
}

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
/// As there.
///
/// # Panics
/// As there.
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

/// Like [`inverse_kinematics`] without a seed: tries a fixed sequence of seeds inside the limits, turns revolute joints by whole
/// turns into their limits, and returns the solution with the largest [`IkReport::limit_margin`], the first of equals. The same
/// target always gives the same answer.
///
/// # Errors
/// The error of the seed that came nearest: a solution outside the limits, else the smallest error left.
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
                // From a solution this takes no step, but judges the turned joints.
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

/// Rotation vector of a unit quaternion, by the shorter way; exact to rounding for small angles, where an arc cosine is not.
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
            // Back, and a shorter step in the direction of steepest descent next time; at rounding level, done.
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

/// Writes Jᵀ(JJᵀ + λ1)⁻¹e to the workspace's step; `false` where even the damped matrix is singular.
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

/// JJᵀ of the task; where only the position counts, the rows of the rotation are those of the identity.
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
    let eigenvalues = SymmetricEigen::new(gram(arm, ws, tool, task)).eigenvalues;
    eigenvalues.min().max(0.0).sqrt()
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

/// Distance to the nearer limit over the range; `None` where a joint has no range.
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

/// Adds whole turns to the revolute joints that stand outside their limits.
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

/// Seed number `number`: the middle of the limits first, then points of the additive sequence with the roots of
/// x^(n+1) = x + 1 (Roberts 2018), which fill the box evenly. A joint without limits ranges over ±π rad or ±1 m.
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

/// Whether `found` is to be preferred to `best`.
fn better(found: &Result<IkReport, IkError>, best: &Result<IkReport, IkError>) -> bool {
    let left = |error: &IkError| match error {
        IkError::OutsideLimits { .. } => 0.0,
        IkError::Singular { position_error, rotation_error, .. }
        | IkError::Unreachable { position_error, rotation_error, .. } => position_error + rotation_error,
        IkError::NotFinite => f64::INFINITY,
    };
    match (found, best) {
        // A hair's breadth of margin is no reason to prefer one solution: rounding must not decide.
        (Ok(found), Ok(best)) => found.limit_margin > best.limit_margin + 1e-9,
        (Ok(_), Err(_)) => true,
        (Err(_), Ok(_)) => false,
        (Err(found), Err(best)) => left(found) < left(best),
    }
}
