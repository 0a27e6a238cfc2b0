//! The search for the most probable set of effects: it adds, drops, swaps and exchanges members, as long as the evidence rises.

use std::collections::{BTreeMap, VecDeque};

use freeplay_arm::Arm;
use freeplay_laws::{Occurrence, changed};

#[cfg(test)]
use crate::candidates::candidate::candidates;
use crate::candidates::candidate::{Candidate, Form};
use crate::data::stacked::Data;
#[cfg(test)]
use crate::data::weights::Weights;
use crate::evidence::parabola::Parabola;
use crate::evidence::system::{Fit, Gain, System, all_but};
use crate::sorting::sort_falling;
use crate::statistics::{BACKTRACKING, TURNS};

/// Largest number of candidates that the search tries in the place of several members: others are far less probable, and each trial takes a fit.
const TRIED: usize = 12;
/// Steps of the logarithm of a shape's parameter: from the distance between two candidate shapes down to one at which a parabola describes the evidence.
pub const STEPS: [f64; 5] = [0.2, 0.07, 0.025, 0.01, 0.004];
/// Smallest increase of the log evidence that justifies another step: less is far below the resolution of any odds, and partly a rounding error.
pub const WORTH: f64 = 0.01;

/// A set of effects with its evidence.
#[derive(Clone, Debug)]
pub(crate) struct EffectSet {
    /// The numbers of its blocks.
    pub members: Vec<usize>,
    /// The shares of discrepancy for this set.
    pub shares: Vec<f64>,
    /// The log of its evidence.
    pub evidence: f64,
}

/// The search.
pub(crate) struct Search<'d, 'a> {
    /// The linear model.
    pub system: System<'d, 'a>,
    /// The blocks of all candidates.
    pub available: Vec<usize>,
    /// All visited answers, the most probable first.
    pub visited: Vec<EffectSet>,
    /// A cache of candidates in recently tried forms.
    tried: Tried,
}

/// A cache of candidates in recently tried forms: most steps of a search try the same forms beside other members. The cache takes no more memory than
/// the first candidates.
#[derive(Default)]
struct Tried {
    /// By kind, place and form; `None` if the motion shows nothing of the candidate.
    known: BTreeMap<String, Option<Candidate>>,
    /// The keys in the order of their first use, the oldest first.
    order: VecDeque<String>,
    /// Number of values in all cached columns, and its limit.
    numbers: [usize; 2],
}

impl Tried {
    /// `candidate` in another `form`, from the cache or made by `make`.
    fn get(
        &mut self,
        candidate: &Candidate,
        form: Form,
        make: impl Fn(&Candidate, Form) -> Option<Candidate>,
    ) -> Option<Candidate> {
        let name = candidate.name_in(&form);
        if let Some(known) = self.known.get(&name) {
            return known.clone();
        }
        let made = make(candidate, form);
        self.numbers[0] += made.as_ref().map_or(0, Candidate::column_entries);
        self.known.insert(name.clone(), made.clone());
        self.order.push_back(name);
        while self.numbers[0] > self.numbers[1] {
            let Some(first) = self.order.pop_front() else { break };
            let gone = self.known.remove(&first).flatten();
            self.numbers[0] -= gone.as_ref().map_or(0, Candidate::column_entries);
        }
        made
    }

    /// Empties the cache, because the machine on which the candidates act has changed.
    fn clear(&mut self) {
        *self = Self { numbers: [0, self.numbers[1]], ..Self::default() };
    }
}

/// The result of a search, and the input of the next one.
pub(crate) struct Found {
    /// The effects.
    pub members: Vec<Candidate>,
    /// The coefficients of each.
    pub coefficients: Vec<Vec<f64>>,
    /// Standard deviation of the error of each row for a model with these effects: see [`Data::row_error_with`](crate::data::stacked::Data::row_error_with) and
    /// [`Weights::most_probable_row_error`](crate::data::weights::Weights::most_probable_row_error).
    pub row_error: Vec<Vec<f64>>,
    /// The residuals of the model with these effects.
    pub residual: Vec<Vec<f64>>,
    /// The part of their log evidence that comes from the priors, not from the rows.
    pub log_prior: f64,
}

