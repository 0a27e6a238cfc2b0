//! `freeplay diagnose`: where a model and a recording differ, what is missing from the model, and how much better it gets.

use std::path::{Path, PathBuf};

use clap::Args;
use freeplay_arm::{ArmFile, to_toml};
use freeplay_diagnosis::page::{Subject, diagnose_command, document};
use freeplay_diagnosis::{
    DiagnoseError, DiagnoseSettings, Diagnosis, ExciteSettings, Settings, Tolerances, beyond_limits,
    diagnose as diagnosed,
};
use freeplay_harness::setup::PAPER_MODEL;
use freeplay_recording::Recording;
use freeplay_report::paste::seen_from;
use freeplay_terminal::arguments::Format;
use freeplay_terminal::exit::{Exit, Failure};
use freeplay_terminal::files::write;
use freeplay_terminal::messages;
use freeplay_terminal::output::{say, show};
use serde_json::Value;

use crate::diagnose_screen;
use crate::excite::{self, Question};
use crate::inputs::{self, Measured};
use freeplay_terminal::target::{asked_file, claim_out, folder_of};

/// The file of results that says how the recordings are to be read.
pub const SETUP: &str = "setup.toml";
/// The next motion: how long it takes, s, how far a joint goes, rad (m), and how many are weighed.
const NEXT_S: f64 = 16.0;
const NEXT_REACH: f64 = 1.2;
const NEXT_CANDIDATES: usize = 16;

/// Locates where a recording and a model differ, names the physics left out, models it and shows the fit improve, or says why not.
///
/// What is missing is sought in the first 70 % of a recording and judged on the rest, and on each other part by a fit that has not seen
/// it; its numbers rest on all of it. With several recordings, on all but the last, which judges. Verdicts:
/// nothing_missing, named, one_of, unknown, insufficient_data; setup, where recording and model don't mean the same (units, signs, order, zeros,
/// gravity, clocks): then all else is said of the mended reading. All of them end with exit code 0.
#[derive(Args, Debug)]
pub struct DiagnoseArgs {
    /// The model: an arm file (URDF, MJCF or TOML), or "paper".
    #[arg(long, value_name = "FILE")]
    model: String,
    /// The link of the model at the end of the arm; without it: the chain whose joints the recording names, else the longest one.
    #[arg(long, value_name = "LINK")]
    tip: Option<String>,
    /// Recordings of one machine with the same columns, of any kind that `freeplay record` reads. A part of each is held out.
    #[arg(long, value_name = "FILE", num_args = 1.., required = true)]
    recording: Vec<PathBuf>,
    /// Mapping file that gives the meaning of the columns, such as the setup.toml of a diagnosis.
    #[arg(long, value_name = "FILE")]
    mapping: Option<PathBuf>,
    /// Output format.
    #[arg(long, default_value = "text")]
    format: Format,
    /// Folder for diagnosis.json, report.html and model.toml, the model with what was missing, tuned inside its tolerances; a name that
    /// ends in .toml or .json is the file of the model, or of the diagnosis, alone.
    #[arg(long, value_name = "DIR|FILE")]
    out: Option<PathBuf>,
    /// Replace results of an earlier command in the folder.
    #[arg(long)]
    force: bool,
    /// Seed of all random numbers.
    #[arg(long, default_value_t = 1)]
    seed: u64,
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

/// What a diagnosis writes.
const EXTENSIONS: [&str; 2] = ["toml", "json"];
/// Results in the folder that `--out` names.
const RESULTS: [&str; 3] = ["diagnosis.json", "model.toml", "report.html"];

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
        Ok(DiagnoseSettings { treatment, tolerances, seed: self.seed })
    }
}

