//! Trials of other effects in the place of each finding.

use std::collections::BTreeMap;

use crate::evidence::system::{Fit, all_but};
use crate::search::moves::Search;

/// Longest list of one kind in a text: alternatives of a finding, findings in a sentence, or channels of a picture. A reader remembers so many; tables hold the
/// rest.
pub(crate) const LISTED: usize = 3;

/// Another effect in the place of a finding.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Tried {
    /// Index of the finding among the members.
    pub place: usize,
    /// The number of the block that replaces it.
    pub index: usize,
    /// Decrease of the log of the evidence; negative: the evidence increases.
    pub against: f64,
}

/// The most probable other effects for each member of `fit`: each replaces the member, in its best form, with the other members refitted.
pub(crate) fn tried(search: &mut Search, fit: &Fit) -> Vec<Tried> {
    let mut all = Vec::new();
    // The search may have ended with other tolerances at an edge.
    if search.system.hold_tolerances(fit).is_none() {
        return all;
    }
    for (place, &member) in fit.members.iter().enumerate() {
        let others = all_but(&fit.members, place);
        let (Some(without), Some(own)) =
            (search.system.fit(&others), search.system.fit_within_tolerances(&fit.members))
        else {
            continue;
        };
        for index in nearest(search, &without, member) {
            let Some(index) = search.refined(&others, index) else { continue };
            let instead: Vec<usize> = others.iter().copied().chain([index]).collect();
            let Some(there) = search.system.fit_within_tolerances(&instead) else { continue };
            all.push(Tried { place, index, against: own.value - there.value });
        }
    }
    all
}

/// The best forms of other effects in the channels of `member`, most probable first.
fn nearest(search: &Search, without: &Fit, member: usize) -> Vec<usize> {
    let system = &search.system;
    let named = system.candidate(member);
    let may = |&index: &usize| {
        let other = system.candidate(index);
        let is_taken = without.members.iter().any(|&known| system.candidate(known).excludes(other));
        !is_taken && !other.same_effect(named) && other.meets(named) && !other.contains(named)
    };
    let candidates: Vec<usize> = search.available.iter().copied().filter(may).collect();
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
