//! The report of `freeplay run`: deviation, contact, torques and latencies of all controllers side by side.

use std::path::{Path, PathBuf};

use freeplay_recording::{Recording, read_overview};
use freeplay_report::text::{Digits, number};
use freeplay_report::{
    Axis, Block, Cell, Chart, Column, Document, Figure, Mark, Section, Series, Table, Verdict,
};
use freeplay_terminal::exit::Failure;
use hdrhistogram::Histogram;
use serde_json::Value;

use crate::columns::play_column;
use crate::histogram_files::read_hlog;
use crate::run_film::{FilmedRun, film};
use crate::scenario::Scenario;
use crate::setup::Setup;
use crate::summary::RunSummary;

/// Largest number of rows of a recording for a report; a longer recording is reduced to an overview with all peaks.
const MOST_ROWS: usize = 40_000;
/// Digits of a deviation everywhere in the report.
const DIGITS: Digits = Digits::Significant(3);

/// One controller's run with its results.
pub struct Played<'a> {
    /// Display name.
    name: String,
    summary: &'a RunSummary,
    recording: Option<Recording>,
    latencies: Vec<(String, Histogram<u64>)>,
}

/// Writes `report.html` into `out` and returns its path.
///
/// # Errors
/// Unreadable recordings or histograms; an unwritable file.
pub fn write(
    scenario: &Scenario,
    setup: &Setup,
    out: &Path,
    runs: &[RunSummary],
    machine: &Value,
) -> Result<PathBuf, Failure> {
    let played = runs
        .iter()
        .map(|run| Played::read(run, out, run.controller.clone()))
        .collect::<Result<Vec<_>, _>>()?;
    let plays: Vec<&str> = setup
        .plant
        .effects
        .clearances
        .iter()
        .map(|(joint, _)| setup.arm().joints()[*joint].name.as_str())
        .collect();
    let mut document =
        Document::new("Freeplay run").subtitle(format!("{}, {} controllers", setup.arm().name(), runs.len()));
    for block in overview(&played) {
        document = document.overview(block);
    }
    document = document.section(deviation(&played));
    for (play, (joint, clearance)) in plays.iter().zip(&setup.plant.effects.clearances) {
        let mut section = contact(&played, play);
        section.blocks.extend(seen(&played, setup, play, *joint, clearance.clearance));
        document = document.section(section);
    }
    document = document
        .section(torques(&played, setup).with(joint_use(&played, setup)))
        .section(latencies(&played))
        .section(configuration(scenario, machine)?)
        .footer(format!("freeplay {}", env!("CARGO_PKG_VERSION")));
    let path = out.join("report.html");
    freeplay_terminal::files::write(&path, &document.to_html())?;
    Ok(path)
}

impl<'a> Played<'a> {
    /// Reads the run of `summary`, called `name`, with its results in `out`.
    ///
    /// # Errors
    /// An unreadable recording or histogram.
    pub fn read(summary: &'a RunSummary, out: &Path, name: String) -> Result<Self, Failure> {
        let recording = match &summary.recording {
            Some(name) if summary.ticks > 0 => {
                Some(read_overview(&out.join(name), None, MOST_ROWS).map_err(Failure::input)?)
            }
            _ => None,
        };
        let latencies = read_hlog(&out.join(format!("{}.hlog", summary.files)))?;
        Ok(Self { name, summary, recording, latencies })
    }

    /// Display name.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Summary.
    pub fn summary(&self) -> &RunSummary {
        self.summary
    }

    /// The recording, if it contains all ticks. The rows of an overview are no samples, because extremes of two columns do not belong to
    /// the same instant.
    fn whole(&self) -> Option<&Recording> {
        self.recording.as_ref().filter(|recording| self.summary.ticks <= recording.len() as u64)
    }

    /// A column of the recording against time, scaled, as a line with the controller's name.
    fn line(&self, column: &str, scale: f64) -> Option<Series> {
        let recording = self.recording.as_ref()?;
        let values: Vec<f64> = recording.column(column)?.iter().map(|value| value * scale).collect();
        Some(Series::line(self.name(), &recording.t, &values))
    }
}

