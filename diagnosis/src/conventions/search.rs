//! The best set of changes: steps from several starts, each adding, dropping or exchanging one change.

use freeplay_arm::Arm;

use super::change::Change;
use super::kinds;
use super::kinds::Ask;
use super::outcome::{Outcome, SPOKEN};
use super::problem::{FLOOR, Problem};
use crate::sorting::sort_falling;
use crate::statistics::STRONG;

/// Rows of the screening: more than the parameters of any reading, and a quarter of all rows, so that a screening takes a quarter of the time.
const FEW_ROWS: usize = 60;
/// Steps after which the starts are compared: a right start has passed the others by then, as each step takes a fault away.
const FIRST: usize = 3;
/// Number of the best sets that continue where continuing all would take too long: a single one may lead by chance.
const AHEAD: usize = 2;
/// Number of changes that the search tries again after a step of physics, which hardly changes the rank of the others: a few of every joint.
const PROMISING: usize = 48;
/// Floor for fitting the parameters of a settled set: below the resolution of encoders and torque sensors with 9 bits or more.
const SHARP: f64 = 2e-3;
/// Steps of a golden-section search: they narrow an interval to a thousandth, 0.618¹⁴.
const GOLDEN: usize = 14;

/// The problem on all rows and on a few rows.
pub(crate) struct Search<'a> {
    pub whole: Problem<'a>,
    few: Problem<'a>,
    /// All rows, with a floor at the resolution of the instruments.
    sharp: Problem<'a>,
}

impl<'a> Search<'a> {
    /// The search for an arm and the rows of a recording.
    pub fn new(arm: &'a Arm, samples: &'a super::samples::Samples) -> Self {
        let stride = (samples.len() / FEW_ROWS).max(1);
        Self {
            whole: Problem::new(arm, samples, 1, FLOOR),
            few: Problem::new(arm, samples, stride, FLOOR),
            sharp: Problem::new(arm, samples, 1, SHARP),
        }
    }

    /// Weights the rows by the correlation of the residuals of `outcome`: correlated rows count less.
    pub fn weigh(&mut self, outcome: &Outcome) {
        let each = rows_per_one(&self.whole.residuals(outcome));
        let mut counts = vec![1.0; each.len()];
        outcome.sources.iter().zip(&each).for_each(|(&source, count)| counts[source] = *count);
        for problem in [&mut self.whole, &mut self.few, &mut self.sharp] {
            problem.count_rows(&counts);
        }
    }

    /// The best set that the steps from `first` reach.
    pub fn again(&self, first: &Outcome) -> Outcome {
        self.settled(&climb(&self.few, &first.changes, Scope::All).changes, Scope::All)
    }

    /// The best set of all starts: the search runs on few rows and settles on all of them.
    pub fn best(&self) -> Outcome {
        let plain = climb(&self.few, &[], Scope::All);
        let best = if is_settled(&plain) { plain } else { self.of_all_starts(plain) };
        self.settled(&best.changes, Scope::All)
    }

    /// The best set that the steps from pairs of readings reach. Of two faults, neither may explain anything alone.
    pub fn of_pairs(&self) -> Outcome {
        let first = ranked(one_more(&self.few, &self.few.outcome(&[])));
        let first = first.iter().take(PROMISING);
        let pairs = ranked(first.flat_map(|one| one_more(&self.few, one)));
        let ends = pairs.iter().take(AHEAD).map(|pair| climb(&self.few, &pair.changes, Scope::All));
        let best = ends.max_by(|a, b| a.evidence.total_cmp(&b.evidence));
        self.settled(best.as_ref().map_or(&[], |best| &best.changes), Scope::All)
    }

    fn of_all_starts(&self, plain: Outcome) -> Outcome {
        let arm = self.whole.arm;
        let scales: Vec<Change> = (0..arm.dof()).map(Change::Scale).collect();
        let mut starts = vec![vec![Change::AngleUnit]];
        if self.whole.samples.has_torques() {
            let turned = [scales.as_slice(), &[Change::AnyGravity]].concat();
            starts.extend([
                scales,
                vec![Change::AnyGravity],
                turned,
                vec![Change::CommonSign],
                vec![Change::Compensated],
            ]);
        }
        // All starts take a few steps; the best two continue.
        let ahead = ranked(starts.iter().map(|start| steps(&self.few, start, Scope::All, FIRST)));
        let mut best = plain;
        for start in ahead.into_iter().take(AHEAD) {
            let other = climb(&self.few, &start.changes, Scope::All);
            if other.evidence > best.evidence {
                best = other;
            }
            if is_settled(&best) {
                break;
            }
        }
        best
    }

    /// The best set of `start` with further physics, small misreadings included. The changes of `kept` stay, and the search tries none of the sort `judged`.
    pub fn best_with_physics(&self, start: &[Change], kept: &[Change], judged: Option<u8>) -> Outcome {
        let scope = Scope::Beside(kept, judged);
        self.settled(&climb(&self.few, start, scope).changes, scope)
    }

    /// `changes` on all rows, with their parameters fitted.
    pub fn refitted(&self, changes: &[Change]) -> Outcome {
        self.whole.outcome(&self.finer(changes))
    }

