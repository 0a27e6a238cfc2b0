//! The SDK for controllers: a trait to implement and a function to call, without a solver or a network behind them.
//!
//! A controller is a process of its own. It never sees the plant, only its states. Its knowledge of the arm comes from a model file,
//! which may be wrong.
//!
//! The nouns, in the order in which data passes through them:
//!
//! - [`Task`]: the file with a controller's model, reference path, gains and options.
//! - [`Controller`]: the trait: [`Controller::start`] with the task and the [`RunInfo`], then [`Controller::answer`] state by state.
//! - [`Answer`]: the controller's answer to one state.
//! - [`serve()`]: the process of a controller: it finds the run, shakes hands, answers, and ends with an exit code; [`serve_with`]
//!   takes [`ServeOptions`].
//!
//! The messages themselves, `State` and `Command`, are those of `freeplay-shm`.

mod answer_loop;
pub mod controller;
mod controller_error;
mod run_info;
pub mod serve;
mod serve_error;
mod serve_options;
pub mod task;

pub use answer_loop::Ended;
pub use controller::{Answer, Controller};
pub use controller_error::ControllerError;
pub use run_info::RunInfo;
pub use serve::{ServeReport, serve, serve_with};
pub use serve_error::ServeError;
pub use serve_options::{PATIENCE_ENV, SLOT_ENV, ServeOptions};
pub use task::{Gains, LimitsFrom, PAPER_MODEL, Task, TaskError, TaskMode};
