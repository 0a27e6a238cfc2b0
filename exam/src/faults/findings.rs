//! Outcome of each injected fault, and the verdict on each kind of fault.

use std::collections::BTreeMap;

use freeplay_harness::scenario::Pacing;
use freeplay_harness::summary::RunSummary;
use freeplay_plant::{PROBATION, Rejection, Stall};
use freeplay_recording::Recording;
use freeplay_terminal::exit::Failure;
use serde::Serialize;

use crate::faults::kinds::{Expected, FAULT_TICKS, Injection, Kind};
use crate::swap_measures::{HELD_COMMAND, STALL_REACH_TICKS, SoloRun, deviation, stalls_in};

/// Largest ratio of the deviation with a fault to that without, for a fault that is to do no harm.
const HARMLESS: f64 = 1.05;
/// Code of a braked arm in the column `in_force`.
const BRAKED: f64 = 3.0;

/// The outcome of one fault.
#[derive(Clone, Debug, Serialize)]
pub struct FaultOutcome {
    /// The fault.
    pub injection: Injection,
    /// True if the controller was active, with open brakes, when the fault set in; else the fault cannot be detected.
    pub was_in_charge: bool,
    /// True if a journal was in contact when it set in.
    pub in_contact: bool,
    /// Ticks from the first faulty answer to the one in which something other than the controller's answers was in force.
    pub detected_after: Option<u64>,
    /// Ticks from the first rejected answer to the one whose successor had the standby's command in force; 0: no tick was lost.
    pub taken_over_after: Option<u64>,
    /// Reason of the rejection.
    pub reason: Option<&'static str>,
    /// Faulty answers that were in force.
    pub faulty_in_force: u64,
    /// Ticks for which the last command was held.
    pub held: u64,
    /// True if the brakes closed.
    pub braked: bool,
    /// Name of the next active controller.
    pub next_in_charge: String,
    /// True if the controller was active again before the next fault.
    pub back: bool,
    /// Stalls of the machine around the fault, until the standby was in force. If the standby has to contradict the controller, the count begins earlier, by
    /// the time after which the standby is trusted again. A stalled fault measures the machine more than the controller.
    pub stalls: u64,
    /// Greatest deviation of the tool until then, mm.
    pub deviation_peak_mm: f64,
    /// Ratio to the greatest deviation of the two controllers alone in the same ticks.
    pub deviation_ratio: f64,
}

fn column<'a>(recording: &'a Recording, name: &str) -> Result<&'a [f64], Failure> {
    recording.column(name).ok_or_else(|| Failure::internal(format!("the recording has no column {name}")))
}

impl FaultOutcome {
    /// Evaluates `injection` from the recording of its run with these `stalls` of the machine, over `window` ticks, against the runs of the controllers
    /// `alone`.
    ///
    /// # Errors
    /// A recording without a column that a run records.
    pub fn of(
        injection: Injection,
        recording: &Recording,
        stalls: &[Stall],
        alone: &[SoloRun],
        names: &[String],
        window: usize,
    ) -> Result<Self, Failure> {
        let (rejected, in_force) = (column(recording, "rejected")?, column(recording, "in_force")?);
        let in_charge = column(recording, "in_charge")?;
        let begin = injection.tick as usize;
        let (end, faulty) =
            ((begin + window).min(rejected.len()), (begin + FAULT_TICKS as usize).min(rejected.len()));
        let refused = (begin..faulty).find(|&tick| rejected[tick] != 0.0);
        // The answer to tick k is in force during tick k + 1.
        let was_faulty = |tick: usize| in_force[tick] == 1.0 && in_charge[tick] == 0.0;
        let is_taken_over = |tick: &usize| in_force[*tick] == 1.0 && in_charge[*tick] != 0.0;
        let taken_over = refused.and_then(|tick| Some((tick + 1..end).find(is_taken_over)? - tick - 1));
        let norm = deviation(recording)?;
        let peak = norm[begin.min(norm.len())..end.min(norm.len())].iter().copied().fold(0.0, f64::max);
        let without = alone.iter().map(|alone| alone.peak(begin..end)).fold(0.0, f64::max);
        let held = |code| in_force[begin..end].iter().filter(|&&what| what == code).count() as u64;
        let next = refused.and_then(|tick| in_charge.get(tick + 1)).map_or(0, |&slot| slot as usize);
        let name = |slot: usize| names.get(slot).cloned().unwrap_or_default();
        // A stalled standby cannot contradict the controller until it has agreed with it for a while.
        let is_compared = injection.kind.expected() == Expected::Compared;
        let (before, unrefused) =
            if is_compared { (u64::from(PROBATION), faulty) } else { (STALL_REACH_TICKS, begin) };
        let over = refused.map_or(unrefused, |tick| tick + taken_over.unwrap_or(0)) as u64;
        let around = injection.tick.saturating_sub(before)..over + STALL_REACH_TICKS + 1;
        // Missing answers of the examined controller after the fault set in belong to the fault.
        let is_machines = |stall: &&Stall| stall.slot != Some(0) || stall.first < injection.tick;
        Ok(Self {
            injection,
            was_in_charge: in_charge.get(begin).is_some_and(|&slot| slot == 0.0) && in_force[begin] != BRAKED,
            in_contact: recording.others.iter().any(|(name, values)| {
                name.ends_with("_contact_time") && values[begin.min(values.len() - 1)] > 0.0
            }),
            detected_after: refused.map(|tick| (tick - begin) as u64 + 1),
            taken_over_after: taken_over.map(|ticks| ticks as u64),
            reason: refused.map(|tick| reason(rejected[tick])),
            faulty_in_force: (begin + 1..(faulty + 1).min(end)).filter(|&tick| was_faulty(tick)).count()
                as u64,
            held: held(HELD_COMMAND),
            braked: held(BRAKED) > 0,
            next_in_charge: name(next),
            back: end > 0 && in_charge.get(end).is_some_and(|&slot| slot == 0.0),
            stalls: stalls_in(stalls.iter().filter(is_machines), &around),
            deviation_peak_mm: peak * 1e3,
            deviation_ratio: if without > 0.0 { peak / without } else { f64::NAN },
        })
    }

