//! Reference motions: where the tool or the joints should be, when.
//!
//! The nouns, in the order in which data passes through them:
//!
//! - [`PathSpec`]: a path as a scenario describes it ([`PathKind`], centre, [`Size`], period, laps…), checked without
//!   an arm ([`SpecError`]).
//! - A path file: CSV rows of joint angles or tool positions; what is wrong with one is a [`FileError`] at a [`Place`].
//! - [`ToolPath`]: the tool's path in closed form; a [`ToolSample`] is its pose, velocity and acceleration at an instant.
//! - [`JointPath`]: the joints' motion along it, tabulated by [`JointPath::plan`] (else a [`PathError`]), evaluated
//!   anywhere without allocation; a [`Sample`] is its position, velocity and acceleration at an instant.
//!
//! SI units and radians; the base frame is z up; tool orientations are roll, pitch, yaw as in URDF.

mod error;
mod file;
mod file_error;
mod laps;
mod nodes;
mod plan;
mod shape;
mod sine;
mod spec;
mod spline;
mod start;
mod table;
mod tool;
mod track;

pub use error::PathError;
pub use file_error::{FEWEST_ROWS, FileError, Place};
pub use plan::HIGHEST_RATE;
pub use spec::{
    LARGEST_BLEND, LONGEST_DURATION, PathKind, PathSpec, SHORTEST_PERIOD, SMALLEST_BLEND, Size, SpecError,
};
pub use table::{JointPath, Sample};
pub use tool::{ToolPath, ToolSample};
