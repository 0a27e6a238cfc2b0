//! `freeplay compare`: differences between a model and a recording, channel by channel.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use clap::Args;
use comfy_table::CellAlignment;
use freeplay_diagnosis::page::diagnose_command;
use freeplay_diagnosis::{Channel, ChannelError, Comparison, Kind, Residuals, Settings};
use freeplay_laws::Effects;
use freeplay_model::{ArmFile, EffectTable};
use freeplay_recording::Recording;
use freeplay_report::paste::shell_word;
use freeplay_report::text::{Digits, MISSING_NUMBER, number};
use freeplay_report::{Axis, Block, Cell, Chart, Column, Document, Section, Series, Table, Verdict};
use freeplay_terminal::arguments::Format;
use freeplay_terminal::exit::{Exit, Failure};
use freeplay_terminal::files::write;
use freeplay_terminal::layout::text_table;
use freeplay_terminal::output::{say, show};
use freeplay_terminal::target::{asked_file, claim_out};
use freeplay_terminal::{flags, messages};
use serde_json::{Value, json};

use crate::{compare_curves, inputs};

/// Compares a recording with the predictions of a model for the recorded motion.
///
/// Torques: the measured torques are compared with the inverse dynamics of the measured motion plus the nominal friction of the
/// model. Tool: the tracked position is compared with the forward kinematics. Link encoders are compared with the motor side.
/// Both sides pass through the same low-pass filter.
///
/// If the model has servos, or if a recording has commanded positions and no torques, the measured positions are compared with
/// positions simulated from the commanded ones, without a filter.
#[derive(Args, Debug)]
pub struct CompareArgs {
    /// Model: an arm file (URDF, MJCF or TOML), or "paper".
    #[arg(long, value_name = "FILE")]
    model: String,
    /// Link of the model at the end of the arm. Default: the end of the chain whose joints the recording names, or of the longest
    /// chain.
    #[arg(long, value_name = "LINK")]
    tip: Option<String>,
    /// Recording from a machine or from `freeplay run`, in any format that `freeplay record` reads.
    #[arg(long, value_name = "FILE")]
    recording: PathBuf,
    /// Mapping file that defines the meaning of the columns, such as the setup.toml of a diagnosis.
    #[arg(long, value_name = "FILE")]
    mapping: Option<PathBuf>,
    /// Output format.
    #[arg(long, default_value = "text")]
    format: Format,
    /// Write the results to this folder: report.html shows measured values against the model for every joint, compare.json holds
    /// the figures, and residuals.parquet holds the curves as columns. If the model has servos and the recording has torques,
    /// positions.parquet holds the curves of the positions. A name that ends in .html, .json or .parquet writes only that one of
    /// the first three files.
    #[arg(long, value_name = "DIR|FILE")]
    out: Option<PathBuf>,
    /// Replace results of an earlier command in the folder.
    #[arg(long)]
    force: bool,
    /// Cutoff frequency of the low-pass filter. Default: 3 % of the recording's sample rate, between 10 and 40 Hz, or less if the
    /// motion is noisy.
    #[arg(long, value_name = "HZ")]
    lowpass: Option<f64>,
    /// Time to leave out at both ends. Default: five periods of the cutoff frequency, at most an eighth of the recording.
    #[arg(long, value_name = "S")]
    trim: Option<f64>,
}

/// Compares the model and the recording of `args`.
///
/// # Errors
/// Bad input: a file that can't be read, another number of joints, nothing to compare, an impossible filter.
pub fn compare(args: &CompareArgs) -> Result<Exit, Failure> {
    let measured = inputs::Measured::read(&args.recording, args.mapping.as_deref())?;
    let file = measured.model(&args.model, args.tip.as_deref())?;
    let effects = Effects::of(&file).map_err(|error| Failure::input(format!("{}: {error}", args.model)))?;
    let recording = measured.for_arm(&args.model, &file)?;
    let settings = Settings { lowpass_hz: args.lowpass, trim_s: args.trim };
    messages::announce(format_args!("comparing {} samples", recording.len()));
    let folder =
        args.out.as_deref().map(|out| claim_out(out, &EXTENSIONS, &RESULTS, args.force)).transpose()?;
    let compared = freeplay_diagnosis::compare_all(&file, &effects.placed, &recording, &settings);
    let (comparison, residuals) = compared.map_err(Failure::input)?;
    let view = View { args, file: &file, recording: &recording, comparison: &comparison };
    let json = view.json()?;
    let report = args.out.as_deref().map(|out| view.write(out, &residuals, &json)).transpose()?;
    drop(folder);
    match args.format {
        Format::Json => say(&format!("{json:#}\n"))?,
        Format::Text => show(&view.text(report.as_deref()))?,
    }
    Ok(Exit::Done)
}

