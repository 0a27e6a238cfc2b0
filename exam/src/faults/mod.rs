//! `freeplay faults`: the exam of a controller. The exam injects faults at ticks drawn from a seed, and measures the reaction of the plant, its gate and a
//! standby to each.
//!
//! In the order of the exam: `kinds` (kinds of fault), `fault_injector` and `active_fault` (the process that causes the faults), `exam` (the runs), `findings`
//! (outcome of each fault), `environment_faults` (faults outside the controller), `exam_report` (words, JSON, JUnit and HTML), `kills` (processes killed at
//! random).

mod active_fault;
mod environment_faults;
mod exam;
mod exam_report;
pub mod fault_injector;
mod findings;
mod kills;
pub mod kinds;

use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use clap::Args;
use freeplay_harness::controller_selection::ControllerSelection;
use freeplay_harness::run::load;
use freeplay_harness::scenario::{Pacing, RecordingKind};
use freeplay_terminal::arguments::Format;
use freeplay_terminal::exit::{Exit, Failure};
use freeplay_terminal::output::{say, show};
use freeplay_terminal::progress;

use crate::faults::exam::Exam;
use crate::faults::kinds::Kind;
use freeplay_terminal::files::claim;

/// Injects faults into a controller, and judges how the run handles them.
#[derive(Args, Debug)]
pub struct FaultsArgs {
    /// Controller to test: a built-in name, or the path of an executable or an FMU.
    controller: String,
    /// Scenario file, as for `freeplay run`. Default: the paper's arm.
    #[arg(long)]
    scenario: Option<PathBuf>,
    /// Standby controller, which takes over from the tested one.
    #[arg(long, default_value = "computed-torque")]
    standby: String,
    /// Kinds of faults to inject. Default: all kinds, one after another.
    #[arg(long, value_enum)]
    kind: Vec<Kind>,
    /// Number of faults of each kind.
    #[arg(long, default_value_t = 5, value_parser = clap::value_parser!(u32).range(1..=1_000_000))]
    seeds: u32,
    /// Instead of injecting faults, kill this many runs at random moments with SIGKILL: the plant, the controller or the run
    /// itself.
    #[arg(long, value_name = "COUNT", conflicts_with_all = ["kind", "seeds"], value_parser = clap::value_parser!(u32).range(1..=1_000_000))]
    kills: Option<u32>,
    /// Schedule of the ticks.
    #[arg(long)]
    pace: Option<Pacing>,
    /// Change a key of the scenario, as in --set path.kind=square_sharp.
    #[arg(long, value_name = "KEY=VALUE")]
    set: Vec<String>,
    /// Seed of the fault ticks, of the random parts of faults, and of all noise.
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Write the results to this folder. Default: a folder in out/ named after the time.
    #[arg(long)]
    out: Option<PathBuf>,
    /// Replace results of an earlier command in the folder.
    #[arg(long)]
    force: bool,
    /// Output format.
    #[arg(long, default_value = "text")]
    format: Format,
}

/// Examines the controller of `args`.
///
/// # Errors
/// Bad input; a run that fails for another reason than the fault.
pub fn faults(args: &FaultsArgs) -> Result<Exit, Failure> {
    let mut scenario = load(args.scenario.as_deref(), &args.set)?;
    scenario.pace = args.pace.unwrap_or(scenario.pace);
    scenario.recording = RecordingKind::Mcap;
    let examined = ControllerSelection::of(&args.controller)?;
    ControllerSelection::of(&args.standby)?;
    let folder = claim(args.out.as_deref(), &["faults.json", "kills.json"], args.force)?;
    let out = folder.path().to_path_buf();
    let stop = Arc::new(AtomicBool::new(false));
    freeplay_terminal::process::stop_on_signals(&stop)?;
    if let Some(count) = args.kills {
        return kills::kill_runs(&args.controller, count, args.seed, &out, &stop);
    }
    let kinds = if args.kind.is_empty() { Kind::ALL.to_vec() } else { args.kind.clone() };
    let bar =
        progress::bar(u64::from(args.seeds) * kinds.len() as u64, "{msg} {wide_bar} {pos}/{len} {elapsed}")
            .with_message("faults");
    let mut exam =
        Exam::new(scenario, examined, args.standby.clone(), args.seed, out.clone(), Arc::clone(&stop))?;
    let verdicts = exam.examine(&kinds, args.seeds, &bar);
    bar.finish_and_clear();
    let (verdicts, interrupted) = (verdicts?, stop.load(Ordering::Relaxed));
    if verdicts.is_empty() {
        return Ok(Exit::Interrupted);
    }
    let surroundings = match args.kind.is_empty() && !interrupted {
        true => environment_faults::examine(exam.scenario(), exam.examined(), &out)?,
        false => Vec::new(),
    };
    let report = exam_report::Report {
        examined: &args.controller,
        standby: &args.standby,
        scenario: exam.scenario(),
        verdicts: &verdicts,
        surroundings: &surroundings,
    };
    report.write(&out)?;
    match args.format {
        Format::Json => say(&format!("{}\n", report.json()?))?,
        Format::Text => show(&report.in_words(&out))?,
    }
    Ok(match (interrupted, report.holds()) {
        (true, _) => Exit::Interrupted,
        (false, true) => Exit::Done,
        (false, false) => Exit::Verdict,
    })
}