impl Found {
    /// Sets the lasting effects on each recording of `data`: all other laws then act on the machine with them.
    pub fn set_on(&self, data: &Data) {
        let members = || self.members.iter().zip(&self.coefficients);
        data.set_found(|arm| {
            members()
                .filter(|(member, _)| !member.kind.happens())
                .filter_map(|(member, coefficients)| member.placed(arm, coefficients))
                .collect()
        });
    }
}

impl<'d, 'a> Search<'d, 'a> {
    /// A search among `candidates`.
    pub fn new(mut system: System<'d, 'a>, candidates: Vec<Candidate>) -> Self {
        let available: Vec<usize> =
            candidates.into_iter().filter_map(|candidate| system.take(candidate)).collect();
        let most = available.iter().map(|&index| system.candidate(index).column_entries()).sum();
        Self {
            system,
            available,
            visited: Vec::new(),
            tried: Tried { numbers: [0, most], ..Tried::default() },
        }
    }

    /// The search in all rows of `data` with all candidates.
    #[cfg(test)]
    pub fn over(data: &'d Data<'a>) -> Option<Self> {
        let target = data.target();
        let weights = Weights::new(data, &target, None, &data.row_error, 1);
        let (candidates, _) = candidates(data, &mut |_| {});
        Some(Self::new(System::new(data, target, weights)?, candidates))
    }

    /// Searches once from `known` alone and once from `known` with the common effects, and restores the better answer; `None` if the system is
    /// singular.
    pub fn run(&mut self, known: &[usize], progress: &mut dyn FnMut(&str)) -> Option<EffectSet> {
        /// Turns until both settle: the columns of a sensor change with the found effects, and the found effects change with the sensor.
        const SEARCHES: usize = 2;
        let first = self.system.shares();
        let from_nothing = self.improve(known.to_vec(), progress)?;
        self.system.set_shares(&first)?;
        self.system.release_tolerances()?;
        let common = [known.to_vec(), self.common(known)].concat();
        let common = self.with_best_shares(common)?;
        let common = self.relinearised(&common)?;
        let from_common = self.improve(common, progress)?;
        let mut best =
            if from_common.evidence > from_nothing.evidence + WORTH { from_common } else { from_nothing };
        for _ in 0..SEARCHES {
            if best.members.is_empty() {
                break;
            }
            self.restore(&best)?;
            let members = self.relinearised(&best)?;
            self.visited.clear();
            let better = self.improve(members, progress)?;
            let is_same = self.same_effects(&better.members, &best.members);
            best = better;
            if is_same {
                break;
            }
        }
        self.restore(&best)?;
        Some(best)
    }

    /// Returns true if `one` and `other` are the same effects, in any forms.
    pub fn same_effects(&self, one: &[usize], other: &[usize]) -> bool {
        let has = |all: &[usize], index: usize| {
            all.iter().any(|&known| self.system.candidate(known).same_effect(self.system.candidate(index)))
        };
        one.len() == other.len() && one.iter().all(|&index| has(other, index))
    }

    /// Recomputes the columns of the sensors and of the members of `answer` on the machine with these members: torque limits, delays and
    /// load-dependent friction act on all found effects. Returns the recomputed members.
    fn relinearised(&mut self, answer: &EffectSet) -> Option<Vec<usize>> {
        let members = self.relinearised_members(answer)?;
        for place in 0..self.available.len() {
            let index = self.available[place];
            if self.system.candidate(index).acts_on_readings && !answer.members.is_empty() {
                self.available[place] = self.relinearised_block(index);
            }
        }
        Some(members)
    }

    /// Recomputes the members of `answer` alone.
    fn relinearised_members(&mut self, answer: &EffectSet) -> Option<Vec<usize>> {
        let fit = self.system.fit(&answer.members)?;
        let data = self.system.data;
        let system = &self.system;
        let lasting = |arm: &Arm| system.placed(&fit, arm, |candidate| !candidate.kind.happens());
        if changed(data.arm(), &lasting(data.arm())).is_err() {
            return Some(answer.members.clone());
        }
        data.set_found(lasting);
        self.tried.clear();
        Some(answer.members.iter().map(|&member| self.relinearised_block(member)).collect())
    }