fn mm(value: &Value) -> f64 {
    value.as_f64().unwrap_or(f64::NAN)
}

/// A length of `mm` mm in the format of the tables: the same unit and the same digits.
fn length(mm: f64) -> String {
    number(mm, DIGITS)
}

/// End of each run, and deviation of its tool.
pub fn overview(played: &[Played]) -> Vec<Block> {
    let verdict = |run: &Played| {
        let summary = run.summary;
        let finished = summary.ending.as_str() == Some("finished");
        let ok = finished && summary.verdict != "failed";
        let words = if ok {
            let [rms, max] =
                ["rms_after_start", "max_after_start"].map(|key| length(mm(&summary.deviation_mm[key])));
            format!(
                "{}: finished; tool deviation {rms} mm RMS, {max} mm maximum after the first 0.5 s",
                run.name(),
            )
        } else {
            let how = crate::terminal_summary::ending(summary).unwrap_or_else(|| summary.ending.to_string());
            let failures = summary.failures.iter().filter_map(crate::verdict::failure_words);
            let all: Vec<String> = (!finished).then_some(how).into_iter().chain(failures).collect();
            let what = if finished { "finished, and failed" } else { "did not finish under control" };
            format!("{}: {what}: {}", run.name(), all.join("; "))
        };
        Block::Verdict(Verdict::passed(ok), words)
    };
    let figure = |run: &Played| {
        Figure::new(run.name(), length(mm(&run.summary.deviation_mm["rms_after_start"])), "mm RMS")
    };
    let mut blocks: Vec<Block> = played.iter().map(verdict).collect();
    blocks.push(Block::Figures(played.iter().map(figure).collect()));
    blocks
}

/// A chart of one recorded column for all controllers; `None` if no run recorded it.
fn chart(played: &[Played], title: &str, axis: Axis, column: &str, scale: f64) -> Option<Chart> {
    let series: Vec<Series> = played.iter().filter_map(|run| run.line(column, scale)).collect();
    if series.is_empty() {
        return None;
    }
    let chart = Chart::trace(title, Axis::new("time", "s"), axis).group("time");
    Some(series.into_iter().fold(chart, Chart::series))
}

/// The tool's deviation: a table, and superimposed traces.
pub fn deviation(played: &[Played]) -> Section {
    let mut table = Table::new("Tool deviation: true tool minus the perfect arm on the desired joints")
        .column(Column::text("controller"))
        .column(Column::number("rms", "mm").significant(3).group("after 0.5 s").lowest())
        .column(Column::number("max", "mm").significant(3).group("after 0.5 s").lowest())
        .column(Column::number("rms", "mm").significant(3).group("whole run"))
        .column(Column::number("max", "mm").significant(3).group("whole run"))
        .column(Column::number("x rms", "mm").significant(3).group("axes, after 0.5 s"))
        .column(Column::number("y rms", "mm").significant(3).group("axes, after 0.5 s"))
        .column(Column::number("z rms", "mm").significant(3).group("axes, after 0.5 s"));
    for run in played {
        let d = &run.summary.deviation_mm;
        let axis = |name: &str| Cell::from(mm(&d["axes"][name]["rms_after_start"]));
        table = table.row([
            Cell::series(run.name()),
            mm(&d["rms_after_start"]).into(),
            mm(&d["max_after_start"]).into(),
            mm(&d["rms"]).into(),
            mm(&d["max"]).into(),
            axis("x"),
            axis("y"),
            axis("z"),
        ]);
    }
    let table = table
        .note("No position command can compensate the drop of a centred journal in the first half second.");
    let mut section = Section::new("Tool deviation").with(table);
    for axis in ["x", "y", "z"] {
        let title = format!("Deviation along {axis}");
        if let Some(chart) =
            chart(played, &title, Axis::new("deviation", "mm"), &format!("deviation_{axis}"), 1e3)
        {
            section = section.with(chart);
        }
    }
    section
}

