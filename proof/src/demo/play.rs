//! One machine: a run, the diagnosis of its recording, and a second run under a controller with the diagnosed model.

use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;

use freeplay_diagnosis::page::{Subject, commands, diagnose_command, document};
use freeplay_diagnosis::{DiagnoseSettings, Diagnosis, Verdict, diagnose};
use freeplay_harness::controller_selection::ControllerSelection;
use freeplay_harness::run::{BUILT_IN_PATIENCE, play};
use freeplay_harness::run_files::Files;
use freeplay_harness::scenario::{RecordingKind, Scenario};
use freeplay_harness::setup::Setup;
use freeplay_model::{ArmFile, to_toml};
use freeplay_plant::{Channel, SensorsSpec};
use freeplay_recording::Recording;
use freeplay_terminal::exit::{Exit, Failure};
use freeplay_terminal::files::write;

use super::cases::{Case, Notch};
use freeplay_report::paste::seen_from;

/// The controller of every run.
pub const CONTROLLER: &str = "quasi-static";
/// Noise of the sensors: rad, rad/s, N·m, m. Twenty bits on a motor behind a gear of 100 : 1 are 6e-8 rad.
const NOISE: [f64; 4] = [1e-7, 1e-6, 0.05, 1e-5];

/// Laps of each run: the held-out part of its recording covers every place again.
const LAPS: u32 = 2;
/// Samples before and after that determine the direction of a joint.
const SPAN: usize = 10;

/// Result of a run of the machine.
#[derive(Clone, Debug)]
pub struct Played {
    /// The recording.
    pub recording: PathBuf,
    /// The tool's deviation after the first 0.5 s, root of the mean square, mm.
    pub deviation: f64,
}

/// Outcome of a machine.
pub struct Outcome {
    /// The machine.
    pub case: Case,
    /// The run with the nominal model.
    pub before: Played,
    /// The diagnosis of its recording.
    pub diagnosis: Diagnosis,
    /// The run with the diagnosed model; `None` if the diagnosis added nothing to the model, or if the run failed.
    pub after: Option<Played>,
    /// Reason for which this run is missing although there is such a model.
    pub failure: Option<String>,
}

impl Outcome {
    /// True if the concealed effect is among the findings, beside false ones.
    pub fn is_found_with_others(&self) -> bool {
        let Some(hidden) = &self.case.effect else { return false };
        let same =
            |effect: &freeplay_diagnosis::Effect| effect.kind == hidden.kind && effect.joint == hidden.joint;
        !self.is_right() && self.diagnosis.effects.iter().any(same)
    }

    /// True if the diagnosis is right: the concealed effect at its joint and no other; no name if there is none to give.
    pub fn is_right(&self) -> bool {
        let found = &self.diagnosis.effects;
        match (&self.case.effect, &self.case.notch) {
            (Some(hidden), _) => {
                let same = |kind: &str, joint: &Option<String>| kind == hidden.kind && *joint == hidden.joint;
                self.diagnosis.verdict == Verdict::Named
                    && self.failure.is_none()
                    && found.iter().all(|effect| same(effect.kind, &effect.joint))
                    && !found.is_empty()
            }
            (None, Some(_)) => self.diagnosis.verdict == Verdict::Unknown,
            (None, None) => self.diagnosis.verdict == Verdict::NothingMissing,
        }
    }
}

/// Runs, diagnoses and runs again, with all files in `out`.
///
/// # Errors
/// A process that fails, or a file that can't be written.
pub fn outcome(
    case: &Case,
    period: f64,
    seed: u64,
    out: &Path,
    stop: &AtomicBool,
) -> Result<Outcome, Failure> {
    let nominal = case.nominal().map_err(Failure::internal)?;
    freeplay_terminal::files::make_folder(out)?;
    let (truth, model) = (out.join("truth.toml"), out.join("nominal.toml"));
    write(&truth, &to_toml(&case.truth().map_err(Failure::internal)?))?;
    write(&model, &to_toml(&nominal))?;
    let run = |model: &Path, name: &str| {
        let mut scenario = Scenario {
            model: truth.display().to_string(),
            controllers: vec![CONTROLLER.to_owned()],
            clearance: std::collections::BTreeMap::new(),
            recording: RecordingKind::Mcap,
            sensors: sensors(),
            seed,
            patience: BUILT_IN_PATIENCE,
            ..Scenario::default()
        };
        scenario.path.period = period;
        scenario.path.laps = LAPS;
        scenario.controller.model = Some(model.display().to_string());
        played(&scenario, &out.join(name), stop)
    };
    let before = run(&model, "before")?;
    let recording = measured(&before.recording, case.notch)?;
    let settings = DiagnoseSettings { seed, ..DiagnoseSettings::default() };
    let diagnosis = diagnose(&nominal, std::slice::from_ref(&recording), &settings, &mut |_| {})
        .map_err(Failure::internal)?;
    keep(&nominal, &before, &diagnosis, out)?;
    let mut outcome = Outcome { case: case.clone(), before, diagnosis, after: None, failure: None };
    if !outcome.diagnosis.effects.is_empty() {
        match run(&out.join("model.toml"), "after") {
            Ok(after) => outcome.after = Some(after),
            // The results of the other machines are still useful.
            Err(failure) => outcome.failure = Some(failure.to_string()),
        }
    }
    Ok(outcome)
}

