//! `freeplay run`: for each controller a plant process and a controller process, then one table and one report.

use std::path::{Path, PathBuf};
use std::process::Stdio;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use clap::Args;
use freeplay_doctor::Examination;
use freeplay_shm::RunFolder;
use freeplay_storage::{Entry, FileIdentity, list, read_text, remove_file};
use freeplay_terminal::arguments::Format;
use freeplay_terminal::exit::{Exit, Failure};
use freeplay_terminal::files::{claim, write};
use freeplay_terminal::hex::hex;
use freeplay_terminal::output::{say, show};
use freeplay_terminal::running::Running;
use freeplay_terminal::{flags, messages, progress};
use indicatif::ProgressBar;
use serde_json::json;
use sha2::{Digest, Sha256};

use crate::controller_selection::ControllerSelection;
use crate::live::{Title, Watch};
use crate::plant_command::pace_name;
use crate::processes::{
    Ended, exit_of_run, new_run, start_in_slot, start_plant, start_watched_plant, supervise,
};
use crate::run_files::{Files, RECORDED};
use crate::scenario::{Pacing, RecordingKind, Scenario, ScenarioError};
use crate::scenario_place::located;
use crate::setup::Setup;
use crate::summary::{RunSummary, SCHEMA};

use crate::{gains, run_report, swaps, terminal_summary, weights, weights_reach};

/// Length of the displayed standard error of a run that did not begin, bytes: a screenful.
const LAST_WORDS: usize = 2000;

/// Results of an earlier run. If the folder contains one of them, the program refuses a run that would overwrite it.
const RESULTS: [&str; 5] =
    ["scenario.toml", "task.toml", "model.toml", "controller_model.toml", "summary.json"];

/// Patience of lockstep runs that other commands start with built-in controllers, s. These controllers never hang, but are slow
/// on a busy machine.
pub const BUILT_IN_PATIENCE: f64 = 60.0;

/// Runs a scenario.
#[derive(Args, Debug)]
pub struct RunArgs {
    /// Scenario file. Default: the paper's arm, 0.6 mm of play in joint 5, the smooth path in 6 s.
    scenario: Option<PathBuf>,
    /// Controller: a built-in name, or the path of an executable or an FMU. Several controllers run one after another.
    #[arg(long)]
    controller: Vec<String>,
    /// Run by the wall clock, or in lockstep. Lockstep is deterministic and as fast as possible. Default: the value in the
    /// scenario, or lockstep.
    #[arg(long)]
    pace: Option<Pacing>,
    /// Arm of the plant: "paper" or an arm file.
    #[arg(long)]
    model: Option<String>,
    /// Link of the model at the end of the arm. Default: tool0, or the end of the longest chain without its fingers.
    #[arg(long, value_name = "LINK")]
    tip: Option<String>,
    /// Standby controller. It runs beside each controller and takes over when that controller fails. Several are allowed.
    #[arg(long)]
    standby: Vec<String>,
    /// Change a key of the scenario, as in --set path.period=12.
    #[arg(long, value_name = "KEY=VALUE")]
    set: Vec<String>,
    /// File format of the recording.
    #[arg(long)]
    recording: Option<RecordingKind>,
    /// Seed of all noise.
    #[arg(long)]
    seed: Option<u64>,
    /// Write the results of the run to this folder. Default: a folder in out/ named after the time.
    #[arg(long)]
    out: Option<PathBuf>,
    /// Replace results of an earlier command in the folder.
    #[arg(long)]
    force: bool,
    /// Output format.
    #[arg(long, default_value = "text")]
    format: Format,
    /// Watch the run in the terminal, and press keys to swap, kill or hang controllers. The run is in real time unless --pace
    /// sets another schedule.
    #[arg(long)]
    live: bool,
    /// Print the effective scenario, and exit without a run.
    #[arg(long)]
    show: bool,
    /// Exit with code 4 unless the machine is fit for measuring tail latencies (see `freeplay doctor`).
    #[arg(long)]
    require_rt: bool,
    /// Start the controller this many seconds after the plant, or before it if negative.
    #[arg(long, default_value_t = 0.0, allow_hyphen_values = true, value_name = "S", hide = true)]
    controller_delay: f64,
}

