//! The findings of a search: the laws that are certain, that the test part confirms and whose coefficients cannot all be zero.

use std::collections::BTreeMap;

use freeplay_arm::Arm;
use freeplay_laws::{ArmParts, LawError, Placed, changed};
use freeplay_model::{ArmFile, EffectTable};
use nalgebra::DVector;

use crate::candidates::candidate::Candidate;
use crate::data::columns::less;
use crate::data::parts::Part;
use crate::data::stacked::Data;
use crate::data::tolerance::Nuisance;
use crate::evidence::gain::Compared;
use crate::evidence::nameless::is_unexplained;
use crate::evidence::system::{Fit, all_but};
use crate::findings::event::{Event, contribution_of};
use crate::findings::held::held_joints;
use crate::findings::interval::{Estimate, estimates};
use crate::findings::joined::joined;
use crate::report::diagnosis::{Effect, Evidence};
use crate::report::settings::DiagnoseSettings;
use crate::report::words;
use crate::search::moves::{EffectSet, Search};
use crate::sorting::{sort_falling, sort_rising};
use crate::statistics::is_strong_evidence;

/// A fit whose members the test part confirms.
struct BorneOut {
    fit: Fit,
    /// Residuals of the arm file that the members make, by channel and row.
    residual: Vec<Vec<f64>>,
    /// For each member, the fit without it.
    without: Vec<Without>,
    /// Weights of the rows of the test part, by channel.
    on_test: Vec<Vec<f64>>,
}

impl BorneOut {
    /// The number of the member to remove where all members together predict a channel of the test part worse than the `tuned` model without laws: of those that
    /// show there, the one without which the least error is left. Members that the test part confirms one by one may do so, if each takes away an error that another
    /// one makes.
    fn harmful(&self, tuned: &[Vec<f64>]) -> Option<usize> {
        let squares = |residual: &[Vec<f64>], c: usize| -> f64 {
            residual[c].iter().zip(&self.on_test[c]).map(|(x, weight)| weight * x * x).sum()
        };
        let worse: Vec<usize> = (0..self.on_test.len())
            .filter(|&c| is_strong_evidence(0.5 * (squares(&self.residual, c) - squares(tuned, c))))
            .collect();
        let left = |one: &Without| worse.iter().map(|&c| squares(&one.residual, c)).sum::<f64>();
        let shows_there = |one: &Without| one.exists && one.shown.iter().any(|c| worse.contains(c));
        let places = (0..self.without.len()).filter(|&place| shows_there(&self.without[place]));
        places.min_by(|&a, &b| left(&self.without[a]).total_cmp(&left(&self.without[b])))
    }
}

/// The fit without one of its members.
struct Without {
    fit: Fit,
    /// Residuals of that fit, by channel and row.
    residual: Vec<Vec<f64>>,
    /// The channels of the test part in which the member shows: see [`Tested::shown`].
    shown: Vec<usize>,
    /// True if the other members make an arm that can exist.
    exists: bool,
}

/// Change of the errors in the test part between the model without and with a law.
struct Tested {
    /// The channels in which the law shows; empty if these rows are too few to decide, by 20 to 1, whether the law is true.
    shown: Vec<usize>,
    /// Reduction of the weighted squares by the law, in the channels where it shows.
    where_shown: f64,
    /// Reduction of the weighted squares by the law, in all channels.
    squares: f64,
}

impl Tested {
    /// The smaller of the two reductions of the weighted squares: where the law shows, and in all channels. `None` if the test part can't decide.
    fn gain(&self) -> Option<f64> {
        (!self.shown.is_empty()).then(|| self.where_shown.min(self.squares))
    }
}

/// The answer of a search, with the data for its tests.
pub(crate) struct Standing<'c, 'd, 'a> {
    pub file: &'c ArmFile,
    pub settings: &'c DiagnoseSettings,
    pub search: &'c mut Search<'d, 'a>,
    pub answer: &'c EffectSet,
    /// Transient events, which the search does not model.
    pub events: &'c [Event],
    /// Measured minus the model as given.
    pub target: &'c [Vec<f64>],
}

/// A finding on its way to a report, with its evidence.
pub(super) struct Finding {
    pub of: Cause,
    pub table: EffectTable,
    pub effect: Effect,
}