/// Endings of the files that a comparison writes.
const EXTENSIONS: [&str; 3] = ["html", "json", "parquet"];
/// Results in the folder that `--out` names.
const RESULTS: [&str; 4] = ["compare.json", "report.html", "residuals.parquet", "positions.parquet"];

/// Data of the terminal output, the report and the JSON.
struct View<'a> {
    args: &'a CompareArgs,
    file: &'a ArmFile,
    recording: &'a Recording,
    comparison: &'a Comparison,
}

impl View<'_> {
    /// `freeplay.compare/1`, with its inputs.
    fn json(&self) -> Result<Value, Failure> {
        let mut value = serde_json::to_value(self.comparison).map_err(Failure::internal)?;
        value["model"] =
            json!({ "file": self.args.model, "name": self.file.arm.name(), "ignored": self.file.ignored });
        value["recording"] = json!(self.args.recording);
        value["worst"] = json!(self.comparison.worst().map(|worst| &worst.name));
        value["effects"] = self.file.effects.iter().map(effect_name).collect();
        Ok(value)
    }

    /// Writes the report and the JSON into the folder `out`, or the one of them that the ending of the file `out` selects. Returns the path of the report, or
    /// of that file.
    fn write(&self, out: &Path, residuals: &[Residuals], json: &Value) -> Result<PathBuf, Failure> {
        let (page, data) = (|| self.document(residuals).to_html(), || format!("{json:#}\n"));
        let mut of_curves = residuals.iter();
        match asked_file(out, &EXTENSIONS) {
            Some("html") => return write(out, &page()).map(|()| out.to_owned()),
            Some("parquet") => {
                of_curves.next().map_or(Ok(()), |first| compare_curves::write(first, out))?;
                return Ok(out.to_owned());
            }
            Some(_) => return write(out, &data()).map(|()| out.to_owned()),
            None => {}
        }
        for (residuals, name) in of_curves.zip(["residuals.parquet", "positions.parquet"]) {
            compare_curves::write(residuals, &out.join(name))?;
        }
        write(&out.join("compare.json"), &data())?;
        let path = out.join("report.html");
        write(&path, &page())?;
        Ok(path)
    }

    /// Terminal output.
    fn text(&self, report: Option<&Path>) -> String {
        let mut text = format!("Freeplay {} · compare\n\n", env!("CARGO_PKG_VERSION"));
        for (what, words) in self.heading() {
            let _ = writeln!(text, "{what:11} {words}");
        }
        let CompareArgs { model, tip, recording, mapping, .. } = self.args;
        let recordings = std::slice::from_ref(recording);
        let again =
            diagnose_command(model, tip.as_deref(), recordings, None, mapping.as_deref()) + " --out found";
        text.push_str(&crate::check::block(&self.comparison.setup, &again));
        let _ = writeln!(text, "\n{}\n\n{}\n", self.verdict(), self.terminal_table());
        text.push_str(
            "error: measured minus model, in every row (a diagnosis leaves out the rows near a reversal); spread: standard deviation of the\nmeasured \
             signal; noise: that of the channel behind the low-pass\n",
        );
        for remark in self.remarks() {
            let _ = writeln!(text, "note: {remark}");
        }
        let next = match report {
            Some(path) => format!("report      {}", shell_word(path)),
            None if flags::is_quiet() => return text,
            None => "next        add --out DIR for the curves, measured against model; --lowpass HZ for another filter".into(),
        };
        let _ = writeln!(text, "{next}");
        text
    }

    /// Recording, model and treatment in words.
    fn heading(&self) -> [(&'static str, String); 3] {
        let (recording, comparison) = (self.recording, self.comparison);
        let file_name = |path: &Path| {
            path.file_name().map_or_else(String::new, |name| name.to_string_lossy().into_owned())
        };
        let measured = format!(
            "{}: {}, {} Hz, {} s, {} samples of {}",
            file_name(&self.args.recording),
            joints(recording.joints()),
            brief(comparison.rate_hz),
            brief(comparison.duration_s),
            recording.len(),
            contents(recording)
        );
        let frictions =
            self.file.arm.joints().iter().filter(|j| j.friction.viscous > 0.0 || j.friction.coulomb > 0.0);
        let friction = match frictions.count() {
            0 => "no nominal friction".to_owned(),
            count => format!("nominal friction in {}", joints(count)),
        };
        let name = self.file.arm.name();
        let model = format!(
            "{name} ({}): {}, {friction}",
            file_name(Path::new(&self.args.model)),
            joints(self.file.arm.dof())
        );
        let unfiltered = format!(
            "{} samples: measured positions against those simulated from the commanded ones",
            comparison.samples
        );
        let treated = format!(
            "{} points at {} Hz; zero-phase low-pass at {} Hz on both sides; the ends are left out",
            comparison.samples,
            brief(comparison.compared_hz),
            brief(comparison.lowpass_hz)
        );
        let treated = match (self.is_of_commands(), self.has_lags()) {
            (true, _) => unfiltered,
            (false, true) => {
                format!("{treated}; positions against those simulated from the commanded ones: unfiltered")
            }
            (false, false) => treated,
        };
        [("recording", measured), ("model", model), ("compared", treated)]
    }

    /// True if the comparison has no channels but measured positions against those simulated from the commands.
    fn is_of_commands(&self) -> bool {
        self.comparison.channels.iter().all(|channel| channel.lag_s.is_some())
    }

    /// True if the comparison includes such channels.
    fn has_lags(&self) -> bool {
        self.comparison.channels.iter().any(|channel| channel.lag_s.is_some())
    }

    /// The worst channel with its meaning, and the error of the tool.
    fn verdict(&self) -> String {
        let tool = self.comparison.tool_distance().map_or_else(String::new, |distance| {
            format!(" The tool deviates by {} mm RMS from its position by the model.", brief(distance * 1e3))
        });
        let Some(worst) = self.comparison.worst() else {
            return format!("Every channel is constant: there is no variation to judge the model by.{tool}");
        };
        if self.comparison.is_within_noise(worst, worst.rmse) {
            return format!("No error exceeds the noise of its channel.{tool}");
        }
        let share = worst.nrmse_std.unwrap_or(f64::NAN);
        let meaning = match share {
            share if share < 0.05 => "the model explains nearly all of the variation",
            share if share < 0.3 => "the model explains most of the variation",
            share if share < 1.0 => "the model misses much of the variation",
            _ => "a model that predicts the mean would do better",
        };
        let (scale, unit) = shown_in(worst.unit);
        let times = worst.times_noise();
        let times = times.map_or_else(String::new, |times| format!(", {} times its noise", brief(times)));
        format!(
            "Worst channel: {}, with an error of {} {unit} RMS{times}. This is {} % of its standard deviation: {meaning}.{tool}",
            label(worst),
            brief(worst.rmse * scale),
            brief(100.0 * share)
        )
    }

    /// Notes of the readers and of the comparison, and the effects in the model file.
    fn remarks(&self) -> Vec<String> {
        let effects = self
            .file
            .effects
            .iter()
            .map(|effect| format!("the model has the effect {}", effect_name(effect)));
        let ignored = self.file.ignored.iter().map(|ignored| format!("model: {ignored}"));
        let of_noise: Vec<String> = self.comparison.of_noise().map(label).collect();
        let of_noise = (!of_noise.is_empty())
            .then(|| format!("these channels contain only noise: {}", of_noise.join(", ")));
        of_noise
            .into_iter()
            .chain(self.comparison.notes.iter().cloned())
            .chain(effects)
            .chain(ignored)
            .collect()
    }

    /// True if the model names friction, so that the table shows two errors.
    fn has_friction(&self) -> bool {
        self.comparison.channels.iter().any(|channel| channel.rmse_without_friction.is_some())
    }

    fn terminal_table(&self) -> String {
        let mut table = text_table();
        let mut header = vec![
            "\nchannel",
            "\njoint",
            "\nunit",
            "measured\nrms",
            "error\nrms",
            "error,\n% of rms",
            "% of\nspread",
        ];
        header.extend(["mean\nerror", "\nnoise"]);
        if self.has_friction() {
            header.push("error rms\nwithout friction");
        }
        let columns = header.len();
        if self.has_lags() {
            header.push("lag,\nms");
        }
        table.set_header(header);
        for channel in &self.comparison.channels {
            let (scale, unit) = shown_in(channel.unit);
            let mut row = vec![
                channel.name.clone(),
                channel.joint.clone().unwrap_or_else(|| MISSING_NUMBER.into()),
                unit.into(),
            ];
            row.extend(numbers(channel, scale).into_iter().take(columns - 3).map(brief));
            let lag = || channel.lag_s.map_or_else(|| MISSING_NUMBER.into(), |lag| brief(lag * 1e3));
            row.extend(self.has_lags().then(lag));
            table.add_row(row);
        }
        for column in 3..=columns {
            if let Some(column) = table.column_mut(column) {
                column.set_cell_alignment(CellAlignment::Right);
            }
        }
        table.lines().map(|line| line.trim_end().to_owned()).collect::<Vec<_>>().join("\n")
    }

    fn document(&self, residuals: &[Residuals]) -> Document {
        let [(_, recording), (_, model), (_, compared)] = self.heading();
        let mut document =
            Document::new("Model against recording").subtitle(format!("{} · {recording}", self.args.model));
        let judged = match self.comparison.worst().and_then(|worst| worst.nrmse_std) {
            Some(share) if share < 0.3 => Verdict::Ok,
            Some(_) => Verdict::Warn,
            None => Verdict::Info,
        };
        document = document.overview((judged, self.verdict())).overview(self.report_table());
        let remarks = self.remarks();
        if !remarks.is_empty() {
            document = document.overview(Block::List(remarks));
        }
        for title in ["Joint torques", "Tool position", "Link encoders", "Joint positions"] {
            let curves = residuals.iter().flat_map(|all| all.channels.iter().map(move |one| (all, one)));
            let section = curves
                .zip(&self.comparison.channels)
                .filter(|((_, channel), _)| section_of(channel.kind) == title)
                .fold(Section::new(title), |section, ((all, channel), error)| {
                    section.with(chart(all, channel, error))
                });
            if !section.blocks.is_empty() {
                document = document.section(section);
            }
        }
        document.footer(model).footer(compared).footer(format!("freeplay {}", env!("CARGO_PKG_VERSION")))
    }

    fn report_table(&self) -> Table {
        let mut table = Table::new(match (self.is_of_commands(), self.has_lags()) {
            (true, _) => "Measured minus simulated from the commanded positions",
            (false, true) => "Measured minus model; all but positions after the same low-pass on both sides",
            (false, false) => "Measured minus model, after the same low-pass on both sides",
        })
        .column(Column::text("channel"))
        .column(Column::text("joint"))
        .column(Column::text("unit"))
        .column(Column::number("measured rms", ""))
        .column(Column::number("error rms", ""))
        .column(Column::number("of rms", "%").group("error rms"))
        .column(Column::number("of spread", "%").group("error rms").bars())
        .column(Column::number("mean error", ""))
        .column(Column::number("noise", ""));
        if self.has_friction() {
            table = table.column(Column::number("error rms without friction", ""));
        }
        let columns = table.columns.len();
        if self.has_lags() {
            table = table.column(Column::number("lag", "ms"));
        }
        for channel in &self.comparison.channels {
            let (scale, unit) = shown_in(channel.unit);
            let joint = channel.joint.clone().unwrap_or_default();
            let words = [Cell::from(channel.name.clone()), joint.into(), unit.into()];
            let lag = self.has_lags().then(|| Cell::from(channel.lag_s.unwrap_or(f64::NAN) * 1e3));
            let numbers = numbers(channel, scale).map(Cell::from);
            table = table.row(words.into_iter().chain(numbers).take(columns).chain(lag));
        }
        table.note("spread: standard deviation of the measured signal, which is the error of a model that predicts the mean")
    }
}

