//! Faults of the program itself: a panic, and an allocation that fails. Each ends the process with [`Exit::Internal`] and one line.
//!
//! The standard library reports a failed allocation with its size, and aborts. No code of this program runs after that: an analyst, a generator or a controller
//! dies with its parent, and a plant without its parent removes the run from shared memory. The system sends SIGBUS for a write to shared memory that was
//! filled up or truncated meanwhile; the signal ends a process in the same way, without a message.

use std::any::Any;
use std::panic::{AssertUnwindSafe, PanicHookInfo, catch_unwind};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use signal_hook::consts::{SIGABRT, SIGBUS};
use signal_hook::flag::register_conditional_shutdown;

use crate::exit::{Exit, Failure};
use crate::messages;

/// True if a panic has been reported. Further panics are its consequences, as in a scope that joins a thread.
static IS_REPORTED: AtomicBool = AtomicBool::new(false);

/// Calls `work`. A panic in it is reported in one line and becomes [`Exit::Internal`]; so does an abort of the process, or the loss of shared memory.
///
/// # Errors
/// Those of `work`; the system's error for the handler.
pub fn guarded(work: impl FnOnce() -> Result<Exit, Failure>) -> Result<Exit, Failure> {
    let code = i32::from(Exit::Internal as u8);
    for signal in [SIGABRT, SIGBUS] {
        register_conditional_shutdown(signal, code, Arc::new(AtomicBool::new(true)))
            .map_err(Failure::internal)?;
    }
    std::panic::set_hook(Box::new(report));
    // `work` is not called again, and owns its data.
    catch_unwind(AssertUnwindSafe(work)).unwrap_or(Ok(Exit::Internal))
}

fn report(panic: &PanicHookInfo) {
    if IS_REPORTED.swap(true, Ordering::Relaxed) {
        return;
    }
    let place = panic.location().map_or_else(String::new, |place| format!(" at {place}"));
    messages::fault(format_args!(
        "internal fault{place}: {}; please report it with the command line and its input",
        text(panic.payload())
    ));
}

/// The message of a panic.
fn text(payload: &dyn Any) -> &str {
    let literal = payload.downcast_ref::<&str>().copied();
    literal
        .or_else(|| payload.downcast_ref::<String>().map(String::as_str))
        .unwrap_or("a panic without a message")
}
