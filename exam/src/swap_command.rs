//! `freeplay swap`: swaps controllers at random ticks and measures the cost of each swap.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use clap::Args;
use comfy_table::CellAlignment;
use freeplay_controller::BUILT_IN;
use freeplay_doctor::Examination;
use freeplay_harness::controller_selection::ControllerSelection;
use freeplay_harness::run::load;
use freeplay_harness::scenario::{Pacing, RecordingKind, Scenario};
use freeplay_harness::setup::Setup;
use freeplay_harness::summary::RunSummary;
use freeplay_harness::swaps;
use freeplay_terminal::arguments::Format;
use freeplay_terminal::exit::{Exit, Failure};
use freeplay_terminal::files::{claim, write};
use freeplay_terminal::layout::text_table;
use freeplay_terminal::output::{say, show};
use freeplay_terminal::{progress, styles};
use indicatif::ProgressBar;
use serde::Serialize;
use serde_json::{Value, json};

use crate::recorded::{check_solo_run, play_recorded};
use crate::swap_measures::{Measured, SETTLING_TICKS, SoloRun, measure, steady_change};

/// The schema of `swap.json`.
const SCHEMA: &str = "freeplay.swap/1";
/// Largest permitted ratio of the deviation with a swap to that without.
const MOST_DEVIATION: f64 = 1.05;
/// Smaller deviations, below a tenth of a micrometre, are not judged, mm: twice a few nanometres does no harm.
const LEAST_DEVIATION_MM: f64 = 1e-4;
/// Least time to wait in lockstep for an answer, s: swaps are measured in ticks, which do not depend on the load of the machine.
const LEAST_PATIENCE_S: f64 = 120.0;
/// Largest permitted ratio of a jump to the greatest steady change.
const MOST_JUMP: f64 = 1.0;

