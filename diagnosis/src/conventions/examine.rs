//! The examination from end to end: from a recording to the faults of its reading.

use std::collections::BTreeSet;

use freeplay_arm::{Arm, JointKind};
use freeplay_recording::{Recording, unwrapped};

use super::change::{Change, reading};
use super::finding::{Certainty, Setup, SetupFinding};
use super::kinds;
use super::kinds::Results;
use super::odds::ChangeOdds;
use super::outcome::Outcome;
use super::problem::Links;
use super::reading::Reading;
use super::samples::Samples;
use super::search::{MEMORY, Search};
use crate::statistics::STRONG;

/// Changes, each with an alternative that explains the data equally well, in words.
type Rivals = Vec<(Change, String)>;

/// Least odds for correcting a change without asking, after price and prior odds: a wrong reading spoils all later results, so that one correction in a
/// thousand may be wrong, not one in twenty.
const OVERWHELMING: f64 = 1000.0;

/// Examines whether `recording` and `arm` describe the same arm, in the same units, signs and order, and on the same clock.
pub fn examine(arm: &Arm, recording: &Recording) -> Setup {
    let mut setup = Setup { findings: Vec::new(), reading: Reading::plain(arm.dof()), stop: None };
    if recording.joints() != arm.dof() {
        return setup;
    }
    let mut raw = recording.clone();
    if let Some(finding) = kinds::time_unit::found(recording) {
        setup.reading.time_unit = 1.0 / finding.value;
        raw.t.iter_mut().for_each(|t| *t *= setup.reading.time_unit);
        setup.findings.push(finding);
    }
    let wrapped = kinds::angle_wrap::found(arm, recording);
    setup.reading.unwrap = !wrapped.is_empty();
    setup.findings.extend(wrapped);
    let frozen = kinds::frozen_channel::found(arm, recording);
    if let Some((finding, _)) = frozen.iter().find(|(_, is_position)| *is_position) {
        setup.stop = Some(finding.statement.clone());
    }
    setup.findings.extend(frozen.into_iter().map(|(finding, _)| finding));
    let turning = |joint: usize| arm.joints()[joint].kind == JointKind::Revolute;
    let columns = recording.q.iter().enumerate();
    let q: Vec<Vec<f64>> = columns
        .map(|(joint, q)| {
            let smooth = if turning(joint) { unwrapped(q) } else { None };
            smooth.unwrap_or_else(|| q.clone())
        })
        .collect();
    let Ok(mut samples) = Samples::new(&raw, &q) else { return setup };
    if setup.stop.is_some() || samples.len() <= arm.dof() + MEMORY {
        return setup;
    }
    // If no arm can move as far or as fast, the unit needs no further test.
    let jumps: Vec<bool> = q.iter().zip(&recording.q).map(|(smooth, q)| smooth != q).collect();
    let by_motion = kinds::angle_unit::by_motion(arm, &samples.motion, &jumps);
    if let Some(finding) = by_motion {
        setup.findings.push(finding);
        setup.reading.positions = reading(arm, &[Change::AngleUnit]).positions;
        for order in &mut samples.motion {
            *order = setup.reading.motion(order, false);
        }
    }
    Examination { arm, recording, samples: &samples }.conclude(&mut setup);
    setup
}

struct Examination<'a> {
    arm: &'a Arm,
    recording: &'a Recording,
    samples: &'a Samples,
}

