//! `freeplay controller`: the process of a built-in controller.

use clap::Args;
use freeplay_controller::{BUILT_IN, Ended, ServeOptions, built_in, serve_with};
use freeplay_shm::{Address, RtRequest};

use crate::exit::{Exit, Failure};

/// Runs a built-in controller as a process of its own; `freeplay run` starts it.
#[derive(Args, Debug)]
pub struct ControllerArgs {
    /// Name of the controller.
    name: String,
    /// Address of the run in shared memory.
    #[arg(long, env = "FREEPLAY_RUN")]
    run: String,
    /// Slot to ask for.
    #[arg(long, env = "FREEPLAY_SLOT", default_value_t = 0)]
    slot: u32,
    /// SCHED_FIFO priority to ask for.
    #[arg(long)]
    priority: Option<u8>,
    /// Core to stay on.
    #[arg(long)]
    cpu: Option<usize>,
    /// Lock all memory.
    #[arg(long)]
    lock_memory: bool,
    /// End when the parent process ends.
    #[arg(long)]
    with_parent: bool,
}

/// Serves one run.
///
/// # Errors
/// An unknown name, a run that can't be joined, a task that can't be used.
pub fn controller(args: &ControllerArgs) -> Result<Exit, Failure> {
    if args.with_parent {
        crate::process::end_with_parent()?;
    }
    let mut controller = built_in(&args.name).ok_or_else(|| unknown(&args.name))?;
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

/// No built-in controller has this name.
pub fn unknown(name: &str) -> Failure {
    Failure::usage(format!(
        "no controller {name:?}: built-in are {}; for a controller of your own give the path of its executable",
        BUILT_IN.join(", ")
    ))
}
