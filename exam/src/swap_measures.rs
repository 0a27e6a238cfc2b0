//! Cost of a swap, compared with the runs of its controllers alone.

use std::ops::Range;

use freeplay_harness::summary::RunSummary;
use freeplay_plant::Stall;
use freeplay_recording::Recording;
use freeplay_terminal::exit::Failure;
use serde::{Deserialize, Serialize};
use serde_json::Value;

/// Code of a held command in the column `in_force`.
pub(crate) const HELD_COMMAND: f64 = 2.0;
/// A stall of the machine affects a swap or a fault that follows within this many ticks.
pub const STALL_REACH_TICKS: u64 = 2;
/// Ticks after the blend during which the arm settles.
pub const SETTLING_TICKS: usize = 200;

/// One controller's run alone.
#[derive(Clone, Debug)]
pub struct SoloRun {
    /// Name of the controller.
    pub name: String,
    /// The tool's deviation at each tick, m.
    deviation: Vec<f64>,
    /// Greatest change of the command from tick to tick after the start, by joint.
    steady: Vec<f64>,
    /// The command in force at each tick, by joint.
    applied: Vec<Vec<f64>>,
    /// Ticks for which the last command was held, after the first [`SETTLING_TICKS`].
    held: u64,
}

/// Cost of one swap.
#[derive(Clone, Debug, Serialize)]
pub struct Measured {
    /// Seed of its run.
    pub seed: u64,
    /// Tick whose answer was the new controller's.
    pub tick: u64,
    /// The old controller.
    pub from: String,
    /// The new controller.
    pub to: String,
    /// Cause of the swap.
    pub cause: Value,
    /// Ticks from the planned one, or the first failure, to the swap.
    pub gap_ticks: u64,
    /// Ticks with a rejected answer after the swap, until the arm has settled.
    pub missed_ticks: u64,
    /// Ticks with a held command among these and those of the gap.
    pub held_ticks: u64,
    /// Change of the command at the swap, relative to the greatest change of either controller alone after the start, or in the same ticks if that is more: an
    /// impact changes the commands of any controller. Maximum over the joints.
    pub jump: f64,
    /// The same for the greatest change during the blend.
    pub blend_change: f64,
    /// Greatest deviation of the tool until it has settled, mm.
    pub deviation_peak_mm: f64,
    /// Ratio to the greatest deviation in the same ticks of the runs without swap of the controllers active before.
    pub deviation_ratio: f64,
    /// Stalls of the machine (see [`freeplay_plant::MissCause::is_machine`]) from one settling time before the planned tick until the arm had settled. A
    /// swap with stalls measures the machine more than the swap.
    pub stalls: u64,
    /// Stalls among these from [`STALL_REACH_TICKS`] ticks before the planned tick to the swap; with such a stall the gap does not count either.
    pub stalls_in_gap: u64,
    /// True if the journals came into contact or lost it in these ticks.
    pub contact_event: bool,
}

/// The norm of the tool's deviation at each tick, m.
pub fn deviation(recording: &Recording) -> Result<Vec<f64>, Failure> {
    let axis = |name: &str| {
        recording.column(name).ok_or_else(|| Failure::internal(format!("the recording has no column {name}")))
    };
    let (x, y, z) = (axis("deviation_x")?, axis("deviation_y")?, axis("deviation_z")?);
    Ok(x.iter().zip(y).zip(z).map(|((x, y), z)| (x * x + y * y + z * z).sqrt()).collect())
}

fn numbers(value: &Value) -> Vec<f64> {
    value.as_array().into_iter().flatten().filter_map(Value::as_f64).collect()
}

impl SoloRun {
    /// Reads the summary and the recording of a run of one controller.
    ///
    /// # Errors
    /// A recording without a column that a run records.
    pub fn new(summary: &RunSummary, name: &str, recording: &Recording) -> Result<Self, Failure> {
        let steady = numbers(&summary.line_up["steady_change"]);
        let column = |joint: usize| recording.column(&format!("applied_{joint}")).map(<[f64]>::to_vec);
        let applied = (1..=recording.joints()).filter_map(column).collect();
        let in_force = recording.column("in_force").unwrap_or_default();
        let held = in_force.iter().skip(SETTLING_TICKS).filter(|&&code| code == HELD_COMMAND).count() as u64;
        Ok(Self { name: name.to_owned(), deviation: deviation(recording)?, steady, applied, held })
    }

