//! The errors of planning a path for an arm.

use crate::planning::file::{Content, Rows};
use crate::planning::file_error::{FileError, Place};
use crate::spec::SpecError;

/// Highest supported rate of ticks, Hz.
pub const HIGHEST_RATE: f64 = 1e5;

/// Reason why [`crate::JointPath::plan`] found no joint path. Times are those of the motion, from 0.
#[derive(thiserror::Error, Debug)]
pub enum PathError {
    /// The specification is invalid for any arm.
    #[error(transparent)]
    Spec(#[from] SpecError),
    /// The file cannot be read.
    #[error(transparent)]
    File(#[from] FileError),
    /// The rate of the ticks is out of range.
    #[error("rate = {value} Hz: write a positive rate of at most {highest} Hz", highest = HIGHEST_RATE)]
    Rate {
        /// The value found, Hz.
        value: f64,
    },
    /// The start posture is for another arm.
    #[error("path.start has {found} values, the arm has {expected} joints")]
    StartLength {
        /// Values given.
        found: usize,
        /// Joints of the arm.
        expected: usize,
    },
    /// A Cartesian path needs three joints.
    #[error(
        "the arm has {joints} joint(s), too few to move its tool along a curve in space: use path.kind = \"joint_sine\" or a file of joint angles (t,q1…)"
    )]
    TooFewJoints {
        /// Joints of the arm.
        joints: usize,
    },
    /// A point of the path is out of reach.
    #[error(
        "at t = {time:.4} s the tool cannot reach ({x:.4}, {y:.4}, {z:.4}) m: {distance:.6} m and {angle:.6} rad remain; move path.centre, lower path.size, change path.rpy, or give a posture near the path in path.start; path.kind = \"joint_sine\" suits every arm",
        x = position[0], y = position[1], z = position[2]
    )]
    Unreachable {
        /// The time, s.
        time: f64,
        /// The position in the base frame, m.
        position: [f64; 3],
        /// Distance to the nearest tool position found, m.
        distance: f64,
        /// Angle between its orientation and the target's, rad; 0 if the orientation is free.
        angle: f64,
    },
    /// The arm reaches a posture in which it cannot follow: the edge of its workspace, or a singular posture inside.
    #[error(
        "at t = {time:.4} s, tool at ({x:.4}, {y:.4}, {z:.4}) m, the arm is stretched, folded or has two axes in line (a singular posture) and cannot follow the path any further: move path.centre, lower path.size, change path.rpy, or choose another branch with path.start",
        x = position[0], y = position[1], z = position[2]
    )]
    Singular {
        /// The time, s.
        time: f64,
        /// The position in the base frame, m.
        position: [f64; 3],
    },
    /// A joint would leave its range.
    #[error(
        "at t = {time:.4} s joint {joint} is at {value:.6}, beyond its limit {limit:.6} (rad or m): move or shrink the path, or choose another branch with path.start"
    )]
    JointLimit {
        /// The joint's name.
        joint: String,
        /// Its index in the arm, from 0.
        index: usize,
        /// The time, s.
        time: f64,
        /// Its position, rad or m.
        value: f64,
        /// The violated limit, rad or m.
        limit: f64,
    },
    /// A joint would be too fast.
    #[error(
        "at t = {time:.4} s joint {joint} moves at {value:.6}, faster than its limit {limit:.6} (rad/s or m/s): give the path more time, shrink it, or keep it clear of stretched and folded postures"
    )]
    SpeedLimit {
        /// The joint's name.
        joint: String,
        /// Its index in the arm, from 0.
        index: usize,
        /// The time, s.
        time: f64,
        /// Its velocity, rad/s or m/s.
        value: f64,
        /// The limit of its magnitude, rad/s or m/s.
        limit: f64,
    },
    /// Numbers overflow.
    #[error(
        "at t = {time:.4} s the position, velocity or acceleration of joint {joint} is not finite: the path is too large or too fast"
    )]
    NotFinite {
        /// The joint's name.
        joint: String,
        /// The time, s.
        time: f64,
    },
    /// The table would be too large.
    #[error("the path needs more than {most} points: run fewer laps, or split the file")]
    TooLong {
        /// The most points for this arm.
        most: usize,
    },
    /// One of the above, at a row of a path file.
    #[error("{place}: {error}")]
    InFile {
        /// The row at or before the failure, and its column.
        place: Place,
        /// The failure.
        error: Box<PathError>,
    },
}

impl PathError {
    /// Adds the row of the path's file to an error with a time.
    pub(crate) fn in_rows(self, rows: &Rows) -> PathError {
        let (time, column) = match &self {
            PathError::Unreachable { time, .. }
            | PathError::Singular { time, .. }
            | PathError::NotFinite { time, .. } => (*time, 1),
            PathError::JointLimit { time, index, .. } | PathError::SpeedLimit { time, index, .. } => {
                (*time, if rows.content == Content::Joints { index + 1 } else { 1 })
            }
            _ => return self,
        };
        PathError::InFile { place: rows.place(time, column), error: Box::new(self) }
    }
}