/// The section of the report that a channel belongs to.
fn section_of(kind: Kind) -> &'static str {
    match kind {
        Kind::Torque(_) => "Joint torques",
        Kind::Tool(_) => "Tool position",
        Kind::Link(_) => "Link encoders",
        Kind::Position(_) => "Joint positions",
    }
}

/// Measured against model over time for torques; their difference for positions, where both lie on one line.
fn chart(residuals: &Residuals, channel: &Channel, error: &ChannelError) -> Chart {
    let (scale, unit) = shown_in(channel.unit);
    let line = |name: &str, values: &[f64]| {
        // A NaN point keeps the line from crossing a gap.
        let (mut t, mut y) = (Vec::new(), Vec::new());
        for stretch in &residuals.stretches {
            t.extend_from_slice(&residuals.t[stretch.clone()]);
            y.extend(values[stretch.clone()].iter().map(|value| value * scale));
            t.push(residuals.t[stretch.end - 1]);
            y.push(f64::NAN);
        }
        Series::line(name, &t, &y)
    };
    let there = |values: &[f64]| -> Vec<f64> {
        let Some(present) = &channel.present else { return values.to_vec() };
        values.iter().zip(present).map(|(value, present)| if *present { *value } else { f64::NAN }).collect()
    };
    let what = match channel.kind {
        Kind::Torque(_) if channel.unit == "N" => "force",
        Kind::Torque(_) => "torque",
        Kind::Tool(_) | Kind::Link(_) | Kind::Position(_) => "difference",
    };
    let chart =
        Chart::trace(label(error), Axis::new("time", "s"), Axis::new(what, unit)).group("time").in_view(0.0);
    let difference = line("measured − model", &there(&channel.residual()));
    if matches!(channel.kind, Kind::Torque(_)) {
        chart
            .series(line("measured", &there(&channel.measured)))
            .series(line("model", &channel.model))
            .series(difference.dashed())
    } else {
        chart.series(difference)
    }
}