    /// The number of the block `index`, recomputed on the present machine.
    fn relinearised_block(&mut self, index: usize) -> usize {
        let candidate = self.system.candidate(index);
        if candidate.changes_arm {
            return index;
        }
        let reformed = candidate.reformed(self.system.data, candidate.form.clone());
        reformed.and_then(|reformed| self.system.take(reformed)).unwrap_or(index)
    }

    /// The effects that are common on machines and improve the evidence beside `members`.
    fn common(&self, members: &[usize]) -> Vec<usize> {
        let odds = |index: usize| self.system.candidate(index).kind.occurs.odds();
        let candidates: Vec<usize> = self
            .available
            .iter()
            .copied()
            .filter(|&index| odds(index) >= Occurrence::Common.odds())
            .collect();
        let Some(fit) = self.system.fit(members) else { return Vec::new() };
        let gains = self.system.gains(&fit, &candidates);
        let found =
            candidates.iter().zip(gains).filter(|(_, gain)| gain.as_ref().is_some_and(|g| g.value > 0.0));
        found.map(|(&index, _)| index).collect()
    }

    /// Improves `members` until no step makes them more probable.
    pub fn improve(&mut self, members: Vec<usize>, progress: &mut dyn FnMut(&str)) -> Option<EffectSet> {
        let mut now = self.with_best_shares(members)?;
        loop {
            progress(&format!("searching: {} effects", now.members.len()));
            let better = match self.added(&now)? {
                Some(better) => Some(better),
                None => match self.dropped(&now)? {
                    Some(better) => Some(better),
                    None => match self.swapped(&now)? {
                        Some(better) => Some(better),
                        None => self.exchanged(&now)?,
                    },
                },
            };
            let Some(better) = better else { break };
            self.record_visited(&now);
            now = better;
        }
        self.record_visited(&now);
        Some(now)
    }

    /// Makes the coefficients of `answer` consistent with the machine on which each law acts, and gives outliers less weight: one law changes the machine of
    /// another, and that changes the machine of the first. `None` if the system is singular.
    pub fn made_consistent(&mut self, answer: &EffectSet) -> Option<EffectSet> {
        let mut now = answer.clone();
        for _ in 0..TURNS {
            let members = self.relinearised_members(&now)?;
            now = self.with_best_shares(members)?;
            let held = self.system.fit_within_tolerances(&now.members)?;
            self.system.downweight_outliers(&held)?;
        }
        Some(now)
    }

    /// Adds `answer` to the visited ones.
    fn record_visited(&mut self, answer: &EffectSet) {
        if self.visited.iter().all(|known| known.members != answer.members) {
            self.visited.push(answer.clone());
            sort_falling(&mut self.visited, |answer| answer.evidence);
        }
    }

    /// `members` with the most probable shares of discrepancy.
    pub fn with_best_shares(&mut self, members: Vec<usize>) -> Option<EffectSet> {
        for _ in 0..TURNS {
            let fit = self.system.fit(&members)?;
            let moved = self.system.update_shares(&fit)?;
            let fit = self.system.fit(&members)?;
            if !self.system.hold_tolerances(&fit)? && !moved {
                break;
            }
        }
        let evidence = self.system.fit(&members)?.value + self.system.common_log_evidence();
        Some(EffectSet { members, shares: self.system.shares(), evidence })
    }

    /// The evidence of `members` with their own shares, approximately.
    fn approximate_evidence(&self, members: &[usize]) -> Option<f64> {
        let fit = self.system.fit(members)?;
        Some(fit.value + self.system.common_log_evidence() + self.system.share_gain(&fit))
    }

    /// `members` with their own shares, if that makes them more probable than `now`; else the method restores the system.
    fn accepted(&mut self, now: &EffectSet, members: Vec<usize>) -> Option<Option<EffectSet>> {
        let there = self.with_best_shares(members)?;
        let there = self.sharpened(there)?;
        if there.evidence > now.evidence + WORTH && self.is_physical(&there.members) {
            return Some(Some(there));
        }
        self.record_visited(&there);
        self.restore(now)?;
        Some(None)
    }

