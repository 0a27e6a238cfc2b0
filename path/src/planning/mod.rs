//! From the description of a path to the motion of the joints along it.

mod error;
mod file;
mod file_error;
mod laps;
mod nodes;
mod path_tracking;
mod plan;
mod shape;
mod sine;
mod spline;
mod start;
mod table;
mod tool;

pub use error::{HIGHEST_RATE, PathError};
pub use file_error::{FEWEST_ROWS, FileError, Place};
pub use table::{JointPath, Sample};
pub use tool::{ToolPath, ToolSample};
