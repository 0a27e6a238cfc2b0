//! Which set of effects is the most probable: add, drop, swap and nest, as long as the evidence rises.

use std::collections::{BTreeMap, VecDeque};

use freeplay_arm::Arm;
use freeplay_laws::{Occurrence, changed};

use crate::candidates::candidate::{Candidate, Form};
use crate::evidence::system::{Fit, Gain, System, all_but};
use crate::statistics::BACKTRACKING;

/// Most candidates of which each is tried in the place of several members: more are far behind, and each takes a fit.
const TRIED: usize = 12;
/// Steps of the logarithm of a shape's number: from one shape that is laid out to the next, down to what no motion tells apart.
const STEPS: [f64; 5] = [0.2, 0.07, 0.025, 0.01, 0.004];
/// Most effects a joint: an arm that lacks more is not known by its laws, and more of them would only follow its shapes.
const MOST: usize = 3;
/// Share of the log of the evidence that is worth another step: less is far below what any odds are said to, and rounding makes some of it.
pub const WORTH: f64 = 0.01;

/// A set of effects with its evidence.
#[derive(Clone, Debug)]
pub(crate) struct Answer {
    /// The numbers of its blocks.
    pub members: Vec<usize>,
    /// The shares of discrepancy beside it.
    pub shares: Vec<f64>,
    /// The log of its evidence.
    pub evidence: f64,
}

/// The search.
pub(crate) struct Search<'d, 'a> {
    /// The linear model.
    pub system: System<'d, 'a>,
    /// The blocks that were laid out.
    pub laid: Vec<usize>,
    /// All answers that were met, the best first.
    pub met: Vec<Answer>,
    /// Forms that were tried of late.
    tried: Tried,
}

/// Candidates in forms that were tried of late: most steps of a search try the same forms beside other members. They take no more memory than what was laid out.
#[derive(Default)]
struct Tried {
    /// By kind, place and form; `None` where the motion shows nothing of it.
    known: BTreeMap<String, Option<Candidate>>,
    /// The same names, those that were tried first in front.
    order: VecDeque<String>,
    /// Numbers in the columns of all, and how many there may be.
    numbers: [usize; 2],
}

impl Tried {
    /// `candidate` in another `form`, from memory or made by `make`.
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
        self.numbers[0] += made.as_ref().map_or(0, Candidate::numbers_in_columns);
        self.known.insert(name.clone(), made.clone());
        self.order.push_back(name);
        while self.numbers[0] > self.numbers[1] {
            let Some(first) = self.order.pop_front() else { break };
            let gone = self.known.remove(&first).flatten();
            self.numbers[0] -= gone.as_ref().map_or(0, Candidate::numbers_in_columns);
        }
        made
    }

    /// Forgets all: what they act on has changed.
    fn clear(&mut self) {
        *self = Self { numbers: [0, self.numbers[1]], ..Self::default() };
    }
}

/// What a search found, for the next one.
pub(crate) struct Found {
    /// The effects.
    pub members: Vec<Candidate>,
    /// The error that each row may have although the model has these effects: see [`Data::off_with`](crate::data::stacked::Data::off_with) and
    /// [`Weights::most_probable_off`](crate::data::weights::Weights::most_probable_off).
    pub off: Vec<Vec<f64>>,
    /// What they leave of every row.
    pub left: Vec<Vec<f64>>,
    /// The part of their log evidence that comes from the priors, not from the rows.
    pub log_prior: f64,
}

impl<'d, 'a> Search<'d, 'a> {
    /// A search among `candidates`.
    pub fn new(mut system: System<'d, 'a>, candidates: Vec<Candidate>) -> Self {
        let laid: Vec<usize> =
            candidates.into_iter().filter_map(|candidate| system.take(candidate)).collect();
        let most = laid.iter().map(|&index| system.candidate(index).numbers_in_columns()).sum();
        Self { system, laid, met: Vec::new(), tried: Tried { numbers: [0, most], ..Tried::default() } }
    }