    /// Restores the shares and the held tolerances of `answer`.
    pub fn restore(&mut self, answer: &EffectSet) -> Option<()> {
        self.system.set_shares(&answer.shares)?;
        let fit = self.system.fit(&answer.members)?;
        self.system.hold_tolerances(&fit)?;
        Some(())
    }

    /// `answer` with its last member in the best form, after tolerances with the same effect have become zero.
    fn sharpened(&mut self, answer: EffectSet) -> Option<EffectSet> {
        let Some((&last, others)) = answer.members.split_last() else { return Some(answer) };
        let index = self.refined(others, last)?;
        if index == last {
            return Some(answer);
        }
        self.with_best_shares(others.iter().copied().chain([index]).collect())
    }

    /// `members`, each in the best form beside the others on the machine with them.
    pub fn polished(&mut self, mut members: Vec<usize>) -> Option<EffectSet> {
        /// Turns until the forms settle: a law that acts on others changes with them, and they change with it.
        const POLISHES: usize = 3;
        let mut now = self.with_best_shares(members.clone())?;
        for _ in 0..POLISHES {
            // A tolerance that reached its limit beside an earlier form need not reach it beside a better one.
            self.system.release_tolerances()?;
            let refined = self.each_refined(members.clone(), |_| true)?;
            let is_still = refined == members;
            let with_best_shares = self.with_best_shares(refined)?;
            now = self.made_consistent(&with_best_shares)?;
            if is_still {
                break;
            }
            members.clone_from(&now.members);
        }
        Some(now)
    }

    /// Fits the shape parameters of `members`, and then all coefficients, to the rows with their present weights.
    pub fn refitted(&mut self, members: Vec<usize>) -> Option<EffectSet> {
        let members = self.with_best_shares(members)?.members;
        let members = self.each_refined(members, |candidate| !candidate.numbers().is_empty())?;
        let with_best_shares = self.with_best_shares(members)?;
        self.made_consistent(&with_best_shares)
    }

    /// Refines the form of each member for which `is_moved` holds, beside the others.
    fn each_refined(
        &mut self,
        mut members: Vec<usize>,
        is_moved: impl Fn(&Candidate) -> bool,
    ) -> Option<Vec<usize>> {
        for place in 0..members.len() {
            if is_moved(self.system.candidate(members[place])) {
                let member = members.remove(place);
                let better = self.refined(&members, member)?;
                members.insert(place, better);
            }
        }
        Some(members)
    }

    /// Returns true if an arm with `members` is physical: no mass is negative.
    fn is_physical(&self, members: &[usize]) -> bool {
        let arm = self.system.data.arm();
        let Some(fit) = self.system.fit(members) else { return false };
        let placed = self.system.placed(&fit, arm, |_| true);
        placed.len() == members.len() && changed(arm, &placed).is_ok()
    }

    /// The effects of `answer`, and their residuals.
    pub fn found(&self, answer: &EffectSet, seed: u64) -> Option<Found> {
        let fit = self.system.fit_within_tolerances(&answer.members)?;
        let data = self.system.data;
        let placed = self.system.placed(&fit, data.arm(), |_| true);
        let residual = self.system.residual(&fit);
        let row_error = self.system.weights.most_probable_row_error(
            &data.row_error_with(&placed, seed),
            &data.solution_spread_with(&placed),
            &residual,
        );
        let coefficients = (0..fit.members.len()).map(|place| self.system.coefficients(&fit, place).to_vec());
        Some(Found {
            members: self.candidates(&answer.members),
            coefficients: coefficients.collect(),
            row_error,
            residual,
            log_prior: fit.log_prior,
        })
    }

    /// The candidates of these numbers.
    pub fn candidates(&self, indices: &[usize]) -> Vec<Candidate> {
        indices.iter().map(|&index| self.system.candidate(index).clone()).collect()
    }

    /// Excludes the effects of these numbers from the search.
    pub fn leave_out(&mut self, effects: &[usize]) {
        let system = &self.system;
        let is_left_out = |index: usize| {
            effects.iter().any(|&effect| system.candidate(effect).same_effect(system.candidate(index)))
        };
        self.available.retain(|&index| !is_left_out(index));
    }

