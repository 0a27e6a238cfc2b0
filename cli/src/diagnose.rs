//! `freeplay diagnose`: where a model and a recording differ, what is missing from the model, and how much better it gets.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use clap::Args;
use clap::builder::styling::Style;
use freeplay_arm::{ArmFile, to_toml};
use freeplay_diagnosis::{
    Alternative, DiagnoseError, DiagnoseSettings, Diagnosis, Effect, ExciteSettings, Fit, Settings,
    Tolerances, Untestable, Verdict, beyond_limits, diagnose as diagnosed,
};
use freeplay_recording::Recording;
use serde_json::Value;

use crate::diagnose_report::{Subject, document};
use crate::excite::{self, Question};
use crate::exit::{Exit, Failure};
use crate::files::{Folder, write};
use crate::recorded;
use crate::run::Format;
use crate::say::{say, show};
use crate::setup::load_model;
use crate::voice::{self, GOOD, OPEN, painted};

/// Width of the longest bar, characters.
const BAR: f64 = 24.0;
/// The next motion: how long it takes, s, how far a joint goes, rad (m), and how many are weighed.
const NEXT_S: f64 = 16.0;
const NEXT_REACH: f64 = 1.2;
const NEXT_CANDIDATES: usize = 24;
/// Most lines of what the recording can't show.
const UNTESTABLE: usize = 6;

/// Locates where a recording and a model differ, names the physics left out, models it and shows the fit improve, or says why not.
///
/// What is missing is sought in the first 70 % of a recording and judged on the rest, and on each other part by a fit that has not seen
/// it; its numbers rest on all of it. With several recordings, on all but the last, which judges. Verdicts:
/// nothing_missing, named, one_of, unknown, insufficient_data; all of them end with exit code 0.
#[derive(Args, Debug)]
pub struct DiagnoseArgs {
    /// The model: an arm file (URDF or TOML), or "paper".
    #[arg(long, value_name = "FILE")]
    model: String,
    /// Recordings of one machine with the same columns: CSV or MCAP. Of several, the last is held out; the first, where the last alone shows what is missing.
    #[arg(long, value_name = "FILE", num_args = 1.., required = true)]
    recording: Vec<PathBuf>,
    /// How results are printed.
    #[arg(long, default_value = "text")]
    format: Format,
    /// Folder for diagnosis.json, report.html and model.toml, the model with what was missing, tuned inside its tolerances.
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Seed of the twins and of all intervals.
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Perfect recordings of the model that the thresholds are taken from.
    #[arg(long, value_name = "N", default_value_t = 24, value_parser = clap::value_parser!(u16).range(4..=1000))]
    twins: u16,
    /// Cutoff of the low-pass; without it: 3 % of the recording's rate, 10 to 40 Hz, or less where the motion is noisy.
    #[arg(long, value_name = "HZ")]
    lowpass: Option<f64>,
    /// Tolerance of masses and inertias, %.
    #[arg(long, value_name = "PERCENT", default_value_t = 2.0)]
    mass_tolerance: f64,
    /// Tolerance of the friction that the model names, %.
    #[arg(long, value_name = "PERCENT", default_value_t = 5.0)]
    friction_tolerance: f64,
    /// Tolerance of encoder zeros, mrad (mm for a slide).
    #[arg(long, value_name = "MRAD", default_value_t = 0.1)]
    zero_tolerance: f64,
    /// Tolerance of lengths, mm.
    #[arg(long, value_name = "MM", default_value_t = 0.1)]
    length_tolerance: f64,
    /// Tolerance of delays between channels, ms.
    #[arg(long, value_name = "MS", default_value_t = 0.6)]
    delay_tolerance: f64,
}

impl DiagnoseArgs {
    fn settings(&self) -> Result<DiagnoseSettings, Failure> {
        let given = [
            ("--mass-tolerance", self.mass_tolerance),
            ("--friction-tolerance", self.friction_tolerance),
            ("--zero-tolerance", self.zero_tolerance),
            ("--length-tolerance", self.length_tolerance),
            ("--delay-tolerance", self.delay_tolerance),
        ];
        if let Some((name, value)) = given.iter().find(|(_, value)| !(*value > 0.0 && value.is_finite())) {
            return Err(Failure::usage(format!("{name} {value}: give a number above 0")));
        }
        let tolerances = Tolerances {
            mass: self.mass_tolerance / 100.0,
            inertia: self.mass_tolerance / 100.0,
            friction: self.friction_tolerance / 100.0,
            zero: self.zero_tolerance / 1e3,
            length: self.length_tolerance / 1e3,
            delay: self.delay_tolerance / 1e3,
            ..Tolerances::default()
        };
        let treatment = Settings { lowpass_hz: self.lowpass, trim_s: None };
        Ok(DiagnoseSettings { treatment, tolerances, twins: self.twins.into(), seed: self.seed })
    }
}