/// Runs the scenario of `args` with each of its controllers.
///
/// # Errors
/// Bad input, a controller that does not start, or a process that fails.
pub fn run(args: &RunArgs) -> Result<Exit, Failure> {
    if args.live && flags::is_quiet() {
        return Err(Failure::usage("--live cannot be used with --quiet: choose one of them"));
    }
    let mut scenario = effective(args)?;
    if let Some(found) = gains::settle(&mut scenario)? {
        messages::note(found);
    }
    if args.show {
        say(&scenario.to_toml().map_err(Failure::internal)?)?;
        return Ok(Exit::Done);
    }
    if args.require_rt {
        Examination::quick().require_rt()?;
    }
    let contestants = contestants(&scenario)?;
    let at =
        |failure: Failure| Failure { message: located(args.scenario.as_deref(), failure.message), ..failure };
    let setup = Setup::new(&scenario).map_err(at)?;
    for contestant in &contestants {
        let names = swaps::names(&contestant.asked, &scenario.standby);
        let period = setup.plant.period_ns as f64 * 1e-9;
        swaps::controller_set(&scenario, &names, setup.plant.ticks, period).map_err(at)?;
    }
    for standby in &scenario.standby {
        ControllerSelection::of(standby)?;
    }
    let folder = claim(args.out.as_deref(), &RESULTS, args.force)?;
    let files = Files::write(&scenario, &setup, folder.path())?;
    let learned =
        |contestant: &ControllerSelection| weights_reach::reach(&scenario, &setup, &contestant.asked);
    let stop = Arc::new(AtomicBool::new(false));
    freeplay_terminal::process::stop_on_signals(&stop)?;
    stands_still(&setup).into_iter().chain(weights::left_alone(&scenario)).for_each(messages::note);
    let (mut runs, mut exit, mut failure) = (Vec::new(), Exit::Done, None);
    for contestant in &contestants {
        let progress = progress(args.live, contestant, &setup, scenario.pace);
        let watch = if args.live {
            Some(watch(contestant, &scenario, &setup, &files)?)
        } else {
            // If a terminal shows a progress bar, the plant's snapshots move it.
            let is_told = scenario.pace == Pacing::Lockstep && !progress.is_hidden();
            is_told.then(|| {
                Watch::for_progress_bar(
                    progress.clone(),
                    title(contestant, &scenario, &setup),
                    &said(contestant, &files),
                )
            })
        };
        let left = watch.as_ref().map(Watch::quit_flag);
        let ended = play_watched(&scenario, contestant, &files, args.controller_delay, &stop, watch);
        progress.finish_and_clear();
        match ended {
            Err(error) if stop.load(Ordering::Relaxed) => {
                // The run was asked to end, so its error is only a note.
                messages::note(&error.message);
            }
            Err(error) => {
                failure = Some(error);
                break;
            }
            Ok((ended, summary)) => {
                runs.extend(summary.map(|summary| RunSummary { learned: learned(contestant), ..summary }));
                exit = if exit == Exit::Done { ended } else { exit };
            }
        }
        if stop.load(Ordering::Relaxed) {
            // Quitting the live view by its key is not an interruption.
            let is_left = left.is_some_and(|left| left.load(Ordering::Relaxed));
            exit = match exit {
                Exit::Done | Exit::Interrupted if is_left => Exit::Done,
                Exit::Verdict if is_left => Exit::Verdict,
                _ => Exit::Interrupted,
            };
            break;
        }
    }
    // The results of other controllers survive the failure of one.
    if !runs.is_empty() {
        finish(args, &scenario, &setup, &files.out, &runs)?;
    } else if !args.force {
        // No result is lost: the run created every file here, and the user may repeat the same command.
        files.give_up(&contestants)?;
    }
    failure.map_or(Ok(exit), Err)
}

/// Text on a run that lasts longer than its path.
fn stands_still(setup: &Setup) -> Option<String> {
    let seconds = setup.plant.ticks as f64 * setup.plant.period_ns as f64 / 1e9;
    let path = setup.path.duration();
    (seconds > path + setup.plant.period_ns as f64 / 1e9).then(|| {
        let laps = (seconds / path).ceil();
        format!(
            "the path ends after {path} s: from then on the arm stands still until the run ends at {seconds} s; \
             --set path.laps={laps} repeats the path"
        )
    })
}

/// Creates a view for the run of `contestant`.
fn watch(
    contestant: &ControllerSelection,
    scenario: &Scenario,
    setup: &Setup,
    files: &Files,
) -> Result<Watch, Failure> {
    Watch::open(title(contestant, scenario, setup), &said(contestant, files))
}

/// Simulates one run as [`play`] does, with a live view that is not displayed.
///
/// # Errors
/// See [`play`].
pub fn play_unseen(
    scenario: &Scenario,
    contestant: &ControllerSelection,
    setup: &Setup,
    files: &Files,
    stop: &AtomicBool,
) -> Result<(Exit, Option<RunSummary>), Failure> {
    let watch = Watch::unseen(title(contestant, scenario, setup), &said(contestant, files))?;
    play_watched(scenario, contestant, files, 0.0, stop, Some(watch))
}

/// File for the standard error of a watched run's processes.
fn said(contestant: &ControllerSelection, files: &Files) -> PathBuf {
    files.out.join(format!("{}.stderr", contestant.name))
}

