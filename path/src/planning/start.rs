//! The first posture of a Cartesian path, which determines the arm's branch.

use freeplay_arm::{
    Arm, IkError, IkReport, IkTask, Workspace, inverse_kinematics, inverse_kinematics_global,
};
use nalgebra::Isometry3;

use crate::planning::error::PathError;
use crate::planning::path_tracking::JOINTS_FOR_POSE;
use crate::planning::sine::middle_of;

/// A posture, with the report of the inverse kinematics.
type Solution = (Vec<f64>, IkReport);

/// Finds the posture in which the path begins; the result is the same for the same arm and path.
///
/// From `start` if given: the result is on its branch. Otherwise the function compares the solutions from the middle of the joints' ranges
/// and from the model's zero posture (for an arm modelled bent: elbow up), and takes the one farther from the limits. If both violate the
/// limits or fail, it searches over the whole range.
pub(crate) fn start_posture(
    arm: &Arm,
    target: &Isometry3<f64>,
    start: Option<&[f64]>,
) -> Result<Vec<f64>, PathError> {
    let found = match start {
        Some(start) => reach(arm, target, start),
        None => from_usual_seeds(arm, target).map_or_else(|| search(arm, target), Ok),
    };
    found.map(|(posture, _)| posture).map_err(|error| refusal(arm, &error, 0.0, target))
}

/// The reason why the tool does not reach `target` from `posture`, at `time` of the motion.
pub(crate) fn explain(arm: &Arm, posture: &[f64], time: f64, target: &Isometry3<f64>) -> PathError {
    match reach(arm, target, posture) {
        Err(error) => refusal(arm, &error, time, target),
        // The point is reachable, but not by continuing from here.
        Ok(_) => PathError::Singular { time, position: target.translation.vector.into() },
    }
}

fn from_usual_seeds(arm: &Arm, target: &Isometry3<f64>) -> Option<Solution> {
    let middle: Vec<f64> = arm.joints().iter().map(|joint| middle_of(&joint.limits)).collect();
    let zero = vec![0.0; arm.dof()];
    let found = [middle, zero].map(|seed| reach(arm, target, &seed).ok());
    found.into_iter().flatten().reduce(|one, other| {
        // A tiny difference of margins must not decide: it may be rounding.
        if other.1.limit_margin > one.1.limit_margin + 1e-9 { other } else { one }
    })
}

fn reach(arm: &Arm, target: &Isometry3<f64>, seed: &[f64]) -> Result<Solution, IkError> {
    let mut posture = vec![0.0; arm.dof()];
    let report = inverse_kinematics(arm, &mut Workspace::new(arm), target, seed, &mut posture, task(arm))?;
    Ok((posture, report))
}

fn search(arm: &Arm, target: &Isometry3<f64>) -> Result<Solution, IkError> {
    let mut posture = vec![0.0; arm.dof()];
    let report = inverse_kinematics_global(arm, &mut Workspace::new(arm), target, &mut posture, task(arm))?;
    Ok((posture, report))
}

fn task(arm: &Arm) -> IkTask {
    if arm.dof() >= JOINTS_FOR_POSE { IkTask::Pose } else { IkTask::Position }
}

fn refusal(arm: &Arm, error: &IkError, time: f64, target: &Isometry3<f64>) -> PathError {
    let position = target.translation.vector.into();
    match error {
        IkError::Unreachable { position_error, rotation_error, .. } => {
            PathError::Unreachable { time, position, distance: *position_error, angle: *rotation_error }
        }
        IkError::Singular { .. } => PathError::Singular { time, position },
        IkError::OutsideLimits { joint, value, lower, upper } => PathError::JointLimit {
            joint: arm.joints()[*joint].name.clone(),
            index: *joint,
            time,
            value: *value,
            limit: if value < lower { *lower } else { *upper },
        },
        IkError::NotFinite => PathError::Unreachable { time, position, distance: f64::INFINITY, angle: 0.0 },
    }
}