    /// The candidates that may join `members`.
    fn open(&self, members: &[usize]) -> Vec<usize> {
        let is_taken = |index: &usize| {
            let candidate = self.system.candidate(*index);
            members.iter().any(|&member| self.system.candidate(member).excludes(candidate))
        };
        self.available.iter().copied().filter(|index| !is_taken(index)).collect()
    }

    /// The best form of each effect that may join `members` with a gain above `least`: the best [`TRIED`] of them, in order. A form with a coefficient at its
    /// bound is a starting point for a better form, if its law has other forms.
    fn nearest(&self, members: &[usize], least: f64) -> Option<Vec<usize>> {
        let fit = self.system.fit(members)?;
        let open = self.open(members);
        let gains = self.system.gains(&fit, &open);
        let worth = open.iter().zip(&gains).filter_map(|(&index, gain)| {
            let gain = gain.as_ref().filter(|gain| gain.value > least)?;
            let may_move = || !self.system.candidate(index).numbers().is_empty();
            (gain.is_inside || may_move()).then_some((index, gain.value))
        });
        let mut worth: Vec<(usize, f64)> = worth.collect();
        sort_falling(&mut worth, |(_, gain)| *gain);
        let mut nearest: Vec<usize> = Vec::new();
        for (index, _) in worth {
            let is_same =
                |&other: &usize| self.system.candidate(other).same_effect(self.system.candidate(index));
            if nearest.len() < TRIED && !nearest.iter().any(is_same) {
                nearest.push(index);
            }
        }
        Some(nearest)
    }

    /// Returns true if the coefficients of the candidate number `index`, fitted beside `members`, are inside their bounds.
    fn is_inside(&self, members: &[usize], index: usize) -> Option<bool> {
        let gain = self.system.gains(&self.system.fit(members)?, &[index]).pop().flatten();
        Some(gain.is_some_and(|gain| gain.is_inside))
    }

    /// `now` with the additional effect that gives the highest evidence.
    pub fn added(&mut self, now: &EffectSet) -> Option<Option<EffectSet>> {
        for index in self.nearest(&now.members, 0.0)? {
            let index = self.best_of_rivals(&now.members, index)?;
            if !self.is_inside(&now.members, index)? {
                continue;
            }
            let mut members = now.members.clone();
            members.push(index);
            if let Some(better) = self.accepted(now, members)? {
                return Some(Some(better));
            }
        }
        Some(None)
    }

    /// `now` without the member whose removal gives the highest evidence.
    fn dropped(&mut self, now: &EffectSet) -> Option<Option<EffectSet>> {
        let mut without: Vec<(f64, Vec<usize>)> = (0..now.members.len())
            .filter_map(|place| {
                let mut members = now.members.clone();
                members.remove(place);
                Some((self.approximate_evidence(&members)?, members))
            })
            .collect();
        sort_falling(&mut without, |(about, _)| *about);
        for (about, members) in without {
            if about <= now.evidence {
                break;
            }
            if let Some(better) = self.accepted(now, members)? {
                return Some(Some(better));
            }
        }
        Some(None)
    }

    /// `now` with another effect in the place of one of its members.
    fn swapped(&mut self, now: &EffectSet) -> Option<Option<EffectSet>> {
        let mut best: Option<(f64, Vec<usize>, usize)> = None;
        for (place, &member) in now.members.iter().enumerate() {
            let others = all_but(&now.members, place);
            let fit = self.system.fit(&others)?;
            let meets = |index: &usize| {
                *index != member && self.system.candidate(*index).meets(self.system.candidate(member))
            };
            let open: Vec<usize> = self.open(&others).into_iter().filter(meets).collect();
            let own = self.system.gains(&fit, &[member]).pop().flatten().map_or(0.0, |gain| gain.value);
            for (&index, gain) in open.iter().zip(self.system.gains(&fit, &open)) {
                let Some(gain) = gain.filter(|gain| gain.is_inside) else { continue };
                let more = gain.value - own;
                if more > WORTH && best.as_ref().is_none_or(|best| more > best.0) {
                    best = Some((more, others.clone(), index));
                }
            }
        }
        if let Some((_, others, index)) = best {
            let index = self.best_of_rivals(&others, index)?;
            let members = others.into_iter().chain([index]).collect();
            if let Some(better) = self.accepted(now, members)? {
                return Some(Some(better));
            }
        }
        self.swapped_for_rival(now)
    }