/// Swaps controllers at random ticks, and measures each swap.
#[derive(Args, Debug)]
pub struct SwapArgs {
    /// Scenario file, as for `freeplay run`.
    scenario: Option<PathBuf>,
    /// Controllers to swap: built-in names, or paths of executables or FMUs. Default: all built-in controllers.
    #[arg(long)]
    controller: Vec<String>,
    /// Total number of swaps.
    #[arg(long, default_value_t = 200)]
    swaps: u32,
    /// Number of swaps in one run.
    #[arg(long, default_value_t = 15)]
    per_run: u32,
    /// Schedule of the ticks: real time or lockstep.
    #[arg(long)]
    pace: Option<Pacing>,
    /// Change a key of the scenario, as in --set path.period=12.
    #[arg(long, value_name = "KEY=VALUE")]
    set: Vec<String>,
    /// Seed of the swap ticks and of all noise. Each run uses the next seed.
    #[arg(long)]
    seed: Option<u64>,
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

/// Checks before the first run that a run of `scenario` is long enough for `count` swaps.
fn check_room(scenario: &Scenario, count: u32) -> Result<(), Failure> {
    let mut scenario = scenario.clone();
    scenario.standby = scenario.controllers.split_off(1);
    scenario.random_swaps = count;
    let plant = Setup::new(&scenario)?.plant;
    let names = swaps::names(&scenario.controllers[0], &scenario.standby);
    swaps::controller_set(&scenario, &names, plant.ticks, plant.period_ns as f64 * 1e-9).map(|_| ())
}

/// Runs each controller alone, then runs all of them with swaps until there are enough, and judges.
///
/// # Errors
/// Bad input; a run that fails.
pub fn swap(args: &SwapArgs) -> Result<Exit, Failure> {
    let mut sets = args.set.clone();
    sets.extend(args.seed.iter().map(|seed| format!("seed={seed}")));
    let mut scenario = load(args.scenario.as_deref(), &sets)?;
    scenario.pace = args.pace.unwrap_or(scenario.pace);
    scenario.recording = RecordingKind::Mcap;
    if scenario.pace == Pacing::Lockstep {
        scenario.patience = scenario.patience.max(LEAST_PATIENCE_S);
    }
    scenario.controllers = match args.controller.as_slice() {
        [] => BUILT_IN.iter().map(|name| (*name).to_owned()).collect(),
        given => given.to_vec(),
    };
    for (option, count) in [("--swaps", args.swaps), ("--per-run", args.per_run)] {
        if count == 0 {
            return Err(Failure::usage(format!(
                "{option} 0: a swap exam needs at least one swap; give 1 or more"
            )));
        }
    }
    if let [one] = scenario.controllers.as_slice() {
        return Err(Failure::usage(format!(
            "--controller {one}: a swap exam needs at least two controllers; name another one, or none for all built-in ones"
        )));
    }
    for asked in scenario.controllers.iter().chain(&scenario.standby) {
        ControllerSelection::of(asked)?;
    }
    check_room(&scenario, args.swaps.min(args.per_run))?;
    let folder = claim(args.out.as_deref(), &["swap.json"], args.force)?;
    let out = folder.path().to_path_buf();
    let stop = Arc::new(AtomicBool::new(false));
    freeplay_terminal::process::stop_on_signals(&stop)?;
    let stage = Stage { scenario, out, stop, seed: args.seed.unwrap_or(1) };
    let bar =
        progress::bar(args.swaps.into(), "{msg} {wide_bar} {pos}/{len} {elapsed}").with_message("swaps");
    let ended = stage.play_all(args.swaps, args.per_run, &bar);
    bar.finish_and_clear();
    let played = ended?;
    if played.swaps.is_empty() {
        return Ok(Exit::Interrupted);
    }
    let verdicts = Verdicts::of(&played, args.swaps);
    let text = json!({
        "schema": SCHEMA, "freeplay": env!("CARGO_PKG_VERSION"), "scenario": stage.scenario,
        "machine": Examination::quick().machine(), "runs": played.runs, "verdicts": verdicts, "swaps": played.swaps,
    });
    let text = serde_json::to_string_pretty(&text).map_err(Failure::internal)?;
    write(&stage.out.join("swap.json"), &text)?;
    match args.format {
        Format::Json => say(&format!("{text}\n"))?,
        Format::Text => show(&in_words(&played, &verdicts, &stage.out))?,
    }
    Ok(match (played.planned() < args.swaps as usize, verdicts.all_hold()) {
        (true, _) => Exit::Interrupted,
        (false, true) => Exit::Done,
        (false, false) => Exit::Verdict,
    })
}

/// The settings of all runs.
struct Stage {
    scenario: Scenario,
    out: PathBuf,
    stop: Arc<AtomicBool>,
    seed: u64,
}

/// Results of all runs.
struct Played {
    runs: usize,
    /// Ticks over which a swap is observed.
    window: usize,
    /// Greatest share of ticks with a held command of any controller alone.
    held_alone: f64,
    swaps: Vec<Measured>,
}

impl Played {
    /// Number of planned swaps.
    fn planned(&self) -> usize {
        self.swaps.iter().filter(|swap| swap.is_planned()).count()
    }
}

impl Stage {
    /// Runs until `count` swaps took place; fewer if interrupted.
    fn play_all(&self, count: u32, per_run: u32, bar: &ProgressBar) -> Result<Played, Failure> {
        let window = (self.scenario.swap_blend * self.scenario.rate).round() as usize + SETTLING_TICKS;
        let mut played = Played { runs: 0, window, held_alone: 0.0, swaps: Vec::new() };
        let mut alone = Vec::new();
        let asked = &self.scenario.controllers;
        let (first, standby) = asked.split_first().ok_or_else(|| Failure::usage("no controller"))?;
        for (asked, name) in asked.iter().zip(swaps::names(first, standby)) {
            bar.set_message(format!("{name} alone"));
            let folder = self.out.join("alone").join(&name);
            let Some((summary, recording)) =
                play_recorded(&self.scenario, &ControllerSelection::of(asked)?, &folder, &self.stop)?
            else {
                return Ok(played);
            };
            check_solo_run(&summary, &name, self.scenario.mode)?;
            alone.push(SoloRun::new(&summary, &name, &recording)?);
        }
        played.held_alone = alone.iter().map(SoloRun::held_share).fold(0.0, f64::max);
        while (played.planned() as u32) < count {
            let left = count - played.planned() as u32;
            let Some(swaps) = self.play_swaps(played.runs, left.min(per_run), &alone, window)? else {
                return Ok(played);
            };
            if !swaps.iter().any(Measured::is_planned) {
                return Err(Failure::internal("no swap took place"));
            }
            played.runs += 1;
            played.swaps.extend(swaps);
            bar.set_position(played.planned() as u64);
        }
        Ok(played)
    }

