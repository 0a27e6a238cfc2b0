//! `freeplay train`: from recordings to a weight file with its region of validity.

use std::path::{Path, PathBuf};

use clap::Args;
use freeplay_arm::Arm;
use freeplay_controller::{Model, RunInfo, Task, TaskMode};
use freeplay_harness::setup::load_model;
use freeplay_harness::weights::beside;
use freeplay_model::ArmFile;
use freeplay_recording::Recording;
use freeplay_shm::{Mode, Pace};
use freeplay_terminal::arguments::{Format, at_least_one};
use freeplay_terminal::exit::{Exit, Failure};
use freeplay_terminal::files::{check_target, write};
use freeplay_terminal::messages;
use freeplay_terminal::output::say;

use crate::choice::choose;
use crate::data::Data;
use crate::forecast::forecasts;
use crate::held_out::{Answers, held_out, scored};
use crate::recorded::{RecordedRun, files, name_of, task_of};
use crate::rehearsal::{RehearsalInputs, check_mode, check_rate};
use crate::selection::errors;
use crate::structure::{Fitting, Structure};
use crate::text::text;
use crate::trained::Trained;
use crate::weight_files::Weights;

/// Time between training windows, s.
const EVERY: f64 = 0.02;

/// Trains a network on the deviation of a tracked tool that a model leaves unexplained.
///
/// Exit code 1: the simulated runs did not confirm that the network helps. Controllers then do not use it.
#[derive(Args, Debug)]
pub struct TrainArgs {
    /// Recordings with a tracked tool, or folders of runs. They must cover at least two paths; three are better.
    #[arg(long = "recording", value_name = "RUN", required = true, num_args = 1..)]
    recordings: Vec<PathBuf>,
    /// Model whose unexplained deviation the network learns: "paper", or an arm file such as the model of a diagnosis.
    #[arg(long, default_value = freeplay_controller::task::PAPER_MODEL)]
    model: String,
    /// Model of the arm that planned the reference. Deviations are measured from this arm. It differs from --model after a
    /// diagnosis, which tunes a model within its tolerances. Default: the arm of --model.
    #[arg(long, value_name = "MODEL")]
    nominal: Option<String>,
    /// Write the weights to this file. Default: a file beside the model, where runs with this model find it.
    #[arg(long)]
    out: Option<PathBuf>,
    /// Number of units in each hidden layer. Default: the best of several choices, by their predictions of held-out paths.
    #[arg(long, value_delimiter = ',', value_parser = at_least_one)]
    hidden: Vec<usize>,
    /// Maximum number of epochs.
    #[arg(long, default_value_t = 60, value_parser = at_least_one)]
    epochs: usize,
    /// Seed of the initial weights.
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Output format.
    #[arg(long, default_value = "text")]
    format: Format,
}

/// Settings of a training.
#[derive(Clone, Debug)]
pub struct Settings {
    /// Hidden layers; if empty, the program chooses them.
    pub hidden: Vec<usize>,
    /// Maximum number of epochs.
    pub epochs: usize,
    /// Seed of the initial weights.
    pub seed: u64,
    /// Reference arm of the deviations; without one, that of the model.
    pub nominal: Option<Arm>,
    /// The command, for the weight file.
    pub command: String,
}

impl Default for Settings {
    fn default() -> Self {
        Self { hidden: Vec::new(), epochs: 60, seed: 1, nominal: None, command: "freeplay train".to_owned() }
    }
}

/// Runs the command.
///
/// # Errors
/// Unusable recordings or an unusable model, failed runs, or an unwritable file.
pub fn train_command(args: &TrainArgs) -> Result<Exit, Failure> {
    let model = Path::new(&args.model);
    let out = args.out.clone().unwrap_or_else(|| beside(model));
    check_target(&out)?;
    check_target(&out.with_extension("html"))?;
    let mut recordings = Vec::new();
    for given in &args.recordings {
        recordings.extend(files(given)?);
    }
    let settings = Settings {
        hidden: args.hidden.clone(),
        epochs: args.epochs,
        seed: args.seed,
        nominal: args.nominal.as_deref().map(load_model).transpose()?.map(|file| file.arm),
        command: std::env::args().collect::<Vec<_>>().join(" "),
    };
    let trained = train_on_files(&recordings, model, &settings)?;
    write(&out, &trained.file.to_json().map_err(Failure::internal)?)?;
    messages::note(format_args!("weights  {}", out.display()));
    let page = out.with_extension("html");
    write(&page, &crate::page::document(&trained).to_html())?;
    messages::note(format_args!("report   {}", page.display()));
    match args.format {
        Format::Json => {
            say(&format!("{}\n", serde_json::to_string_pretty(&trained).map_err(Failure::internal)?))?;
        }
        Format::Text => say(&text(&trained))?,
    }
    Ok(if trained.receipt.proved { Exit::Done } else { Exit::Verdict })
}