    /// `now` with a law in the place of one that it excludes, each in its best form.
    fn swapped_for_rival(&mut self, now: &EffectSet) -> Option<Option<EffectSet>> {
        for &member in &now.members {
            if self.system.candidate(member).kind.happens() {
                continue;
            }
            let others: Vec<usize> = now.members.iter().copied().filter(|other| *other != member).collect();
            let index = self.best_of_rivals(&others, member)?;
            if self.system.candidate(index).same_effect(self.system.candidate(member)) {
                continue;
            }
            let members = others.into_iter().chain([index]).collect();
            if let Some(better) = self.accepted(now, members)? {
                return Some(Some(better));
            }
        }
        Some(None)
    }

    /// The best law among `index` and those that it excludes, of which a machine has at most one. Each takes its best form beside `members`, because
    /// a strongly nonlinear law explains less in its initial form than it could.
    fn best_of_rivals(&mut self, members: &[usize], index: usize) -> Option<usize> {
        let fit = self.system.fit(members)?;
        let rivals = self.rivals(members, index)?;
        let mut first = self.refined(members, index)?;
        for other in rivals {
            let other = self.refined(members, other)?;
            let gains = self.system.gains(&fit, &[first, other]);
            let value =
                |gain: &Option<Gain>| gain.as_ref().filter(|gain| gain.is_inside).map(|gain| gain.value);
            if value(&gains[1]) > value(&gains[0]) {
                first = other;
            }
        }
        Some(first)
    }

    /// The rivals of the member at `place` of `members`, each in its best form beside the others, if they or that member have several possible
    /// solutions.
    pub fn open_rivals(&mut self, members: &[usize], place: usize) -> Option<Vec<usize>> {
        let (member, others) = (members[place], all_but(members, place));
        let rivals = self.rivals(&others, member)?;
        let has_several_solutions = |index: &usize| self.system.candidate(*index).has_several_solutions;
        let rivals: Vec<usize> = rivals
            .into_iter()
            .filter(|rival| has_several_solutions(rival) || has_several_solutions(&member))
            .collect();
        rivals.into_iter().map(|rival| self.refined(&others, rival)).collect()
    }

    /// The laws that can't exist together with `index`, each in that of its present forms that explains most beside `members`.
    fn rivals(&self, members: &[usize], index: usize) -> Option<Vec<usize>> {
        let fit = self.system.fit(members)?;
        let mut best: Vec<(f64, usize)> = Vec::new();
        let open: Vec<usize> =
            self.open(members).into_iter().filter(|&other| self.is_rival(index, other)).collect();
        for (&other, gain) in open.iter().zip(self.system.gains(&fit, &open)) {
            let Some(gain) = gain else { continue };
            let candidate = self.system.candidate(other);
            match best.iter_mut().find(|(_, known)| self.system.candidate(*known).same_effect(candidate)) {
                Some(known) if known.0 < gain.value => *known = (gain.value, other),
                Some(_) => {}
                None => best.push((gain.value, other)),
            }
        }
        Some(best.into_iter().map(|(_, index)| index).collect())
    }

    /// Returns true for different laws of which a machine has only one, and for events at the same time in a common channel: one event is more probable
    /// than two.
    fn is_rival(&self, one: usize, other: usize) -> bool {
        let (one, other) = (self.system.candidate(one), self.system.candidate(other));
        (one.excludes(other) || one.happens_with(other) && one.meets(other)) && !one.same_effect(other)
    }

    /// `now` with one more effect and without the members that become unnecessary: one law replaces several that imitate it.
    fn exchanged(&mut self, now: &EffectSet) -> Option<Option<EffectSet>> {
        let nearest = self.nearest(&now.members, f64::NEG_INFINITY)?;
        self.exchanged_for(now, &nearest)
    }