/// Contact of the journal of `play`.
pub fn contact(played: &[Played], play: &str) -> Section {
    let mut table = Table::new(format!("Contact in {play}"))
        .column(Column::text("controller"))
        .column(Column::number("free flight", "%").fixed(2))
        .column(Column::number("impact", "%").fixed(2))
        .column(Column::number("continuous", "%").fixed(2))
        .column(Column::number("contacts", ""))
        .column(Column::number("peak normal force", "N").fixed(0));
    for run in played {
        let tally = &run.summary.contact["joints"][play];
        let percent = |key: &str| Cell::from(tally[key].as_f64().unwrap_or(f64::NAN) * 100.0);
        table = table.row([
            Cell::series(run.name()),
            percent("free"),
            percent("impact"),
            percent("continuous"),
            tally["contacts"].as_u64().unwrap_or(0).into(),
            tally["peak_normal_force_N"].as_f64().unwrap_or(f64::NAN).into(),
        ]);
    }
    let mut section = Section::new(format!("Contact in {play}")).with(table);
    let force = Axis::new("normal force, peak of the tick", "N");
    if let Some(chart) = chart(played, "Normal force", force, &play_column(play, "normal_force"), 1.0) {
        section = section.with(chart);
    }
    if let Some(chart) = chart(
        played,
        "Duration of the contact so far (0 is free flight; impacts stay below 2 ms)",
        Axis::log("contact", "ms"),
        &play_column(play, "contact_time"),
        1e3,
    ) {
        section = section.with(chart.mark(Mark::Level { y: 2.0, label: "impact / continuous".into() }));
    }
    section
}

/// The film of the arm and its journals, and their orbits as charts.
fn seen(played: &[Played], setup: &Setup, play: &str, joint: usize, clearance: f64) -> Vec<Block> {
    let seen: Vec<FilmedRun> = played
        .iter()
        .filter_map(|run| Some(FilmedRun { name: run.name(), recording: run.whole()? }))
        .collect();
    let orbits = played.iter().filter_map(|run| orbit(run, play, clearance)).map(Block::from).collect();
    let film = film(setup.arm(), &seen, play, joint, clearance).map(Block::from);
    film.into_iter().chain([Block::Columns(orbits)]).collect()
}

/// The journal's path in its bearing.
fn orbit(run: &Played, play: &str, clearance: f64) -> Option<Chart> {
    let recording = run.whole()?;
    let scaled = |quantity: &str| -> Option<Vec<f64>> {
        Some(recording.column(&play_column(play, quantity))?.iter().map(|value| value * 1e3).collect())
    };
    let (first, second) = (scaled("play_1")?, scaled("play_2")?);
    let chart = Chart::xy(
        format!("Journal in its bearing: {}", run.name()),
        Axis::new("play 1", "mm"),
        Axis::new("play 2", "mm"),
    )
    .equal_axes()
    .series(Series::circle("clearance", (0.0, 0.0), clearance * 1e3).dashed())
    .series(Series::points(run.name(), &first, &second));
    Some(chart)
}

fn torques(played: &[Played], setup: &Setup) -> Section {
    let mut section = Section::new("Joint torques");
    for (index, joint) in setup.arm().joints().iter().enumerate() {
        let unit = match joint.kind {
            freeplay_arm::JointKind::Revolute => "N·m",
            freeplay_arm::JointKind::Prismatic => "N",
        };
        if let Some(chart) =
            chart(played, &joint.name, Axis::new("torque", unit), &format!("tau{}", index + 1), 1.0)
        {
            section = section.with(chart.height(180));
        }
    }
    let base = Axis::new("force, peak of the tick", "N");
    if let Some(chart) = chart(played, "Force of the base on the first moving body", base, "base_force", 1.0)
    {
        section = section.with(chart);
    }
    section
}