/// The law or the event behind a finding.
pub(super) enum Cause {
    /// A permanent law, by the number of its block.
    Law(usize),
    /// An event, by its number.
    Event(usize),
    /// Dry friction that holds a joint at rest.
    Hold,
}

impl Cause {
    /// The number of the block of a law.
    fn member(&self) -> Option<usize> {
        match self {
            Self::Law(member) => Some(*member),
            Self::Event(_) | Self::Hold => None,
        }
    }
}

impl<'d, 'a> Standing<'_, 'd, 'a> {
    pub(super) fn data(&self) -> &'d Data<'a> {
        self.search.system.data
    }

    pub(super) fn arm(&self) -> &Arm {
        &self.file.arm
    }

    /// The numbers of the laws that pass all tests, and true if their residual demands a law outside the catalogue.
    ///
    /// # Errors
    /// See [`LawError`]; `None` if a fit is singular.
    pub fn stands(mut self) -> Result<Option<(Vec<usize>, bool)>, LawError> {
        let Some((fit, _)) = self.standing()? else { return Ok(None) };
        let leaves_more = self.leaves_more(&fit);
        Ok(Some((fit.members, leaves_more)))
    }

    /// The laws that are certain, that the test part confirms and whose coefficients cannot all be zero, with their evidence.
    pub(super) fn standing(&mut self) -> Result<Option<(Fit, Vec<Finding>)>, LawError> {
        let mut members = self.answer.members.clone();
        let mut is_first = true;
        let (members, mut findings) = loop {
            let Some(fit) = self.search.system.fit_within_tolerances(&members) else { return Ok(None) };
            let Some(fit) = self.certain(fit) else { return Ok(None) };
            let certain = fit.members.clone();
            let Some(borne_out) = self.borne_out(fit)? else { return Ok(None) };
            let Some(findings) = self.findings(&borne_out)? else { return Ok(None) };
            let kept: Vec<usize> = findings.iter().filter_map(|finding| finding.of.member()).collect();
            let (kept, empty): (Vec<_>, Vec<_>) =
                certain.into_iter().partition(|member| kept.contains(member));
            if empty.is_empty() {
                break (kept, findings);
            }
            members = kept;
            // A rejected law may have imitated another law, so the search runs once more without it. On a machine that many laws describe in part, repeating
            // the search until no law fails takes minutes.
            if std::mem::take(&mut is_first) {
                let Some(better) = self.searched_without(&empty, members)? else { return Ok(None) };
                members = better;
            }
        };
        let Some(fit) = self.search.system.fit_within_tolerances(&members) else { return Ok(None) };
        // Without the members whose coefficients may all be zero, the others may make an arm that can't exist.
        let Some(fit) = self.certain(fit) else { return Ok(None) };
        findings.retain(|finding| finding.of.member().is_none_or(|member| fit.members.contains(&member)));
        Ok(Some((fit, findings)))
    }

    /// `kept`, or what the test part leaves of the laws that the search finds from there without the `rejected` laws: those under which all parts are more probable.
    /// `None` if the system is singular.
    fn searched_without(
        &mut self,
        rejected: &[usize],
        kept: Vec<usize>,
    ) -> Result<Option<Vec<usize>>, LawError> {
        self.search.leave_out(rejected);
        let better = self.search.improve(kept.clone(), &mut |_| {});
        let Some(better) = better.and_then(|better| self.search.made_consistent(&better)) else {
            return Ok(None);
        };
        if self.search.same_effects(&better.members, &kept) {
            return Ok(Some(better.members));
        }
        let fit = self.search.system.fit_within_tolerances(&better.members);
        let Some(fit) = fit.and_then(|fit| self.certain(fit)) else { return Ok(None) };
        let Some(borne_out) = self.borne_out(fit)? else { return Ok(None) };
        let mut best: Option<(f64, EffectSet)> = None;
        for members in [kept, borne_out.fit.members] {
            let Some((score, answer)) = self.with_test(members)? else { return Ok(None) };
            if best.as_ref().is_none_or(|(known, _)| score > *known) {
                best = Some((score, answer));
            }
        }
        let consistent = best.and_then(|(_, best)| self.search.made_consistent(&best));
        Ok(consistent.map(|answer| answer.members))
    }

    /// The log of the evidence of `members` and of the likelihood of the test part, all rows with the same weights, and the members with their discrepancies. `None`
    /// if the system is singular.
    fn with_test(&mut self, members: Vec<usize>) -> Result<Option<(f64, EffectSet)>, LawError> {
        let known = self.search.system.reset_robust_weights();
        let Some(answer) = known.and_then(|()| self.search.with_best_shares(members)) else {
            return Ok(None);
        };
        let Some(fit) = self.search.system.fit_within_tolerances(&answer.members) else { return Ok(None) };
        let Some(residual) = self.residual_if_possible(&fit)? else {
            return Ok(Some((f64::NEG_INFINITY, answer)));
        };
        let test = self.search.system.weights.on(self.data(), &[Part::Test]);
        Ok(Some((answer.evidence + test.score(&residual), answer)))
    }

    /// Removes from `fit` the members that are no findings: those with odds below 20 to 1 given the other members, and differences within the tolerances.
    fn certain(&self, mut fit: Fit) -> Option<Fit> {
        let system = &self.search.system;
        let step = 1.0 / self.data().recordings[0].prepared.treatment.rate_hz();
        loop {
            let (can_exist, mut least): (bool, Option<(f64, usize)>) = (self.can_exist(&fit), None);
            for place in 0..fit.members.len() {
                let others = all_but(&fit.members, place);
                let candidate = system.candidate(fit.members[place]);
                let parameters = candidate.parameters(system.coefficients(&fit, place));
                let odds = if self.settings.tolerances.hold(candidate.kind, &parameters, step) {
                    f64::NEG_INFINITY
                } else if can_exist || self.changes_arm(&fit, place) {
                    fit.value - system.fit_within_tolerances(&others)?.value
                } else {
                    f64::INFINITY
                };
                if least.is_none_or(|(known, _)| odds < known) {
                    least = Some((odds, place));
                }
            }
            let is_sure = |(odds, _): &(f64, usize)| is_strong_evidence(*odds) && can_exist;
            let Some((_, place)) = least.filter(|least| !is_sure(least)) else { return Some(fit) };
            fit = system.fit_within_tolerances(&all_but(&fit.members, place))?;
        }
    }

    /// Removes from `fit` the members that the test part contradicts, one by one and all together. `None` if a fit is singular.
    fn borne_out(&self, mut fit: Fit) -> Result<Option<BorneOut>, LawError> {
        let system = &self.search.system;
        let Some(none) = system.fit_within_tolerances(&[]) else { return Ok(None) };
        let (tuned, mut residual) = (self.residual(&none)?, self.residual(&fit)?);
        let mut on_test = system.weights.on(system.data, &[Part::Test]).by_row();
        loop {
            let Some(mut each) = self.each_borne_out(fit, residual, on_test)? else { return Ok(None) };
            let Some(place) = each.harmful(&tuned) else { return Ok(Some(each)) };
            Without { fit, residual, .. } = each.without.swap_remove(place);
            on_test = each.on_test;
        }
    }

    /// Removes from `fit`, with its `residual`, each member that the test part contradicts: the arm file predicts these rows worse with the member, or the odds for it,
    /// these rows included, fall below 20 to 1. `None` if a fit is singular.
    fn each_borne_out(
        &self,
        mut fit: Fit,
        mut residual: Vec<Vec<f64>>,
        on_test: Vec<Vec<f64>>,
    ) -> Result<Option<BorneOut>, LawError> {
        'fits: loop {
            let Some(order) = self.least_first(&fit, &on_test) else { return Ok(None) };
            let mut without = BTreeMap::new();
            for (place, others) in order {
                // Without this law another one may make an arm that can't exist. The residual then comes from the linear columns.
                let exact = self.residual_if_possible(&others)?;
                let exists = exact.is_some();
                let residual_without = exact.unwrap_or_else(|| self.search.system.residual(&others));
                let tested = self.tested(&fit, place, &on_test, [&residual, &residual_without]);
                let odds = fit.value - others.value + 0.5 * tested.squares;
                if exists && (!is_strong_evidence(odds) || tested.gain().is_some_and(|gain| gain <= 0.0)) {
                    (fit, residual) = (others, residual_without);
                    continue 'fits;
                }
                let one = Without { fit: others, residual: residual_without, shown: tested.shown, exists };
                without.insert(place, one);
            }
            return Ok(Some(BorneOut { fit, residual, without: without.into_values().collect(), on_test }));
        }
    }

    /// The number of each member of `fit` and the fit without it. The member comes first that reduces the test part's error least by its linear columns.
    fn least_first(&self, fit: &Fit, on_test: &[Vec<f64>]) -> Option<Vec<(usize, Fit)>> {
        let system = &self.search.system;
        let residual = system.residual(fit);
        let mut order = Vec::new();
        for place in 0..fit.members.len() {
            let others = system.fit_within_tolerances(&all_but(&fit.members, place))?;
            let tested = self.tested(fit, place, on_test, [&residual, &system.residual(&others)]);
            order.push((tested.gain().unwrap_or(f64::INFINITY), place, others));
        }
        sort_rising(&mut order, |(gain, ..)| *gain);
        Some(order.into_iter().map(|(_, place, others)| (place, others)).collect())
    }

    /// Errors in rows with these `weights` with and without the member number `place` of `fit`; `with` and `without` are these errors, by channel and row.
    fn tested(
        &self,
        fit: &Fit,
        place: usize,
        weights: &[Vec<f64>],
        [with, without]: [&[Vec<f64>]; 2],
    ) -> Tested {
        let more = |c: usize| {
            let rows = with[c].iter().zip(&without[c]).zip(&weights[c]);
            rows.fold([0.0, 0.0], |[fallen, moved], ((with, without), weight)| {
                [
                    fallen + weight * (without * without - with * with),
                    moved + weight * (without - with).powi(2),
                ]
            })
        };
        let more: Vec<[f64; 2]> = (0..weights.len()).map(more).collect();
        let candidate = self.search.system.candidate(fit.members[place]);
        let mut shown: Vec<usize> =
            (0..more.len()).filter(|&c| candidate.has_weight_in(c, weights)).collect();
        let [where_shown, moved] = [0, 1].map(|of: usize| shown.iter().map(|&c| more[c][of]).sum::<f64>());
        // On average a true law reduces the squares by those of its prediction, and a false law increases them by as much.
        if !is_strong_evidence(0.5 * moved) {
            shown.clear();
        }
        Tested { shown, where_shown, squares: more.iter().map(|more| more[0]).sum() }
    }

    /// Residuals, by channel and row, of the arm file that all members of `fit` make together, tuned; zero in rows without weight. Each journal starts in the
    /// initial state that the search found.
    fn residual(&self, fit: &Fit) -> Result<Vec<Vec<f64>>, LawError> {
        let mut residual =
            self.residual_beside(|recording| self.search.system.placed_in(fit, self.arm(), recording))?;
        self.tune(&mut residual, fit);
        Ok(residual)
    }

    /// As [`Self::residual`]; `None` if no arm file could describe the machine with the members of `fit`.
    fn residual_if_possible(&self, fit: &Fit) -> Result<Option<Vec<Vec<f64>>>, LawError> {
        match self.residual(fit) {
            Ok(residual) => Ok(Some(residual)),
            Err(LawError::Changed { .. }) => Ok(None),
            Err(error) => Err(error),
        }
    }

    /// The residuals with the model as given, as a comparison with the file computes them.
    pub(super) fn left_as_given(&self, fit: &Fit) -> Result<Vec<Vec<f64>>, LawError> {
        self.residual_beside(|_| self.search.system.placed(fit, self.arm(), |_| true))
    }

    /// Residuals of the model with these laws in each recording, after subtraction of the events.
    fn residual_beside(&self, laws: impl Fn(usize) -> Vec<Placed>) -> Result<Vec<Vec<f64>>, LawError> {
        Ok(less(&self.data().residual_with(laws)?, &contribution_of(self.events, self.target)))
    }

    /// Subtracts from `rows` the contribution of the tolerances beside `fit`, and sets rows without weight to zero.
    pub(super) fn tune(&self, rows: &mut [Vec<f64>], fit: &Fit) {
        let system = &self.search.system;
        system.subtract_tolerances(rows, &system.tolerances_beside(fit));
        (0..rows.len()).for_each(|channel| system.data.apply_mask(channel, &mut rows[channel]));
    }

    /// Returns true if the arm with the members of `fit` can exist, as given and tuned: otherwise no file could describe it.
    fn can_exist(&self, fit: &Fit) -> bool {
        let placed = self.search.system.placed(fit, self.arm(), |_| true);
        let tuned = self.tuned_arm(fit);
        placed.len() == fit.members.len()
            && changed(self.arm(), &placed).is_ok()
            && tuned.is_some_and(|tuned| changed(&tuned, &placed).is_ok())
    }

    /// Returns true if the member number `place` of `fit` changes the arm, or makes one that no file could describe.
    fn changes_arm(&self, fit: &Fit, place: usize) -> bool {
        let system = &self.search.system;
        let placed = system.candidate(fit.members[place]).placed(self.arm(), system.coefficients(fit, place));
        let mut parts = ArmParts::of(self.arm());
        placed.is_none_or(|placed| placed.effect.arm(&mut parts).is_err() || !parts.are_of(self.arm()))
    }

    /// The findings with their evidence, the largest gain first; without those whose coefficients may all be zero.
    fn findings(&mut self, borne_out: &BorneOut) -> Result<Option<Vec<Finding>>, LawError> {
        let BorneOut { fit, residual: with, without, on_test } = borne_out;
        let all = estimates(&mut self.search.system, fit, self.settings.seed);
        let system = &self.search.system;
        let on_fit = system.weights.by_row();
        let mut found = Vec::new();
        for ((place, estimate), Without { fit: fit_without, residual: without, shown, .. }) in
            all.into_iter().enumerate().zip(without)
        {
            let Estimate { parameters, includes_zero } = estimate;
            let member = fit.members[place];
            let candidate = system.candidate(member);
            let held_out = !shown.is_empty();
            let (weights, channels) =
                if held_out { (on_test, shown.clone()) } else { (&on_fit, candidate.channels.clone()) };
            let compared = Compared { before: without, after: with, weights };
            let Some(gain) = compared.gain(system.data, &channels, self.settings.seed) else {
                return Ok(None);
            };
            let (removed, names) = compared.removed(system.data, &channels);
            if includes_zero {
                continue;
            }
            let log_odds = fit.value - fit_without.value;
            let mut table = candidate.table(self.arm(), system.coefficients(fit, place));
            let phrase = words::phrase(candidate.kind, &parameters);
            let mut statement = words::statement(&phrase, table.joint.as_deref());
            if let Some(given) = self.given(candidate)
                && let Some(both) = joined(system.data, given, candidate, system.coefficients(fit, place))
            {
                statement.push_str(&words::with_given(given, &both, system.data.arm()));
                table = both;
            }
            let effect = Effect {
                kind: candidate.kind.name,
                joint: table.joint.clone(),
                statement,
                parameters,
                equation: candidate.kind.equation,
                source: candidate.kind.source,
                evidence: Evidence {
                    log_odds,
                    odds: words::odds(log_odds),
                    share: removed,
                    held_out_gain: gain,
                    held_out,
                    channels: names,
                },
                phrase,
            };
            found.push(Finding { of: Cause::Law(member), table, effect });
        }
        for (number, event) in self.events.iter().enumerate() {
            let (table, effect) = event.finding(self.arm());
            found.push(Finding { of: Cause::Event(number), table, effect });
        }
        let held = held_joints(system.data, &system.placed(fit, self.arm(), |_| true), self.settings.seed)?;
        found.extend(held.into_iter().map(|(table, effect)| Finding { of: Cause::Hold, table, effect }));
        let all: f64 = found.iter().map(|finding| finding.effect.evidence.share.max(0.0)).sum();
        for finding in &mut found {
            finding.effect.evidence.share =
                (finding.effect.evidence.share / all.max(f64::MIN_POSITIVE)).max(0.0);
        }
        sort_falling(&mut found, |found| found.effect.evidence.share);
        Ok(Some(found))
    }

    /// The effect of the same kind that the file already has at the place of `candidate`.
    fn given(&self, candidate: &Candidate) -> Option<&EffectTable> {
        let joint = candidate.joint.map(|joint| &self.arm().joints()[joint].name);
        let is_same =
            |table: &&EffectTable| table.kind == candidate.kind.name && table.joint.as_ref() == joint;
        self.file.effects.iter().find(is_same)
    }

    /// The arm of the file with its masses, lengths and frictions tuned within their tolerances.
    pub(super) fn tuned_arm(&self, fit: &Fit) -> Option<Arm> {
        let mut parts = ArmParts::of(self.arm());
        for (nuisance, eta) in self.bound(&self.search.system.tolerances_beside(fit)) {
            nuisance.of.change(&mut parts, &self.settings.tolerances, eta);
        }
        parts.into_arm(self.arm().name()).ok()
    }

    /// The tolerances with a prior, and their coefficients.
    pub(super) fn bound(&self, eta: &DVector<f64>) -> Vec<(&'d Nuisance, f64)> {
        let data = self.data();
        let mut at = 0;
        let mut all = Vec::new();
        for nuisance in &data.nuisances[0] {
            if nuisance.free {
                at += data.recordings.len();
            } else {
                all.push((nuisance, eta[at]));
                at += 1;
            }
        }
        all
    }

    /// Returns true if `fit` leaves errors so large that a law outside the catalogue must act. The function examines the rows of the search and those of the
    /// test part.
    pub(super) fn leaves_more(&self, fit: &Fit) -> bool {
        let system = &self.search.system;
        let test = system.weights.on(system.data, &[Part::Test]);
        [&system.weights, &test].into_iter().any(|weights| is_unexplained(system, fit, weights))
    }
}