/// Trains on the recordings `files`.
fn train_on_files(files: &[PathBuf], model: &Path, settings: &Settings) -> Result<Trained, Failure> {
    let task = task_of_all(files)?.unwrap_or_default();
    let read = |file: &PathBuf| {
        let recording = freeplay_recording::read(file, None).map_err(Failure::input)?;
        Ok((name_of(file), recording))
    };
    let recordings: Vec<(String, Recording)> = files.iter().map(read).collect::<Result<_, Failure>>()?;
    train(&recordings, task, model, settings)
}

/// Trains on `recordings`, given by name, the remainder beyond `model` ("paper" or an arm file); `task` is the one of their runs.
///
/// # Errors
/// Unusable recordings, an unusable model, or failed runs.
pub fn train(
    recordings: &[(String, Recording)],
    task: Task,
    model: &Path,
    settings: &Settings,
) -> Result<Trained, Failure> {
    let file = load_model(&model.display().to_string())?;
    let task = Task { model: model.display().to_string(), weights: None, ..task };
    check_mode(&task)?;
    let believed = believed(&task, &file)?;
    let nominal = settings.nominal.as_ref().unwrap_or(&believed.nominal);
    if nominal.dof() != believed.arm.dof() {
        return Err(Failure::input(format!(
            "--nominal: {} joints, but the model has {}: give the nominal arm of this machine",
            nominal.dof(),
            believed.arm.dof()
        )));
    }
    let runs: Result<Vec<_>, Failure> = recordings
        .iter()
        .map(|(name, recording)| RecordedRun::of(recording, name.clone(), &believed, nominal))
        .collect();
    let data = Data::new(&believed.arm, runs?)?;
    let period = data.runs[0].period;
    if let Some(other) = data.runs.iter().find(|run| (run.period / period - 1.0).abs() > 1e-3) {
        return Err(Failure::input(format!(
            "{} has a sample every {} s, {} every {period} s: give recordings of one rate",
            other.name, other.period, data.runs[0].name
        )));
    }
    check_rate(period)?;
    let task = Task { rate: (1.0 / period).round(), ..task };
    let stride = ((EVERY / period).round() as usize).max(1);
    let fitting = Fitting { stride, epochs: settings.epochs, seed: settings.seed };
    let (structure, held, mut tried) = choose(&data, fitting)?;
    let (structure, held) = if settings.hidden.is_empty() {
        (structure, held)
    } else {
        let asked = Structure { hidden: settings.hidden.clone(), ..structure };
        let held = held_out(&data, &asked, fitting)?;
        tried.push(scored(&data, asked.words(data.joints()), held.iter().map(|held| &held.answers)));
        (asked, held)
    };
    tried.splice(0..0, crate::baselines::all(&data, &structure, fitting)?);
    let (data, structure) = (&data, &structure);
    let making =
        Weights { data, structure, fitting, command: &settings.command, task: &task, model: &believed };
    let (mut weights, of_folds) = making.files(&held)?;
    let answers: Vec<&Answers> = held.iter().map(|held| &held.answers).collect();
    let bounds = (weights.learned.region.trust.as_slice(), &weights.learned.axes);
    let forecasts = forecasts(data, &weights.learned.region.inputs, &answers, bounds, stride);
    let mut courses = Vec::new();
    if weights.learned.axes.iter().any(|axis| axis.share > 0.0) {
        let rehearsal = RehearsalInputs { data, model, believed: &believed, file: &file, task: &task };
        (weights.receipt, courses) = rehearsal.decide(&of_folds)?;
    }
    Ok(Trained {
        structure: structure.words(data.joints()),
        left_of_paths: errors(data, &held),
        tried,
        receipt: weights.receipt.clone(),
        file: weights,
        forecasts,
        courses,
    })
}

/// The common task of the runs of `recordings`; `None` if no recording has a task file next to it.
fn task_of_all(recordings: &[PathBuf]) -> Result<Option<Task>, Failure> {
    let mut task: Option<Task> = None;
    for recording in recordings {
        let Some(found) = task_of(recording)? else { continue };
        if let Some(first) = &task
            && (first.gains, first.mode, first.rate) != (found.gains, found.mode, found.rate)
        {
            return Err(Failure::input(format!(
                "{}: its mode, rate or feedback differs from that of the recordings before, and the network depends on them; give recordings with the same",
                recording.display()
            )));
        }
        task.get_or_insert(found);
    }
    Ok(task)
}

/// The model as a controller with `task` loads it.
fn believed(task: &Task, file: &ArmFile) -> Result<Model, Failure> {
    let mode = match task.mode {
        TaskMode::Torque => Mode::Torque,
        TaskMode::Driven => Mode::Driven,
        TaskMode::Servo => Mode::Servo,
    };
    let period_ns = (1e9 / task.rate).round() as u64;
    let run = RunInfo { joints: file.arm.dof(), mode, pace: Pace::Lockstep, period_ns, ticks: 1 };
    Model::load(task, &run).map_err(Failure::input)
}
