//! The result of a bench: each controller against the yardsticks, the verdicts, the compute limit.

use std::collections::BTreeMap;

use freeplay_harness::summary::RunSummary;
use serde::Serialize;
use serde_json::{Value, json};

use crate::bench::blocks::Block;
use crate::bench::figures::{Compared, Ratio, caught_up, ratios};

/// Largest permitted ratio of the wake-up's p99 to that of the bare loop.
pub const MOST_WAKE_UP: f64 = 1.10;
/// Largest permitted ratio of the transport's p50 to that of bare iceoryx2.
pub const MOST_TRANSPORT: f64 = 1.15;
/// Least share of missed deadlines with a known cause.
pub const LEAST_CAUSED: f64 = 0.95;
/// Share of missed deadlines at which the budget counts as exceeded.
pub const EXCEEDED_SHARE: f64 = 0.01;

/// One controller against the yardsticks.
#[derive(Debug, Serialize)]
pub struct YardstickComparison {
    /// The controller.
    pub controller: String,
    /// Ratios of the wake-up of awaited ticks to that of the bare loop at p50, p99, p99.9.
    pub wake_up: [Option<Ratio>; 3],
    /// Ratios of the lateness of all ticks to that of the bare loop.
    pub lateness: [Option<Ratio>; 3],
    /// Ratios of the transport to that of bare iceoryx2.
    pub transport: [Option<Ratio>; 3],
    /// Ticks played.
    pub ticks: u64,
    /// Ticks that were already due when the loop reached them: it was catching up after a stall, without a wake-up.
    pub caught_up: u64,
    /// The same for the bare loop.
    pub bare_caught_up: u64,
    /// Ticks without an answer in time, and ticks at which the plant itself was a period late.
    pub missed: u64,
    /// Number of missed ticks by cause.
    pub causes: BTreeMap<String, u64>,
}

impl YardstickComparison {
    pub fn of(blocks: &[Block], which: usize, controller: &str) -> Self {
        let mut causes = BTreeMap::new();
        let [mut ticks, mut missed, mut ours, mut bare] = [0; 4];
        for (block, (run, stages)) in blocks.iter().map(|block| (block, &block.full[which])) {
            ticks += run.ticks;
            ours += caught_up(stages);
            bare += caught_up(&block.clock);
            missed += missed_of(run);
            for (cause, count) in run.deadlines["by_evidence"].as_object().into_iter().flatten() {
                *causes.entry(cause.clone()).or_insert(0) += count.as_u64().unwrap_or(0);
            }
        }
        Self {
            controller: controller.to_owned(),
            wake_up: ratios(blocks, which, Compared::WakeUp),
            lateness: ratios(blocks, which, Compared::Lateness),
            transport: ratios(blocks, which, Compared::Transport),
            ticks,
            caught_up: ours,
            bare_caught_up: bare,
            missed,
            causes,
        }
    }

    /// The comparisons, in words, with their ratios.
    pub fn compared(&self) -> [(&'static str, &[Option<Ratio>; 3]); 3] {
        [
            ("wake-up", &self.wake_up),
            ("lateness, catching up included", &self.lateness),
            ("transport", &self.transport),
        ]
    }
}

/// Requirements on all controllers together, with the results.
#[derive(Debug, Serialize)]
pub struct Verdicts {
    /// Greatest ratio of a wake-up's p99, the median of the blocks: each block is compared with the bare loop's block next to it, so that a disturbance of one
    /// block by the host does not matter.
    pub wake_up_p99: Option<f64>,
    /// Greatest ratio of a transport's p50.
    pub transport_p50: Option<f64>,
    /// Missed deadlines.
    pub missed: u64,
    /// Number of these with a cause.
    pub caused: u64,
    limits: Value,
}

impl Verdicts {
    pub fn of(contests: &[YardstickComparison]) -> Self {
        let most = |of: &dyn Fn(&YardstickComparison) -> Option<f64>| {
            contests.iter().filter_map(of).reduce(f64::max)
        };
        let unknown: u64 = contests.iter().filter_map(|contest| contest.causes.get("unknown")).sum();
        let missed = contests.iter().map(|contest| contest.missed).sum::<u64>();
        Self {
            wake_up_p99: most(&|contest| contest.wake_up[1].map(|ratio| ratio.median)),
            transport_p50: most(&|contest| contest.transport[0].map(|ratio| ratio.all)),
            missed,
            caused: contests.iter().flat_map(|contest| contest.causes.values()).sum::<u64>() - unknown,
            limits: json!({ "wake_up_p99": MOST_WAKE_UP, "transport_p50": MOST_TRANSPORT, "caused": LEAST_CAUSED }),
        }
    }

    /// Results of the three limits: wake-up, transport and causes.
    pub fn hold(&self) -> [bool; 3] {
        [
            self.wake_up_p99.is_some_and(|ratio| ratio <= MOST_WAKE_UP),
            self.transport_p50.is_some_and(|ratio| ratio <= MOST_TRANSPORT),
            self.caused as f64 >= LEAST_CAUSED * self.missed as f64,
        ]
    }
}

/// A block with added compute.
#[derive(Debug, Serialize)]
pub struct Step {
    /// The controller.
    pub controller: String,
    /// Added compute of each answer, µs.
    pub load_us: f64,
    /// Share of the ticks with a missed deadline; 1 if the run ended before its last tick.
    pub missed_share: f64,
    /// The round trip, µs.
    pub round_trip_us: Value,
}

/// The largest added compute time of `controller` that kept the budget, µs, and the first that exceeded it.
pub fn cliff_of(cliff: &[Step], controller: &str) -> Option<(Option<f64>, f64)> {
    let steps = || cliff.iter().filter(|step| step.controller == controller);
    let broken = steps()
        .filter(|step| step.missed_share > EXCEEDED_SHARE)
        .map(|step| step.load_us)
        .reduce(f64::min)?;
    let held = steps().map(|step| step.load_us).filter(|&load| load < broken).reduce(f64::max);
    Some((held, broken))
}

/// Missed deadlines of a run, by the controller or by the plant.
fn missed_of(run: &RunSummary) -> u64 {
    ["missed", "plant_late"].iter().filter_map(|key| run.deadlines[key].as_u64()).sum()
}

#[cfg(test)]
mod tests {
    use super::{Step, cliff_of};

    #[test]
    fn the_cliff_lies_between_the_last_load_that_held_and_the_first_that_did_not() {
        let step = |load_us, missed_share| Step {
            controller: "a".to_owned(),
            load_us,
            missed_share,
            round_trip_us: serde_json::Value::Null,
        };
        let steps = [step(0.0, 0.0), step(400.0, 0.002), step(800.0, 0.3), step(1200.0, 1.0)];
        assert_eq!(cliff_of(&steps, "a"), Some((Some(400.0), 800.0)));
        assert_eq!(cliff_of(&steps[..2], "a"), None);
        assert_eq!(cliff_of(&steps[2..], "a"), Some((None, 800.0)));
    }
}