    /// `changes` on all rows. The function drops changes that are not worth their price there, and fits parameters as finely as the instruments allow.
    fn settled(&self, changes: &[Change], scope: Scope) -> Outcome {
        let mut best = self.whole.outcome(changes);
        // A reading that is small on few rows belongs to the scope there, but may be large on all rows: it is dropped.
        while let Some(large) =
            best.changes.iter().position(|change| !scope.has(self.whole.arm, &best, change))
        {
            best.changes.remove(large);
            best = self.whole.outcome(&best.changes);
        }
        while let Some(next) = dropped(&self.whole, &best, scope)
            .into_iter()
            .max_by(|a, b| a.evidence.total_cmp(&b.evidence))
            .filter(|next| next.evidence > best.evidence || !best.is_possible())
        {
            best = next;
        }
        if matches!(scope, Scope::All) {
            let finer = self.whole.outcome(&self.finer(&best.changes));
            if finer.evidence > best.evidence - STRONG {
                best = finer;
            }
        }
        best
    }

    /// `changes` with their parameters fitted under the sharp floor, rounded where a rounded value is as good.
    fn finer(&self, changes: &[Change]) -> Vec<Change> {
        let mut best = self.sharp.outcome(changes);
        for _ in 0..best.changes.len() {
            // The first change moves to the end, refined.
            best.changes.rotate_left(1);
            best = refined(&self.sharp, best, Scope::All);
        }
        best.changes
    }
}

/// Lag in rows beyond which residuals count as independent, and the most rows that count as one: 1.8 s, longer than any settling of an arm.
pub(super) const MEMORY: usize = 12;

/// Number of rows that count as one, by channel: 1 + 2 Σ ρ_k of its residual (Bartlett 1946).
fn rows_per_one(residuals: &[Vec<f64>]) -> Vec<f64> {
    let of = |residual: &Vec<f64>| {
        let mean = residual.iter().sum::<f64>() / residual.len().max(1) as f64;
        let x: Vec<f64> = residual.iter().map(|x| x - mean).collect();
        let whole: f64 = x.iter().map(|x| x * x).sum();
        if whole <= 0.0 {
            return 1.0;
        }
        let at = |lag: usize| x.iter().zip(&x[lag.min(x.len())..]).map(|(a, b)| a * b).sum::<f64>() / whole;
        let sum: f64 = (1..=MEMORY).map(at).take_while(|rho| *rho > 0.0).sum();
        (1.0 + 2.0 * sum).min(MEMORY as f64)
    };
    residuals.iter().map(of).collect()
}
/// The changes that a search may make.
#[derive(Clone, Copy)]
enum Scope<'s> {
    /// The reading and further physics.
    All,
    /// Physics beside these changes of the reading, small misreadings included for which the catalogue has laws. Changes of the same sort as the judged change
    /// are excluded: size, not odds, separates small from large ones.
    Beside(&'s [Change], Option<u8>),
}

impl Scope<'_> {
    fn allows(self, arm: &Arm, outcome: &Outcome) -> bool {
        let Scope::Beside(kept, _) = self else { return true };
        outcome.changes.iter().all(|change| self.has(arm, outcome, change))
            && kept.iter().all(|change| outcome.changes.contains(change))
    }

    /// Returns true if the scope contains `change` of `outcome`.
    fn has(self, arm: &Arm, outcome: &Outcome, change: &Change) -> bool {
        let Scope::Beside(kept, _) = self else { return true };
        !change.is_reading() || kinds::is_small(arm, outcome, change) || kept.contains(change)
    }

    /// Returns true if `change` can be physics for some value of its parameter.
    fn asks(self, change: &Change) -> bool {
        match (self, change) {
            (Scope::Beside(_, Some(sort)), change) if change.sort() == sort => false,
            (Scope::All, _)
            | (_, Change::Beside(_) | Change::Scale(_) | Change::CommonScale | Change::AnyGravity) => true,
            (_, Change::Zero { offset, .. }) => offset.abs() <= kinds::joint_zero::LEAST,
            (_, Change::Delay(_, delay)) => delay.abs() <= kinds::clock_offset::LEAST,
            _ => false,
        }
    }
}

/// Takes steps from `start` while the evidence grows.
fn climb(problem: &Problem, start: &[Change], scope: Scope) -> Outcome {
    steps(problem, start, scope, usize::MAX)
}

/// Takes at most `most` steps from `start` while the evidence grows.
fn steps(problem: &Problem, start: &[Change], scope: Scope, most: usize) -> Outcome {
    let mut best = problem.outcome(start);
    let mut promising = None;
    for _ in 0..most {
        let added = added(problem, &best, scope, &mut promising);
        let next = added.into_iter().chain(dropped(problem, &best, scope));
        let Some(next) = next.max_by(|a, b| a.evidence.total_cmp(&b.evidence)) else { break };
        if next.evidence.is_nan() || next.evidence <= best.evidence {
            break;
        }
        // A step of physics hardly changes which other changes are promising; a step of the reading changes all of them.
        if next
            .changes
            .iter()
            .filter(|change| change.is_reading())
            .ne(best.changes.iter().filter(|change| change.is_reading()))
        {
            promising = None;
        }
        best = next;
    }
    best
}

