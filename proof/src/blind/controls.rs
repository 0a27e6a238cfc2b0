//! What the score is to be compared with: chance, a better fit without a name, and an oracle that knows what was concealed.

use serde::Serialize;

use super::interval::{Median, Share};
use super::score::Outcome;
use super::tally::{Judged, of_sort};
use super::truth::Sort;

/// The controls.
#[derive(Clone, Debug, Serialize)]
pub struct Controls {
    /// Cases with one effect whose answer is right.
    pub right: Share,
    /// The same if every case had the answer of another one, mean over all others: kind and joint.
    pub permuted: f64,
    /// The same, the kind alone.
    pub permuted_kind: f64,
    /// Cases with one effect in which the concealed kind at its joint, known beforehand, explains more than the least that counts: what
    /// an oracle that knows the structure could name at best.
    pub oracle: Share,
    /// Held-out error closed by the named effects, % of what is above the floor, where the name is right.
    pub closed_by_name: Option<Median>,
    /// The same by the tolerances alone, nothing added and nothing named.
    pub closed_by_tuning: Option<Median>,
    /// The same by an unnamed correction.
    pub closed_by_black_box: Option<Median>,
}

impl Controls {
    /// Of `cases`.
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

/// The mean share of right answers if every case had the answer of each other one: kind and joint, kind alone. What is the same by
/// another name counts here as it does in the score.
fn permuted(singles: &[&Judged]) -> (f64, f64) {
    let (mut same, mut same_kind, mut pairs) = (0_usize, 0_usize, 0_usize);
    for (i, case) in singles.iter().enumerate() {
        let concealed = &case.truth.effects[0];
        for (j, other) in singles.iter().enumerate() {
            if i != j {
                pairs += 1;
                let named = other.answer.verdict == "named";
                let effects = &other.answer.effects;
                let all = concealed.said_by(effects).len();
                same += usize::from(named && all > 0 && all == effects.len());
                same_kind += usize::from(named && effects.len() == 1 && effects[0].kind == concealed.kind);
            }
        }
    }
    let share = |count: usize| count as f64 / pairs.max(1) as f64;
    (share(same), share(same_kind))
}

/// Whether the concealed kind at its joint, or what is the same by another name, explains more than the least that counts.
pub fn oracle(case: &Judged) -> bool {
    let concealed = &case.truth.effects[0];
    let others = concealed.equivalents.iter().flat_map(|e| e.kinds.iter().map(move |kind| (kind, &e.joint)));
    let wanted: Vec<_> = std::iter::once((&concealed.kind, &concealed.joint)).chain(others).collect();
    case.answer
        .hypotheses
        .iter()
        .any(|row| wanted.contains(&(&row.kind, &row.joint)) && row.alone > row.threshold)
}
