//! The process of a controller: from the address of a run to an exit code.

use std::process::ExitCode;

use freeplay_shm::realtime::{RtReport, prepare};
use freeplay_shm::{ControllerLink, Hello};
use freeplay_storage::without_error_number;

use crate::answer_loop::{AnswerLoop, Ended, Stop, guarded};
use crate::controller::Controller;
use crate::controller_error::ControllerError;
use crate::run_info::RunInfo;
use crate::serve_error::ServeError;
use crate::serve_options::ServeOptions;
use crate::task::Task;

/// Result of a controller's process.
#[derive(Clone, Debug, PartialEq)]
pub struct ServeReport {
    /// End of the process.
    pub ended: Ended,
    /// Number of answered states.
    pub answered: u64,
    /// Number of states lost because this side was slow.
    pub lost: u64,
    /// Number of states skipped in favour of a newer one.
    pub skipped: u64,
    /// Result of the request for real time.
    pub realtime: RtReport,
}

/// Serves the run that the command line or the environment names (see [`ServeOptions::from_args`]) until it ends. Returns the exit
/// code of the process: 0 done, 2 usage, 3 bad input, 5 peer missing, 70 internal fault, 130 interrupted. Errors go to standard
/// error.
///
/// ```no_run
/// # use freeplay_controller_sdk::{Answer, Controller, ControllerError, RunInfo, Task, serve};
/// # struct Mine;
/// # impl Controller for Mine {
/// #     fn name(&self) -> &str { "mine" }
/// #     fn start(&mut self, _: &Task, _: &RunInfo) -> Result<(), ControllerError> { Ok(()) }
/// #     fn answer(&mut self, _: &freeplay_shm::State, _: &mut Answer) {}
/// # }
/// fn main() -> std::process::ExitCode {
///     serve(Mine)
/// }
/// ```
pub fn serve(mut controller: impl Controller) -> ExitCode {
    let outcome = ServeOptions::from_args(std::env::args().skip(1))
        .and_then(|options| serve_with(&mut controller, &options));
    match outcome {
        Ok(ServeReport { ended: Ended::LastTick, .. }) => ExitCode::SUCCESS,
        Ok(ServeReport { ended: Ended::Interrupted, .. }) => ExitCode::from(130),
        Err(error) => {
            eprintln!("{}: {}", controller.name(), without_error_number(&error.to_string()));
            ExitCode::from(error.exit_code())
        }
    }
}

/// Joins the run of `options`, starts `controller` with its task and answers until the run ends, the plant is gone, or SIGINT or
/// SIGTERM arrives. The function leaves the run in order in every case, even after a panic of the controller.
///
/// # Errors
/// See [`ServeError`].
pub fn serve_with(
    controller: &mut dyn Controller,
    options: &ServeOptions,
) -> Result<ServeReport, ServeError> {
    let stop = Stop::on_signals()?;
    let hello = Hello::new(controller.name(), options.slot, 0);
    let (link, welcome) = ControllerLink::connect(&options.address, hello, options.patience)?;
    let run = RunInfo {
        joints: welcome.joints as usize,
        mode: welcome.mode().ok_or(ServeError::UnknownCode { field: "mode", code: welcome.mode })?,
        pace: welcome.pace().ok_or(ServeError::UnknownCode { field: "pace", code: welcome.pace })?,
        period_ns: welcome.period_ns,
        ticks: welcome.ticks,
    };
    let task = Task::load(welcome.task().as_ref()).map_err(ControllerError::from)?;
    guarded(controller, || "while starting".to_owned(), |controller| controller.start(&task, &run))??;
    let realtime = prepare(&options.realtime);
    let mut answers = AnswerLoop::new(link, run, options, welcome.run);
    let ended = answers.run(controller, &stop)?;
    Ok(ServeReport {
        ended,
        answered: answers.answered(),
        lost: answers.link().lost(),
        skipped: answers.link().skipped(),
        realtime,
    })
}