#[cfg(test)]
mod tests {
    use std::f64::consts::FRAC_PI_2;

    use freeplay_arm::{Arm, JointFriction, JointKind};
    use freeplay_model::ArmFile;

    use super::Standing;
    use crate::data::linearised::{LinearisedRecording, PreparedRecording};
    use crate::data::stacked::Data;
    use crate::data::tolerance::Tolerances;
    use crate::made::{arm, columns_along, even, link, recording, without};
    use crate::report::settings::DiagnoseSettings;
    use crate::search::moves::{EffectSet, Search};
    use crate::signals::motion::Settings;
    use crate::statistics::STRONG;

    /// Length of the recording, s.
    const SECONDS: f64 = 20.0;

    /// To and fro at one speed; in the last 30 % of the recording at half of it.
    fn to_and_fro(_: &Arm, t: f64) -> [Vec<f64>; 3] {
        let w = if t < 0.7 * SECONDS { 3.0 } else { 1.5 };
        let (sharp, (sin, cos)) = (0.95_f64, (w * (t - 0.7 * SECONDS) + FRAC_PI_2).sin_cos());
        let rest = 1.0 - (sharp * sin).powi(2);
        let velocity = 0.4 * sharp * w * cos / rest.sqrt();
        let acceleration = -0.4 * sharp * w * w * sin * (1.0 - sharp * sharp) / rest.powf(1.5);
        [vec![0.4 * (sharp * sin).asin()], vec![velocity], vec![acceleration]]
    }

