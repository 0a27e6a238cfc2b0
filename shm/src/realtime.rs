//! Real-time set-up of the calling thread, and the facts of the machine: asked for, reported, never required.

use serde::Serialize;

/// What to ask of the system for the calling thread.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct RtRequest {
    /// `SCHED_FIFO` priority, 1 to 99; `None` keeps the default scheduler.
    pub priority: Option<u8>,
    /// Number of the core to stay on; `None` leaves the choice to the system.
    pub cpu: Option<usize>,
    /// Whether to keep all pages of the process in memory.
    pub lock_memory: bool,
}

/// What became of one request.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Outcome {
    /// Not asked for.
    NotAsked,
    /// In force.
    Granted,
    /// Refused; the text says why.
    Refused(String),
}

/// What became of a [`RtRequest`].
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct RtReport {
    /// `SCHED_FIFO` at the priority asked for.
    pub priority: Outcome,
    /// Staying on the core asked for.
    pub cpu: Outcome,
    /// All pages kept in memory.
    pub lock_memory: Outcome,
    /// The machine as it is after that.
    pub machine: Machine,
}

/// Facts of the machine and of the calling thread that timing depends on.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Machine {
    /// Model name of the processor.
    pub cpu: String,
    /// Number of cores this process may use.
    pub cores: usize,
    /// Name and release of the kernel.
    pub kernel: String,
    /// Whether the runs' folder is on tmpfs.
    pub tmpfs: bool,
    /// Scheduler in force for the calling thread: `SCHED_OTHER`, `SCHED_FIFO`, …
    pub scheduler: String,
    /// Real-time priority in force, 0 without.
    pub priority: u8,
    /// Whether the pages of the process are kept in memory.
    pub mlock: bool,
    /// How lockstep waits on this machine.
    pub wait_policy: String,
}

/// Asks the system for what `request` says, for the calling thread, and reports what became of it.
#[must_use]
pub fn prepare(request: &RtRequest) -> RtReport {
    let _ = request;
    unimplemented!()
}

impl RtReport {
    /// One line per item that was asked for and refused.
    #[must_use]
    pub fn refusals(&self) -> Vec<String> {
        unimplemented!()
    }
}

impl Machine {
    /// Reads the facts; what cannot be read is `"unknown"`.
    #[must_use]
    pub fn read() -> Self {
        unimplemented!()
    }
}