    /// Greatest change of the command of `joint` from tick to tick after the start, or in `ticks` if that is more: an impact, which steady motion lacks, may
    /// change the command more.
    fn change(&self, joint: usize, ticks: &Range<usize>) -> f64 {
        let Some(applied) = self.applied.get(joint) else { return 0.0 };
        let within = ticks.start.saturating_sub(1).min(applied.len())..ticks.end.min(applied.len());
        let changes = applied[within].windows(2).map(|pair| (pair[1] - pair[0]).abs());
        changes.fold(self.steady.get(joint).copied().unwrap_or(0.0), f64::max)
    }
}

/// The least of the steady changes of `alone`, by joint: a smaller change occurs in the steady motion of every controller.
pub fn steady_change(alone: &[SoloRun]) -> Vec<f64> {
    let joints = alone.iter().map(|alone| alone.steady.len()).min().unwrap_or(0);
    let least = |joint: usize| alone.iter().map(|alone| alone.steady[joint]).fold(f64::INFINITY, f64::min);
    // Slightly reduced, since a sum and a difference of two torques are rounded.
    (0..joints).map(|joint| least(joint) * (1.0 - 1e-9)).collect()
}

impl SoloRun {
    /// Share of the ticks for which the last command was held, after the first [`SETTLING_TICKS`].
    pub fn held_share(&self) -> f64 {
        self.held as f64 / self.deviation.len().saturating_sub(SETTLING_TICKS).max(1) as f64
    }

    /// The greatest deviation in `ticks`, m.
    pub fn peak(&self, ticks: Range<usize>) -> f64 {
        let within = ticks.start.min(self.deviation.len())..ticks.end.min(self.deviation.len());
        self.deviation[within].iter().copied().fold(0.0, f64::max)
    }
}

/// A finished run with swaps.
struct Run<'a> {
    deviation: Vec<f64>,
    in_charge: Vec<usize>,
    in_force: &'a [f64],
    rejected: &'a [f64],
    stalls: Vec<Stall>,
    /// Time in contact of each joint with play at each tick, s.
    contact: Vec<&'a [f64]>,
    /// The run alone of the controller in each slot.
    alone: Vec<&'a SoloRun>,
    window: usize,
}

/// Measures the cost of each swap of a run. `names` are its controllers by slot; a swap is observed for `window` ticks.
///
/// # Errors
/// A recording without a column that a run records.
pub fn measure(
    summary: &RunSummary,
    recording: &Recording,
    alone: &[SoloRun],
    names: &[String],
    seed: u64,
    window: usize,
) -> Result<Vec<Measured>, Failure> {
    let column = |name: &str| {
        recording.column(name).ok_or_else(|| Failure::internal(format!("the recording has no column {name}")))
    };
    let of = |name: &String| alone.iter().find(|alone| alone.name == *name);
    let run = Run {
        deviation: deviation(recording)?,
        in_charge: column("in_charge")?.iter().map(|&slot| slot as usize).collect(),
        in_force: column("in_force")?,
        rejected: column("rejected")?,
        stalls: stalls(summary),
        contact: summary.contact["joints"]
            .as_object()
            .into_iter()
            .flat_map(serde_json::Map::keys)
            .filter_map(|joint| recording.column(&format!("{joint}_contact_time")))
            .collect(),
        alone: names.iter().filter_map(of).collect(),
        window,
    };
    if run.alone.len() != names.len() {
        return Err(Failure::internal("a controller of the run was not run alone"));
    }
    let swaps = summary.line_up["swaps"].as_array().map(Vec::as_slice).unwrap_or_default();
    Ok(swaps.iter().map(|swap| run.measure(swap, names, seed)).collect())
}