fn title(contestant: &ControllerSelection, scenario: &Scenario, setup: &Setup) -> Title {
    Title {
        words: terminal_summary::heading(scenario, setup),
        seconds: setup.plant.ticks as f64 * setup.plant.period_ns as f64 * 1e-9,
        period: setup.plant.period_ns as f64 * 1e-9,
        controllers: swaps::names(&contestant.asked, &scenario.standby),
        plays: setup.plays(),
        patience: scenario.patience,
    }
}

/// Removes the plant's files of the run `name` from the folder `out`.
fn remove_run(out: &Path, name: &str) -> Result<(), Failure> {
    let is_of_run = |entry: &Entry| {
        let file = entry.path.file_name().unwrap_or_default().to_string_lossy();
        let ending = file.strip_prefix(name).and_then(|rest| rest.strip_prefix('.'));
        ending.is_some_and(|ending| {
            ["json", "hlog"].contains(&ending) || RECORDED.contains(&ending) || ending.ends_with("hgrm")
        })
    };
    for entry in list(out)?.into_iter().filter(is_of_run) {
        remove_file(&entry.path)?;
    }
    Ok(())
}

fn effective(args: &RunArgs) -> Result<Scenario, Failure> {
    // The model comes first, because another arm drops the paper's play, which a later --set may restore.
    let mut sets: Vec<String> = args.model.iter().map(|model| format!("model={model}")).collect();
    sets.extend(args.set.iter().cloned());
    sets.extend(args.seed.iter().map(|seed| format!("seed={seed}")));
    let mut scenario = load(args.scenario.as_deref(), &sets)?;
    if args.tip.is_some() {
        scenario.tip.clone_from(&args.tip);
    }
    if !args.controller.is_empty() {
        scenario.controllers.clone_from(&args.controller);
    }
    if !args.standby.is_empty() {
        scenario.standby.clone_from(&args.standby);
    }
    let pace = if args.live { Pacing::Realtime } else { scenario.pace };
    scenario.pace = args.pace.unwrap_or(pace);
    scenario.recording = args.recording.unwrap_or(scenario.recording);
    Ok(scenario)
}

/// The scenario of `file` changed by `sets`.
///
/// # Errors
/// Bad usage or bad input.
pub fn load(file: Option<&Path>, sets: &[String]) -> Result<Scenario, Failure> {
    Scenario::load(file, sets).map_err(|error| match error {
        ScenarioError::Set { .. } => Failure::usage(error),
        error => Failure::input(located(file, error.to_string())),
    })
}

/// The controllers of `scenario`, each with a unique name.
fn contestants(scenario: &Scenario) -> Result<Vec<ControllerSelection>, Failure> {
    let mut found: Vec<ControllerSelection> = Vec::new();
    for asked in &scenario.controllers {
        let mut contestant = ControllerSelection::of(asked)?;
        let same =
            found.iter().filter(|other| other.name.split('#').next() == Some(&contestant.name)).count();
        if same > 0 {
            contestant.name = format!("{}#{}", contestant.name, same + 1);
        }
        found.push(contestant);
    }
    Ok(found)
}

/// Plays one run. Returns its exit code and its summary; there is no summary if the run was interrupted before it began.
///
/// # Errors
/// A process that cannot start, or that fails.
pub fn play(
    scenario: &Scenario,
    contestant: &ControllerSelection,
    files: &Files,
    delay: f64,
    stop: &AtomicBool,
) -> Result<(Exit, Option<RunSummary>), Failure> {
    play_watched(scenario, contestant, files, delay, stop, None)
}

/// Simulates one run; `watch` shows it and is closed at its end.
fn play_watched(
    scenario: &Scenario,
    contestant: &ControllerSelection,
    files: &Files,
    delay: f64,
    stop: &AtomicBool,
    watch: Option<Watch>,
) -> Result<(Exit, Option<RunSummary>), Failure> {
    let left = files.out.join(format!("{}.json", contestant.name));
    // The summary of an earlier run stays until this run writes its own.
    let earlier = FileIdentity::of(&left);
    let has_left = || FileIdentity::of(&left).is_some_and(|now| Some(&now) != earlier.as_ref());
    let members: Vec<ControllerSelection> = std::iter::once(Ok(contestant.clone()))
        .chain(scenario.standby.iter().map(|asked| ControllerSelection::of(asked)))
        .collect::<Result<_, _>>()?;
    let root = new_run()?;
    let ended = processes(scenario, &members, files, &root, delay, stop, watch)?;
    let exit = exit_of_run(&ended, &members, has_left())?;
    if exit != Exit::Done && !has_left() {
        for line in last_lines(&said(contestant, files)) {
            messages::note(line);
        }
    }
    match read_text(&left) {
        Ok(text) if has_left() => {
            let mut summary: RunSummary = serde_json::from_str(&text).map_err(Failure::internal)?;
            if exit == Exit::Input && summary.ending["braked"]["tick"] == 0 {
                // A controller that refuses its input has not run, so no file may suggest that it has.
                remove_run(&files.out, &contestant.name)?;
                return Err(Failure::input(format!(
                    "{} did not start; its message is above",
                    contestant.asked
                )));
            }
            summary.controller.clone_from(&contestant.asked);
            Ok((exit, Some(summary)))
        }
        _ if exit == Exit::Input => Err(Failure::input("the plant ended; its message is above")),
        _ if exit != Exit::Done => Ok((exit, None)),
        Ok(_) => Err(Failure::internal(format!("{}: the plant did not write this file", left.display()))),
        Err(error) => Err(error.into()),
    }
}