    /// One run with `count` swaps; each run begins with the next controller.
    fn play_swaps(
        &self,
        run: usize,
        count: u32,
        alone: &[SoloRun],
        window: usize,
    ) -> Result<Option<Vec<Measured>>, Failure> {
        let mut scenario = self.scenario.clone();
        let first = run % scenario.controllers.len();
        scenario.controllers.rotate_left(first);
        scenario.standby = scenario.controllers.split_off(1);
        (scenario.random_swaps, scenario.seed) = (count, self.seed + run as u64);
        scenario.swap_change.get_or_insert_with(|| steady_change(alone));
        // The names of the controllers in their runs alone.
        let mut names: Vec<String> = alone.iter().map(|alone| alone.name.clone()).collect();
        names.rotate_left(first);
        let folder = self.out.join("swapped");
        let asked = ControllerSelection::of(&scenario.controllers[0])?;
        let Some((mut summary, recording)) = play_recorded(&scenario, &asked, &folder, &self.stop)? else {
            return Ok(None);
        };
        rename(&mut summary, &swaps::names(asked.asked(), &scenario.standby), &names);
        measure(&summary, &recording, alone, &names, scenario.seed, window).map(Some)
    }
}

/// Renames the controllers in the swaps of a run to their names alone: with another order, `mine#2` may be called `mine`.
fn rename(summary: &mut RunSummary, from: &[String], to: &[String]) {
    for swap in summary.line_up["swaps"].as_array_mut().into_iter().flatten() {
        for key in ["from", "to"] {
            let slot = from.iter().position(|name| swap[key] == name.as_str());
            if let Some(slot) = slot {
                swap[key] = Value::from(to[slot].as_str());
            }
        }
    }
}

/// The ratio of the deviation to that without swap if the deviation is large enough to be judged; else 0.
fn judged_ratio(swap: &Measured) -> f64 {
    if swap.deviation_peak_mm > LEAST_DEVIATION_MM { swap.deviation_ratio } else { 0.0 }
}

/// Requirements on all swaps together, with the results.
#[derive(Debug, Serialize)]
struct Verdicts {
    swaps: usize,
    asked: u32,
    with_contact_event: usize,
    /// Unplanned changes: an answer was missing or rejected.
    fail_overs: usize,
    /// Greatest gap of these changes.
    greatest_gap_of_fail_overs: u64,
    /// Swaps whose gap contains no stall of the machine; `greatest_gap_ticks` is of these.
    met: usize,
    greatest_gap_ticks: u64,
    /// Swaps without a stall of the machine until the arm had settled; the following figures are of these.
    undisturbed: usize,
    missed_ticks: u64,
    held_ticks: u64,
    /// Ticks over which these counts were taken.
    watched_ticks: u64,
    /// Greatest share of held ticks of any controller alone, without a swap.
    held_share_alone: f64,
    greatest_jump: f64,
    greatest_blend_change: f64,
    greatest_deviation_ratio: f64,
    above_deviation_limit: usize,
    limits: Value,
}

impl Verdicts {
    fn of(played: &Played, asked: u32) -> Self {
        let (planned, fail_overs): (Vec<&Measured>, Vec<&Measured>) =
            played.swaps.iter().partition(|swap| swap.is_planned());
        let gap = |swaps: &[&Measured]| swaps.iter().map(|swap| swap.gap_ticks).max().unwrap_or(0);
        let met: Vec<&Measured> = planned.iter().copied().filter(|swap| swap.stalls_in_gap == 0).collect();
        let swaps: Vec<&Measured> = planned.iter().copied().filter(|swap| swap.stalls == 0).collect();
        let most = |of: &dyn Fn(&Measured) -> f64| swaps.iter().map(|swap| of(swap)).fold(0.0, f64::max);
        Self {
            swaps: planned.len(),
            asked,
            with_contact_event: planned.iter().filter(|swap| swap.contact_event).count(),
            fail_overs: fail_overs.len(),
            greatest_gap_of_fail_overs: gap(&fail_overs),
            met: met.len(),
            greatest_gap_ticks: gap(&met),
            undisturbed: swaps.len(),
            missed_ticks: swaps.iter().map(|swap| swap.missed_ticks).sum(),
            held_ticks: swaps.iter().map(|swap| swap.held_ticks).sum(),
            watched_ticks: (swaps.len() * played.window) as u64,
            held_share_alone: played.held_alone,
            greatest_jump: most(&|swap| swap.jump),
            greatest_blend_change: most(&|swap| swap.blend_change),
            greatest_deviation_ratio: most(&judged_ratio),
            above_deviation_limit: swaps.iter().filter(|swap| judged_ratio(swap) > MOST_DEVIATION).count(),
            limits: json!({
                "gap_ticks": 0, "held_share": "that without swap", "jump": MOST_JUMP, "deviation_ratio": MOST_DEVIATION,
                "least_deviation_mm": LEAST_DEVIATION_MM,
            }),
        }
    }