/// Diagnoses the recordings of `args`.
///
/// # Errors
/// Bad input: a file that can't be read, another number of joints, nothing to compare, recordings with different columns.
pub fn diagnose(args: &DiagnoseArgs) -> Result<Exit, Failure> {
    let settings = args.settings()?;
    recorded::only_once(&args.recording)?;
    let file = load_model(&args.model)?;
    let read = |path: &PathBuf| recorded::read(path, &args.model, &file);
    let recordings: Vec<Recording> = args.recording.iter().map(read).collect::<Result<_, _>>()?;
    // Before what takes minutes.
    let _reserved = args.out.as_deref().map(Folder::reserve).transpose()?;
    let found = diagnosed(&file, &recordings, &settings, &mut |what| voice::doing(what));
    let mut diagnosis = found.map_err(|error| match error {
        DiagnoseError::Law(error) => Failure::input(format!("{}: {error}", args.model)),
        other => Failure::input(other),
    })?;
    remark(&mut diagnosis.quality, &file, &recordings);
    let next = next_motion(args, &file, &recordings, &diagnosis)?;
    diagnosis.next.extend(next);
    let view = View { args, file: &file, recordings: &recordings, diagnosis: &diagnosis };
    let json = view.json()?;
    if let Some(out) = &args.out {
        view.write(out, &json)?;
    }
    match args.format {
        Format::Json => say(&format!("{json:#}\n"))?,
        Format::Text => show(&view.text())?,
    }
    Ok(Exit::Done)
}

/// What a person should know of the inputs, beside what `quality` has: first joints beyond their limits, last what of the model file is not
/// used.
fn remark(quality: &mut Vec<String>, file: &ArmFile, recordings: &[Recording]) {
    let beyond = recordings.iter().flat_map(|recording| {
        let name = file_name(recording);
        beyond_limits(&file.arm, recording).into_iter().map(move |note| format!("{name}: {note}"))
    });
    quality.splice(0..0, beyond);
    quality.extend(file.ignored.iter().map(|ignored| format!("model: {ignored}")));
}

/// Where two causes remain: the motion that would separate them, written into the folder of results; one sentence on it. Several recordings
/// of one machine were not enough, so that the first of them stands for what was moved.
fn next_motion(
    args: &DiagnoseArgs,
    file: &ArmFile,
    recordings: &[Recording],
    diagnosis: &Diagnosis,
) -> Result<Option<String>, Failure> {
    let (Some(out), Some(seen)) = (&args.out, recordings.first()) else { return Ok(None) };
    let rivals = excite::rivals(diagnosis, file)?;
    if rivals.len() < 2 {
        return Ok(None);
    }
    let settings = ExciteSettings {
        duration: NEXT_S,
        candidates: NEXT_CANDIDATES,
        seed: args.seed,
        posture: None,
        reach: NEXT_REACH,
        tolerances: args.settings()?.tolerances,
        noise: diagnosis.noise.clone(),
    };
    let question = Question { file, rivals, seen: Some(seen) };
    match excite::seek(&question, &settings) {
        Ok(found) => {
            let path = excite::write_path(&found, &args.model, file, out)?;
            Ok(Some(excite::sentence(&found, file, &path)))
        }
        // A diagnosis is worth having without the next motion.
        Err(failure) => Ok(Some(format!("no motion was found that separates them: {failure}"))),
    }
}

/// Everything that is shown.
struct View<'a> {
    args: &'a DiagnoseArgs,
    file: &'a ArmFile,
    recordings: &'a [Recording],
    diagnosis: &'a Diagnosis,
}

