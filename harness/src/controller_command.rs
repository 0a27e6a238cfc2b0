//! `freeplay controller`: the process of a controller.

use std::os::unix::process::CommandExt;
use std::path::{Path, PathBuf};
use std::process::Command;

use clap::Args;
use freeplay_controller::{BUILT_IN, Ended, ServeOptions, built_in, serve_with};
use freeplay_fmi::guest::FmuController;
use freeplay_shm::{Address, RtRequest};
use freeplay_terminal::exit::{Exit, Failure};

use crate::slowed_controller::SlowedController;

/// Runs a controller in its own process. `freeplay run` starts this process.
#[derive(Args, Debug)]
pub struct ControllerArgs {
    /// Name of a built-in controller, path of an FMU, or path of an executable, which reads the address of the run from its
    /// environment.
    pub name: PathBuf,
    /// Address of the run in shared memory.
    #[arg(long, env = "FREEPLAY_RUN")]
    pub run: String,
    /// Slot to request.
    #[arg(long, env = "FREEPLAY_SLOT", default_value_t = 0)]
    pub slot: u32,
    /// SCHED_FIFO priority to request.
    #[arg(long)]
    pub priority: Option<u8>,
    /// Core to which this process is pinned.
    #[arg(long)]
    pub cpu: Option<usize>,
    /// Lock all memory in RAM.
    #[arg(long)]
    pub lock_memory: bool,
    /// Compute time to add to each answer, s.
    #[arg(long, default_value_t = 0.0, value_name = "S")]
    pub load: f64,
    /// File with the plan of faults to inject into this controller.
    #[arg(long, value_name = "FILE")]
    pub faults: Option<PathBuf>,
    /// End when the parent process with this ID ends.
    #[arg(long, value_name = "PID")]
    pub with_parent: Option<u32>,
}

/// Runs the controller of one run.
///
/// # Errors
/// An unknown name, an executable that cannot start, a run that cannot be joined, or an unusable task.
pub fn controller(args: &ControllerArgs) -> Result<Exit, Failure> {
    let mut controller = match args.name.to_str().and_then(built_in) {
        Some(controller) => controller,
        None if FmuController::is_named(&args.name) => Box::new(FmuController::new(&args.name)),
        None => return Err(become_executable(&args.name)),
    };
    if args.load > 0.0 {
        controller = Box::new(SlowedController::new(controller, args.load));
    }
    let address = Address::parse(&args.run).map_err(Failure::usage)?;
    let realtime = RtRequest { priority: args.priority, cpu: args.cpu, lock_memory: args.lock_memory };
    let options = ServeOptions { slot: args.slot, realtime, ..ServeOptions::new(address) };
    match serve_with(controller.as_mut(), &options) {
        Ok(report) if report.ended == Ended::Interrupted => Ok(Exit::Interrupted),
        Ok(_) => Ok(Exit::Done),
        Err(error) => Err(Failure {
            exit: match error.exit_code() {
                2 => Exit::Usage,
                3 => Exit::Input,
                5 => Exit::Peer,
                _ => Exit::Internal,
            },
            message: error.to_string(),
        }),
    }
}

/// Replaces this process by the executable `path`, which then ends with the parent as a built-in controller does. Returns only on
/// failure.
fn become_executable(path: &Path) -> Failure {
    if path.components().count() < 2 {
        return unknown(&path.display().to_string());
    }
    let error = Command::new(path).exec();
    Failure::peer(format!("cannot start the controller {}: {error}", path.display()))
}

/// Error: no built-in controller has this name.
pub fn unknown(name: &str) -> Failure {
    Failure::usage(format!(
        "no controller {name:?}: built-in are {}; for a controller of your own give the path of its executable or FMU",
        BUILT_IN.join(", ")
    ))
}