impl Examination<'_> {
    fn conclude(&self, setup: &mut Setup) {
        let (has_torques, has_tool) = (self.samples.has_torques(), self.samples.has_tool());
        if !has_torques && !has_tool {
            return;
        }
        let mut search = Search::new(self.arm, self.samples);
        let first = search.best();
        search.weigh(&first);
        let first = search.again(&first);
        let (mut best, mut certain, mut rivals) = self.settled(&search, first);
        let mut other = self.other(&search, &best, &certain);
        if other.is_some() || self.sorts(&best) > 2 {
            // The search adds one change after the other. Before it reports another arm or more than two faults, it also starts from pairs.
            let pair = self.settled(&search, search.of_pairs());
            if pair.0.evidence > best.evidence {
                (best, certain, rivals) = pair;
                other = self.other(&search, &best, &certain);
            }
        }
        if let Some(other) = other {
            let still = kinds::frozen_channel::suspected(self.arm, self.recording);
            let finding = still.unwrap_or(other);
            // A torque alone can be far from any model; geometry can't.
            setup.stop = (finding.certainty == Certainty::Sure).then(|| finding.statement.clone());
            setup.findings.push(finding);
            return;
        }
        // A position that seems frozen lacks the motion of its joint. Changes of that joint only compensate the lack: the program rejects them.
        let still = self.left_still(&best);
        if let Some(still) = &still {
            let name = |joint: usize| self.arm.joints()[joint].name.clone();
            certain.retain(|change| change.joint().map(name) != still.joint);
        }
        let results = Results { arm: self.arm, best: &best, certain: &certain, rivals: &rivals };
        setup.findings.extend(kinds::findings(&results));
        self.take(setup, &certain);
        for change in &certain {
            match *change {
                Change::Scale(joint) | Change::SameScale(joint, _) => {
                    setup.reading.torques[joint].factor /= kinds::torque_unit::exact(best.scale[joint]);
                }
                Change::CommonScale => {
                    let each = setup.reading.torques.iter_mut().zip(&best.scale);
                    each.for_each(|(torque, scale)| torque.factor /= kinds::torque_unit::exact(*scale));
                }
                Change::AnyGravity => setup.reading.gravity = Some(best.gravity),
                _ => {}
            }
        }
        setup.findings.extend(still);
    }

    /// Number of different sorts of readings in `best` that no law of the catalogue covers.
    fn sorts(&self, best: &Outcome) -> usize {
        self.large(best, &best.readings()).iter().map(Change::sort).collect::<BTreeSet<u8>>().len()
    }

    /// The finding that the recording comes from another arm; `None` if the reading of `best` explains it better.
    fn other(&self, search: &Search, best: &Outcome, certain: &[Change]) -> Option<SetupFinding> {
        // Torques without gravity are small, and the rigid arm explains little of them.
        let is_silent = certain.contains(&Change::Compensated);
        let is_silent = is_silent || !self.samples.has_torques();
        let other = kinds::another_arm::found(best, self.arm.dof(), is_silent, self.samples.has_tool());
        other.or_else(|| self.is_another(search, best).then(kinds::another_arm::by_evidence))
    }

    /// Returns true if another arm explains the recording better than the reading of `settled`, in which every change is certain. The other arm has links of
    /// any inertia, with or without joint zeros of its own; the links of the model have the error of a data sheet. A single link is equivalent to a unit of its
    /// torque.
    fn is_another(&self, search: &Search, settled: &Outcome) -> bool {
        let is_large = |change: &Change| change.is_reading() && !kinds::is_small(self.arm, settled, change);
        let is_misread = settled.changes.iter().any(is_large);
        // Torques without gravity hold little information about an arm.
        if !is_misread || settled.changes.contains(&Change::Compensated) || self.arm.dof() < 2 {
            return false;
        }
        let worth = |links| search.whole.with_links(settled, links);
        let others = [false, true].map(|own_zeros| worth(Links::Any { own_zeros }));
        let best = others.into_iter().flatten().reduce(f64::max);
        best.zip(worth(Links::OfSheet)).is_some_and(|(another, sheet)| another > sheet)
    }

    /// Stores the reading of the certain changes, with the units and angle wraps known before.
    fn take(&self, setup: &mut Setup, sure: &[Change]) {
        let known = setup.reading.clone();
        setup.reading =
            Reading { time_unit: known.time_unit, unwrap: known.unwrap, ..reading(self.arm, sure) };
        for (position, known) in setup.reading.positions.iter_mut().zip(&known.positions) {
            position.unit *= known.unit;
        }
    }

    /// The best set in which every change is certain or small: the function drops the others one by one, and judges the rest anew.
    fn settled(&self, search: &Search, mut best: Outcome) -> (Outcome, Vec<Change>, Rivals) {
        loop {
            if let Some(kept) = self.speaking(search, &best) {
                // Parameters that were fitted together with such a unit need a new fit.
                best = search.refitted(&kept);
                let readings = best.readings();
                best = search.best_with_physics(&readings, &self.large(&best, &readings), None);
                continue;
            }
            let judged = self.judged(search, &best);
            let unsure = judged.iter().filter(|(_, margin)| *margin <= 0.0);
            let Some((least, _)) = unsure.min_by(|a, b| a.1.total_cmp(&b.1)) else {
                let certain: Vec<Change> = judged.into_iter().map(|(change, _)| change).collect();
                let rivals = certain.iter().filter_map(|change| {
                    let rest = without(&best.changes, change);
                    self.rival(search, &best, change, &rest).map(|words| (*change, words))
                });
                let rivals = rivals.collect();
                return (best, certain, rivals);
            };
            let mut kept = without(&best.changes, least);
            kept.retain(Change::is_reading);
            best = search.best_with_physics(&kept, &self.large(&best, &kept), None);
        }
    }

    /// The changes of `best` without torque units that carry no evidence: those of channels whose torque is as probable without the rigid arm. Such a unit
    /// hides the evidence of other readings in its channel. `None` if there is no such unit.
    fn speaking(&self, search: &Search, best: &Outcome) -> Option<Vec<Change>> {
        if !best.is_possible() {
            return None;
        }
        let problem = &search.whole;
        // A torque unrelated to the arm is as rare as one in another unit: only the parameter of the unit has a price.
        let massless = problem.without_arm(&best.changes);
        let price = problem.log_price(best);
        let is_silent = |change: &Change| match *change {
            Change::Scale(joint) | Change::SameScale(joint, _)
                if !kinds::is_small(self.arm, best, change) =>
            {
                let worth = |left| problem.log_likelihood(best.sources[joint], left, best.floors[joint]);
                best.likelihood[joint] - worth(massless[joint]) - price < STRONG
            }
            _ => false,
        };
        let kept: Vec<Change> = best.changes.iter().filter(|change| !is_silent(change)).copied().collect();
        (kept.len() < best.changes.len()).then_some(kept)
    }

    /// The `changes` of `best` that no law of the catalogue covers.
    fn large(&self, best: &Outcome, changes: &[Change]) -> Vec<Change> {
        changes.iter().copied().filter(|change| !kinds::is_small(self.arm, best, change)).collect()
    }

    /// The changes of `best` that no law of the catalogue covers, each with the margin of its certainty.
    fn judged(&self, search: &Search, best: &Outcome) -> Vec<(Change, f64)> {
        let asked = self.large(best, &best.readings());
        if !best.is_possible() {
            return asked.into_iter().map(|change| (change, f64::NEG_INFINITY)).collect();
        }
        let odds = ChangeOdds::new(&search.whole, best);
        asked.into_iter().map(|change| (change, self.margin(search, &odds, &change))).collect()
    }

    /// Log odds of `change` in `set` against the best set without it, minus the required log odds: [`OVERWHELMING`] with the links of the model, those of a
    /// name with links within the error of a data sheet.
    fn margin(&self, search: &Search, set: &ChangeOdds, change: &Change) -> f64 {
        let best = set.best;
        let is_comparable = |other: &Outcome| other.likelihood.len() == best.likelihood.len();
        let rest = without(&best.changes, change);
        let readings: Vec<Change> = rest.iter().copied().filter(Change::is_reading).collect();
        // The scale of a torque with the wrong sign is negative: without the change, the joint's other changes may be void, too.
        let others: Vec<Change> =
            readings.iter().copied().filter(|other| other.joint() != change.joint()).collect();
        // If no other reading is possible without the change, the recording as it stands is the rival.
        let starts = [readings.as_slice(), &others, &[]];
        let rivals = starts
            .iter()
            .map(|start| search.best_with_physics(start, &self.large(best, start), Some(change.sort())));
        let Some(other) = rivals.into_iter().find(is_comparable) else {
            return f64::NEG_INFINITY;
        };
        // Physics that fits one reading may be impossible under another.
        let same = Some(search.whole.outcome(&rest)).filter(Outcome::is_possible);
        let same = same.unwrap_or_else(|| other.clone());
        let odds = set.by_channels(change, &other, &same);
        (odds - OVERWHELMING.ln()).min(set.by_sheet(&other) - STRONG)
    }

    /// Another change of the same joint that explains the data equally well.
    fn rival(&self, search: &Search, best: &Outcome, change: &Change, rest: &[Change]) -> Option<String> {
        let joint = change.joint()?;
        let others = [
            Change::Direction { joint, with_torque: true },
            Change::Direction { joint, with_torque: false },
            Change::TorqueSign(joint),
            Change::Zero { joint, offset: std::f64::consts::PI, is_fitted: false },
        ];
        let others = others.into_iter().filter(|other| other != change);
        let as_good = others.filter(|other| {
            let set = [rest, &[*other]].concat();
            search.whole.outcome(&set).evidence > best.evidence - STRONG
        });
        as_good.map(|other| kinds::briefly(self.arm, &other)).next()
    }

    /// A position that never changes, in a recording that no reading explains.
    fn left_still(&self, best: &Outcome) -> Option<SetupFinding> {
        let is_odd = best.left.iter().any(|left| *left > kinds::another_arm::UNEXPLAINED);
        kinds::frozen_channel::suspected(self.arm, self.recording)
            .filter(|_| is_odd)
            .map(|finding| SetupFinding { certainty: Certainty::Likely, ..finding })
    }
}

/// `changes` without `change`; all exchanges together count as one order.
fn without(changes: &[Change], change: &Change) -> Vec<Change> {
    let is_order = matches!(change, Change::Exchange(..));
    let stays = |other: &&Change| **other != *change && !(is_order && matches!(other, Change::Exchange(..)));
    changes.iter().filter(stays).copied().collect()
}
