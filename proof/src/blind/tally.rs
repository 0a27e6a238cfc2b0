//! Score of many answers: the goals with the results.

use std::collections::BTreeMap;

use serde::Serialize;

use super::answer::Errors;
use super::confidence_intervals::{Median, Share};
use super::confusion::{self, Confusion, Mistake};
use super::controls::Controls;
use super::judged::{Judged, of_sort};
use super::score::{Outcome, ParameterScore};
use super::truth::Sort;

/// Bounds of the bins of the signal-to-floor ratio for success rates.
const RATIOS: [f64; 8] = [0.0, 1.6, 2.0, 2.5, 3.5, 5.0, 9.0, f64::INFINITY];
/// Bounds of the bins of confidence for success rates.
const CONFIDENCES: [f64; 6] = [0.0, 0.8, 0.95, 0.99, 0.999, 1.0 + f64::EPSILON];
/// Name of the place of an effect of the arm as a whole.
pub const WHOLE_ARM: &str = "whole arm";
/// Nominal length of a recording, s: the time goal is for one of 16 s.
const RECORDING: f64 = 16.0;

/// A goal with its result.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Goal {
    /// The quantity.
    pub quantity: &'static str,
    /// The goal.
    pub goal: &'static str,
    /// The result, %, or s.
    pub reached: f64,
    /// Its 95 % interval.
    pub ci95: [f64; 2],
    /// A count out of a total, if the result is one.
    pub share: Option<Share>,
    /// Number of cases.
    pub of: usize,
    /// `%` or `s`.
    pub unit: &'static str,
    /// True if the result meets the goal; `None` without cases.
    pub met: Option<bool>,
}

impl Goal {
    fn share(quantity: &'static str, goal: &'static str, share: Share, met: impl Fn(f64) -> bool) -> Self {
        let reached = 100.0 * share.value();
        Self {
            quantity,
            goal,
            reached: if share.of == 0 { 0.0 } else { reached },
            ci95: share.ci95.map(|x| 100.0 * x),
            of: share.of,
            unit: "%",
            met: (share.of > 0).then(|| met(reached)),
            share: Some(share),
        }
    }

    fn median(
        quantity: &'static str,
        goal: &'static str,
        unit: &'static str,
        values: Vec<f64>,
        met: impl Fn(f64) -> bool,
    ) -> Self {
        let median = Median::new(values);
        Self {
            quantity,
            goal,
            reached: median.map_or(0.0, |m| m.value),
            ci95: median.map_or([0.0; 2], |m| m.ci95),
            share: None,
            of: median.map_or(0, |m| m.of),
            unit,
            met: median.map(|m| met(m.value)),
        }
    }
}

/// A range of some quantity and the share of successes in it.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Bin {
    /// Mean of the quantity.
    pub at: f64,
    /// Share of right answers.
    pub right: Share,
    /// Share of answers that something is missing.
    pub detected: Share,
}

/// The score of many answers.
#[derive(Clone, Debug, Serialize)]
pub struct Score {
    /// Outcomes by sort of case.
    pub outcomes: BTreeMap<&'static str, BTreeMap<&'static str, usize>>,
    /// The goals.
    pub goals: Vec<Goal>,
    /// One effect: success against its signal-to-floor ratio.
    pub by_strength: Vec<Bin>,
    /// One effect: success by severity.
    pub by_severity: BTreeMap<String, Bin>,
    /// One named effect: success against confidence.
    pub calibration: Vec<Bin>,
    /// One effect: success by machine and joint; [`WHOLE_ARM`] for an effect without a joint.
    pub by_joint: BTreeMap<String, BTreeMap<String, Bin>>,
    /// One effect: named kind against concealed kind; equivalents in brackets.
    pub confusion: Confusion,
    /// One effect: confused kinds, the commonest first.
    pub mistakes: Vec<Mistake>,
    /// Results of chance, re-tuning, a black box and an oracle.
    pub controls: Controls,
}

impl Score {
    /// The score of `cases`.
    pub fn of(cases: &[Judged]) -> Self {
        let mut outcomes: BTreeMap<_, BTreeMap<_, usize>> = BTreeMap::new();
        for case in cases {
            *outcomes.entry(case.truth.sort().name()).or_default().entry(case.outcome.name()).or_default() +=
                1;
        }
        let singles: Vec<&Judged> = of_sort(cases, Sort::Single).collect();
        let mut by_severity = BTreeMap::new();
        for severity in ["slight", "clear", "strong"] {
            let some = singles.iter().copied().filter(|case| case.truth.effects[0].severity == severity);
            by_severity.extend(bin(some, strength).map(|bin| (severity.to_owned(), bin)));
        }
        let sure = |case: &Judged| case.answer.confidence();
        Self {
            outcomes,
            goals: goals(cases),
            by_strength: bins(&singles, &RATIOS, |case| Some(strength(case))),
            by_severity,
            calibration: bins(&singles, &CONFIDENCES, sure),
            by_joint: by_joint(&singles),
            confusion: confusion::matrix(&singles),
            mistakes: confusion::mistakes(&singles),
            controls: Controls::of(cases),
        }
    }
}

fn strength(case: &Judged) -> f64 {
    case.truth.effects[0].signal_to_floor
}

