//! Processes: signals, the parent, and children that end with their owner.

use std::process::Child;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use rustix::process::{Signal, set_parent_process_death_signal};
use signal_hook::consts::{SIGINT, SIGTERM, SIGXFSZ};

use crate::exit::Failure;

/// A child process; ended when this is dropped.
pub struct Running(pub Child);

impl Drop for Running {
    fn drop(&mut self) {
        // Errors here mean that the child is gone already, which is what is wanted.
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// Makes SIGINT and SIGTERM set `stop`, and a file that reaches the largest size allowed (`ulimit -f`) an error of the
/// write like a full disk, where it would end the process.
///
/// # Errors
/// What the system says.
pub fn stop_on_signals(stop: &Arc<AtomicBool>) -> Result<(), Failure> {
    for signal in [SIGINT, SIGTERM] {
        signal_hook::flag::register(signal, Arc::clone(stop)).map_err(Failure::internal)?;
    }
    // Nobody reads the flag: that the signal is handled is enough for the write to return.
    signal_hook::flag::register(SIGXFSZ, Arc::default()).map_err(Failure::internal)?;
    Ok(())
}

/// Asks the system to end this process with SIGTERM when its parent, the process `parent`, dies, so that a killed
/// `freeplay run` leaves none. It holds for a program that takes this process over, too.
///
/// # Errors
/// What the system says; or the parent is gone already.
pub fn end_with_parent(parent: u32) -> Result<(), Failure> {
    set_parent_process_death_signal(Some(Signal::TERM)).map_err(Failure::internal)?;
    if std::os::unix::process::parent_id() == parent {
        Ok(())
    } else {
        Err(Failure::peer(format!("process {parent}, which started this one, has ended")))
    }
}