    #[test]
    fn the_test_part_takes_part_in_the_choice_between_whole_sets() {
        let arm = arm(vec![link("joint", JointKind::Revolute, JointFriction::default())]);
        let columns = columns_along(to_and_fro, &arm, &even(SECONDS, 250.0), |_, v| 1.5 * v);
        let made = recording(without(columns, "x"));
        let prepared = PreparedRecording::new(&arm, &made, &Settings::default()).expect("a ground");
        let recording = LinearisedRecording::new(&arm, &[], &prepared).expect("a stage");
        let data = Data::new(vec![recording], &Tolerances::default(), &[]);
        let target = data.target();
        let mut search = Search::over(&data).expect("a system");
        let file = ArmFile { arm: arm.clone(), effects: Vec::new(), ignored: Vec::new() };
        let of_test = ["viscous_friction", "quadratic_drag"].map(|kind| {
            let is_kind = |&index: &usize| search.system.candidate(index).kind.name == kind;
            let member = search.available.iter().copied().find(is_kind).expect("a candidate");
            let answer = EffectSet { members: Vec::new(), shares: Vec::new(), evidence: 0.0 };
            let settings = DiagnoseSettings::default();
            let (search, answer) = (&mut search, &answer);
            let mut standing =
                Standing { file: &file, settings: &settings, search, answer, events: &[], target: &target };
            let (score, set) = standing.with_test(vec![member]).expect("an arm").expect("a fit");
            println!(
                "{kind}: log of the evidence {}, of the test part {}",
                set.evidence,
                score - set.evidence
            );
            score - set.evidence
        });
        assert!(of_test[0] > of_test[1] + STRONG);
    }
}
