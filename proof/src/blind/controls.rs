//! Controls for the score: chance, a better fit without a name, and an oracle that knows the concealed kind.

use std::collections::HashMap;

use serde::Serialize;

use super::answer::Named;
use super::confidence_intervals::{Median, Share};
use super::judged::{Judged, of_sort};
use super::score::Outcome;
use super::truth::{Concealed, Sort, TruthKey};

/// The controls.
#[derive(Clone, Debug, Serialize)]
pub struct Controls {
    /// Cases with one effect whose answer is right.
    pub right: Share,
    /// Mean share of right answers if every case had the answer of another one, over all others: kind and joint.
    pub permuted: f64,
    /// The same, the kind alone.
    pub permuted_kind: f64,
    /// Cases with one effect in which the concealed kind at its joint, known beforehand, exceeds the required score: the best that an oracle with this
    /// knowledge could name.
    pub oracle: Share,
    /// Reduction of the held-out error above the floor by the named effects, %, if the name is right.
    pub closed_by_name: Option<Median>,
    /// The same by the tolerances alone, without an effect.
    pub closed_by_tuning: Option<Median>,
    /// The same by an unnamed correction.
    pub closed_by_black_box: Option<Median>,
}

impl Controls {
    /// The controls of `cases`.
    pub fn of(cases: &[Judged]) -> Self {
        let singles: Vec<&Judged> = of_sort(cases, Sort::Single).collect();
        let right = || cases.iter().filter(|case| case.outcome == Outcome::Right);
        let closed = |error: fn(&super::answer::Errors) -> f64| {
            Median::new(right().filter_map(|case| case.closed(error)).map(|x| 100.0 * x).collect())
        };
        let (permuted, permuted_kind) = permuted(&singles);
        Self {
            right: Share::among(singles.iter(), |case| case.outcome == Outcome::Right),
            permuted,
            permuted_kind,
            oracle: Share::among(singles.iter(), |case| oracle(case)),
            closed_by_name: closed(|e| e.after_tuned),
            closed_by_tuning: closed(|e| e.tuned),
            closed_by_black_box: closed(|e| e.black_box),
        }
    }
}

/// The mean share of right answers if every case had the answer of each other one: kind and joint, kind alone. Equivalents count here as in the score.
///
/// The function first counts equal truths and equal answers, so that it compares each pair of kind and joint once.
fn permuted(singles: &[&Judged]) -> (f64, f64) {
    let mut truths: HashMap<TruthKey, (&Concealed, usize)> = HashMap::new();
    let mut answers: HashMap<AnswerKey, (&[Named], usize)> = HashMap::new();
    let (mut same, mut same_kind) = (0_usize, 0_usize);
    let mut own = [0_usize; 2];
    for case in singles {
        let concealed = &case.truth.effects[0];
        truths.entry(concealed.key()).or_insert((concealed, 0)).1 += 1;
        if case.answer.verdict == "named" {
            let effects = case.answer.effects.as_slice();
            let key = effects.iter().map(|effect| (effect.kind.as_str(), effect.joint.as_deref())).collect();
            answers.entry(key).or_insert((effects, 0)).1 += 1;
            // A case does not count with its own answer here.
            for (count, hit) in own.iter_mut().zip(hits(concealed, effects)) {
                *count += usize::from(hit);
            }
        }
    }
    for (concealed, cases) in truths.values() {
        for (effects, times) in answers.values() {
            let [all, kind] = hits(concealed, effects);
            same += usize::from(all) * cases * times;
            same_kind += usize::from(kind) * cases * times;
        }
    }
    let pairs = singles.len() * singles.len().saturating_sub(1);
    let share = |count: usize| count as f64 / pairs.max(1) as f64;
    (share(same - own[0]), share(same_kind - own[1]))
}

/// Kind and joint of all effects in an answer, in its order.
type AnswerKey<'a> = Vec<(&'a str, Option<&'a str>)>;

/// True if an answer with `effects` names exactly the concealed effect: by kind and joint, and by kind alone.
fn hits(concealed: &Concealed, effects: &[Named]) -> [bool; 2] {
    let all = concealed.stated_by(effects).len();
    [all > 0 && all == effects.len(), effects.len() == 1 && effects[0].kind == concealed.kind]
}

/// True if the concealed kind at its joint, or an equivalent, exceeds the required score.
pub fn oracle(case: &Judged) -> bool {
    let concealed = &case.truth.effects[0];
    case.answer.hypotheses.iter().any(|row| concealed.names(row) && row.alone > row.threshold)
}