    /// True if the controller was late for another reason than the fault: it was not active when the fault set in, or an answer was missing although the fault
    /// removes none.
    pub fn is_late(&self, expected: Expected) -> bool {
        let loses_none = matches!(expected, Expected::Compared | Expected::Harmless);
        !self.was_in_charge || (loses_none && self.reason == Some(Rejection::Missing.name()))
    }

    /// The commands in force during the fault.
    fn applied(&self) -> &'static str {
        match (self.braked, self.held, self.detected_after, self.faulty_in_force) {
            (true, ..) => "brakes",
            (_, 1.., ..) => "hold, then the standby",
            (_, _, Some(_), 0) => "the standby's",
            (_, _, Some(_), _) => "its own command, then the standby",
            (_, _, None, _) => "its own",
        }
    }

    /// True if the outcome meets the expectation.
    fn holds(&self, expected: Expected) -> bool {
        match expected {
            Expected::Detected { ticks } => self.detected_after.is_some_and(|after| after <= ticks),
            Expected::Compared => self.detected_after.is_some() || self.deviation_ratio <= HARMLESS,
            Expected::Harmless => self.detected_after.is_none() && self.deviation_ratio <= HARMLESS,
        }
    }
}

/// The name of a code of the column `rejected`.
fn reason(code: f64) -> &'static str {
    Rejection::ALL
        .into_iter()
        .find(|&reason| f64::from(reason as u8 + 1) == code)
        .map_or("?", Rejection::name)
}

/// Outcomes of the faults of one run, and the state of the run itself.
pub struct RunFindings {
    findings: Vec<FaultOutcome>,
    bad_applied: u64,
    plant_late: u64,
    unrecorded: u64,
    swept: usize,
}

impl RunFindings {
    /// Evaluates a run with its `findings`; after it, `swept` dead runs were removed from shared memory.
    ///
    /// # Errors
    /// A recording without a column that a run records.
    pub fn of(
        findings: Vec<FaultOutcome>,
        summary: &RunSummary,
        recording: &Recording,
        limits: &[[f64; 2]],
        swept: usize,
    ) -> Result<Self, Failure> {
        let mut bad_applied = 0;
        for (joint, [lower, upper]) in limits.iter().enumerate() {
            let applied = column(recording, &format!("applied_{}", joint + 1))?;
            bad_applied += applied.iter().filter(|value| !(*lower..=*upper).contains(*value)).count() as u64;
        }
        let count = |key: &str| summary.deadlines[key].as_u64().unwrap_or(0);
        Ok(Self {
            findings,
            bad_applied,
            plant_late: count("plant_late"),
            unrecorded: count("unrecorded"),
            swept,
        })
    }
}

