//! Inverse kinematics: tool pose → q.

mod global;
mod newton;

use thiserror::Error;

pub use global::inverse_kinematics_global;
pub use newton::{inverse_kinematics, inverse_kinematics_with};

/// The target of the tool.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum IkTask {
    /// Position and orientation: six conditions.
    Pose,
    /// The position alone: three conditions, for arms with fewer than six joints.
    Position,
}

/// Termination criteria and step size.
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

/// Properties of a solution.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct IkReport {
    /// Newton steps from the seed to the solution.
    pub iterations: usize,
    /// Remaining position error, m.
    pub position_error: f64,
    /// Remaining orientation error, rad; 0 for [`IkTask::Position`].
    pub rotation_error: f64,
    /// Smallest singular value of the task's Jacobian at the solution (m and rad mixed): near zero at a singular posture.
    pub conditioning: f64,
    /// Smallest distance to a position limit, as a share of that joint's range (0 at a limit, 0.5 in the centre); 0.5 without limits.
    pub limit_margin: f64,
}

/// Reason why no joint positions were found. `out` then holds the best positions reached.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum IkError {
    /// The iteration stopped away from the target.
    #[error(
        "the target is out of reach from here: {position_error:.3e} m and {rotation_error:.3e} rad are left after {iterations} steps; \
         try another seed or move the target nearer"
    )]
    Unreachable {
        /// Remaining position error, m.
        position_error: f64,
        /// Remaining orientation error, rad.
        rotation_error: f64,
        /// Steps taken.
        iterations: usize,
    },
    /// Close to the target, but at a posture where the tool cannot move in the direction of the remaining error.
    #[error(
        "the target lies at a singular posture (smallest singular value {conditioning:.1e}): {position_error:.3e} m and \
         {rotation_error:.3e} rad are left; loosen the tolerance or move the target away from it"
    )]
    Singular {
        /// Remaining position error, m.
        position_error: f64,
        /// Remaining orientation error, rad.
        rotation_error: f64,
        /// Smallest singular value of the Jacobian there.
        conditioning: f64,
    },
    /// The solution violates a joint limit.
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
    /// A target or seed that is not finite.
    #[error("the target and the seed must be finite numbers")]
    NotFinite,
}
