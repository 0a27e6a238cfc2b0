//! The process of a controller: from the address of a run to an exit code.

use std::process::ExitCode;
use std::time::Duration;

use freeplay_shm::realtime::{RtReport, RtRequest, prepare};
use freeplay_shm::{Address, ControllerLink, Hello, LinkError, MessageFault, RUN_ENV};
use freeplay_storage::without_error_number;
use thiserror::Error;

use crate::answer_loop::{AnswerLoop, Stop, guarded};
use crate::controller::{Controller, ControllerError, RunInfo};
use crate::task::{Task, TaskError};

/// Environment variable with the number of the controller's slot; 0 if it is not set.
pub const SLOT_ENV: &str = "FREEPLAY_SLOT";

/// Environment variable with the least time, s, for which a controller waits for its plant; `freeplay run` sets it to the patience of the scenario.
pub const PATIENCE_ENV: &str = "FREEPLAY_PATIENCE";

/// A controller waits this long for its plant if nobody asks for more.
const PATIENCE: Duration = Duration::from_secs(10);

/// Which run to join and how.
#[derive(Clone, Debug)]
pub struct ServeOptions {
    /// Where the run is.
    pub address: Address,
    /// The slot to ask for.
    pub slot: u32,
    /// How long to wait for the plant: for its welcome, and for each state.
    pub patience: Duration,
    /// What to ask of the system for the thread that answers.
    pub realtime: RtRequest,
}

impl ServeOptions {
    /// For the run at `address`, slot 0, ten seconds of patience or what [`PATIENCE_ENV`] says if that is longer, nothing asked of the system.
    pub fn new(address: Address) -> ServeOptions {
        let asked = std::env::var(PATIENCE_ENV).ok().and_then(|seconds| seconds.parse().ok());
        let asked = asked.and_then(|seconds| Duration::try_from_secs_f64(seconds).ok());
        let patience = asked.map_or(PATIENCE, |asked| asked.max(PATIENCE));
        ServeOptions { address, slot: 0, patience, realtime: RtRequest::default() }
    }

    /// From the arguments of a command line (`--run ADDRESS`, `--slot N`; others are left alone), else from the environment variables
    /// [`RUN_ENV`] and [`SLOT_ENV`].
    ///
    /// # Errors
    /// [`ServeError::Usage`] for a flag without a value or a slot that is no number; [`ServeError::Link`] without a valid address.
    pub fn from_args(arguments: impl IntoIterator<Item = String>) -> Result<ServeOptions, ServeError> {
        let mut arguments = arguments.into_iter();
        let (mut run, mut slot) = (std::env::var(RUN_ENV).ok(), std::env::var(SLOT_ENV).ok());
        while let Some(argument) = arguments.next() {
            let (flag, value) = match argument.split_once('=') {
                Some((flag, value)) => (flag, Some(value.to_owned())),
                None => (argument.as_str(), None),
            };
            let target = match flag {
                "--run" => &mut run,
                "--slot" => &mut slot,
                _ => continue,
            };
            let value = value.or_else(|| arguments.next());
            *target = Some(value.ok_or_else(|| ServeError::Usage(format!("{flag} needs a value")))?);
        }
        let address = Address::parse(&run.ok_or(LinkError::NoAddress)?)?;
        let slot = match slot {
            None => 0,
            Some(text) => text.parse().map_err(|_| {
                ServeError::Usage(format!("slot {text:?} is not a number: give --slot 0 or {SLOT_ENV}=0"))
            })?,
        };
        Ok(ServeOptions { slot, ..ServeOptions::new(address) })
    }
}

/// Why a controller's process ended otherwise than at the last tick.
#[derive(Debug, Error)]
pub enum ServeError {
    /// The command line cannot be understood.
    #[error("{0}")]
    Usage(String),
    /// The run could not be joined, or the link failed.
    #[error(transparent)]
    Link(#[from] LinkError),
    /// The controller could not start.
    #[error(transparent)]
    Controller(#[from] ControllerError),
    /// The welcome says something that this version does not know.
    #[error(
        "the plant's welcome says {field} = {code}, which this version does not know: rebuild both sides from one version"
    )]
    UnknownCode {
        /// The field.
        field: &'static str,
        /// Its value.
        code: u32,
    },
    /// A state is not one of this run.
    #[error("a state that is not to be used: {0}")]
    Message(#[from] MessageFault),
    /// The plant is gone.
    #[error("the plant is gone: no state for {waited:?} after {states} states{cause}")]
    PlantGone {
        /// How long nothing came.
        waited: Duration,
        /// How many states had come.
        states: u64,
        /// What else is known, beginning with a separator.
        cause: &'static str,
    },
    /// The controller panicked; its message has been printed.
    #[error("the controller {controller} panicked {at}; the plant has been left to its fallback")]
    Panicked {
        /// Name of the controller.
        controller: String,
        /// When.
        at: String,
    },
    /// The handlers of the signals could not be installed.
    #[error("cannot install the handlers of SIGINT and SIGTERM: {0}")]
    Signals(#[from] std::io::Error),
}

impl ServeError {
    /// Exit code of a process that ends in this way: 2 usage, 3 bad input, 5 peer missing, 70 internal fault.
    pub fn exit_code(&self) -> u8 {
        match self {
            ServeError::Usage(_) | ServeError::Link(LinkError::NoAddress | LinkError::BadAddress { .. }) => 2,
            ServeError::Controller(_) | ServeError::UnknownCode { .. } | ServeError::Message(_) => 3,
            ServeError::Link(LinkError::Refused { .. } | LinkError::NoSlot { .. }) => 3,
            ServeError::Link(LinkError::NoRun { .. } | LinkError::NoPlant { .. }) => 5,
            ServeError::PlantGone { .. } => 5,
            ServeError::Link(_) | ServeError::Panicked { .. } | ServeError::Signals(_) => 70,
        }
    }
}

/// How a controller's process ended well.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Ended {
    /// The last state of the run was answered.
    LastTick,
    /// SIGINT or SIGTERM came.
    Interrupted,
}

/// What a controller's process did.
#[derive(Clone, Debug, PartialEq)]
pub struct ServeReport {
    /// How it ended.
    pub ended: Ended,
    /// States answered.
    pub answered: u64,
    /// States that were lost because this side was slow.
    pub lost: u64,
    /// States passed over because a newer one was there.
    pub skipped: u64,
    /// What became of the request for real time.
    pub realtime: RtReport,
}

/// Serves the run that the command line or the environment names (see [`ServeOptions::from_args`]) until it ends; the exit code of
/// the process: 0 done, 2 usage, 3 bad input, 5 peer missing, 70 internal fault, 130 interrupted. Errors go to standard error.
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
/// SIGTERM comes. Leaves the run in order in every case, a panic of the controller included.
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

impl From<TaskError> for ServeError {
    fn from(error: TaskError) -> ServeError {
        ServeError::Controller(error.into())
    }
}