    /// The same exchange with the candidates that explain most alone: many members together may leave nothing for such a candidate to explain.
    pub fn exchanged_whole(&mut self, now: &EffectSet) -> Option<Option<EffectSet>> {
        let nearest = self.nearest(&[], 0.0)?;
        self.exchanged_for(now, &nearest)
    }

    /// The same exchange with one of `others`, in their order.
    fn exchanged_for(&mut self, now: &EffectSet, others: &[usize]) -> Option<Option<EffectSet>> {
        for &index in others {
            let Some(members) = self.thinned(&now.members, index)? else { continue };
            let Some((&last, others)) = members.split_last() else { continue };
            if !self.is_inside(others, last)? {
                continue;
            }
            if self.approximate_evidence(&members)? <= now.evidence + WORTH {
                continue;
            }
            if let Some(better) = self.accepted(now, members)? {
                return Some(Some(better));
            }
        }
        Some(None)
    }

    /// `members` and `index` without the members that lower the evidence beside it; `None` if there are none.
    fn thinned(&mut self, members: &[usize], index: usize) -> Option<Option<Vec<usize>>> {
        let mut all: Vec<usize> = members.to_vec();
        all.push(index);
        let mut value = self.system.fit(&all)?.value;
        let before = all.len();
        loop {
            let mut best: Option<(f64, usize)> = None;
            for place in 0..all.len() - 1 {
                let mut rest = all.clone();
                rest.remove(place);
                let there = self.system.fit(&rest)?.value;
                if there > value && best.is_none_or(|best| there > best.0) {
                    best = Some((there, place));
                }
            }
            let Some((there, place)) = best else { break };
            all.remove(place);
            value = there;
        }
        if all.len() == before {
            return Some(None);
        }
        let index = self.refined(&all[..all.len() - 1], index)?;
        if let Some(last) = all.last_mut() {
            *last = index;
        }
        Some(Some(all))
    }

    /// The block number `index` in its best form beside `members`: with continuous shape parameters, and with the law linearised at the fitted
    /// coefficients.
    pub fn refined(&mut self, members: &[usize], index: usize) -> Option<usize> {
        let fit = self.system.fit(members)?;
        let mut best = index;
        let value = |search: &Self, at: usize| {
            search.system.gains(&fit, &[at]).pop().flatten().map_or(f64::NEG_INFINITY, |gain| gain.value)
        };
        let mut now = value(self, best);
        // An event in one recording may occur in all.
        if self.system.candidate(best).form.only.is_some() {
            let form = Form { only: None, ..self.system.candidate(best).form.clone() };
            (best, now) = self.try_form(&fit, best, form, now).unwrap_or((best, now));
        }
        (best, now) = self.moved(&fit, best, now);
        if let Some(form) = self.system.candidate(best).usual_form() {
            let usual = self.try_form(&fit, best, form, f64::NEG_INFINITY);
            let usual = usual.map(|(index, value)| self.moved(&fit, index, value));
            (best, now) = usual.filter(|usual| usual.1 > now).unwrap_or((best, now));
        }
        for _ in 0..CENTRES {
            let Some(gain) = self.system.gains(&fit, &[best]).pop().flatten() else { break };
            let beta = gain.beta.as_slice();
            let from = (best, now);
            let forms = BACKTRACKING.map(|share| self.system.candidate(best).about(beta, share));
            if let Some(form) = forms[0].clone().filter(Form::is_chord) {
                // The value of a chord between its ends differs from that of the law.
                let there = self.try_form(&fit, best, form, f64::NEG_INFINITY);
                let Some(there) = there.filter(|there| (there.1 - now).abs() > WORTH) else { break };
                (best, now) = there;
                continue;
            }
            for form in forms.into_iter().flatten() {
                (best, now) = self.try_form(&fit, best, form, now).unwrap_or((best, now));
            }
            if best == from.0 {
                break;
            }
        }
        Some(best)
    }