impl View<'_> {
    /// `freeplay.diagnosis/1`, with what it was made from.
    fn json(&self) -> Result<Value, Failure> {
        let mut value = serde_json::to_value(self.diagnosis).map_err(Failure::internal)?;
        value["inputs"] = serde_json::json!({ "model": self.args.model, "recordings": self.args.recording });
        if let Some(out) = &self.args.out {
            value["model"] = serde_json::json!(out.join("model.toml"));
            value["report"] = serde_json::json!("report.html");
        }
        Ok(value)
    }

    /// Writes diagnosis.json, model.toml and report.html into `out`.
    fn write(&self, out: &Path, json: &Value) -> Result<(), Failure> {
        crate::files::make_folder(out)?;
        write(&out.join("diagnosis.json"), &format!("{json:#}\n"))?;
        write(&out.join("model.toml"), &to_toml(&self.diagnosis.model))?;
        let View { args, file, diagnosis, .. } = self;
        let subject = Subject { model: &args.model, file, recordings: &args.recording, diagnosis };
        write(&out.join("report.html"), &document(&subject).to_html())
    }

    /// What a person sees in the terminal.
    fn text(&self) -> String {
        let diagnosis = self.diagnosis;
        let mut text = String::new();
        for recording in self.recordings {
            let _ = writeln!(text, "{}", heading(recording));
        }
        for note in &diagnosis.quality {
            let _ = writeln!(text, "  note: {note}");
        }
        for line in untestable(&diagnosis.untestable) {
            let _ = writeln!(text, "  {line}");
        }
        let _ = writeln!(
            text,
            "\nVERDICT {}\n        {}\n",
            painted_verdict(diagnosis.verdict),
            diagnosis.statement
        );
        for (index, place) in diagnosis.location.iter().enumerate() {
            let title = if index == 0 { "WHERE " } else { "      " };
            let joint = place.joint.as_ref().map_or("whole arm".to_owned(), |joint| joint.clone());
            let share = 100.0 * place.share;
            let _ = writeln!(
                text,
                "{title}  {joint}, {}: {share:.0} % of what the tuned model leaves unexplained; {} (p = {:.3})",
                place.channels.join(", "),
                place.when,
                place.p
            );
        }
        for (index, effect) in diagnosis.effects.iter().enumerate() {
            let _ = write!(text, "{}", what(if index == 0 { "\nWHAT  " } else { "      " }, effect));
        }
        for alternative in &diagnosis.alternatives {
            let _ = writeln!(text, "        {}", instead(alternative));
        }
        if let Some(fit) = &diagnosis.fit {
            text.push_str(&bars(fit, diagnosis));
        }
        text.push_str(&self.next());
        text
    }

    fn next(&self) -> String {
        let mut text = String::from("\n");
        for next in &self.diagnosis.next {
            let _ = writeln!(text, "NEXT    {next}");
        }
        match &self.args.out {
            Some(out) => {
                let model = out.join("model.toml");
                let recording = &self.args.recording[self.args.recording.len() - 1];
                let _ = writeln!(
                    text,
                    "MODEL   {0}   →   freeplay compare --model {0} --recording {1}",
                    model.display(),
                    recording.display()
                );
                let _ = writeln!(
                    text,
                    "        {:1$}   →   freeplay run --model {2} --set path.kind=joint_sine",
                    "",
                    model.display().to_string().chars().count(),
                    model.display()
                );
                let _ = writeln!(text, "report  {}", out.join("report.html").display());
            }
            None => text.push_str(
                "next    add --out DIR for the report, the model with these effects and diagnosis.json\n",
            ),
        }
        text
    }
}

fn file_name(recording: &Recording) -> String {
    recording.origin.file_name().map_or_else(String::new, |name| name.to_string_lossy().into_owned())
}

fn heading(recording: &Recording) -> String {
    let name = file_name(recording);
    let joints = recording.joints();
    let mut what = vec!["joint angles"];
    what.extend(recording.tau.is_some().then_some("torque"));
    what.extend(recording.tool.is_some().then_some("tool tracked"));
    what.extend(recording.q_link.iter().any(Option::is_some).then_some("link encoders"));
    format!(
        "Recording {name}: {joints} joint{}, {:.0} Hz, {:.1} s: {}.",
        if joints == 1 { "" } else { "s" },
        recording.rate_hz(),
        recording.duration(),
        what.join(", ")
    )
}

