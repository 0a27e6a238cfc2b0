//! A bench in words, as JSON, as HdrHistogram's files and as HTML.

use std::path::Path;

use comfy_table::{CellAlignment, Table as TextTable, presets};
use freeplay_report::{
    Axis, Block as Part, Cell, Chart, Column, Document, Mark, Section, Series, Table, Verdict,
};
use hdrhistogram::Histogram;
use serde_json::{Value, json};

use crate::bench::blocks::{Block, ByStage};
use crate::bench::figures::{QUANTILES, Ratio, curve, merged};
use crate::bench::{BROKEN, Contest, LEAST_CAUSED, MOST_TRANSPORT, MOST_WAKE_UP, Step, Verdicts, cliff_of};
use crate::exit::Failure;
use crate::histogram_files::{write_distribution, write_tagged};
use crate::scenario::Scenario;
use crate::setup::write;
use crate::summary::percentiles;

/// The schema of `bench.json`.
const SCHEMA: &str = "freeplay.bench/1";
/// Name of the bare loop in tables and files.
const CLOCK: &str = "bare clock loop";
/// Name of the bare transport.
const EXCHANGE: &str = "bare iceoryx2";
/// Misses that are shown one by one.
const MOST_SHOWN: usize = 20;
/// The stages in the order of the tick, with what they are called.
const STAGES: [(&str, &str); 9] = [
    ("wake_up", "wake-up"),
    ("state_transport", "publish → receive"),
    ("predict", "prediction"),
    ("qp", "quadratic programme"),
    ("compute", "controller compute"),
    ("command_transport", "command → receive"),
    ("plant_step", "plant step"),
    ("round_trip", "round trip, by the schedule"),
    ("round_trip_uncorrected", "round trip, uncorrected"),
];

/// All that a bench came to.
pub struct Report<'a> {
    /// The scenario of a block.
    pub scenario: &'a Scenario,
    /// The machine, with what the doctor says of it.
    pub machine: Value,
    /// What holds.
    pub verdicts: Verdicts,
    /// The controllers against the yardsticks.
    pub contests: &'a [Contest],
    /// All blocks.
    pub blocks: &'a [Block],
    /// Blocks with added compute.
    pub cliff: &'a [Step],
}

