//! The runs of an exam: first a run without faults for comparison, then runs with faults, as many in a run as it survives.

use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use freeplay_harness::controller_selection::ControllerSelection;
use freeplay_harness::scenario::{Drive, Pacing, Scenario};
use freeplay_harness::setup::Setup;
use freeplay_harness::summary::RunSummary;
use freeplay_harness::swap_tables::{CompareTable, SwapTable};
use freeplay_harness::swaps::names;
use freeplay_recording::Recording;
use freeplay_shm::RunFolder;
use freeplay_terminal::exit::Failure;
use freeplay_terminal::files::write;
use indicatif::ProgressBar;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use crate::faults::findings::{FaultOutcome, RunFindings, Verdict};
use crate::faults::kinds::{Injection, Kind, Plan};
use crate::recorded::{check_solo_run, play_recorded};
use crate::swap_measures::{SoloRun, stalls};

/// First tick of a fault; the arm has settled by then.
const FIRST: u64 = 600;
/// Ticks from one fault to the next; meanwhile the fault ends, the arm settles and the controller becomes active again.
const SPACING: u64 = 250;
/// Largest random delay of a fault, ticks.
const JITTER: u64 = 50;
/// Ticks from a fault until the run makes the controller active again.
const BACK: u64 = 170;
/// The run makes an inactive controller active this many ticks before a fault: in real time it may have been late before.
const BEFORE: u64 = 30;
/// Ticks over which a fault is observed.
const WINDOW: usize = (SPACING - BEFORE) as usize;
/// Faults in one run.
const PER_RUN: u32 = 20;
/// Lockstep waits this long for an answer that does not come, s.
const ANSWER_PATIENCE: f64 = 0.15;
/// Least time to wait for a process to join, s: a process that a busy machine starts late is not at fault.
const LEAST_PATIENCE_S: f64 = 60.0;
/// Largest number of times that a lockstep run is played if a sound controller was late: the delay came from a busy machine.
const ATTEMPTS: u32 = 3;
/// Real time injects up to this many faults for each requested one, until the requested number could be judged.
const MOST_FOR_ONE: u32 = 3;
/// Factor on the waiting time of lockstep in each repetition.
const MORE_PATIENCE: f64 = 4.0;
/// Permitted difference between two controllers beyond that in the sound run, as a share of the joint's range.
const TOLERANCE: f64 = 0.002;

/// The exam of one controller.
pub struct Exam {
    scenario: Scenario,
    examined: ControllerSelection,
    seed: u64,
    out: PathBuf,
    stop: Arc<AtomicBool>,
    names: Vec<String>,
    limits: Vec<[f64; 2]>,
    alone: Vec<SoloRun>,
}

impl Exam {
    /// The exam of `examined` in `scenario` with `standby`; its files are in `out`.
    ///
    /// # Errors
    /// A scenario that can't be run.
    pub fn new(
        mut scenario: Scenario,
        examined: ControllerSelection,
        standby: String,
        seed: u64,
        out: PathBuf,
        stop: Arc<AtomicBool>,
    ) -> Result<Self, Failure> {
        let names = names(examined.asked(), std::slice::from_ref(&standby));
        (scenario.controllers, scenario.standby) = (vec![examined.asked().to_owned()], vec![standby]);
        (scenario.swap, scenario.random_swaps, scenario.seed) = (Vec::new(), 0, seed);
        scenario.answer_patience.get_or_insert(ANSWER_PATIENCE);
        scenario.patience = scenario.patience.max(LEAST_PATIENCE_S);
        let setup = Setup::new(&scenario)?;
        let limit = |joint: &freeplay_arm::Joint| match scenario.mode {
            Drive::Torque => [-joint.limits.effort, joint.limits.effort],
            Drive::Driven | Drive::Servo => [joint.limits.lower, joint.limits.upper],
        };
        let limits = setup.arm().joints().iter().map(limit).collect();
        Ok(Self { scenario, examined, seed, out, stop, names, limits, alone: Vec::new() })
    }

    /// The controller under examination.
    pub fn examined(&self) -> &ControllerSelection {
        &self.examined
    }

    /// The scenario with the values measured for it.
    pub fn scenario(&self) -> &Scenario {
        &self.scenario
    }

    /// Injects `seeds` faults of each of `kinds`; in real time replaces faults that could not be judged. Returns the verdicts so far if interrupted.
    ///
    /// # Errors
    /// A run that fails for another reason than the fault.
    pub fn examine(
        &mut self,
        kinds: &[Kind],
        seeds: u32,
        bar: &ProgressBar,
    ) -> Result<Vec<Verdict>, Failure> {
        let mut verdicts = Vec::new();
        if !self.measure_sound_runs(seeds.min(PER_RUN))? {
            return Ok(verdicts);
        }
        for &kind in kinds {
            let per_run = if kind.ends_the_process() { 1 } else { PER_RUN };
            let mut verdict = Verdict::new(kind);
            let mut done = 0;
            // A fault during a stall of the machine, or with brakes closed by one, cannot be judged; another fault replaces it.
            let most = match self.scenario.pace {
                Pacing::Lockstep => seeds,
                Pacing::Realtime => seeds.saturating_mul(MOST_FOR_ONE),
            };
            while done < seeds || verdict.judged < seeds as usize && done < most {
                if done >= seeds {
                    bar.inc_length(u64::from(per_run.min(seeds)));
                }
                let wanted = if done < seeds { seeds - done } else { most - done };
                let count = per_run.min(seeds).min(wanted);
                let Some(found) = self.inject(kind, done, count)? else {
                    if done > 0 {
                        verdicts.push(verdict.with_pace(self.scenario.pace));
                    }
                    return Ok(verdicts);
                };
                verdict.add(found);
                done += count;
                bar.inc(u64::from(count));
            }
            verdicts.push(verdict.with_pace(self.scenario.pace));
        }
        Ok(verdicts)
    }

