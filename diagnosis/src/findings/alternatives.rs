//! Other effects in the place of each finding, and how much less probable they are.

use std::collections::BTreeMap;

use freeplay_arm::Arm;

use crate::candidates::candidate::Candidate;
use crate::evidence::system::{Fit, Gain};
use crate::report::diagnosis::{Alternative, EvidenceRow};
use crate::report::words;
use crate::search::moves::Search;
use crate::search::tried::{Tried, tried};
use crate::sorting::sort_falling;
use crate::statistics::is_strong_evidence;

/// The alternatives to the members of `fit` for the report.
pub(crate) fn alternatives(search: &mut Search, fit: &Fit) -> Vec<Alternative> {
    tried(search, fit).iter().map(|tried| alternative(search, fit, tried)).collect()
}

fn alternative(search: &Search, fit: &Fit, &Tried { place, index, against }: &Tried) -> Alternative {
    let system = &search.system;
    let [named, other] = [fit.members[place], index].map(|index| system.candidate(index));
    instead(system.data.arm(), named, other, against)
}

/// The alternative `other` to the `named` effect; with it the log of the evidence falls by `against`.
pub(crate) fn instead(arm: &Arm, named: &Candidate, other: &Candidate, against: f64) -> Alternative {
    let separates = named.kind.confounders.iter().find(|(kind, _)| *kind == other.kind.name);
    let back = other.kind.confounders.iter().find(|(kind, _)| *kind == named.kind.name);
    let separation = match (separates, back) {
        (Some((_, words)), _) => format!("{} {words}", other.kind.title),
        (None, Some((_, words))) => format!("{} {words}", named.kind.title),
        (None, None) => "record a motion in which the two differ".to_owned(),
    };
    Alternative {
        kind: other.kind.name,
        joint: other.joint.map(|joint| arm.joints()[joint].name.clone()),
        instead_of: called(arm, named),
        why_not: words::odds_against(against),
        indistinguishable: !is_strong_evidence(against),
        what_would_separate: separation,
        log_odds_against: against,
    }
}

/// The most probable form of every kind at every place, alone and given the members of `fit`.
pub(crate) fn rows_of_evidence(search: &mut Search, bare: &Fit, fit: &Fit) -> Vec<EvidenceRow> {
    let [alone, beside] = [bare, fit].map(|fit| {
        // Tolerances that another fit holds at an edge would look like an explanation by a law.
        if search.system.hold_tolerances(fit).is_some() {
            search.system.gains(fit, &search.available)
        } else {
            Vec::new()
        }
    });
    let system = &search.system;
    let mut rows: BTreeMap<(&str, Option<usize>), EvidenceRow> = BTreeMap::new();
    for ((&index, alone), beside) in search.available.iter().zip(alone).zip(beside) {
        let candidate = system.candidate(index);
        let value =
            |gain: Option<Gain>| gain.filter(|gain| gain.is_inside).map_or(f64::MIN, |gain| gain.value);
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
    sort_falling(&mut rows, |row| row.alone);
    rows
}

/// The name of a candidate's kind and place, as in alternatives.
pub(crate) fn called(arm: &Arm, candidate: &Candidate) -> String {
    let joint = candidate.joint.map(|joint| arm.joints()[joint].name.as_str());
    format!("{} {}", candidate.kind.name, words::site(joint))
}