/// Diagnoses the recordings of `args`.
///
/// # Errors
/// Bad input: a file that can't be read, another number of joints, nothing to compare, recordings with different columns.
pub fn diagnose(args: &DiagnoseArgs) -> Result<Exit, Failure> {
    let settings = args.settings()?;
    inputs::only_once(&args.recording)?;
    let measured: Vec<Measured> = args
        .recording
        .iter()
        .map(|path| Measured::read(path, args.mapping.as_deref()))
        .collect::<Result<_, _>>()?;
    let [first, ..] = measured.as_slice() else { return Err(Failure::usage("name a --recording")) };
    let file = first.model(&args.model, args.tip.as_deref())?;
    let for_arm = |measured: Measured| measured.for_arm(&args.model, &file);
    let recordings: Vec<Recording> = measured.into_iter().map(for_arm).collect::<Result<_, _>>()?;
    // Before what takes minutes.
    let folder =
        args.out.as_deref().map(|out| claim_out(out, &EXTENSIONS, &RESULTS, args.force)).transpose()?;
    let found = diagnosed(&file, &recordings, &settings, &mut |what| messages::announce(what));
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
    drop(folder);
    match args.format {
        Format::Json => say(&format!("{json:#}\n"))?,
        Format::Text => show(&diagnose_screen::text(&view))?,
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
    let folder = args.out.as_deref().filter(|out| target(out).is_none());
    let (Some(out), Some(seen)) = (folder, recordings.first()) else { return Ok(None) };
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
pub struct View<'a> {
    args: &'a DiagnoseArgs,
    file: &'a ArmFile,
    /// The recordings.
    pub recordings: &'a [Recording],
    /// What was found.
    pub diagnosis: &'a Diagnosis,
}

impl View<'_> {
    /// The folder of results.
    pub fn out(&self) -> Option<&Path> {
        self.args.out.as_deref().filter(|out| target(out).is_none())
    }

    /// The single file of results.
    pub fn file(&self) -> Option<&Path> {
        self.args.out.as_deref().filter(|out| target(out).is_some())
    }

    /// The file that says how the recordings are to be read, where one is written.
    pub fn setup_file(&self) -> Option<PathBuf> {
        self.diagnosis.mapping.as_ref().and_then(|_| Some(self.out()?.join(SETUP)))
    }

    /// The mapping file by which the recordings are to be read: the mended reading, or else the one that was given.
    pub fn reading(&self) -> Option<PathBuf> {
        self.setup_file().or_else(|| self.args.mapping.clone())
    }

    /// The commands that use the model `model` of this diagnosis: one that compares it with the recording that judged, and one that moves it; by the scenario
    /// of that recording where it has one.
    pub fn commands(&self, model: &Path) -> [String; 2] {
        let recording = self.args.recording.last().map_or(Path::new(""), PathBuf::as_path);
        let scenario = self.recordings.last().and_then(scenario_of);
        freeplay_diagnosis::page::commands(model, recording, self.reading().as_deref(), scenario.as_deref())
    }

    /// The command that makes this diagnosis again with the mended reading, or that writes how the recordings are to be read.
    pub fn again(&self) -> String {
        match (self.setup_file(), &self.args.mapping) {
            (Some(mended), _) => self.command(Some(&mended)),
            (None, given) => self.command(given.as_deref()) + " --out found",
        }
    }

    /// This diagnosis as a command that reads the recordings by `mapping`.
    fn command(&self, mapping: Option<&Path>) -> String {
        let DiagnoseArgs { model, tip, recording, lowpass, .. } = self.args;
        diagnose_command(model, tip.as_deref(), recording, *lowpass, mapping)
    }

    /// `freeplay.diagnosis/1`, with what it was made from.
    fn json(&self) -> Result<Value, Failure> {
        let mut value = serde_json::to_value(self.diagnosis).map_err(Failure::internal)?;
        value["inputs"] = serde_json::json!({ "model": self.args.model, "recordings": self.args.recording });
        if let Some(tip) = &self.args.tip {
            value["inputs"]["tip"] = serde_json::json!(tip);
        }
        if self.args.out.is_some() {
            if self.diagnosis.has_model() {
                value["model"] = serde_json::json!("model.toml");
            }
            value["report"] = serde_json::json!("report.html");
        }
        Ok(value)
    }

    /// Writes diagnosis.json, report.html and, where the recordings could tell, model.toml into the folder `out`, or the one of them that the ending of the
    /// file `out` asks for. Paths in a diagnosis.json are those seen from its folder.
    fn write(&self, out: &Path, json: &Value) -> Result<(), Failure> {
        let folder = target(out).map_or(out, |_| folder_of(out));
        let mut moved = json.clone();
        if self.args.model != PAPER_MODEL {
            moved["inputs"]["model"] = serde_json::json!(seen_from(folder, Path::new(&self.args.model)));
        }
        let recordings: Vec<PathBuf> =
            self.args.recording.iter().map(|path| seen_from(folder, path)).collect();
        moved["inputs"]["recordings"] = serde_json::json!(recordings);
        let json = moved;
        match target(out) {
            Some("toml") if !self.diagnosis.has_model() => return Ok(freeplay_storage::remove_file(out)?),
            Some("toml") => return write(out, &to_toml(&self.diagnosis.model)),
            Some(_) => return write(out, &format!("{json:#}\n")),
            None => {}
        }
        write(&out.join("diagnosis.json"), &format!("{json:#}\n"))?;
        // This diagnosis replaces an earlier one in the same folder. Files of that one would pass for files of this one.
        let model = out.join("model.toml");
        if self.diagnosis.has_model() {
            write(&model, &to_toml(&self.diagnosis.model))?;
        } else {
            freeplay_storage::remove_file(&model)?;
        }
        match &self.diagnosis.mapping {
            Some(mapping) => write(&out.join(SETUP), mapping)?,
            None => freeplay_storage::remove_file(&out.join(SETUP))?,
        }
        let View { args, file, diagnosis, .. } = self;
        let subject = Subject {
            model: &args.model,
            file,
            recordings: &args.recording,
            command: self.command(args.mapping.as_deref()),
            commands: self.commands(&model),
            diagnosis,
            out,
        };
        write(&out.join("report.html"), &document(&subject).to_html())
    }
}

/// The single file of results that `out` asks for.
fn target(out: &Path) -> Option<&'static str> {
    asked_file(out, &EXTENSIONS)
}

/// The scenario that a run left beside its `recording`; `None` of a recording of another machine.
fn scenario_of(recording: &Recording) -> Option<PathBuf> {
    let is_of_a_run = recording.metadata.iter().any(|(key, _)| key == "scenario");
    let file = folder_of(&recording.origin).join("scenario.toml");
    (is_of_a_run && file.is_file()).then_some(file)
}

/// The name of its file.
pub fn file_name(recording: &Recording) -> String {
    recording.origin.file_name().map_or_else(String::new, |name| name.to_string_lossy().into_owned())
}