fn painted_verdict(verdict: Verdict) -> String {
    let (style, words) = match verdict {
        Verdict::NothingMissing => (GOOD, "nothing missing"),
        Verdict::Named => (GOOD, "named"),
        Verdict::OneOf => (OPEN, "one of several"),
        Verdict::Unknown => (OPEN, "unknown"),
        Verdict::InsufficientData => (OPEN, "insufficient data"),
    };
    painted(style, words)
}

/// What can't be told, reasons shared by several kinds said once.
fn untestable(all: &[Untestable]) -> Vec<String> {
    let mut reasons: Vec<(&str, Vec<&str>)> = Vec::new();
    for one in all {
        match reasons.iter_mut().find(|(because, _)| *because == one.because) {
            Some((_, kinds)) => kinds.push(one.kind),
            None => reasons.push((&one.because, vec![one.kind])),
        }
    }
    reasons.sort_by_key(|(_, kinds)| std::cmp::Reverse(kinds.len()));
    let more = reasons.len().saturating_sub(UNTESTABLE);
    let mut lines: Vec<String> = reasons
        .into_iter()
        .take(UNTESTABLE)
        .map(|(because, mut kinds)| {
            kinds.dedup();
            format!("not testable here: {} ({because})", kinds.join(", "))
        })
        .collect();
    if more > 0 {
        lines.push(format!("and {more} more reasons in diagnosis.json"));
    }
    lines
}

fn what(title: &str, effect: &Effect) -> String {
    let gain = effect.evidence.held_out_gain;
    let on = if effect.evidence.held_out {
        "held-out data"
    } else {
        "the data of the fit, the held-out data being hardly touched by it"
    };
    format!(
        "{title}  {}\n        {}. Takes {:.0} % ({:.0} to {:.0} %) of the error in {} away on {on}.\n",
        effect.statement,
        effect.source,
        100.0 * gain.value,
        100.0 * gain.ci95[0],
        100.0 * gain.ci95[1],
        effect.evidence.channels.join(", "),
    )
}

fn instead(alternative: &Alternative) -> String {
    let joint = alternative.joint.as_ref().map_or(String::new(), |joint| format!(" of {joint}"));
    let separate = if alternative.indistinguishable {
        format!("; what would separate them: {}", alternative.what_would_separate)
    } else {
        String::new()
    };
    format!(
        "instead of {}: {}{joint} {}{separate}",
        alternative.instead_of, alternative.kind, alternative.why_not
    )
}

/// The held-out errors as bars, for the channels in which something was found.
fn bars(fit: &Fit, diagnosis: &Diagnosis) -> String {
    let mut channels: Vec<&String> = diagnosis.effects.iter().flat_map(|e| &e.evidence.channels).collect();
    if channels.is_empty() {
        channels = diagnosis.location.iter().flat_map(|place| &place.channels).collect();
    }
    channels.sort_unstable();
    channels.dedup();
    let mut text = format!("\nFIT     held out: {}\n", fit.data);
    for channel in channels {
        let unit = fit.units.get(channel).copied().unwrap_or("");
        let (scale, unit) = match unit {
            "m" => (1e3, "mm"),
            "rad" => (1e3, "mrad"),
            "N*m" => (1.0, "N·m"),
            other => (1.0, other),
        };
        let rows = [
            ("model as given", OPEN, &fit.before),
            ("parameters re-tuned", Style::new(), &fit.retuned),
            ("with what was found", GOOD, &fit.after_retuned),
            ("black box (splines)", Style::new(), &fit.black_box),
        ];
        let longest = rows.iter().map(|(_, _, table)| table[channel].rmse).fold(f64::MIN_POSITIVE, f64::max);
        let _ =
            writeln!(text, "  {channel}, {unit}, noise floor {:.3}", fit.noise_floor[channel].rmse * scale);
        for (name, style, table) in rows {
            let rmse = table[channel].rmse;
            let bar = painted(style, "█".repeat((BAR * rmse / longest).round() as usize));
            let _ = writeln!(text, "    {name:20} {:10.3}  {bar}", rmse * scale);
        }
    }
    if let Some(gain) = fit.gain {
        let _ = writeln!(
            text,
            "  improvement over the re-tuned model {:.0} % (95 %: {:.0} to {:.0} %)",
            100.0 * gain.value,
            100.0 * gain.ci95[0],
            100.0 * gain.ci95[1]
        );
    }
    text
}
