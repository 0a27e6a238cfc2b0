//! Processes: signals, the parent, and commands of this program.

use std::process::Command;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, OnceLock};

use nix::sys::signal::{SIGHUP as HANG_UP, SIGINT as INTERRUPT, SIGTERM as TERMINATE, SigSet, SigmaskHow};
use rustix::process::{Signal, getppid, set_parent_process_death_signal};
use signal_hook::consts::{SIGHUP, SIGINT, SIGTERM, SIGXFSZ};
use signal_hook::flag::{register, register_conditional_shutdown};

use crate::exit::{Exit, Failure};

/// True if a signal ends this process at once.
static ENDS_AT_ONCE: OnceLock<Arc<AtomicBool>> = OnceLock::new();

/// Makes SIGINT, SIGTERM and SIGHUP end this process at once with the exit code of an interruption, until a call of [`stop_on_signals`] by a command that has
/// to finish in order.
///
/// # Errors
/// The system's error.
pub fn end_on_signals() -> Result<(), Failure> {
    let at_once = ENDS_AT_ONCE.get_or_init(|| Arc::new(AtomicBool::new(true)));
    // The first handler of a signal is set before its action, so that a signal in between would be lost. Blocking the signal makes it wait.
    let mut waiting = SigSet::empty();
    [INTERRUPT, TERMINATE, HANG_UP].into_iter().for_each(|signal| waiting.add(signal));
    let before = waiting.thread_swap_mask(SigmaskHow::SIG_BLOCK).map_err(Failure::internal)?;
    let code = i32::from(Exit::Interrupted as u8);
    let registered = stop_signals()
        .try_for_each(|signal| register_conditional_shutdown(signal, code, Arc::clone(at_once)).map(drop));
    before.thread_set_mask().map_err(Failure::internal)?;
    registered.map_err(Failure::internal)
}

/// Makes SIGINT, SIGTERM and SIGHUP set `stop`. A file that reaches the largest permitted size (`ulimit -f`) makes the write fail like a full disk, instead of
/// ending the process.
///
/// # Errors
/// The system's error.
pub fn stop_on_signals(stop: &Arc<AtomicBool>) -> Result<(), Failure> {
    for signal in stop_signals() {
        register(signal, Arc::clone(stop)).map_err(Failure::internal)?;
    }
    // No code reads the flag: handling the signal suffices for the write to return.
    register(SIGXFSZ, Arc::default()).map_err(Failure::internal)?;
    // Last, so that no signal in between is lost.
    leave_signals_alone();
    Ok(())
}

/// Reverts [`end_on_signals`].
pub fn leave_signals_alone() {
    if let Some(at_once) = ENDS_AT_ONCE.get() {
        at_once.store(false, Ordering::Relaxed);
    }
}

/// The signals that ask a process to end. A process that was started with SIGHUP ignored, as by `nohup`, continues without a terminal.
fn stop_signals() -> impl Iterator<Item = i32> {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let ignored = status.lines().find_map(|line| line.strip_prefix("SigIgn:"));
    let ignored = ignored.and_then(|mask| u64::from_str_radix(mask.trim(), 16).ok()).unwrap_or(0);
    let hears_hang_ups = ignored & 1 << (SIGHUP - 1) == 0;
    [SIGINT, SIGTERM].into_iter().chain(hears_hang_ups.then_some(SIGHUP))
}

/// Asks the system to kill this process when its parent, the process `parent`, dies, so that a killed `freeplay run` leaves no process. This also holds for a
/// program that replaces this process, whatever it does about signals.
///
/// # Errors
/// The system's error; or the parent is gone already.
pub fn die_with_parent(parent: u32) -> Result<(), Failure> {
    end_with_parent(parent, Signal::KILL)
}

/// The same with SIGTERM, for a process that has to finish in order.
///
/// # Errors
/// As [`die_with_parent`].
pub fn stop_with_parent(parent: u32) -> Result<(), Failure> {
    end_with_parent(parent, Signal::TERM)
}

fn end_with_parent(parent: u32, signal: Signal) -> Result<(), Failure> {
    set_parent_process_death_signal(Some(signal)).map_err(Failure::internal)?;
    // The parent may have died before this call.
    if is_parent_alive(parent) {
        Ok(())
    } else {
        Err(Failure::peer(format!("process {parent}, which started this one, has ended")))
    }
}

/// True if the process `parent`, which started this one, still lives: an orphan has another parent.
pub fn is_parent_alive(parent: u32) -> bool {
    getppid().is_some_and(|pid| pid.as_raw_nonzero().get().cast_unsigned() == parent)
}

/// A command of this program for a process that may lock its memory.
///
/// The allocator, mimalloc, takes 1 GiB of address space at a time. By default it makes all of it writable at once, and `mlockall` then fills all of it with
/// pages, which can take longer than a run waits for its controllers. In a process of this command it makes writable what it hands out.
///
/// # Errors
/// The path of this program is unknown.
pub fn command_with_locked_memory() -> Result<Command, Failure> {
    let mut command = Command::new(std::env::current_exe().map_err(Failure::internal)?);
    command.env("MIMALLOC_ARENA_EAGER_COMMIT", "0");
    Ok(command)
}