    /// Searches from `known` alone and from that and what is common, and goes back to the best; `None` if the system is singular.
    pub fn run(&mut self, known: &[usize], progress: &mut dyn FnMut(&str)) -> Option<Answer> {
        /// Turns in which they settle: what a sensor reads changes with what is found, and that with the sensor.
        const TURNS: usize = 2;
        let first = self.system.shares();
        let from_nothing = self.improve(known.to_vec(), progress)?;
        self.system.set_shares(&first)?;
        self.system.unpin()?;
        let common = [known.to_vec(), self.common(known)].concat();
        let common = self.settled(common)?;
        let common = self.laid_upon(&common)?;
        let from_common = self.improve(common, progress)?;
        let mut best =
            if from_common.evidence > from_nothing.evidence + WORTH { from_common } else { from_nothing };
        for _ in 0..TURNS {
            if best.members.is_empty() {
                break;
            }
            self.back(&best)?;
            let laid = self.laid_upon(&best)?;
            self.met.clear();
            let better = self.improve(laid, progress)?;
            let is_same = self.same_effects(&better.members, &best.members);
            best = better;
            if is_same {
                break;
            }
        }
        self.back(&best)?;
        Some(best)
    }

    /// Whether `one` and `other` are the same effects in whatever form.
    pub fn same_effects(&self, one: &[usize], other: &[usize]) -> bool {
        let has = |all: &[usize], index: usize| {
            all.iter().any(|&known| self.system.candidate(known).same_effect(self.system.candidate(index)))
        };
        one.len() == other.len() && one.iter().all(|&index| has(other, index))
    }

    /// Lets what sensors do, and the members of `answer`, act on the machine that has these members: what clips, is late or grows with the load does so with
    /// all that was found. The members as they are then.
    fn laid_upon(&mut self, answer: &Answer) -> Option<Vec<usize>> {
        let members = self.members_upon(answer)?;
        for place in 0..self.laid.len() {
            let index = self.laid[place];
            if self.system.candidate(index).is_read && !answer.members.is_empty() {
                self.laid[place] = self.anew(index);
            }
        }
        Some(members)
    }

    /// The same for the members alone.
    fn members_upon(&mut self, answer: &Answer) -> Option<Vec<usize>> {
        let fit = self.system.fit(&answer.members)?;
        let data = self.system.data;
        let system = &self.system;
        let lasting = |arm: &Arm| system.placed(&fit, arm, |candidate| !candidate.kind.happens());
        if changed(data.arm(), &lasting(data.arm())).is_err() {
            return Some(answer.members.clone());
        }
        data.set_found(lasting);
        self.tried.clear();
        Some(answer.members.iter().map(|&member| self.anew(member)).collect())
    }

    /// The number of the block `index` as it is on the machine of now.
    fn anew(&mut self, index: usize) -> usize {
        let candidate = self.system.candidate(index);
        if candidate.changes_arm {
            return index;
        }
        let laid = candidate.reformed(self.system.data, candidate.form.clone());
        laid.and_then(|laid| self.system.take(laid)).unwrap_or(index)
    }

    /// The most probable form of each effect that is common on machines, beside `members`.
    fn common(&self, members: &[usize]) -> Vec<usize> {
        let odds = |index: usize| self.system.candidate(index).kind.occurs.odds();
        let candidates: Vec<usize> =
            self.laid.iter().copied().filter(|&index| odds(index) >= Occurrence::Common.odds()).collect();
        let Some(fit) = self.system.fit(members) else { return Vec::new() };
        let gains = self.system.gains(&fit, &candidates);
        let found =
            candidates.iter().zip(gains).filter(|(_, gain)| gain.as_ref().is_some_and(|g| g.value > 0.0));
        found.map(|(&index, _)| index).collect()
    }

