//! What was tried in the place of each finding, and how much less probable it is.

use std::collections::BTreeMap;

use freeplay_arm::Arm;

use super::candidate::Candidate;
use super::conclude::{called, is_told};
use super::report::{Alternative, EvidenceRow};
use super::search::Search;
use super::system::{Fit, all_but};
use super::words;

/// Most things of a kind that are listed at once, as alternatives of a finding, findings in a sentence, or channels of a picture: a reader keeps so many in
/// mind, and tables hold the rest.
pub(crate) const LISTED: usize = 3;

/// Another effect in the place of a finding.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Tried {
    /// The finding's place among the members.
    pub place: usize,
    /// The number of the block that was put in its place.
    pub index: usize,
    /// The log of the evidence falls by this much; negative: it rises.
    pub against: f64,
}

/// The most probable others in the place of each member of `fit`: each was put there, in the form that explains most, beside the other members.
pub(crate) fn tried(search: &mut Search, fit: &Fit) -> Vec<Tried> {
    let mut all = Vec::new();
    // The search may have come to rest with other tolerances at an edge.
    if search.system.pin(fit).is_none() {
        return all;
    }
    for (place, &member) in fit.members.iter().enumerate() {
        let others = all_but(&fit.members, place);
        let (Some(without), Some(own)) = (search.system.fit(&others), search.system.held_fit(&fit.members))
        else {
            continue;
        };
        for index in nearest(search, &without, member) {
            let Some(index) = search.refined(&others, index) else { continue };
            let instead: Vec<usize> = others.iter().copied().chain([index]).collect();
            let Some(there) = search.system.held_fit(&instead) else { continue };
            all.push(Tried { place, index, against: own.value - there.value });
        }
    }
    all
}

/// The report lists these other effects in the places of the members of `fit`.
pub(crate) fn alternatives(search: &mut Search, fit: &Fit) -> Vec<Alternative> {
    tried(search, fit).iter().map(|tried| alternative(search, fit, tried)).collect()
}

/// The best forms of other effects that show where `member` does, most probable first.
fn nearest(search: &Search, without: &Fit, member: usize) -> Vec<usize> {
    let system = &search.system;
    let named = system.candidate(member);
    let may = |&index: &usize| {
        let other = system.candidate(index);
        let is_taken = without.members.iter().any(|&known| system.candidate(known).excludes(other));
        !is_taken && !other.same_effect(named) && other.meets(named) && !other.contains(named)
    };
    let candidates: Vec<usize> = search.laid.iter().copied().filter(may).collect();
    let gains = system.gains(without, &candidates);
    let mut best: BTreeMap<(&str, Option<usize>), (f64, usize)> = BTreeMap::new();
    for (&index, gain) in candidates.iter().zip(&gains) {
        let Some(gain) = gain.as_ref().filter(|gain| gain.is_inside) else { continue };
        let other = system.candidate(index);
        let entry = best.entry((other.kind.name, other.joint)).or_insert((gain.value, index));
        if gain.value > entry.0 {
            *entry = (gain.value, index);
        }
    }
    let mut order: Vec<(f64, usize)> = best.into_values().collect();
    order.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
    order.into_iter().take(LISTED).map(|(_, index)| index).collect()
}

fn alternative(search: &Search, fit: &Fit, &Tried { place, index, against }: &Tried) -> Alternative {
    let system = &search.system;
    let [named, other] = [fit.members[place], index].map(|index| system.candidate(index));
    instead(system.data.arm(), named, other, against)
}

/// That `other` in the place of what is `named` makes the log of the evidence fall by `against`.
pub(crate) fn instead(arm: &Arm, named: &Candidate, other: &Candidate, against: f64) -> Alternative {
    let separates = named.kind.confounders.iter().find(|(kind, _)| *kind == other.kind.name);
    let back = other.kind.confounders.iter().find(|(kind, _)| *kind == named.kind.name);
    let words = separates.or(back).map_or("a motion in which the two differ", |(_, words)| *words);
    Alternative {
        kind: other.kind.name,
        joint: other.joint.map(|joint| arm.joints()[joint].name.clone()),
        instead_of: called(arm, named),
        why_not: words::odds_against(against),
        indistinguishable: !is_told(against),
        what_would_separate: words.to_owned(),
        log_odds_against: against,
    }
}

/// The most probable form of every kind at every place, alone and beside the members of `fit`.
pub(crate) fn rows_of_evidence(search: &mut Search, bare: &Fit, fit: &Fit) -> Vec<EvidenceRow> {
    let [alone, beside] = [bare, fit].map(|fit| {
        // Tolerances that another fit holds at an edge would pass for what a law explains.
        if search.system.pin(fit).is_some() { search.system.gains(fit, &search.laid) } else { Vec::new() }
    });
    let system = &search.system;
    let mut rows: BTreeMap<(&str, Option<usize>), EvidenceRow> = BTreeMap::new();
    for ((&index, alone), beside) in search.laid.iter().zip(alone).zip(beside) {
        let candidate = system.candidate(index);
        let value = |gain: Option<super::system::Gain>| {
            gain.filter(|gain| gain.is_inside).map_or(f64::MIN, |gain| gain.value)
        };
        let row = rows.entry((candidate.kind.name, candidate.joint)).or_insert_with(|| EvidenceRow {
            kind: candidate.kind.name,
            joint: candidate.joint.map(|joint| system.data.arm().joints()[joint].name.clone()),
            alone: f64::MIN,
            beside: f64::MIN,
        });
        row.alone = row.alone.max(value(alone));
        row.beside = row.beside.max(value(beside));
    }
    let mut rows: Vec<EvidenceRow> = rows.into_values().filter(|row| row.alone > f64::MIN).collect();
    rows.iter_mut().for_each(|row| row.beside = row.beside.max(-1e9));
    rows.sort_by(|a, b| b.alone.total_cmp(&a.alone));
    rows
}