/// The verdict on one kind of fault.
#[derive(Clone, Debug, Serialize)]
pub struct Verdict {
    /// The kind.
    pub kind: Kind,
    /// True if the outcomes meet the expectations.
    pub holds: bool,
    /// Faults injected.
    pub count: usize,
    /// Of these, while a journal was in contact.
    pub in_contact: usize,
    /// Of these, faults with the controller active and without a stall of the machine. The following figures that rate the reaction to a fault count only
    /// these.
    pub judged: usize,
    /// Faults that fell on a stall of the machine.
    pub stalled: usize,
    /// Of these, detected.
    pub detected: usize,
    /// Faults after which the standby's answer to the same tick was in force.
    pub taken_over_at_once: usize,
    /// Faults after which the standby was active within two more ticks.
    pub taken_over_soon: usize,
    /// Ticks until the slowest detection.
    pub slowest: Option<u64>,
    /// Faults with an outcome other than expected.
    pub not_as_expected: usize,
    /// Commands in force during the faults, with counts.
    pub applied: BTreeMap<&'static str, usize>,
    /// Reasons of rejection, with counts.
    pub reasons: BTreeMap<&'static str, usize>,
    /// Next active controllers, with counts.
    pub next_in_charge: BTreeMap<String, usize>,
    /// Most ticks for which a command was held.
    pub most_held: u64,
    /// Faults after which the controller was active again.
    pub back: usize,
    /// Greatest ratio of the tool's deviation to that without a fault.
    pub deviation_ratio: f64,
    /// Greatest deviation of the tool, mm.
    pub deviation_peak_mm: f64,
    /// Commands in force with values beyond a limit, or NaN.
    pub bad_applied: u64,
    /// Ticks at which the plant itself woke up more than a period late.
    pub plant_late: u64,
    /// Ticks missing in the recordings.
    pub unrecorded: u64,
    /// Runs of killed processes that were removed from shared memory.
    pub swept: usize,
    /// All faults.
    pub findings: Vec<FaultOutcome>,
}

impl Verdict {
    /// The verdict on `kind` before any fault.
    pub fn new(kind: Kind) -> Self {
        Self {
            kind,
            holds: true,
            count: 0,
            in_contact: 0,
            judged: 0,
            stalled: 0,
            detected: 0,
            taken_over_at_once: 0,
            taken_over_soon: 0,
            slowest: None,
            not_as_expected: 0,
            applied: BTreeMap::new(),
            reasons: BTreeMap::new(),
            next_in_charge: BTreeMap::new(),
            most_held: 0,
            back: 0,
            deviation_ratio: 0.0,
            deviation_peak_mm: 0.0,
            bad_applied: 0,
            plant_late: 0,
            unrecorded: 0,
            swept: 0,
            findings: Vec::new(),
        }
    }

    /// Adds the outcomes of a run.
    pub fn add(&mut self, run: RunFindings) {
        self.bad_applied += run.bad_applied;
        self.plant_late += run.plant_late;
        self.unrecorded += run.unrecorded;
        self.swept += run.swept;
        for finding in run.findings {
            self.count += 1;
            self.in_contact += usize::from(finding.in_contact);
            let is_stalled = finding.was_in_charge && finding.stalls > 0;
            self.stalled += usize::from(is_stalled);
            if finding.was_in_charge && !is_stalled {
                self.judged += 1;
                self.detected += usize::from(finding.detected_after.is_some());
                self.taken_over_at_once += usize::from(finding.taken_over_after == Some(0));
                self.taken_over_soon += usize::from(matches!(finding.taken_over_after, Some(1 | 2)));
                self.slowest = self.slowest.max(finding.detected_after);
                self.not_as_expected += usize::from(!finding.holds(self.kind.expected()));
            }
            *self.applied.entry(finding.applied()).or_default() += 1;
            if let Some(reason) = finding.reason {
                *self.reasons.entry(reason).or_default() += 1;
            }
            *self.next_in_charge.entry(finding.next_in_charge.clone()).or_default() += 1;
            self.most_held = self.most_held.max(finding.held);
            self.back += usize::from(finding.back);
            self.deviation_ratio = self.deviation_ratio.max(finding.deviation_ratio);
            self.deviation_peak_mm = self.deviation_peak_mm.max(finding.deviation_peak_mm);
            self.findings.push(finding);
        }
    }

    /// Closes the verdict: it fails if no fault could be judged. In real time the machine, too, delays answers, so that a sound controller may be replaced.
    pub fn with_pace(mut self, pace: Pacing) -> Self {
        let tolerated = pace == Pacing::Realtime && self.kind.expected() == Expected::Harmless;
        self.holds = self.bad_applied == 0 && self.judged > 0 && (self.not_as_expected == 0 || tolerated);
        self
    }
}