fn bins(cases: &[&Judged], bounds: &[f64], of: impl Fn(&Judged) -> Option<f64> + Copy) -> Vec<Bin> {
    let inside = |pair: &[f64]| {
        let some =
            cases.iter().copied().filter(move |case| of(case).is_some_and(|x| x >= pair[0] && x < pair[1]));
        bin(some.collect::<Vec<_>>().into_iter(), |case| of(case).unwrap_or_default())
    };
    bounds.windows(2).filter_map(inside).collect()
}

fn bin<'a>(cases: impl Iterator<Item = &'a Judged>, of: impl Fn(&Judged) -> f64) -> Option<Bin> {
    let cases: Vec<&Judged> = cases.collect();
    let at = cases.iter().map(|case| of(case)).sum::<f64>() / cases.len() as f64;
    let right = |case: &&&Judged| case.outcome == Outcome::Right;
    let detected = |case: &&&Judged| !case.answer.is_silent() && case.outcome != Outcome::Failed;
    (!cases.is_empty()).then(|| Bin {
        at,
        right: Share::among(cases.iter(), right),
        detected: Share::among(cases.iter(), detected),
    })
}

/// Success by machine and joint.
fn by_joint(singles: &[&Judged]) -> BTreeMap<String, BTreeMap<String, Bin>> {
    let mut groups: BTreeMap<(&str, &str), Vec<&Judged>> = BTreeMap::new();
    for case in singles {
        let joint = case.truth.effects[0].joint.as_deref().unwrap_or(WHOLE_ARM);
        groups.entry((&case.truth.machine, joint)).or_default().push(case);
    }
    let mut table: BTreeMap<String, BTreeMap<String, Bin>> = BTreeMap::new();
    for ((machine, joint), cases) in groups {
        let bin = bin(cases.into_iter(), strength).map(|bin| (joint.to_owned(), bin));
        table.entry(machine.to_owned()).or_default().extend(bin);
    }
    table
}

/// The table of goals.
fn goals(cases: &[Judged]) -> Vec<Goal> {
    let sort = |sort| of_sort(cases, sort);
    let is_right = |case: &&Judged| case.outcome == Outcome::Right;
    let alarm = |case: &&Judged| matches!(case.outcome, Outcome::Wrong | Outcome::Failed);
    let named = sort(Sort::Single).filter(|case| case.answer.verdict == "named");
    let detected = sort(Sort::Single).filter(|case| !case.answer.is_silent());
    let unnamed = |case: &&Judged| matches!(case.outcome, Outcome::Right | Outcome::Missed);
    let partly = |case: &&Judged| matches!(case.outcome, Outcome::Right | Outcome::Partly);
    let misleading = |case: &&Judged| case.names_wrongly() && case.fits_better();
    let (errors, covered) = parameters(cases);
    let rightly =
        || cases.iter().filter(|case| case.outcome == Outcome::Right && !case.answer.effects.is_empty());
    let closed = |error: fn(&Errors) -> f64| {
        rightly().filter_map(|case| case.closed(error)).map(|x| 100.0 * x).collect()
    };
    let seconds = cases.iter().filter(|case| case.truth.joints == 6 && case.truth.duration > 0.0);
    // A case consists of two recordings of that length.
    let seconds =
        seconds.map(|case| case.answer.cpu_seconds * RECORDING / (2.0 * case.truth.duration)).collect();
    vec![
        Goal::share(
            "false alarm on negative controls",
            "0",
            Share::among(sort(Sort::Negative), alarm),
            |x| x == 0.0,
        ),
        Goal::share(
            "verdict `named`: effect and joint right",
            "≥ 98 %",
            Share::among(named, is_right),
            |x| x >= 98.0,
        ),
        Goal::share(
            "effect and joint right among detected",
            "≥ 95 %",
            Share::among(detected, is_right),
            |x| x >= 95.0,
        ),
        Goal::share(
            "unknown physics not given a catalogue name",
            "≥ 90 %",
            Share::among(sort(Sort::Outside), unnamed),
            |x| x >= 90.0,
        ),
        Goal::share("two effects: both right", "≥ 80 %", Share::among(sort(Sort::Double), is_right), |x| {
            x >= 80.0
        }),
        Goal::share(
            "two effects: at least one right, none wrong",
            "≥ 97 %",
            Share::among(sort(Sort::Double), partly),
            |x| x >= 97.0,
        ),
        Goal::median("parameter error, median", "≤ 4 %", "%", errors, |x| x <= 4.0),
        Goal::share("95 % intervals that hold the truth", "93–97 %", covered, |x| {
            (93.0..=97.0).contains(&x)
        }),
        Goal::median("held-out error closed, median", "≥ 90 %", "%", closed(|e| e.after), |x| x >= 90.0),
        Goal::median("the same, tolerances tuned too", "–", "%", closed(|e| e.after_tuned), |_| true),
        Goal::share("better fit but wrong name", "≤ 0.5 %", Share::among(cases.iter(), misleading), |x| {
            x <= 0.5
        }),
        Goal::median("processor time, six axes, 16 s of recording", "≤ 5 s", "s", seconds, |x| x <= 5.0),
    ]
}

/// Relative errors, %, of all parameters of correctly named effects, and the share of intervals that contain the truth.
fn parameters(cases: &[Judged]) -> (Vec<f64>, Share) {
    let right = cases.iter().filter(|case| case.outcome == Outcome::Right);
    let hits: Vec<&ParameterScore> = right.flat_map(|case| &case.hits).collect();
    let errors = hits.iter().map(|hit| 100.0 * hit.error).collect();
    (errors, Share::among(hits.iter().filter_map(|hit| hit.covered), |covered| *covered))
}