/// All changes that the search can try when `best` is the best set so far.
fn asks(problem: &Problem, best: &Outcome) -> Vec<Change> {
    let samples = problem.samples;
    kinds::asks(&Ask {
        arm: problem.arm,
        has_torques: samples.has_torques(),
        has_tool: samples.has_tool(),
        positions: &samples.motion[0],
        best,
    })
}

/// The changes of `best` plus `change`, without those that `change` excludes.
fn with(best: &Outcome, change: Change) -> Vec<Change> {
    best.changes.iter().copied().filter(|other| !other.excludes(&change)).chain([change]).collect()
}

/// The outcomes with one more reading than `best`.
fn one_more(problem: &Problem, best: &Outcome) -> impl Iterator<Item = Outcome> {
    let readings = asks(problem, best).into_iter().filter(Change::is_reading);
    readings.map(|change| problem.outcome(&with(best, change)))
}

/// `outcomes`, the most probable first.
fn ranked(outcomes: impl Iterator<Item = Outcome>) -> Vec<Outcome> {
    let mut outcomes: Vec<Outcome> = outcomes.collect();
    sort_falling(&mut outcomes, |outcome| outcome.evidence);
    outcomes
}

/// The best outcomes with one more change, or with one that replaces those it excludes. `promising` holds the promising changes of the last step; without them
/// the function tries all changes.
fn added(
    problem: &Problem,
    best: &Outcome,
    scope: Scope,
    promising: &mut Option<Vec<Change>>,
) -> Option<Outcome> {
    let asked = promising.clone().unwrap_or_else(|| asks(problem, best));
    let asked = asked.into_iter().filter(|change| scope.asks(change) && !best.changes.contains(change));
    let outcomes = asked.map(|change| problem.outcome(&with(best, change)));
    let mut outcomes = ranked(outcomes.filter(|outcome| scope.allows(problem.arm, outcome)));
    let last = outcomes.iter().take(PROMISING).filter_map(|outcome| outcome.changes.last().copied());
    *promising = Some(last.collect());
    outcomes.truncate(AHEAD);
    outcomes
        .into_iter()
        .map(|outcome| refined(problem, outcome, scope))
        .max_by(|a, b| a.evidence.total_cmp(&b.evidence))
}

/// The outcomes with one change fewer.
fn dropped(problem: &Problem, best: &Outcome, scope: Scope) -> Vec<Outcome> {
    let without = |k: usize| {
        let mut set = best.changes.clone();
        set.remove(k);
        problem.outcome(&set)
    };
    (0..best.changes.len()).map(without).filter(|outcome| scope.allows(problem.arm, outcome)).collect()
}

/// `outcome` with the parameter of its last change fitted or rounded, if the evidence grows.
fn refined(problem: &Problem, outcome: Outcome, scope: Scope) -> Outcome {
    let Some((last, rest)) = outcome.changes.split_last() else { return outcome };
    let with = |change: Change| problem.outcome(&[rest, &[change]].concat());
    let fitted: Vec<Change> = match *last {
        Change::Zero { joint, offset, .. } => {
            let at = |offset| Change::Zero { joint, offset, is_fitted: true };
            vec![at(golden(offset, 0.5 * kinds::joint_zero::step(), |x| with(at(x)).evidence))]
        }
        Change::Delay(late, delay) => {
            let at = |delay| Change::Delay(late, delay);
            vec![at(golden(delay, kinds::clock_offset::unsure(), |x| with(at(x)).evidence))]
        }
        Change::Scale(joint) | Change::SameScale(joint, _) => {
            kinds::torque_unit::rounded(outcome.scale[joint])
                .into_iter()
                .map(|factor| Change::SameScale(joint, factor))
                .collect()
        }
        _ => Vec::new(),
    };
    let fitted = fitted.into_iter().map(with).filter(|outcome| scope.allows(problem.arm, outcome));
    fitted.fold(outcome.clone(), |best, other| if other.evidence > best.evidence { other } else { best })
}
/// Returns true if the residual of every channel is so small that no other start can be better.
fn is_settled(outcome: &Outcome) -> bool {
    outcome.left.iter().all(|left| left.is_nan() || *left <= SPOKEN)
}

/// The position within `width` of `about` that maximises `value` (Kiefer 1953).
fn golden(about: f64, width: f64, value: impl Fn(f64) -> f64) -> f64 {
    let ratio = 0.5 * (5.0_f64.sqrt() - 1.0);
    let (mut low, mut high) = (about - width, about + width);
    let (mut a, mut b) = (high - ratio * (high - low), low + ratio * (high - low));
    let (mut at_a, mut at_b) = (value(a), value(b));
    for _ in 0..GOLDEN {
        if at_a > at_b {
            (high, b, at_b) = (b, a, at_a);
            a = high - ratio * (high - low);
            at_a = value(a);
        } else {
            (low, a, at_a) = (a, b, at_b);
            b = low + ratio * (high - low);
            at_b = value(b);
        }
    }
    0.5 * (low + high)
}