/// The stalls of the machine in a run.
pub fn stalls(summary: &RunSummary) -> Vec<Stall> {
    let stalls = summary.deadlines["stalls"].as_array().into_iter().flatten();
    stalls.filter_map(|stall| Stall::deserialize(stall).ok()).collect()
}

/// Number of `stalls` that overlap `ticks`.
pub fn stalls_in<'s>(stalls: impl IntoIterator<Item = &'s Stall>, ticks: &Range<u64>) -> u64 {
    stalls.into_iter().filter(|stall| stall.first < ticks.end && stall.last >= ticks.start).count() as u64
}

impl Measured {
    /// True for a planned swap; else an answer was missing or rejected.
    pub fn is_planned(&self) -> bool {
        self.cause == "planned"
    }
}

impl Run<'_> {
    fn measure(&self, swap: &Value, names: &[String], seed: u64) -> Measured {
        let text = |key: &str| swap[key].as_str().unwrap_or("?").to_owned();
        let count = |key: &str| swap[key].as_u64().unwrap_or(0);
        let tick = count("tick");
        let planned = tick.saturating_sub(count("gap_ticks"));
        let (from, to) = (text("from"), text("to"));
        let slots = [&from, &to].map(|name| names.iter().position(|other| other == name).unwrap_or(0));
        let begin = tick as usize + 1;
        let ticks = begin.min(self.deviation.len())..(begin + self.window).min(self.deviation.len());
        let peak = self.deviation[ticks.clone()].iter().copied().fold(0.0, f64::max);
        let without = ticks.clone().map(|tick| self.without_swap(tick)).fold(0.0, f64::max);
        let ticks_with = |values: &[f64], is: &dyn Fn(f64) -> bool| {
            values[ticks.clone()].iter().filter(|&&value| is(value)).count() as u64
        };
        Measured {
            seed,
            tick,
            cause: swap["cause"].clone(),
            gap_ticks: count("gap_ticks"),
            missed_ticks: ticks_with(self.rejected, &|code| code != 0.0),
            held_ticks: count("held_ticks") + ticks_with(self.in_force, &|code| code == HELD_COMMAND),
            jump: self.relative_to_solo(&numbers(&swap["jump"]), slots, &ticks),
            blend_change: self.relative_to_solo(&numbers(&swap["greatest_change"]), slots, &ticks),
            stalls: stalls_in(&self.stalls, &(planned.saturating_sub(self.window as u64)..ticks.end as u64)),
            stalls_in_gap: stalls_in(&self.stalls, &(planned.saturating_sub(STALL_REACH_TICKS)..tick + 1)),
            deviation_peak_mm: peak * 1e3,
            deviation_ratio: if without > 0.0 { peak / without } else { f64::NAN },
            contact_event: self
                .contact
                .iter()
                .any(|time| ticks.clone().skip(1).any(|tick| (time[tick] > 0.0) != (time[tick - 1] > 0.0))),
            from,
            to,
        }
    }

    /// The deviation at `tick` without swap: the greatest of the controllers that were active in the window before.
    fn without_swap(&self, tick: usize) -> f64 {
        let mut seen = [false; freeplay_shm::MAX_SLOTS];
        self.in_charge[tick.saturating_sub(self.window)..=tick].iter().for_each(|&slot| seen[slot] = true);
        let slots = self.alone.iter().enumerate().filter(|(slot, _)| seen[*slot]);
        slots.filter_map(|(_, alone)| alone.deviation.get(tick)).copied().fold(0.0, f64::max)
    }

    /// Ratio of `change` to the greatest change of the controllers in `slots` without swap; maximum over the joints.
    fn relative_to_solo(&self, change: &[f64], slots: [usize; 2], ticks: &Range<usize>) -> f64 {
        let usual = |joint: usize| {
            slots.iter().map(|&slot| self.alone[slot].change(joint, ticks)).fold(0.0, f64::max)
        };
        let ratios = change.iter().enumerate().filter(|(_, change)| **change > 0.0);
        ratios.map(|(joint, change)| change / usual(joint)).fold(0.0, f64::max)
    }
}
