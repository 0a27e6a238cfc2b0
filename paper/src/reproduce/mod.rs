//! `freeplay reproduce`: the paper (S. Erkaya, 2018) reproduced, judged and drawn.
//!
//! Modules in the order in which numbers pass through them: `case` (the simulated scenarios), `trace` and `peaks` (the results of a run), `orbit` (the journal
//! in its bearing), `dataset`, `network` and `free_run` (learning), `compensation`, `improvement`; `reference` (results of others), `claim`, `motion_claims`
//! and `network_claims` (verdicts); `parameters`, `figures`, `tables`, `document` and `terminal_summary` (display).

mod case;
mod claim;
mod compensation;
mod dataset;
mod document;
mod figures;
mod free_run;
mod improvement;
mod motion_claims;
mod network;
mod network_claims;
mod orbit;
mod parameters;
mod peaks;
mod reference;
mod tables;
mod terminal_summary;
mod trace;

use std::path::PathBuf;

use clap::{Args, ValueEnum};
use freeplay_harness::scenario::Drive;
use freeplay_path::PathKind;
use freeplay_terminal::arguments::Format;
use freeplay_terminal::exit::{Exit, Failure};
use freeplay_terminal::output::{say, show};
use freeplay_terminal::parallel::on_all_cores;
use freeplay_terminal::{messages, progress};
use serde::Serialize;
use serde_json::json;

use case::{CLEARANCES, Case, PERIODS, Scope};
use claim::Claim;
use compensation::Played;
use dataset::{Dataset, TrainingRuns};
use freeplay_terminal::files::claim;
use improvement::Improved;
use motion_claims::Evidence;
use network::{Cut, Experiment, Study, study};
use orbit::JournalOrbit;
use reference::Independent;
use trace::Runs;

/// The schema of `reproduce.json`.
const SCHEMA: &str = "freeplay.reproduce/1";

/// Part of the reproduction that can be skipped.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Part {
    /// The training of the networks, and the claims about them.
    Network,
    /// The runs of the built-in controllers, and the claim that a network can improve the motion.
    Compensation,
}

/// Reproduces the paper.
#[derive(Args, Debug)]
pub struct ReproduceArgs {
    /// Write report.html and reproduce.json to this folder. Default: out/reproduce.
    #[arg(long)]
    out: Option<PathBuf>,
    /// Replace results of an earlier command in the folder.
    #[arg(long)]
    force: bool,
    /// Reproduce only a part: the smooth path with prescribed motion, one short training for each network, and one run of the
    /// controllers.
    #[arg(long)]
    quick: bool,
    /// Skip this part. Both parts may be skipped.
    #[arg(long, value_name = "PART")]
    skip: Vec<Part>,
    /// Output format.
    #[arg(long, default_value = "text")]
    format: Format,
}

/// Amount of training.
struct Effort {
    /// Trainings of each network.
    seeds: u64,
    /// Largest number of epochs of a training.
    epochs: usize,
}

/// All results.
pub struct Reproduction {
    command: String,
    scope: Scope,
    runs: Runs,
    orbits: Vec<(&'static str, &'static str, JournalOrbit)>,
    studies: Vec<Study>,
    played: Vec<Played>,
    improved: Vec<Improved>,
    claims: Vec<Claim>,
    independent: Independent,
}

/// Reproduces the paper and writes report and numbers.
///
/// # Errors
/// A run that can't be simulated, a training that can't be made, a folder that can't be written.
pub fn reproduce(args: &ReproduceArgs) -> Result<Exit, Failure> {
    let out = args.out.clone().unwrap_or_else(|| PathBuf::from("out").join("reproduce"));
    let folder = claim(Some(&out), &["report.html", "reproduce.json"], args.force)?;
    let folder = folder.path();
    let done = find(args)?;
    let numbers = serde_json::to_string_pretty(&numbers(&done)).map_err(Failure::internal)?;
    freeplay_terminal::files::write(&folder.join("report.html"), &document::document(&done)?.to_html())?;
    freeplay_terminal::files::write(&folder.join("reproduce.json"), &numbers)?;
    match args.format {
        Format::Json => say(&format!("{numbers}\n"))?,
        Format::Text => show(&terminal_summary::summary(&done.claims, folder))?,
    }
    Ok(Exit::Done)
}