/// The numbers of a table's row: measured, error, shares in %, mean error, noise, error without friction; NaN for a missing one.
fn numbers(channel: &ChannelError, scale: f64) -> [f64; 7] {
    let percent = |share: Option<f64>| share.map_or(f64::NAN, |share| 100.0 * share);
    [
        channel.rms_measured * scale,
        channel.rmse * scale,
        percent(channel.nrmse),
        percent(channel.nrmse_std),
        channel.mean_error * scale,
        channel.noise.map_or(f64::NAN, |noise| noise * scale),
        channel.rmse_without_friction.map_or(f64::NAN, |rmse| rmse * scale),
    ]
}

/// Unit and factor for display: metres as mm, radians as mrad.
fn shown_in(unit: &str) -> (f64, &str) {
    match unit {
        "m" => (1e3, "mm"),
        "rad" => (1e3, "mrad"),
        "N*m" => (1.0, "N·m"),
        other => (1.0, other),
    }
}

fn brief(value: f64) -> String {
    number(value, Digits::Significant(3))
}

fn joints(count: usize) -> String {
    format!("{count} joint{}", if count == 1 { "" } else { "s" })
}

/// `tau5 (joint_5)`, or `x` for the tool.
fn label(channel: &ChannelError) -> String {
    channel.joint.as_ref().map_or_else(|| channel.name.clone(), |joint| format!("{} ({joint})", channel.name))
}

