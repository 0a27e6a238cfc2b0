//! Data of a run for the live view, a few times a second.

use std::collections::BTreeMap;

use freeplay_plant::{Applied, IMPACT_LIMIT};
use serde::{Deserialize, Serialize};

/// Contact of a journal with its bearing.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ContactMode {
    /// No contact.
    Free,
    /// A contact that has lasted less than 2 ms so far.
    Impact,
    /// A lasting contact.
    Continuous,
}

impl ContactMode {
    /// The mode of a contact that has lasted for `episode` s; zero means free flight.
    pub fn of(episode: f64) -> Self {
        match episode {
            _ if episode <= 0.0 => Self::Free,
            _ if episode < IMPACT_LIMIT => Self::Impact,
            _ => Self::Continuous,
        }
    }

    /// Name of the mode.
    pub fn name(self) -> &'static str {
        match self {
            Self::Free => "free flight",
            Self::Impact => "impact",
            Self::Continuous => "contact",
        }
    }
}

/// One joint with play.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct PlaySnapshot {
    /// Contact at the last tick.
    pub mode: ContactMode,
    /// Ticks so far in free flight, impact and lasting contact.
    pub ticks: [u64; 3],
    /// Greatest normal force since the last snapshot, N.
    pub peak_normal_force: f64,
    /// Offsets of the journal since the last snapshot, every few ticks, in the plane across the axis, m.
    pub orbit: Vec<[f64; 2]>,
}

/// Latency of a stage since the start, µs.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct StageSnapshot {
    /// Name of the stage.
    pub stage: String,
    /// Percentiles 50, 99, 99.9 and the maximum.
    pub percentiles: [f64; 4],
}

/// A snapshot of a run.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct LiveSnapshot {
    /// The last tick.
    pub tick: u64,
    /// The tool's deviation at that tick, base frame, m.
    pub deviation: [f64; 3],
    /// RMS and maximum of its size after the start of the run, m.
    pub rms_max: [f64; 2],
    /// Time, s, and size of the deviation, m, since the last snapshot: the maximum of every few ticks.
    pub trace: Vec<[f64; 2]>,
    /// The joints with play.
    pub plays: Vec<PlaySnapshot>,
    /// Slot of the active controller.
    pub in_charge: usize,
    /// Command in force on the joints.
    pub applied: Applied,
    /// Rejected answers of the active controller, by reason.
    pub rejected: BTreeMap<String, u64>,
    /// Latencies by stage.
    pub stages: Vec<StageSnapshot>,
    /// Marks set so far.
    pub marks: u32,
}

impl LiveSnapshot {
    /// Size of the deviation at the last tick, m.
    pub fn size(&self) -> f64 {
        self.deviation.iter().map(|along| along * along).sum::<f64>().sqrt()
    }
}
