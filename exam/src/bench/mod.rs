//! `freeplay bench`: measures every stage of the loop, alternating with a bare clock loop and bare iceoryx2; attributes missed deadlines to causes; and finds
//! the additional compute time at which a controller exceeds the budget of a tick.

mod bench_page;
mod bench_report;
mod bench_words;
mod blocks;
mod cost;
mod figures;
mod verdicts;
mod yardstick;

use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use clap::Args;
use freeplay_controller::BUILT_IN;
use freeplay_doctor::Examination;
use freeplay_harness::controller_selection::ControllerSelection;
use freeplay_harness::run::load;
use freeplay_harness::scenario::{Pacing, RecordingKind, Scenario};
use freeplay_harness::summary::RunSummary;
use freeplay_terminal::arguments::Format;
use freeplay_terminal::exit::{Exit, Failure};
use freeplay_terminal::output::{say, show};
use freeplay_terminal::progress;
use indicatif::ProgressBar;
use rustix::thread::{CpuSet, sched_getaffinity};

use crate::bench::bench_report::Report;
use crate::bench::blocks::{Block, Stand};
use crate::bench::verdicts::{Step, Verdicts, YardstickComparison};
use freeplay_terminal::files::claim;

pub use yardstick::{YardstickArgs, yardstick};

/// Missed ticks that the plant bridges: a bench measures a stall of the machine and continues.
const HOLD: u32 = 1000;