impl Report<'_> {
    /// Who was measured, yardsticks first, each with its histograms of all blocks.
    fn measured(&self) -> Vec<(String, ByStage)> {
        let mut all = vec![
            (CLOCK.to_owned(), merged(self.blocks.iter().map(|block| &block.clock))),
            (EXCHANGE.to_owned(), merged(self.blocks.iter().map(|block| &block.exchange))),
        ];
        for (which, contest) in self.contests.iter().enumerate() {
            let stages = merged(self.blocks.iter().map(|block| &block.full[which].1));
            all.push((contest.controller.clone(), stages));
        }
        all
    }

    /// Writes `bench.json`, `report.html` and a `.hlog` and `.hgrm` of each that was measured into `out`; the JSON.
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
    fn misses(&self, most: usize) -> Vec<Value> {
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

    /// For the terminal.
    pub fn in_words(&self, out: &Path) -> String {
        let mut table = TextTable::new();
        table.load_style(presets::NOTHING);
        let quantiles = QUANTILES.map(|(name, _)| name);
        table.set_header(["stage [µs]", "", quantiles[0], quantiles[1], quantiles[2], "max", "count"]);
        let measured = self.measured();
        for (stage, title) in STAGES {
            for (name, stages) in &measured {
                let Some(histogram) = stages.get(stage) else { continue };
                table.add_row(row(title, name, histogram));
            }
        }
        for column in 2..7 {
            if let Some(column) = table.column_mut(column) {
                column.set_cell_alignment(CellAlignment::Right);
            }
        }
        let realtime = &self.scenario.realtime;
        let core =
            |cpu: Option<usize>| cpu.map_or_else(|| "any core".to_owned(), |cpu| format!("core {cpu}"));
        let mut text = format!(
            "{} blocks of {} ticks each in turn, {} Hz, plant on {}, controller on {}\n\n{table}\n\n{}\n\n",
            self.blocks.len(),
            self.scenario.duration.unwrap_or(0.0) * self.scenario.rate,
            self.scenario.rate,
            core(realtime.plant_cpu),
            core(realtime.controller_cpu),
            self.ratio_table(),
        );
        for contest in self.contests.iter().filter(|contest| contest.missed > 0) {
            text += &format!("{}: {}\n", contest.controller, causes(contest));
        }
        for contest in self.contests {
            text += &self.cliff_words(&contest.controller).map_or(String::new(), |words| words + "\n");
        }
        for (holds, words) in self.verdict_lines() {
            text += &format!("{} {words}\n", if holds { "holds  " } else { "FAILS  " });
        }
        let machine = self.machine["doctor"]["verdict"]["words"].as_str().unwrap_or("?");
        text + &format!(
            "this machine: {machine} (see freeplay doctor)\n\nreport      {}\nlatencies   {}/*.hlog, *.hgrm\n",
            out.join("report.html").display(),
            out.display()
        )
    }

    fn ratio_table(&self) -> TextTable {
        let mut table = TextTable::new();
        table.load_style(presets::NOTHING);
        table.set_header(["of the yardstick", "", "p50 [blocks]", "p99 [blocks]", "p99.9 [blocks]"]);
        for contest in self.contests {
            for (what, ratios) in [("wake-up", &contest.wake_up), ("transport", &contest.transport)] {
                let [p50, p99, p999] = ratios.map(in_words);
                table.add_row([what.to_owned(), contest.controller.clone(), p50, p99, p999]);
            }
        }
        table
    }

    fn cliff_words(&self, controller: &str) -> Option<String> {
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

    fn verdict_lines(&self) -> [(bool, String); 3] {
        let [wake_up, transport, caused] = self.verdicts.hold();
        let number = |ratio: Option<f64>| {
            ratio.map_or_else(|| "not measured".to_owned(), |ratio| format!("{ratio:.3}"))
        };
        let verdicts = &self.verdicts;
        [
            (
                wake_up,
                format!(
                    "wake-up: p99 {} of the bare loop's at most, limit {MOST_WAKE_UP}",
                    number(verdicts.wake_up_p99)
                ),
            ),
            (
                transport,
                format!(
                    "transport: p50 {} of bare iceoryx2's at most, limit {MOST_TRANSPORT}",
                    number(verdicts.transport_p50)
                ),
            ),
            (
                caused,
                format!(
                    "causes: {} of {} missed deadlines have one, limit {:.0} %",
                    verdicts.caused,
                    verdicts.missed,
                    LEAST_CAUSED * 100.0
                ),
            ),
        ]
    }

    fn document(&self, measured: &[(String, ByStage)]) -> Result<Document, Failure> {
        let mut document = Document::new("Freeplay bench").subtitle(format!(
            "{} controllers, {} blocks in turn with a bare clock loop and bare iceoryx2",
            self.contests.len(),
            self.blocks.len()
        ));
        for (holds, words) in self.verdict_lines() {
            document = document.overview(Part::Verdict(Verdict::passed(holds), words));
        }
        document = document.section(self.ratio_section()).section(stage_section(measured));
        document = document.section(self.miss_section());
        if !self.cliff.is_empty() {
            document = document.section(self.cliff_section());
        }
        let pretty = |value: &Value| serde_json::to_string_pretty(value).map_err(Failure::internal);
        let section = Section::new("Machine and configuration")
            .with(Part::Code(pretty(&self.machine)?))
            .with(Part::Code(self.scenario.to_toml().map_err(Failure::internal)?));
        Ok(document.section(section).footer(format!("freeplay {}", env!("CARGO_PKG_VERSION"))))
    }

    fn ratio_section(&self) -> Section {
        let mut table = Table::new("Ours over the yardstick")
            .column(Column::text("controller"))
            .column(Column::text("what"))
            .column(Column::text("at"))
            .column(Column::number("all blocks together", "").fixed(3));
        for title in ["least", "median", "greatest"] {
            table = table.column(Column::number(title, "").fixed(3).group("of the blocks"));
        }
        for contest in self.contests {
            for (what, ratios) in [("wake-up", &contest.wake_up), ("transport", &contest.transport)] {
                for ((quantile, _), ratio) in QUANTILES.iter().zip(ratios) {
                    let Some(ratio) = ratio else { continue };
                    let numbers = [ratio.all, ratio.least, ratio.median, ratio.greatest].map(Cell::from);
                    let words = [Cell::series(&contest.controller), what.into(), (*quantile).into()];
                    table = table.row(words.into_iter().chain(numbers));
                }
            }
        }
        Section::new("Beside the yardsticks").with(table).with(
            "The yardsticks run on the same cores, at the same priority and with the same wait, in blocks that take turns with the full \
             loop. Absolute times do not travel from machine to machine; these ratios do. Transport is the way of the state plus that of \
             the command.",
        )
    }

    fn miss_section(&self) -> Section {
        let mut table = Table::new("Missed deadlines by cause")
            .column(Column::text("controller"))
            .column(Column::number("ticks", ""))
            .column(Column::number("missed", ""))
            .column(Column::text("causes"));
        for contest in self.contests {
            table = table.row([
                Cell::series(&contest.controller),
                contest.ticks.into(),
                contest.missed.into(),
                causes_alone(contest).into(),
            ]);
        }
        let mut first = Table::new(format!("The first {MOST_SHOWN}, with their evidence"))
            .column(Column::text("controller"))
            .column(Column::number("block", ""))
            .column(Column::number("tick", ""))
            .column(Column::text("cause"));
        let columns = [
            ("woke late", "links", "wake_up_ns"),
            ("plant step", "links", "step_ns"),
            ("state", "links", "state_ns"),
            ("compute", "links", "compute_ns"),
            ("command", "links", "command_ns"),
            ("plant without a core", "plant", "waited_ns"),
            ("controller without a core", "controller", "waited_ns"),
        ];
        for (title, ..) in columns {
            first = first.column(Column::number(title, "µs").fixed(0));
        }
        for miss in self.misses(MOST_SHOWN) {
            let mut cells = vec![
                Cell::series(miss["controller"].as_str().unwrap_or("?")),
                miss["block"].as_u64().unwrap_or(0).into(),
                miss["tick"].as_u64().unwrap_or(0).into(),
                miss["cause"].as_str().unwrap_or("?").replace('_', " ").into(),
            ];
            let us = |part: &str, key: &str| miss["evidence"][part][key].as_f64().unwrap_or(f64::NAN) * 1e-3;
            cells.extend(columns.map(|(_, part, key)| us(part, key).into()));
            first = first.row(cells);
        }
        Section::new("Missed deadlines").with(table).with(first).with(
            "A missed deadline is a tick whose answer did not come 50 µs before the next tick, or one at which the plant itself was more \
             than a period late. The link of the tick that was longest beyond its usual is the guilty one; what its thread went through \
             (waiting for a core, page faults, time stolen by the hypervisor) says why, if it accounts for half of the excess.",
        )
    }

    fn cliff_section(&self) -> Section {
        let mut share = Chart::trace(
            "Missed deadlines against added compute",
            Axis::new("added compute of each answer", "µs"),
            Axis::new("missed", "%"),
        )
        .mark(Mark::Level { y: BROKEN * 100.0, label: "broken".into() });
        let mut trip = Chart::trace(
            "Round trip, p99, against added compute",
            Axis::new("added compute of each answer", "µs"),
            Axis::log("round trip", "µs"),
        );
        let mut section = Section::new("The cliff");
        for contest in self.contests {
            let steps: Vec<&Step> =
                self.cliff.iter().filter(|step| step.controller == contest.controller).collect();
            let x: Vec<f64> = steps.iter().map(|step| step.load_us).collect();
            let y: Vec<f64> = steps.iter().map(|step| step.missed_share * 100.0).collect();
            let p99: Vec<f64> =
                steps.iter().map(|step| step.round_trip_us["p99"].as_f64().unwrap_or(f64::NAN)).collect();
            share = share.series(Series::line(&contest.controller, &x, &y));
            trip = trip.series(Series::line(&contest.controller, &x, &p99));
            if let Some(words) = self.cliff_words(&contest.controller) {
                section = section.with(words);
            }
        }
        section.with(share).with(trip)
    }
}

fn stage_section(measured: &[(String, ByStage)]) -> Section {
    let mut table = Table::new("Latencies by stage, all blocks together")
        .column(Column::text("stage"))
        .column(Column::text("of"));
    for (name, _) in QUANTILES {
        table = table.column(Column::number(name, "µs").significant(3));
    }
    table = table.column(Column::number("max", "µs").significant(3)).column(Column::number("count", ""));
    let mut charts = Vec::new();
    for (stage, title) in STAGES {
        let mut chart = Chart::trace(title, Axis::percentile("percentile"), Axis::log("latency", "µs"));
        for (name, stages) in measured {
            let Some(histogram) = stages.get(stage) else { continue };
            let us = |quantile: f64| histogram.value_at_quantile(quantile) as f64 * 1e-3;
            let mut cells = vec![Cell::from(title), Cell::series(name)];
            cells.extend(QUANTILES.map(|(_, quantile)| us(quantile).into()));
            cells.extend([(histogram.max() as f64 * 1e-3).into(), histogram.len().into()]);
            table = table.row(cells);
            let (x, y) = curve(histogram);
            let line = Series::line(name, &x, &y);
            let is_bare = name == CLOCK || name == EXCHANGE;
            chart = chart.series(if is_bare { line.dashed() } else { line });
        }
        if stage != "round_trip" && stage != "round_trip_uncorrected" && !chart.series.is_empty() {
            charts.push(chart);
        }
    }
    let mut section = Section::new("Stages").with(table).with(corrected(measured));
    for chart in charts {
        section = section.with(chart);
    }
    section
}

/// The round trip with and without the correction for coordinated omission, one picture.
fn corrected(measured: &[(String, ByStage)]) -> Chart {
    let mut chart = Chart::trace(
        "Round trip: by the schedule (solid), and uncorrected (dashed)",
        Axis::percentile("percentile"),
        Axis::log("latency", "µs"),
    );
    for (name, stages) in measured {
        if let Some(histogram) = stages.get("round_trip") {
            let (x, y) = curve(histogram);
            chart = chart.series(Series::line(name, &x, &y));
            if let Some(histogram) = stages.get("round_trip_uncorrected") {
                let (x, y) = curve(histogram);
                chart =
                    chart.series(Series::line(format!("{name}, uncorrected"), &x, &y).like(name).dashed());
            }
        }
    }
    chart
}

fn row(title: &str, name: &str, histogram: &Histogram<u64>) -> [String; 7] {
    let us = |ns: u64| format!("{:.2}", ns as f64 * 1e-3);
    let [p50, p99, p999] = QUANTILES.map(|(_, quantile)| us(histogram.value_at_quantile(quantile)));
    [title.to_owned(), name.to_owned(), p50, p99, p999, us(histogram.max()), histogram.len().to_string()]
}

fn in_words(ratio: Option<Ratio>) -> String {
    ratio.map_or_else(
        || "–".to_owned(),
        |ratio| format!("{:.3} [{:.2} … {:.2}]", ratio.all, ratio.least, ratio.greatest),
    )
}

fn causes_alone(contest: &Contest) -> String {
    let each = contest.causes.iter().map(|(cause, count)| format!("{} {count}", cause.replace('_', " ")));
    each.collect::<Vec<_>>().join(", ")
}

fn causes(contest: &Contest) -> String {
    format!("{} of {} deadlines missed: {}", contest.missed, contest.ticks, causes_alone(contest))
}

fn file_name(name: &str) -> String {
    name.rsplit('/').next().unwrap_or(name).replace(' ', "-")
}
