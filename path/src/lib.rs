//! Reference motions of the tool and of the joints over time.
//!
//! The nouns, in the order in which data passes through them:
//!
//! - [`PathSpec`]: the specification of a path in a scenario ([`PathKind`], centre, [`Size`], period, laps…), checked without an arm
//!   ([`SpecError`]).
//! - A path file: CSV rows of joint angles or tool positions; a defect is a [`FileError`] at a [`Place`].
//! - [`ToolPath`]: the tool's path in closed form; a [`ToolSample`] is its pose, velocity and acceleration at an instant.
//! - [`JointPath`]: the joints' motion along it, tabulated by [`JointPath::plan`] (else a [`PathError`]), evaluated
//!   anywhere without allocation; a [`Sample`] is its position, velocity and acceleration at an instant.
//!
//! SI units and radians; the base frame is z up; tool orientations are roll, pitch, yaw as in URDF.

#[cfg(feature = "plan")]
mod planning;
mod spec;

#[cfg(feature = "plan")]
pub use planning::{
    FEWEST_ROWS, FileError, HIGHEST_RATE, JointPath, PathError, Place, Sample, ToolPath, ToolSample,
};
pub use spec::{
    LARGEST_BLEND, LONGEST_DURATION, PathKind, PathSpec, SHORTEST_PERIOD, SMALLEST_BLEND, Size, SpecError,
};