    /// Each verdict in words; without a swap all verdicts fail.
    fn lines(&self) -> [(bool, String); 4] {
        let is_undisturbed = self.undisturbed > 0;
        let held_share = self.held_ticks as f64 / self.watched_ticks.max(1) as f64;
        [
            (
                self.met > 0 && self.greatest_gap_ticks == 0,
                format!("gap: at most {} ticks in {} swaps", self.greatest_gap_ticks, self.met),
            ),
            (
                is_undisturbed && held_share <= self.held_share_alone,
                format!(
                    "held commands: {} in {} ticks after {} swaps ({:.3} %; without swap {:.3} %); missed ticks: {}",
                    self.held_ticks,
                    self.watched_ticks,
                    self.undisturbed,
                    100.0 * held_share,
                    100.0 * self.held_share_alone,
                    self.missed_ticks
                ),
            ),
            (
                is_undisturbed && self.greatest_jump <= MOST_JUMP,
                format!(
                    "jump: {:.3} times the greatest steady change, limit {MOST_JUMP}",
                    self.greatest_jump
                ),
            ),
            (
                is_undisturbed && self.above_deviation_limit == 0,
                format!(
                    "deviation: at most {:.3} times that without swap, limit {MOST_DEVIATION}; above it: {}; peaks below {} µm are not judged",
                    self.greatest_deviation_ratio,
                    self.above_deviation_limit,
                    LEAST_DEVIATION_MM * 1e3
                ),
            ),
        ]
    }

    fn all_hold(&self) -> bool {
        self.lines().iter().all(|(holds, _)| *holds)
    }
}

fn in_words(played: &Played, verdicts: &Verdicts, out: &Path) -> String {
    let mut pairs: BTreeMap<(&str, &str), Vec<&Measured>> = BTreeMap::new();
    for swap in played.swaps.iter().filter(|swap| swap.is_planned() && swap.stalls == 0) {
        pairs.entry((&swap.from, &swap.to)).or_default().push(swap);
    }
    let mut table = text_table();
    table.set_header([
        "from",
        "to",
        "swaps",
        "gap\n[ticks]",
        "held\n[ticks]",
        "jump\nof steady",
        "blend\nof steady",
        "deviation\npeak [mm]",
        "of that\nwithout swap",
    ]);
    for ((from, to), swaps) in &pairs {
        let most = |of: &dyn Fn(&Measured) -> f64| swaps.iter().map(|swap| of(swap)).fold(0.0, f64::max);
        table.add_row([
            (*from).to_owned(),
            (*to).to_owned(),
            swaps.len().to_string(),
            swaps.iter().map(|swap| swap.gap_ticks).max().unwrap_or(0).to_string(),
            swaps.iter().map(|swap| swap.held_ticks).sum::<u64>().to_string(),
            format!("{:.3}", most(&|swap| swap.jump)),
            format!("{:.3}", most(&|swap| swap.blend_change)),
            format!("{:.4}", most(&|swap| swap.deviation_peak_mm)),
            format!("{:.3}", most(&|swap| swap.deviation_ratio)),
        ]);
    }
    for column in 2..9 {
        if let Some(column) = table.column_mut(column) {
            column.set_cell_alignment(CellAlignment::Right);
        }
    }
    let mut text = format!(
        "{} swaps in {} runs, {} of them with a contact event before they settled; greatest values of each pair\n\n{table}\n\n",
        verdicts.swaps, played.runs, verdicts.with_contact_event
    );
    for (holds, words) in verdicts.lines() {
        text += &format!("{} {words}\n", styles::judgement(holds));
    }
    if verdicts.undisturbed < verdicts.swaps {
        text += &format!(
            "{} of {} swaps fell on a stall of the machine, and {} more had one before they settled; the figures above leave them out\n",
            verdicts.swaps - verdicts.met,
            verdicts.swaps,
            verdicts.met - verdicts.undisturbed
        );
    }
    if verdicts.fail_overs > 0 {
        text += &format!(
            "{} unplanned hand-overs after a missing or rejected answer: at most {} ticks until a controller was active\n",
            verdicts.fail_overs, verdicts.greatest_gap_of_fail_overs
        );
    }
    text + &format!("\nall swaps   {}\n", out.join("swap.json").display())
}
