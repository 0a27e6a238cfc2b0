//! The plant's words about a run.

use freeplay_shm::{Mode, Pace};

/// The run, as the plant's welcome describes it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RunInfo {
    /// Number of joints of the arm.
    pub joints: usize,
    /// Who moves the joints.
    pub mode: Mode,
    /// When the plant takes its next step.
    pub pace: Pace,
    /// Time between two ticks, ns.
    pub period_ns: u64,
    /// Length of the run, ticks.
    pub ticks: u64,
}
