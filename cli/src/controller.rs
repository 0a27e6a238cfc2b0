//! `freeplay controller`: the process of a controller, which an exam may make faulty.

use freeplay_exam::faults::saboteur::relay;
use freeplay_harness::controller_command::{ControllerArgs, controller as serve};
use freeplay_terminal::exit::{Exit, Failure};
use freeplay_terminal::process::end_with_parent;

/// Serves one run.
///
/// # Errors
/// As the controller, or the process that makes it faulty.
pub fn controller(args: &ControllerArgs) -> Result<Exit, Failure> {
    args.with_parent.map_or(Ok(()), end_with_parent)?;
    match &args.faults {
        Some(plan) => relay(args, plan),
        None => serve(args),
    }
}
