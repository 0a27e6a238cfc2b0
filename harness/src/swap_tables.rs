//! The tables of a scenario for changes of the controller.

use std::path::PathBuf;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Planned swap of the controller.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SwapTable {
    /// First tick whose answer comes from the new controller. That answer is in force from the next tick on.
    pub tick: u64,
    /// Name of the new controller: the controller of the run or a standby.
    pub to: String,
}

/// Comparison of the commands of two controllers.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct CompareTable {
    /// Greatest permitted difference between the controllers' commands for each joint, N·m or rad. With `sound`, this tolerance is added to
    /// the difference in the sound run.
    pub tolerance: Vec<f64>,
    /// Recording of a sound run of the same motion with the same controllers in the same order. The plant permits the differences that this
    /// run shows within two ticks. Absent: only the tolerance is permitted.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sound: Option<PathBuf>,
    /// Consecutive ticks of disagreement after which the plant rejects the commands of the active controller.
    #[serde(default = "CompareTable::default_ticks")]
    pub ticks: u32,
}

impl CompareTable {
    fn default_ticks() -> u32 {
        2
    }
}
