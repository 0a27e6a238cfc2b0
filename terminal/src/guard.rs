//! The guard of an executable: a process that only waits for the end of its parent, and then ends together with all processes that the executable has started.
//!
//! The system kills a child with its parent (see [`crate::process::die_with_parent`]), but no grandchild: not the interpreter that a shell script has started,
//! not the worker of a controller. So each executable shares a process group with a guard, which starts first and waits for the end of its standard input: the
//! other end of that pipe closes with `freeplay run`, however that ends.

use std::io::Read;
use std::os::unix::process::CommandExt;
use std::process::{Child, Command, Stdio};
use std::sync::Arc;

use rustix::process::{Pid, Signal, getpgrp, kill_process_group};

use crate::exit::{Exit, Failure};

/// A process group with a guard; dropping it kills the whole group.
pub struct Group {
    guard: Child,
}

impl Group {
    /// A group with the guard alone.
    ///
    /// # Errors
    /// A process that can't be started.
    pub fn start() -> Result<Self, Failure> {
        let program = std::env::current_exe().map_err(Failure::internal)?;
        let mut command = Command::new(program);
        command.arg("guard").process_group(0);
        command.stdin(Stdio::piped()).stdout(Stdio::null()).stderr(Stdio::null());
        let guard = command.spawn();
        Ok(Self {
            guard: guard.map_err(|error| Failure::internal(format!("cannot start a guard: {error}")))?,
        })
    }

    /// Makes `command` start in this group.
    pub fn take(&self, command: &mut Command) {
        command.process_group(self.guard.id().cast_signed());
    }
}

impl Drop for Group {
    fn drop(&mut self) {
        if let Some(group) = Pid::from_raw(self.guard.id().cast_signed()) {
            // An error means that the group has ended already.
            let _ = kill_process_group(group, Signal::KILL);
        }
        let _ = self.guard.wait();
    }
}

/// The guard's main function: waits for the end of standard input, then kills its process group with itself.
///
/// # Errors
/// The system's error.
pub fn guard() -> Result<Exit, Failure> {
    // A closing terminal signals the whole session. The guard ends last.
    crate::process::stop_on_signals(&Arc::default())?;
    let mut nothing = Vec::new();
    let _ = std::io::stdin().read_to_end(&mut nothing);
    kill_process_group(getpgrp(), Signal::KILL).map_err(Failure::internal)?;
    Ok(Exit::Done)
}