fn find(args: &ReproduceArgs) -> Result<Reproduction, Failure> {
    let (scope, effort) = if args.quick {
        (Scope::quick(), Effort { seeds: 1, epochs: 100 })
    } else {
        (Scope::whole(), Effort { seeds: 3, epochs: 1000 })
    };
    let independent = Independent::read()?;
    let cases = scope.cases();
    let runs = Runs(over("simulating", cases.len(), |index| trace::simulate(&cases[index]))?);
    let orbits = orbits(&scope)?;
    let studies = if args.skip.contains(&Part::Network) {
        Vec::new()
    } else {
        let experiments = experiments(&scope, args.quick);
        let studies =
            over("training", experiments.len(), |index| train(&experiments[index], &runs, &effort))?;
        studies.into_iter().flatten().collect()
    };
    let (mut played, mut improved) = (Vec::new(), Vec::new());
    if !args.skip.contains(&Part::Compensation) {
        let tasks = compensation::tasks(args.quick);
        played = over("compensating", tasks.len(), |index| compensation::play(&tasks[index]))?;
        let mut clearances: Vec<f64> = tasks.iter().map(|task| task.clearance).collect();
        clearances.sort_by(f64::total_cmp);
        clearances.dedup();
        let found =
            over("improving", clearances.len(), |index| improvement::improved(clearances[index], &tasks))?;
        improved = found.into_iter().flatten().collect();
    }
    let mut claims = Evidence { runs: &runs, independent: &independent, scope: &scope }.claims();
    if !studies.is_empty() {
        claims.extend(network_claims::claims(&studies));
    }
    if !improved.is_empty() {
        claims.push(improvement::claim(&improved));
    }
    Ok(Reproduction {
        command: command(args),
        scope,
        runs,
        orbits,
        studies,
        played,
        improved,
        claims,
        independent,
    })
}

/// The command line, as far as it affects the numbers.
fn command(args: &ReproduceArgs) -> String {
    let mut command = "freeplay reproduce".to_owned();
    if args.quick {
        command += " --quick";
    }
    for part in args.skip.iter().filter_map(ValueEnum::to_possible_value) {
        command += &format!(" --skip {}", part.get_name());
    }
    command
}

/// The path of the journal during the first drop and, on a path with corners, around a corner.
fn orbits(scope: &Scope) -> Result<Vec<(&'static str, &'static str, JournalOrbit)>, Failure> {
    let largest = |path| Case::new(Drive::Driven, path, PERIODS[0], CLEARANCES[2]);
    let mut views = vec![(
        "The first drop: the journal falls from the middle of its bearing and bounces",
        "c = 0.6 mm, smooth path, prescribed motion, T = 6 s, the first 0.3 s; seen along the axis of joint 5. After the bounces the journal stays in contact.",
        largest(PathKind::Lissajous),
        0.0,
    )];
    if scope.paths.contains(&PathKind::SquareSharp) {
        views.push((
            "A sharp corner: the journal leaves its bearing and crosses it",
            "c = 0.6 mm, sharp square, prescribed motion, T = 6 s, 0.3 s around the second corner at 3 s.",
            largest(PathKind::SquareSharp),
            2.95,
        ));
    }
    let found = over("following the journal", views.len(), |index| {
        let (_, _, case, start) = &views[index];
        JournalOrbit::follow(case, *start, 0.3)
    })?;
    Ok(views.iter().zip(found).map(|((title, caption, _, _), orbit)| (*title, *caption, orbit)).collect())
}

/// The training experiments: single runs and all clearances, both splits; three laps in blocks.
fn experiments(scope: &Scope, quick: bool) -> Vec<Experiment> {
    let mut experiments = Vec::new();
    let pools: &[TrainingRuns] = if quick {
        &[TrainingRuns::Single]
    } else {
        &[TrainingRuns::Clearances, TrainingRuns::Single, TrainingRuns::Laps]
    };
    for &pool in pools {
        for (drive, path) in scope.pairs() {
            for period in PERIODS {
                let cuts: &[Cut] =
                    if pool == TrainingRuns::Laps { &[Cut::Block] } else { &[Cut::Random, Cut::Block] };
                experiments.extend(cuts.iter().map(|&cut| Experiment { drive, path, period, pool, cut }));
            }
        }
    }
    experiments
}

/// The study of `setting`; `None` if its runs were not made.
fn train(setting: &Experiment, runs: &Runs, effort: &Effort) -> Result<Option<Study>, Failure> {
    let data = Dataset::new(runs, setting.pool, (setting.drive, setting.path), setting.period)?;
    data.map(|data| study(*setting, &data, effort.seeds, effort.epochs)).transpose()
}

/// `reproduce.json`.
fn numbers(done: &Reproduction) -> serde_json::Value {
    #[derive(Serialize)]
    struct Run<'a> {
        case: &'a Case,
        figures: &'a trace::Figures,
    }
    let runs: Vec<Run> =
        done.runs.0.iter().map(|run| Run { case: &run.case, figures: &run.figures }).collect();
    json!({
        "schema": SCHEMA, "version": env!("CARGO_PKG_VERSION"), "command": done.command,
        "claims": done.claims, "runs": runs, "networks": done.studies, "compensation": done.played, "improvement": done.improved,
    })
}

/// Calls `work` for every number below `count` on all cores, with a bar for the `stage`.
fn over<T: Send>(
    stage: &'static str,
    count: usize,
    work: impl Fn(usize) -> Result<T, Failure> + Sync,
) -> Result<Vec<T>, Failure> {
    messages::detail(stage);
    let bar = progress::bar(count as u64, "{msg:<22} {wide_bar} {pos}/{len} {elapsed}").with_message(stage);
    bar.tick();
    let done = on_all_cores(count, |index| {
        let result = work(index);
        bar.inc(1);
        result
    });
    bar.finish();
    done
}