/// Measures the time of every stage of the loop.
#[derive(Args, Debug)]
pub struct BenchArgs {
    /// Scenario file, as for `freeplay run`.
    scenario: Option<PathBuf>,
    /// Controller: a built-in name, or the path of an executable or an FMU. Default: all built-in controllers.
    #[arg(long)]
    controller: Vec<String>,
    /// Number of ticks for each controller, for the bare clock loop and for bare iceoryx2.
    #[arg(long, default_value_t = 10_000)]
    ticks: u64,
    /// Number of blocks in which the full loop and the reference measurements alternate. With short blocks, both measure the same
    /// state of the machine.
    #[arg(long, default_value_t = 20)]
    pairs: usize,
    /// Also find the compute time at which the loop misses deadlines. Run a block of each controller with each of these added
    /// compute times in µs, as in --load 100,300,600.
    #[arg(long, value_name = "US", value_delimiter = ',')]
    load: Vec<f64>,
    /// Measure instead the cost of recording and of the live view: blocks with and without them alternate, under the first
    /// controller.
    #[arg(long, conflicts_with = "load")]
    cost: bool,
    /// Cores of the plant and of the controller. Default: the last two cores that this process may use.
    #[arg(long, value_name = "P,C", value_parser = two_cores)]
    cpus: Option<[usize; 2]>,
    /// Change a key of the scenario, as in --set path.period=12.
    #[arg(long, value_name = "KEY=VALUE")]
    set: Vec<String>,
    /// Seed of all noise.
    #[arg(long)]
    seed: Option<u64>,
    /// Exit with code 4 unless the machine is fit for measuring tail latencies (see `freeplay doctor`).
    #[arg(long)]
    require_rt: bool,
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

/// The blocks and their results.
struct Played {
    blocks: Vec<Block>,
    cliff: Vec<Step>,
}

/// Measures the loop with the settings of `args`.
///
/// # Errors
/// Bad input; an unfit machine, with `--require-rt`; a process that fails.
pub fn bench(args: &BenchArgs) -> Result<Exit, Failure> {
    let examination = Examination::quick();
    if args.require_rt {
        examination.require_rt()?;
    }
    let scenario = scenario(args)?;
    let contestants: Vec<ControllerSelection> =
        scenario.controllers.iter().map(|asked| ControllerSelection::of(asked)).collect::<Result<_, _>>()?;
    let folder = claim(args.out.as_deref(), &["bench.json", "cost.json"], args.force)?;
    let out = folder.path().to_path_buf();
    let stop = Arc::new(AtomicBool::new(false));
    freeplay_terminal::process::stop_on_signals(&stop)?;
    let stand = Stand { scenario: &scenario, contestants: &contestants, out: &out, stop: &stop };
    if args.cost {
        return cost::cost(&stand, args.pairs, args.format);
    }
    let steps = args.load.len() * contestants.len();
    let bar = progress::bar((args.pairs + steps) as u64, "{msg} {wide_bar} {pos}/{len} {elapsed}")
        .with_message("blocks");
    let played = play(args, &stand, &bar);
    bar.finish_and_clear();
    let Some(Played { blocks, cliff }) = played? else { return Ok(Exit::Interrupted) };
    let contests: Vec<YardstickComparison> = contestants
        .iter()
        .enumerate()
        .map(|(which, contestant)| YardstickComparison::of(&blocks, which, contestant.asked()))
        .collect();
    let report = Report {
        scenario: &scenario,
        machine: examination.machine(),
        verdicts: Verdicts::of(&contests),
        contests: &contests,
        blocks: &blocks,
        cliff: &cliff,
    };
    let text = report.write(&out)?;
    match args.format {
        Format::Json => say(&format!("{text}\n"))?,
        Format::Text => show(&report.in_words(&out))?,
    }
    let holds = report.verdicts.hold().iter().all(|&holds| holds);
    Ok(if holds { Exit::Done } else { Exit::Verdict })
}

/// The scenario of a block.
fn scenario(args: &BenchArgs) -> Result<Scenario, Failure> {
    let sets: Vec<String> =
        args.set.iter().cloned().chain(args.seed.map(|seed| format!("seed={seed}"))).collect();
    let mut scenario = load(args.scenario.as_deref(), &sets)?;
    if args.pairs == 0 || args.ticks / (args.pairs as u64) < 100 {
        return Err(Failure::usage(
            "bench needs a block or more (--pairs) of a hundred ticks or more (--ticks)",
        ));
    }
    let faulty = args.load.iter().any(|&us| !us.is_finite() || !(0.0..=1e6).contains(&us));
    if faulty {
        return Err(Failure::usage("--load: give microseconds from 0 to 1000000"));
    }
    scenario.pace = Pacing::Realtime;
    scenario.recording = RecordingKind::None;
    scenario.hold = scenario.hold.max(HOLD);
    scenario.duration = Some((args.ticks / args.pairs as u64) as f64 / scenario.rate);
    scenario.controllers = match args.controller.as_slice() {
        [] => BUILT_IN.iter().map(|name| (*name).to_owned()).collect(),
        given => given.to_vec(),
    };
    let built_in = |asked: &String| BUILT_IN.contains(&asked.as_str());
    if !args.load.is_empty() && !scenario.controllers.iter().all(built_in) {
        return Err(Failure::usage("--load loads built-in controllers alone: add the load in your own"));
    }
    let [plant, controller] = match args.cpus {
        Some([plant, controller]) => {
            let all: Vec<usize> = cores().into_iter().rev().collect();
            if let Some(cpu) = [plant, controller].into_iter().find(|cpu| !all.contains(cpu)) {
                return Err(Failure::usage(format!(
                    "--cpus: no core {cpu} for this process; choose among {all:?}"
                )));
            }
            [Some(plant), Some(controller)]
        }
        None => last_cores(),
    };
    scenario.realtime.plant_cpu = scenario.realtime.plant_cpu.or(plant);
    scenario.realtime.controller_cpu = scenario.realtime.controller_cpu.or(controller);
    Ok(scenario)
}

/// Two numbers of cores.
fn two_cores(text: &str) -> Result<[usize; 2], String> {
    let both = text
        .split_once(',')
        .and_then(|(plant, controller)| Some([plant.parse().ok()?, controller.parse().ok()?]));
    both.ok_or_else(|| "give two cores, as in 2,3".to_owned())
}

/// The cores that this process may use, the last first; empty if the system does not report them.
fn cores() -> Vec<usize> {
    let Ok(allowed) = sched_getaffinity(None) else { return Vec::new() };
    (0..CpuSet::MAX_CPU).rev().filter(|&cpu| allowed.is_set(cpu)).collect()
}

/// The last two cores that this process may use: the first ones handle interrupts. `None` if there is only one.
fn last_cores() -> [Option<usize>; 2] {
    match cores().as_slice() {
        &[plant, controller, ..] => [Some(plant), Some(controller)],
        _ => [None; 2],
    }
}

/// All blocks, then the cliff; `None` if interrupted.
fn play(args: &BenchArgs, stand: &Stand, bar: &ProgressBar) -> Result<Option<Played>, Failure> {
    let mut blocks = Vec::with_capacity(args.pairs);
    for number in 0..args.pairs {
        let Some(block) = stand.play(number)? else { return Ok(None) };
        blocks.push(block);
        bar.inc(1);
    }
    let mut cliff = Vec::new();
    for contestant in stand.contestants {
        for &load_us in &args.load {
            let mut scenario = stand.scenario.clone();
            scenario.realtime.load = load_us * 1e-6;
            let Some((run, _)) = stand.full(contestant, &scenario)? else { return Ok(None) };
            cliff.push(step(&run, contestant.asked(), load_us));
            bar.inc(1);
        }
    }
    Ok(Some(Played { blocks, cliff }))
}

fn step(run: &RunSummary, controller: &str, load_us: f64) -> Step {
    let finished = run.ending.as_str() == Some("finished");
    let missed = run.deadlines["missed"].as_u64().unwrap_or(0) as f64 / run.ticks.max(1) as f64;
    Step {
        controller: controller.to_owned(),
        load_us,
        missed_share: if finished { missed } else { 1.0 },
        round_trip_us: run.latency_us.get("round_trip").cloned().unwrap_or_default(),
    }
}
