//! The plant's description of a run.

use freeplay_shm::{Mode, Pace};

/// The run, as the plant's welcome describes it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RunInfo {
    /// Number of joints of the arm.
    pub joints: usize,
    /// Mode of the joints' motion.
    pub mode: Mode,
    /// Pace of the plant's steps.
    pub pace: Pace,
    /// Time between two ticks, ns.
    pub period_ns: u64,
    /// Length of the run, ticks.
    pub ticks: u64,
}