/// Sensors of good quality.
pub fn sensors() -> SensorsSpec {
    let noisy = |noise: f64| Channel { noise, ..Channel::default() };
    let [position, velocity, torque, tool] = NOISE.map(noisy);
    SensorsSpec { position, velocity, torque, tool, ..SensorsSpec::default() }
}

fn played(scenario: &Scenario, out: &Path, stop: &AtomicBool) -> Result<Played, Failure> {
    let setup = Setup::new(scenario)?;
    let files = Files::write(scenario, &setup, out)?;
    let (exit, summary) = play(scenario, &ControllerSelection::of(CONTROLLER)?, &files, 0.0, stop)?;
    let summary = summary.filter(|_| exit == Exit::Done);
    let summary = summary.ok_or_else(|| Failure { exit, message: unfinished(exit, out) })?;
    let deviation = summary.deviation_mm["rms_after_start"].as_f64().unwrap_or(f64::NAN);
    let recording = summary.recording.ok_or_else(|| Failure::internal("a run left no recording"))?;
    Ok(Played { recording: files.out.join(recording), deviation })
}

/// Message about a run in `out` that ended with `exit`.
fn unfinished(exit: Exit, out: &Path) -> String {
    let out = out.display();
    match exit {
        Exit::Peer => format!(
            "the run in {out} lost its controller; its message is above: try again on a machine with less other work"
        ),
        Exit::Interrupted => format!("the run in {out} was interrupted"),
        _ => format!("the run in {out} did not end well; its message is above"),
    }
}

/// The recording of a real machine: joints, torques and the tracked tool, without the truth.
fn measured(path: &Path, notch: Option<Notch>) -> Result<Recording, Failure> {
    let all = freeplay_recording::read(path, None).map_err(Failure::input)?;
    let mut columns = vec![("t".to_owned(), all.t.clone())];
    let joints = |name: &str, values: &[Vec<f64>]| -> Vec<(String, Vec<f64>)> {
        values
            .iter()
            .enumerate()
            .map(|(joint, column)| (format!("{name}{}", joint + 1), column.clone()))
            .collect()
    };
    columns.extend(joints("q", &all.q));
    let mut torques = all.tau.clone().unwrap_or_default();
    if let Some(notch) = notch {
        add(notch, &all.q[notch.joint], &mut torques[notch.joint]);
    }
    columns.extend(joints("tau", &torques));
    if let Some(tool) = &all.tool {
        columns.extend(
            ["x", "y", "z"].iter().zip(tool).map(|(name, column)| ((*name).to_owned(), column.clone())),
        );
    }
    Recording::new(path, columns).map_err(Failure::internal)
}

fn add(notch: Notch, q: &[f64], torque: &mut [f64]) {
    let (low, high) = q.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), q| (l.min(*q), h.max(*q)));
    let (at, wide) = (low + notch.place * (high - low), notch.width * (high - low));
    for k in 0..q.len() {
        // Over some samples, in which the joint moves by more than the noise of its encoder.
        let way = q[(k + SPAN).min(q.len() - 1)] - q[k.saturating_sub(SPAN)];
        torque[k] += notch.torque * (-((q[k] - at) / wide).powi(2)).exp() * way.signum();
    }
}

/// Writes diagnosis.json, model.toml and report.html of a machine.
fn keep(nominal: &ArmFile, before: &Played, diagnosis: &Diagnosis, out: &Path) -> Result<(), Failure> {
    let mut json = serde_json::to_value(diagnosis).map_err(Failure::internal)?;
    let model = out.join("nominal.toml").display().to_string();
    let recording = seen_from(out, &before.recording);
    json["inputs"] = serde_json::json!({ "model": "nominal.toml", "recordings": [recording] });
    json["model"] = serde_json::json!("model.toml");
    json["report"] = serde_json::json!("report.html");
    write(&out.join("diagnosis.json"), &format!("{json:#}\n"))?;
    write(&out.join("model.toml"), &to_toml(&diagnosis.model))?;
    let recordings = [before.recording.clone()];
    let subject = Subject {
        model: &model,
        file: nominal,
        recordings: &recordings,
        command: diagnose_command(&model, None, &recordings, None, None),
        commands: commands(&out.join("model.toml"), &before.recording, None, None),
        diagnosis,
        out,
    };
    write(&out.join("report.html"), &document(&subject).to_html())
}
