//! What else could stand in the place of what was named.

use std::collections::BTreeMap;

use super::conclude::Conclusion;
use super::hypothesis::Hypothesis;
use super::report::Alternative;
use super::search::TOLD_APART;
use super::words;

/// Most alternatives that are listed.
const ALTERNATIVES: usize = 6;

impl Conclusion<'_, '_, '_> {
    /// What else could stand in the place of each named effect, the closest first.
    pub(super) fn alternatives(&self) -> Vec<Alternative> {
        let search = self.search;
        let mut all = Vec::new();
        for (index, chosen) in search.chosen.iter().enumerate() {
            let named = &search.hypotheses[chosen.hypothesis];
            let Some(fit) = search.system.fit(&search.active(Some(index))) else { continue };
            let Some(all_in) = search.system.fit(&search.active(None)) else { continue };
            let weighing = search.case.weigh(&search.system.residual(&all_in));
            let merit = search.merit(named, chosen.gain, &weighing);
            let mut best: BTreeMap<(&str, Option<usize>), (f64, &Hypothesis)> = BTreeMap::new();
            for other in &search.hypotheses {
                let taken = search.chosen.iter().any(|c| search.hypotheses[c.hypothesis].same_effect(other));
                let refuted = search.vetoed.contains(&(other.kind.name, other.joint));
                // What has a name keeps it beside what has none, unless that explains more.
                let nameless = !other.kind.is_catalogued();
                if taken || refuted || nameless || named.contains(other) || other.contains(named) {
                    continue;
                }
                let Some(score) = search.system.score(&fit, &other.block) else { continue };
                if !other.is_physical(&score) {
                    continue;
                }
                // What it explains beside the named effect is no reason to put it in that one's place.
                let beside = search.system.score(&all_in, &other.block).map_or(0.0, |score| score.gain);
                let others = search.merit(other, score.gain - beside, &weighing);
                let entry = best.entry((other.kind.name, other.joint)).or_insert((others, other));
                if others > entry.0 {
                    *entry = (others, other);
                }
            }
            for entry in best.values_mut() {
                let block = &entry.1.block;
                let exact = search.system.exact_score(&fit, block);
                let beside = search.system.exact_score(&all_in, block).map_or(0.0, |score| score.gain);
                let exact = exact.filter(|score| entry.1.is_physical(score));
                let gain = exact.map_or(0.0, |score| score.gain - beside);
                entry.0 = search.merit(entry.1, gain, &weighing);
            }
            let explained = |merit_: f64| 100.0 * (1.0 - merit_ / merit.max(f64::MIN_POSITIVE));
            all.extend(best.into_values().map(|(others, other)| {
                let behind = merit - others;
                let indistinguishable = behind < TOLD_APART;
                let instead_of =
                    format!("{} {}", named.kind.name, words::site(self.joint_name(named.joint).as_deref()));
                let why_not = if indistinguishable {
                    "says it as well in this motion".to_owned()
                } else {
                    format!("explains {:.0} % less", explained(others).clamp(0.0, 100.0))
                };
                Alternative {
                    kind: other.kind.name,
                    joint: self.joint_name(other.joint),
                    instead_of,
                    why_not,
                    indistinguishable,
                    what_would_separate: separates(named, other),
                    log_odds_against: 0.5 * behind,
                }
            }));
        }
        all.sort_by(|a, b| a.log_odds_against.total_cmp(&b.log_odds_against));
        let sure = all.iter().filter(|alternative| alternative.indistinguishable).count();
        all.truncate(sure.max(ALTERNATIVES));
        all
    }
}

/// What separates two kinds, by the catalogue.
fn separates(named: &Hypothesis, other: &Hypothesis) -> String {
    if named.kind.name == other.kind.name {
        return "a motion in which the two joints do not move alike".to_owned();
    }
    let of = |a: &Hypothesis, b: &Hypothesis| {
        a.kind
            .confounders
            .iter()
            .find(|(kind, _)| *kind == b.kind.name)
            .map(|(kind, how)| format!("{kind} {how}"))
    };
    of(named, other)
        .or_else(|| of(other, named))
        .unwrap_or_else(|| "a motion that varies speed, load and position independently".to_owned())
}