    /// Improves `members` until nothing makes them more probable.
    pub fn improve(&mut self, members: Vec<usize>, progress: &mut dyn FnMut(&str)) -> Option<Answer> {
        let mut now = self.settled(members)?;
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
            self.meet(&now);
            now = better;
        }
        self.meet(&now);
        Some(now)
    }

    /// `answer` with its numbers brought into agreement with what each law acts on, and with rows that are far out believed less. `None` if the system is
    /// singular.
    pub fn agreed(&mut self, answer: &Answer) -> Option<Answer> {
        /// Turns in which they settle: one law changes what another acts on, and that the first once more.
        const TURNS: usize = 4;
        let mut now = answer.clone();
        for _ in 0..TURNS {
            let members = self.members_upon(&now)?;
            now = self.settled(members)?;
            let held = self.system.held_fit(&now.members)?;
            self.system.distrust(&held)?;
        }
        Some(now)
    }

    /// Keeps `answer` among those that were met.
    fn meet(&mut self, answer: &Answer) {
        if self.met.iter().all(|known| known.members != answer.members) {
            self.met.push(answer.clone());
            self.met.sort_by(|a, b| b.evidence.total_cmp(&a.evidence));
        }
    }

    /// `members` with the shares of discrepancy that are most probable beside them.
    pub fn settled(&mut self, members: Vec<usize>) -> Option<Answer> {
        /// Most turns: a share moves by less at each, and the grid of shares ends it.
        const TURNS: usize = 4;
        for _ in 0..TURNS {
            let fit = self.system.fit(&members)?;
            let moved = self.system.follow(&fit)?;
            let fit = self.system.fit(&members)?;
            if !self.system.pin(&fit)? && !moved {
                break;
            }
        }
        let evidence = self.system.fit(&members)?.value + self.system.shared();
        Some(Answer { members, shares: self.system.shares(), evidence })
    }

    /// The evidence of `members` with shares of their own, about.
    fn about(&self, members: &[usize]) -> Option<f64> {
        let fit = self.system.fit(members)?;
        Some(fit.value + self.system.shared() + self.system.to_gain(&fit))
    }

    /// `members` settled, if that makes them more probable than `now`; else the system as it was.
    fn accepted(&mut self, now: &Answer, members: Vec<usize>) -> Option<Option<Answer>> {
        let there = self.settled(members)?;
        let there = self.sharpened(there)?;
        if there.evidence > now.evidence + WORTH && self.can_exist(&there.members) {
            return Some(Some(there));
        }
        self.meet(&there);
        self.back(now)?;
        Some(None)
    }

    /// Sets the system back to where `answer` was settled.
    pub fn back(&mut self, answer: &Answer) -> Option<()> {
        self.system.set_shares(&answer.shares)?;
        let fit = self.system.fit(&answer.members)?;
        self.system.pin(&fit)?;
        Some(())
    }

    /// `answer` with its last member in the form that explains most now that tolerances which say the same have given way to it.
    fn sharpened(&mut self, answer: Answer) -> Option<Answer> {
        let Some((&last, others)) = answer.members.split_last() else { return Some(answer) };
        let index = self.refined(others, last)?;
        if index == last {
            return Some(answer);
        }
        self.settled(others.iter().copied().chain([index]).collect())
    }

    /// `members`, each in the form that explains most beside the others and beside what it acts on.
    pub fn polished(&mut self, mut members: Vec<usize>) -> Option<Answer> {
        /// Turns in which they settle: a law that acts on others moves with them, and they with it.
        const TURNS: usize = 3;
        let mut now = self.settled(members.clone())?;
        for _ in 0..TURNS {
            // Where an earlier form had a tolerance at an edge, a better one need not.
            self.system.unpin()?;
            let refined = self.each_refined(members.clone(), |_| true)?;
            let is_still = refined == members;
            let settled = self.settled(refined)?;
            now = self.agreed(&settled)?;
            if is_still {
                break;
            }
            members.clone_from(&now.members);
        }
        Some(now)
    }

    /// `members` with the numbers of their shapes, and then all coefficients, fitted to the rows as they count now.
    pub fn refitted(&mut self, members: Vec<usize>) -> Option<Answer> {
        let members = self.settled(members)?.members;
        let members = self.each_refined(members, |candidate| !candidate.numbers().is_empty())?;
        let settled = self.settled(members)?;
        self.agreed(&settled)
    }

    /// `members`, each for which `is_moved` holds in the form that explains most beside the others.
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

    /// Whether an arm with `members` can exist: no link of it weighs less than nothing.
    fn can_exist(&self, members: &[usize]) -> bool {
        let arm = self.system.data.arm();
        let Some(fit) = self.system.fit(members) else { return false };
        let placed = self.system.placed(&fit, arm, |_| true);
        placed.len() == members.len() && changed(arm, &placed).is_ok()
    }

    /// The effects of `answer`, and what they leave.
    pub fn found(&self, answer: &Answer, seed: u64) -> Option<Found> {
        let fit = self.system.held_fit(&answer.members)?;
        let data = self.system.data;
        let placed = self.system.placed(&fit, data.arm(), |_| true);
        let left = self.system.left(&fit);
        let off = self.system.weights.most_probable_off(
            &data.off_with(&placed, seed),
            &data.apart_with(&placed),
            &left,
        );
        Some(Found { members: self.candidates(&answer.members), off, left, log_prior: fit.log_prior })
    }

    /// The candidates of these numbers.
    pub fn candidates(&self, indices: &[usize]) -> Vec<Candidate> {
        indices.iter().map(|&index| self.system.candidate(index).clone()).collect()
    }

    /// Looks for none of the effects of these numbers any more.
    pub fn leave_out(&mut self, effects: &[usize]) {
        let system = &self.system;
        let is_left_out = |index: usize| {
            effects.iter().any(|&effect| system.candidate(effect).same_effect(system.candidate(index)))
        };
        self.laid.retain(|&index| !is_left_out(index));
    }

    /// The candidates that may join `members`.
    fn open(&self, members: &[usize]) -> Vec<usize> {
        let is_taken = |index: &usize| {
            let candidate = self.system.candidate(*index);
            members.iter().any(|&member| self.system.candidate(member).excludes(candidate))
        };
        self.laid.iter().copied().filter(|index| !is_taken(index)).collect()
    }

    /// The best form of each effect that may join `members` and brings more than `least`, the best [`TRIED`] of them in order. A form whose coefficient is held at a bound
    /// is where the search for a better one begins, if its law has others.
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
        worth.sort_by(|a, b| b.1.total_cmp(&a.1));
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

    /// Whether the coefficients of the candidate number `index`, fitted beside `members`, are inside their bounds.
    fn is_inside(&self, members: &[usize], index: usize) -> Option<bool> {
        let gain = self.system.gains(&self.system.fit(members)?, &[index]).pop().flatten();
        Some(gain.is_some_and(|gain| gain.is_inside))
    }

    /// `now` with the effect that makes it most probable.
    pub fn added(&mut self, now: &Answer) -> Option<Option<Answer>> {
        if now.members.len() >= MOST * self.system.data.arm().dof() {
            return Some(None);
        }
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

    /// `now` without the member whose absence makes it most probable.
    fn dropped(&mut self, now: &Answer) -> Option<Option<Answer>> {
        let mut without: Vec<(f64, Vec<usize>)> = (0..now.members.len())
            .filter_map(|place| {
                let mut members = now.members.clone();
                members.remove(place);
                Some((self.about(&members)?, members))
            })
            .collect();
        without.sort_by(|a, b| b.0.total_cmp(&a.0));
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
    fn swapped(&mut self, now: &Answer) -> Option<Option<Answer>> {
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
    fn swapped_for_rival(&mut self, now: &Answer) -> Option<Option<Answer>> {
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

    /// Of the laws of which a machine has one at most, `index` and those that it excludes, the one that explains most beside `members`, each in its best form: before
    /// that a law that is far from linear says less than it could.
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

    /// The rivals of the member at `place` of `members`, each in its best form beside the others, where they or that member may take one of several courses.
    pub fn open_rivals(&mut self, members: &[usize], place: usize) -> Option<Vec<usize>> {
        let (member, others) = (members[place], all_but(members, place));
        let rivals = self.rivals(&others, member)?;
        let is_open = |index: &usize| self.system.candidate(*index).is_open;
        let rivals: Vec<usize> =
            rivals.into_iter().filter(|rival| is_open(rival) || is_open(&member)).collect();
        rivals.into_iter().map(|rival| self.refined(&others, rival)).collect()
    }

    /// The laws of which a machine has one at most with `index`, each in the form that explains most beside `members` as it is laid out.
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

    /// Whether a machine has `one` or `other` and they are different laws, or both happen at the same time: one thing happens then sooner than two.
    fn is_rival(&self, one: usize, other: usize) -> bool {
        let (one, other) = (self.system.candidate(one), self.system.candidate(other));
        (one.excludes(other) || one.happens_with(other)) && !one.same_effect(other)
    }

    /// `now` with one effect more and without all members that it makes needless: one law in the place of several that imitate it.
    fn exchanged(&mut self, now: &Answer) -> Option<Option<Answer>> {
        let nearest = self.nearest(&now.members, f64::NEG_INFINITY)?;
        self.exchanged_for(now, &nearest)
    }

    /// The same with what explains most by itself: what many members say together leaves nothing to it.
    pub fn exchanged_whole(&mut self, now: &Answer) -> Option<Option<Answer>> {
        let nearest = self.nearest(&[], 0.0)?;
        self.exchanged_for(now, &nearest)
    }

    /// The same with one of `others`, of which the first is tried first.
    fn exchanged_for(&mut self, now: &Answer, others: &[usize]) -> Option<Option<Answer>> {
        for &index in others {
            let Some(members) = self.thinned(&now.members, index)? else { continue };
            let Some((&last, others)) = members.split_last() else { continue };
            if !self.is_inside(others, last)? {
                continue;
            }
            if self.about(&members)? <= now.evidence + WORTH {
                continue;
            }
            if let Some(better) = self.accepted(now, members)? {
                return Some(Some(better));
            }
        }
        Some(None)
    }

    /// `members` and `index` without those of `members` that are not worth their place beside it; `None` if all are.
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

    /// The block number `index` in the form that explains most beside `members`: the numbers of its shape off their grid, its law taken about what was found.
    pub fn refined(&mut self, members: &[usize], index: usize) -> Option<usize> {
        let fit = self.system.fit(members)?;
        let mut best = index;
        let value = |search: &Self, at: usize| {
            search.system.gains(&fit, &[at]).pop().flatten().map_or(f64::NEG_INFINITY, |gain| gain.value)
        };
        let mut now = value(self, best);
        // What happens in one recording may happen in all.
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
                // What a chord says elsewhere than at its end is not what the law says there.
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

    /// The number of `index` with the numbers of its shape where it explains most beside `fit`, and what it explains there: `now` where they are.
    fn moved(&mut self, fit: &Fit, index: usize, now: f64) -> (usize, f64) {
        let (mut best, mut now) = (index, now);
        let moves = moves(&self.system.candidate(best).numbers());
        for step in STEPS {
            for along in &moves {
                loop {
                    let along: Vec<(&str, f64)> =
                        along.iter().map(|(name, way)| (name.as_str(), *way)).collect();
                    let form = self.system.candidate(best).moved(self.system.data, &along, step);
                    let Some(there) = self.try_form(fit, best, form, now) else { break };
                    (best, now) = there;
                }
            }
        }
        (best, now)
    }

    /// The number of `index` in another `form` and what it explains beside `fit`, if that is more than `now`.
    fn try_form(&mut self, fit: &Fit, index: usize, form: Form, now: f64) -> Option<(usize, f64)> {
        let data = self.system.data;
        let candidate = self.system.candidate(index);
        let other = self.tried.get(candidate, form, |one, form| one.reformed(data, form))?;
        let at = self.system.take(other)?;
        let gain = self.system.gains(fit, &[at]).pop().flatten().filter(|gain| gain.is_inside);
        match gain.filter(|gain| gain.value > now + WORTH) {
            Some(gain) => Some((at, gain.value)),
            None => {
                self.system.forget(at);
                None
            }
        }
    }
}

/// The ways to move the `numbers` of a shape: each alone, and of two each way together and against each other, a gap that is wider behind flanks that give less.
fn moves(numbers: &[String]) -> Vec<Vec<(String, f64)>> {
    let mut all = Vec::new();
    for (k, name) in numbers.iter().enumerate() {
        all.extend([1.0, -1.0].map(|way| vec![(name.clone(), way)]));
        for other in &numbers[k + 1..] {
            let ways = [[1.0, 1.0], [1.0, -1.0], [-1.0, 1.0], [-1.0, -1.0]];
            all.extend(ways.map(|[a, b]| vec![(name.clone(), a), (other.clone(), b)]));
        }
    }
    all
}

/// Most times that a law is taken about what was found: each time the way there is shorter, and a step that gains nothing ends it before.
const CENTRES: usize = 6;
