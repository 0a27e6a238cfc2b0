//! `freeplay controller`: the process of a controller, to which an exam may add faults.

use freeplay_exam::faults::fault_injector::relay;
use freeplay_harness::controller_command::{ControllerArgs, controller as serve};
use freeplay_terminal::exit::{Exit, Failure};
use freeplay_terminal::process::{die_with_parent, leave_signals_alone};

/// Serves one run.
///
/// # Errors
/// Errors of the controller, or of the process that injects faults.
pub fn controller(args: &ControllerArgs) -> Result<Exit, Failure> {
    args.with_parent.map_or(Ok(()), die_with_parent)?;
    // A controller leaves its run in order; an external executable handles signals itself.
    leave_signals_alone();
    match &args.faults {
        Some(plan) => relay(args, plan),
        None => serve(args),
    }
}