    /// Moves the shape parameters of `index` to the values that explain most beside `fit`. Returns the new number and the value there; `now` is the
    /// present value.
    fn moved(&mut self, fit: &Fit, index: usize, now: f64) -> (usize, f64) {
        let (mut best, mut now) = (index, now);
        let lines = lines(&self.system.candidate(best).numbers());
        for step in STEPS.into_iter().flat_map(|step| [step, -step]) {
            for line in &lines {
                loop {
                    let form = self.system.candidate(best).moved(self.system.data, &along(line), step);
                    let Some(there) = self.try_form(fit, best, form, now) else { break };
                    (best, now) = there;
                }
            }
        }
        self.moved_to_vertex(fit, best, now, &lines)
    }

    /// Moves the shape parameters of `index` along each of `lines` to the vertex of the parabola through the values at two neighbours, as long as it promises
    /// more than [`WORTH`]. Returns the new number and the value there; `now` is the present value.
    fn moved_to_vertex(&mut self, fit: &Fit, index: usize, now: f64, lines: &[Line]) -> (usize, f64) {
        let (mut best, mut now) = (index, now);
        for line in lines {
            let mut step = STEPS[STEPS.len() - 1];
            while let Some(parabola) = self.parabola(fit, best, now, &along(line), step) {
                if parabola.rise() <= WORTH {
                    break;
                }
                let form =
                    self.system.candidate(best).moved(self.system.data, &along(line), parabola.vertex());
                let Some(there) = self.try_form(fit, best, form, now) else { break };
                (best, now) = there;
                // The parabola is exact over a short distance.
                step = parabola.deviation().min(step);
            }
        }
        (best, now)
    }

    /// The parabola through the value `now` of `index` beside `fit` and its values at a `step` to each side; `None` if there is no maximum near.
    fn parabola(
        &mut self,
        fit: &Fit,
        index: usize,
        now: f64,
        along: &[(&str, f64)],
        step: f64,
    ) -> Option<Parabola> {
        let mut value = |step: f64| {
            let form = self.system.candidate(index).moved(self.system.data, along, step);
            let (at, gain) = self.reformed_gain(fit, index, form)?;
            self.system.forget(at);
            Some(gain?.value)
        };
        Parabola::new([value(-step)?, now, value(step)?], step)
    }

    /// The number of `index` in another `form` and its value beside `fit`, if that is more than `now`.
    fn try_form(&mut self, fit: &Fit, index: usize, form: Form, now: f64) -> Option<(usize, f64)> {
        let (at, gain) = self.reformed_gain(fit, index, form)?;
        match gain.filter(|gain| gain.is_inside && gain.value > now + WORTH) {
            Some(gain) => Some((at, gain.value)),
            None => {
                self.system.forget(at);
                None
            }
        }
    }

    /// The number that the system gives `index` in another `form`, and its gain beside `fit`.
    fn reformed_gain(&mut self, fit: &Fit, index: usize, form: Form) -> Option<(usize, Option<Gain>)> {
        let data = self.system.data;
        let candidate = self.system.candidate(index);
        let other = self.tried.get(candidate, form, |one, form| one.reformed(data, form))?;
        let at = self.system.take(other)?;
        Some((at, self.system.gains(fit, &[at]).pop().flatten()))
    }
}

/// A direction in the space of a shape's parameters: each parameter's name and its share.
type Line = Vec<(String, f64)>;

/// The lines along which the search moves the parameters `numbers` of a shape: each alone, and each pair in the same and in opposite directions, as a wider
/// gap with softer flanks.
fn lines(numbers: &[String]) -> Vec<Line> {
    let mut all = Vec::new();
    for (k, name) in numbers.iter().enumerate() {
        all.push(vec![(name.clone(), 1.0)]);
        for other in &numbers[k + 1..] {
            all.extend([1.0, -1.0].map(|way| vec![(name.clone(), 1.0), (other.clone(), way)]));
        }
    }
    all
}

/// The parts of `line` by name.
fn along(line: &Line) -> Vec<(&str, f64)> {
    line.iter().map(|(name, way)| (name.as_str(), *way)).collect()
}

/// Largest number of linearisations of a law at the fitted coefficients: each has a shorter distance to the solution, and a step without a gain ends
/// the loop earlier.
const CENTRES: usize = 6;
