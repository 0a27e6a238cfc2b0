//! A bench as one HTML file.

use freeplay_report::{
    Axis, Block as Part, Cell, Chart, Column, Document, Mark, Section, Series, Table, Verdict,
};
use freeplay_terminal::exit::Failure;
use serde_json::Value;

use crate::bench::bench_report::{BARE_CLOCK, BARE_TRANSPORT, Report, STAGES, causes_alone};
use crate::bench::blocks::ByStage;
use crate::bench::figures::{QUANTILES, curve};
use crate::bench::verdicts::{EXCEEDED_SHARE, Step};

/// Misses that the page lists one by one.
const MOST_SHOWN: usize = 20;

impl Report<'_> {
    /// The whole page, for the `measured` controllers and yardsticks.
    pub fn document(&self, measured: &[(String, ByStage)]) -> Result<Document, Failure> {
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
        let mut table = Table::new("Freeplay over the yardstick")
            .column(Column::text("controller"))
            .column(Column::text("what"))
            .column(Column::text("at"))
            .column(Column::number("all blocks together", "").fixed(3));
        for title in ["least", "median", "greatest"] {
            table = table.column(Column::number(title, "").fixed(3).group("of the blocks"));
        }
        for contest in self.contests {
            for (what, ratios) in contest.compared() {
                for ((quantile, _), ratio) in QUANTILES.iter().zip(ratios) {
                    let Some(ratio) = ratio else { continue };
                    let numbers = [ratio.all, ratio.least, ratio.median, ratio.greatest].map(Cell::from);
                    let words = [Cell::series(&contest.controller), what.into(), (*quantile).into()];
                    table = table.row(words.into_iter().chain(numbers));
                }
            }
        }
        let mut caught_up = Table::new("Ticks that the loop reached late")
            .column(Column::text("controller"))
            .column(Column::number("of ticks", ""))
            .column(Column::number("full loop", ""))
            .column(Column::number("bare clock loop", ""));
        for contest in self.contests {
            caught_up = caught_up.row([
                Cell::series(&contest.controller),
                contest.ticks.into(),
                contest.caught_up.into(),
                contest.bare_caught_up.into(),
            ]);
        }
        let caught_up = caught_up.note(
            "After a stall both loops catch up without a pause. These ticks are not wake-ups, because the loop did not sleep before them; the lateness of all ticks includes them. The full loop has work in each tick and therefore takes more ticks to catch up from the same stall.",
        );
        Section::new("Comparison with the yardsticks").with(table).with(caught_up).with(
            "The yardsticks run on the same cores, at the same priority and with the same wait, in blocks that take turns with the full loop. \
             Absolute times depend on the machine; these ratios hardly depend on it. Transport is the time of the state message plus that of the \
             command message.",
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
             than a period late. The cause is the stage of the tick that took the longest beyond its median. The counters of its thread (waiting for a core, page faults, time stolen by the hypervisor) name the reason where they account for half of the excess.",
        )
    }

    fn cliff_section(&self) -> Section {
        let mut share = Chart::trace(
            "Missed deadlines against added compute",
            Axis::new("added compute of each answer", "µs"),
            Axis::new("missed", "%"),
        )
        .mark(Mark::Level { y: EXCEEDED_SHARE * 100.0, label: "broken".into() });
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
            let is_bare = name == BARE_CLOCK || name == BARE_TRANSPORT;
            chart = chart.series(if is_bare { line.dashed() } else { line });
        }
        if !PAIRS.iter().any(|(_, pair)| pair.contains(&stage)) && !chart.series.is_empty() {
            charts.push(chart);
        }
    }
    let mut section = Section::new("Stages").with(table);
    for chart in PAIRS.iter().map(|(title, pair)| corrected(measured, title, *pair)).chain(charts) {
        section = section.with(chart);
    }
    section
}

/// Latencies measured for every tick against the schedule (first) and their components (second), in one picture each.
const PAIRS: [(&str, [&str; 2]); 2] = [
    (
        "Round trip: by the schedule (solid), and uncorrected (dashed)",
        ["round_trip", "round_trip_uncorrected"],
    ),
    (
        "Lateness of all ticks (solid), and wake-up of ticks waited for (dashed)",
        ["wake_up", "wake_up_uncorrected"],
    ),
];

/// A latency with and without the correction for coordinated omission.
fn corrected(measured: &[(String, ByStage)], title: &str, [corrected, uncorrected]: [&str; 2]) -> Chart {
    let mut chart = Chart::trace(title, Axis::percentile("percentile"), Axis::log("latency", "µs"));
    for (name, stages) in measured {
        let (Some(all), Some(seen)) = (stages.get(corrected), stages.get(uncorrected)) else { continue };
        let ((x, y), (seen_x, seen_y)) = (curve(all), curve(seen));
        let seen = Series::line(format!("{name}, uncorrected"), &seen_x, &seen_y).like(name).dashed();
        chart = chart.series(Series::line(name, &x, &y)).series(seen);
    }
    chart
}
