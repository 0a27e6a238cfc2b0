//! The result of a bench, as JSON and as HdrHistogram's files; in words: `bench_words`, as HTML: `bench_page`.

use std::path::Path;

use freeplay_harness::histogram_files::{write_distribution, write_tagged};
use freeplay_harness::scenario::Scenario;
use freeplay_harness::summary::percentiles;
use freeplay_terminal::exit::Failure;
use freeplay_terminal::files::write;
use serde_json::{Value, json};

use crate::bench::blocks::{Block, ByStage};
use crate::bench::figures::merged;
use crate::bench::verdicts::{
    LEAST_CAUSED, MOST_TRANSPORT, MOST_WAKE_UP, Step, Verdicts, YardstickComparison, cliff_of,
};

/// The schema of `bench.json`.
const SCHEMA: &str = "freeplay.bench/1";
/// Name of the bare loop in tables and files.
pub const BARE_CLOCK: &str = "bare clock loop";
/// Name of the bare transport.
pub const BARE_TRANSPORT: &str = "bare iceoryx2";
/// The stages in the order of the tick, with their names.
pub const STAGES: [(&str, &str); 11] = [
    ("wake_up_uncorrected", "wake-up, of ticks waited for"),
    ("wake_up", "lateness, of all ticks"),
    ("state_transport", "publish → receive"),
    ("predict", "prediction"),
    ("qp", "quadratic programme"),
    ("qp_iterated", "… where a limit binds"),
    ("compute", "controller compute"),
    ("command_transport", "command → receive"),
    ("plant_step", "plant step"),
    ("round_trip", "round trip, by the schedule"),
    ("round_trip_uncorrected", "round trip, uncorrected"),
];

/// All results of a bench.
pub struct Report<'a> {
    /// The scenario of a block.
    pub scenario: &'a Scenario,
    /// The machine, with the doctor's findings.
    pub machine: Value,
    /// The verdicts.
    pub verdicts: Verdicts,
    /// The controllers against the yardsticks.
    pub contests: &'a [YardstickComparison],
    /// All blocks.
    pub blocks: &'a [Block],
    /// Blocks with added compute.
    pub cliff: &'a [Step],
}

impl Report<'_> {
    /// The measured controllers and yardsticks, yardsticks first, each with its histograms of all blocks.
    pub fn measured(&self) -> Vec<(String, ByStage)> {
        let mut all = vec![
            (BARE_CLOCK.to_owned(), merged(self.blocks.iter().map(|block| &block.clock))),
            (BARE_TRANSPORT.to_owned(), merged(self.blocks.iter().map(|block| &block.exchange))),
        ];
        for (which, contest) in self.contests.iter().enumerate() {
            let stages = merged(self.blocks.iter().map(|block| &block.full[which].1));
            all.push((contest.controller.clone(), stages));
        }
        all
    }

    /// Writes `bench.json`, `report.html` and a `.hlog` and `.hgrm` of each measured one into `out`; returns the JSON.
    ///
    /// # Errors
    /// A file that can't be written.
    pub fn write(&self, out: &Path) -> Result<String, Failure> {
        let measured = self.measured();
        let stages: serde_json::Map<String, Value> = measured
            .iter()
            .map(|(name, stages)| {
                let each: serde_json::Map<String, Value> =
                    stages.iter().map(|(stage, histogram)| (stage.clone(), percentiles(histogram))).collect();
                (name.clone(), Value::Object(each))
            })
            .collect();
        let text = json!({
            "schema": SCHEMA, "freeplay": env!("CARGO_PKG_VERSION"), "scenario": self.scenario,
            "machine": self.machine, "blocks": self.blocks.len(), "verdicts": self.verdicts,
            "controllers": self.contests, "latency_us": stages, "misses": self.misses(usize::MAX), "cliff": self.cliff,
        });
        let text = serde_json::to_string_pretty(&text).map_err(Failure::internal)?;
        for (name, stages) in &measured {
            let file = file_name(name);
            write_tagged(&out.join(format!("{file}.hlog")), stages)?;
            let shown = ["round_trip", "round_trip_uncorrected", "wake_up"];
            if let Some(histogram) = shown.iter().find_map(|stage| stages.get(*stage)) {
                write_distribution(&out.join(format!("{file}.hgrm")), histogram)?;
            }
        }
        write(&out.join("bench.json"), &text)?;
        write(&out.join("report.html"), &self.document(&measured)?.to_html())?;
        Ok(text)
    }

    /// The first misses of all runs, each with its controller and block.
    pub fn misses(&self, most: usize) -> Vec<Value> {
        let runs = self
            .blocks
            .iter()
            .enumerate()
            .flat_map(|(number, block)| block.full.iter().map(move |(run, _)| (number, run)));
        let misses = runs.flat_map(|(number, run)| {
            let first = run.deadlines["first"].as_array().into_iter().flatten();
            first.map(move |miss| {
                let mut miss = miss.clone();
                (miss["controller"], miss["block"]) = (json!(run.controller), json!(number));
                miss
            })
        });
        misses.take(most).collect()
    }

    /// The compute time at which `controller` exceeds the budget, in words; `None` if no load was added.
    pub fn cliff_words(&self, controller: &str) -> Option<String> {
        if self.cliff.is_empty() {
            return None;
        }
        Some(match cliff_of(self.cliff, controller) {
            None => format!("{controller}: the budget held with all added compute"),
            Some((None, broken)) => {
                format!("{controller}: the budget is broken with {broken} µs of added compute already")
            }
            Some((Some(held), broken)) => {
                format!(
                    "{controller}: the budget held with {held} µs of added compute and broke with {broken} µs"
                )
            }
        })
    }

    /// Requirements on all controllers together, each with its result.
    pub fn verdict_lines(&self) -> [(bool, String); 3] {
        let [wake_up, transport, caused] = self.verdicts.hold();
        let number = |ratio: Option<f64>| {
            ratio.map_or_else(|| "not measured".to_owned(), |ratio| format!("{ratio:.3}"))
        };
        let verdicts = &self.verdicts;
        [
            (
                wake_up,
                format!(
                    "wake-up: p99 of ticks after a wait, relative to the bare loop: {}, median of the blocks, limit {MOST_WAKE_UP}",
                    number(verdicts.wake_up_p99)
                ),
            ),
            (
                transport,
                format!(
                    "transport: p50 relative to bare iceoryx2: {}, limit {MOST_TRANSPORT}",
                    number(verdicts.transport_p50)
                ),
            ),
            (
                caused,
                format!(
                    "causes: {} of {} missed deadlines have a known cause, limit {:.0} %",
                    verdicts.caused,
                    verdicts.missed,
                    LEAST_CAUSED * 100.0
                ),
            ),
        ]
    }
}

/// Number of missed deadlines for each cause.
pub fn causes_alone(contest: &YardstickComparison) -> String {
    let each = contest.causes.iter().map(|(cause, count)| format!("{} {count}", cause.replace('_', " ")));
    each.collect::<Vec<_>>().join(", ")
}

fn file_name(name: &str) -> String {
    name.rsplit('/').next().unwrap_or(name).replace(' ', "-")
}