/// The greatest speeds, accelerations and torques, and their shares of the limits.
fn joint_use(played: &[Played], setup: &Setup) -> Table {
    let mut table = Table::new("Load on the motors: greatest values, and shares of the limits")
        .column(Column::text("controller"))
        .column(Column::text("joint"))
        .column(Column::number("speed", "rad/s, m/s").significant(3).group("speed"))
        .column(Column::number("of its limit", "%").fixed(1).group("speed"))
        .column(Column::number("mean over a tick", "rad/s², m/s²").significant(3).group("acceleration"))
        .column(Column::number("of its limit", "%").fixed(1).group("acceleration"))
        .column(Column::number("torque", "N·m, N").significant(3).group("torque"))
        .column(Column::number("of its limit", "%").fixed(1).group("torque"));
    for run in played {
        for joint in setup.arm().joints() {
            let mut row = vec![Cell::series(run.name()), joint.name.as_str().into()];
            for quantity in ["speed", "acceleration", "torque"] {
                let used = &run.summary.joint_use[&joint.name][quantity];
                row.push(used["peak_after_start"].as_f64().unwrap_or(f64::NAN).into());
                row.push(used["share"].as_f64().map_or_else(|| "–".into(), |share| (100.0 * share).into()));
            }
            table = table.row(row);
        }
    }
    table.note("The table leaves out the first half second, in which the bouncing journal moves the light joints under any controller.")
}

/// Quantiles of a percentile curve.
fn quantiles() -> impl Iterator<Item = f64> {
    (0..=120).map(|step| 1.0 - 10f64.powf(-f64::from(step) / 24.0))
}

/// Durations of the stages: a table, and superimposed percentile curves.
pub fn latencies(played: &[Played]) -> Section {
    let mut table = Table::new("Latencies by stage")
        .column(Column::text("controller"))
        .column(Column::text("stage"))
        .column(Column::number("p50", "µs").significant(3))
        .column(Column::number("p99", "µs").significant(3))
        .column(Column::number("p99.9", "µs").significant(3))
        .column(Column::number("max", "µs").significant(3))
        .column(Column::number("count", ""));
    for run in played {
        for (stage, value) in &run.summary.latency_us {
            let us = |key: &str| Cell::from(value[key].as_f64().unwrap_or(f64::NAN));
            let count = value["count"].as_u64().unwrap_or(0);
            table = table.row([
                Cell::series(run.name()),
                stage.replace('_', " ").into(),
                us("p50"),
                us("p99"),
                us("p99.9"),
                us("max"),
                count.into(),
            ]);
        }
    }
    let mut section = Section::new("Latencies").with(table);
    for (stage, title) in [
        ("round_trip", "Round trip"),
        ("compute", "Controller compute"),
        ("wake_up", "Wake-up lateness"),
        ("plant_step", "Plant step"),
    ] {
        let mut chart = Chart::trace(title, Axis::percentile("percentile"), Axis::log("latency", "µs"));
        for run in played {
            let Some((_, histogram)) = run.latencies.iter().find(|(tag, _)| tag == stage) else { continue };
            let most = 1.0 - 1.0 / histogram.len() as f64;
            let x: Vec<f64> = quantiles().filter(|&quantile| quantile <= most).collect();
            let y: Vec<f64> =
                x.iter().map(|&quantile| histogram.value_at_quantile(quantile) as f64 * 1e-3).collect();
            chart = chart.series(Series::line(run.name(), &x, &y));
        }
        if !chart.series.is_empty() {
            section = section.with(chart);
        }
    }
    section.with("In real time, latencies count from the schedule: a stall counts for every tick that it delays. In lockstep there is no schedule; the round trip counts from the publication of the state and includes the plant's own step.")
}

fn configuration(scenario: &Scenario, machine: &Value) -> Result<Section, Failure> {
    let machine = serde_json::to_string_pretty(machine).map_err(Failure::internal)?;
    Ok(Section::new("Machine and configuration")
        .with(Block::Code(machine))
        .with(Block::Code(scenario.to_toml().map_err(Failure::internal)?)))
}