/// The end of the standard error of a run that was watched on a screen; empty if the processes could print it themselves.
fn last_lines(said: &Path) -> Vec<String> {
    let text = freeplay_storage::read_bytes(said, u64::MAX).unwrap_or_default();
    let text = String::from_utf8_lossy(&text[text.len().saturating_sub(LAST_WORDS)..]).into_owned();
    text.lines().map(str::to_owned).collect()
}

/// Starts the processes of a run, with the first of `members` active, and waits until it has ended.
fn processes(
    scenario: &Scenario,
    members: &[ControllerSelection],
    files: &Files,
    root: &RunFolder,
    delay: f64,
    stop: &AtomicBool,
    mut watch: Option<Watch>,
) -> Result<Ended, Failure> {
    let (address, wait) = (root.address(), Duration::from_secs_f64(delay.abs().min(60.0)));
    let start = |slot: usize, stderr: Stdio| start_in_slot(scenario, &members[slot], slot, address, stderr);
    let stderr = |watch: &Option<Watch>| watch.as_ref().map_or_else(|| Ok(Stdio::inherit()), Watch::stderr);
    let start_all = |watch: &Option<Watch>| -> Result<Vec<Running>, Failure> {
        (0..members.len()).map(|slot| start(slot, stderr(watch)?)).collect()
    };
    let mut controllers = Vec::new();
    if delay < 0.0 {
        controllers = start_all(&watch)?;
        std::thread::sleep(wait);
    }
    let mut plant = Running::alone(match &mut watch {
        Some(watch) => start_watched_plant(&members[0], files, address, watch)?,
        None => start_plant(&members[0], files, address)?,
    });
    if delay >= 0.0 {
        std::thread::sleep(wait);
        controllers = start_all(&watch)?;
    }
    let ended = supervise(root, &mut plant.0, &mut controllers, stop, |controllers| {
        if let Some(watch) = &mut watch {
            stop.fetch_or(watch.look(controllers, &start)?, Ordering::Relaxed);
        }
        Ok(())
    })?;
    watch.map_or(Ok(()), |mut watch| watch.end())?;
    Ok(ended)
}

/// A progress line on standard error; hidden if the run is watched.
fn progress(is_watched: bool, contestant: &ControllerSelection, setup: &Setup, pace: Pacing) -> ProgressBar {
    let seconds = setup.plant.ticks as f64 * setup.plant.period_ns as f64 / 1e9;
    let words = format!("{}: {seconds} s of motion, {}", contestant.asked, pace_name(pace));
    messages::detail(&words);
    if is_watched {
        return ProgressBar::hidden();
    }
    match pace {
        Pacing::Lockstep => {
            progress::bar(setup.plant.ticks, "{msg} {wide_bar} {percent} % {elapsed}").with_message(words)
        }
        Pacing::Realtime => progress::clock(words, seconds),
    }
}

/// Writes the summary and the report, and prints the result for a person or a program.
fn finish(
    args: &RunArgs,
    scenario: &Scenario,
    setup: &Setup,
    out: &Path,
    runs: &[RunSummary],
) -> Result<(), Failure> {
    let effective = scenario.to_toml().map_err(Failure::internal)?;
    let hash = hex(&Sha256::digest(effective.as_bytes()));
    let machine = Examination::quick().machine();
    let summary = json!({
        "schema": SCHEMA, "freeplay": env!("CARGO_PKG_VERSION"),
        "scenario": json!(scenario), "config_hash": hash, "machine": machine, "runs": runs,
    });
    let text = serde_json::to_string_pretty(&summary).map_err(Failure::internal)?;
    let report = write(&out.join("summary.json"), &text)
        .and_then(|()| run_report::write(scenario, setup, out, runs, &machine));
    // The summary is printed even if the disk has no room for it.
    match args.format {
        Format::Json => say(&format!("{text}\n"))?,
        Format::Text => {
            show(&terminal_summary::table(scenario, setup, runs, out, report.as_deref().unwrap_or(out)))?;
        }
    }
    report.map(|_| ())
}