/// `joint_clearance at joint_5`.
fn effect_name(effect: &EffectTable) -> String {
    let place = effect.joint.as_ref().map_or_else(String::new, |joint| format!(" at {joint}"));
    format!("{}{place}", effect.kind)
}

/// Content of the recording, in words.
fn contents(recording: &Recording) -> String {
    let links = recording.q_link.iter().flatten().count();
    let held = [
        (recording.qd.is_some(), "velocity"),
        (recording.tau.is_some(), "torque"),
        (recording.q_ref.is_some(), "reference"),
        (links > 0, "link encoders"),
        (recording.tool.is_some(), "tool position"),
        (recording.orientation.is_some(), "tool orientation (not compared)"),
    ];
    let held = held.into_iter().filter(|(held, _)| *held).map(|(_, name)| name.to_owned());
    let mut words: Vec<String> = std::iter::once("position".to_owned()).chain(held).collect();
    if !recording.others.is_empty() {
        let names: Vec<&str> = recording.others.iter().take(4).map(|(name, _)| name.as_str()).collect();
        let more = if recording.others.len() > names.len() { ", …" } else { "" };
        words.push(format!(
            "{} other columns are not used ({}{more})",
            recording.others.len(),
            names.join(", ")
        ));
    }
    words.join(", ")
}