    /// Runs each controller without faults to measure the deviation and the difference between the two; `false` if interrupted.
    fn measure_sound_runs(&mut self, per_run: u32) -> Result<bool, Failure> {
        let mut sound = self.scenario.clone();
        last(&mut sound, per_run);
        let asked = [sound.controllers[0].clone(), sound.standby[0].clone()];
        for (slot, name) in self.names.clone().iter().enumerate() {
            sound.standby = vec![asked[1 - slot].clone()];
            let contestant = ControllerSelection::of(&asked[slot])?;
            let is_late =
                |summary: &RunSummary, _: &Recording| Ok(is_late(summary, 0) || is_late(summary, 1));
            let folder = format!("sound/{name}");
            let played = self.play_patiently(&sound, &contestant, &folder, is_late)?;
            let Some((summary, recording)) = played else { return Ok(false) };
            check_solo_run(&summary, name, self.scenario.mode)?;
            self.alone.push(SoloRun::new(&summary, name, &recording)?);
            if slot == 0 && self.scenario.compare.is_none() {
                let tolerance = self.limits.iter().map(|[lower, upper]| TOLERANCE * (upper - lower));
                let file = summary.recording.as_ref().map(|file| self.out.join(&folder).join(file));
                self.scenario.compare =
                    Some(CompareTable { tolerance: tolerance.collect(), sound: file, ticks: 2 });
            }
        }
        Ok(true)
    }

    /// One run with `count` faults of `kind`, the first of which has the number `from`; `None` if interrupted.
    fn inject(&self, kind: Kind, from: u32, count: u32) -> Result<Option<RunFindings>, Failure> {
        let mut scenario = self.scenario.clone();
        last(&mut scenario, count);
        scenario.seed = self.seed.wrapping_add(u64::from(from));
        let mut random = ChaCha8Rng::seed_from_u64(scenario.seed ^ (kind as u64) << 32);
        let mut injection = |number: u64| {
            let tick = FIRST + number * SPACING + random.random_range(0..JITTER);
            Injection { kind, tick, seed: random.random() }
        };
        let injections: Vec<Injection> = (0..u64::from(count)).map(&mut injection).collect();
        let to_examined = |tick: u64| SwapTable { tick, to: self.names[0].clone() };
        let before = injections.iter().map(|injection| to_examined(injection.tick - BEFORE));
        let after = injections.iter().map(|injection| to_examined(injection.tick + BACK));
        scenario.swap = match kind.ends_the_process() {
            true => before.collect(),
            false => before.chain(after).collect(),
        };
        let plan = Plan { injections: injections.clone(), limits: self.limits.clone() };
        let file = self.out.join("plan.json");
        write(&file, &serde_json::to_string(&plan).map_err(Failure::internal)?)?;
        let file = std::path::absolute(&file).map_err(Failure::input)?;
        let contestant = self.examined.clone().with_faults(file);
        let findings = |summary: &RunSummary, recording: &Recording| {
            let stalls = stalls(summary);
            let of = |injection: &Injection| {
                FaultOutcome::of(*injection, recording, &stalls, &self.alone, &self.names, WINDOW)
            };
            injections.iter().map(of).collect::<Result<Vec<_>, _>>()
        };
        let is_late = |summary: &RunSummary, recording: &Recording| {
            Ok(is_late(summary, 1)
                || findings(summary, recording)?.iter().any(|finding| finding.is_late(kind.expected())))
        };
        let played = self.play_patiently(&scenario, &contestant, "examined", is_late)?;
        let Some((summary, recording)) = played else { return Ok(None) };
        let swept = RunFolder::sweep_dead().len();
        let findings = findings(&summary, &recording)?;
        RunFindings::of(findings, &summary, &recording, &self.limits, swept).map(Some)
    }

    /// Runs `scenario`; repeats it in lockstep with more patience if `is_late` reports that a sound controller was late.
    fn play_patiently(
        &self,
        scenario: &Scenario,
        contestant: &ControllerSelection,
        folder: &str,
        is_late: impl Fn(&RunSummary, &Recording) -> Result<bool, Failure>,
    ) -> Result<Option<(RunSummary, Recording)>, Failure> {
        let mut scenario = scenario.clone();
        for _ in 1..ATTEMPTS {
            let Some((summary, recording)) =
                play_recorded(&scenario, contestant, &self.out.join(folder), &self.stop)?
            else {
                return Ok(None);
            };
            match &mut scenario.answer_patience {
                Some(patience) if is_late(&summary, &recording)? => *patience *= MORE_PATIENCE,
                _ => return Ok(Some((summary, recording))),
            }
        }
        play_recorded(&scenario, contestant, &self.out.join(folder), &self.stop)
    }
}

/// True if an answer of the controller in `slot` was missing.
fn is_late(summary: &RunSummary, slot: usize) -> bool {
    summary.line_up["controllers"][slot]["rejected"]["missing"].as_u64().is_some_and(|count| count > 0)
}

/// Sets the duration of `scenario` for `count` faults, with enough laps; real time does not use lockstep's patience.
fn last(scenario: &mut Scenario, count: u32) {
    let ticks = FIRST + u64::from(count) * SPACING;
    let seconds = ticks as f64 / scenario.rate;
    scenario.duration = Some(seconds);
    scenario.path.laps = scenario.path.laps.max((seconds / scenario.path.period).ceil() as u32 + 1);
    if scenario.pace == Pacing::Realtime {
        scenario.answer_patience = None;
    }
}
