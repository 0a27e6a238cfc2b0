//! The tables of a scenario for changes of the controller.

use std::path::PathBuf;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// A change of controller at a tick.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SwapTable {
    /// Tick whose answer is to be the new controller's; it is in force from the next tick on.
    pub tick: u64,
    /// The new controller: the one of the run or a standby, by its name.
    pub to: String,
}

/// When two controllers disagree.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct CompareTable {
    /// Greatest difference of each joint's command between controllers that agree, N·m or rad; with `sound`: beyond what is usual.
    pub tolerance: Vec<f64>,
    /// A recording of a sound run of the same motion with the same controllers in the same order: what they differed by there within two
    /// ticks is usual. Without it, the tolerance holds for the whole motion.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sound: Option<PathBuf>,
    /// Ticks in a row for which they disagree before the one in charge is not believed.
    #[serde(default = "CompareTable::default_ticks")]
    pub ticks: u32,
}

impl CompareTable {
    fn default_ticks() -> u32 {
        2
    }
}
