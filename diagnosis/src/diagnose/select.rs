//! How effects are chosen: forward while they count, backward where others made them idle, one exchanged for another where that
//! explains more; and the same once more from the friction that sits on every joint of a real machine.

use std::collections::BTreeMap;

use freeplay_laws::{ABOUT, Placed, START, changed};
use nalgebra::DVector;

use super::case::Weighing;
use super::hypothesis::Hypothesis;
use super::search::{Chosen, Search, TOLD_APART};
use super::system::{Fit, Score};
use super::validate::{Validation, is_above_the_floor, is_brief_and_weak};

/// Most effects that are named, beside these for each joint.
const MOST_EFFECTS: usize = 4;
const MOST_A_JOINT: usize = 4;
/// How often weights and winner are brought into agreement.
const ROUNDS: usize = 4;
/// How many of those that don't count get a second look.
const LOOKS: usize = 5;
/// How often every effect is put to the test of an exchange.
const EXCHANGES: usize = 3;
/// How often the search goes on after the cross-validation has dropped effects.
const VALIDATIONS: usize = 6;
/// How often the search goes on in what refined shapes leave.
const DEPTH: usize = 3;
/// How many effects in a row may fail the cross-validation before the search stops.
const PATIENCE: usize = 6;
/// Least share of the error that an effect takes away where it was not fitted.
pub(super) const LEAST_GAIN: f64 = 0.05;
/// The same where noise could be all that is left.
const LEAST_IN_NOISE: f64 = 0.25;
/// Two models whose errors differ by less than this share, summed over the channels, are as good.
const AS_GOOD: f64 = 0.02;
/// Share of an effect's merit from which on another one explains nearly as much.
const NEARLY: f64 = 0.7;
/// The same for a plainer law whose shape was not moved off its grid.
pub(super) const CLOSE: f64 = 0.9;
/// Share of an effect's merit from which on what is far from linear may explain more in another shape.
pub(super) const HINT: f64 = 0.1;
/// Kinds whose merits differ by less than this share are judged by their strongest place.
const ALIKE: f64 = 0.05;
/// What sits on every joint of a real machine.
pub(super) const USUAL: [&str; 3] = ["coulomb_friction", "viscous_friction", "torque_offset"];
/// The strongest hypothesis of a step.
#[derive(Clone)]
pub(super) struct Winner {
    /// Which hypothesis.
    pub hypothesis: usize,
    /// What it explains.
    pub score: Score,
    /// That less the cost of its coefficients.
    pub merit: f64,
}

/// The places of one kind.
#[derive(Default)]
struct Family {
    strongest: Option<Winner>,
    together: f64,
    channels: Vec<usize>,
    overlap: bool,
}

impl Family {
    /// Takes a place in.
    fn join(&mut self, winner: Winner, channels: Vec<usize>) {
        self.together += winner.merit;
        self.overlap |= channels.iter().any(|channel| self.channels.contains(channel));
        self.channels.extend(channels);
        if self.strongest.as_ref().is_none_or(|strongest| winner.merit > strongest.merit) {
            self.strongest = Some(winner);
        }
    }

    /// Of its strongest place.
    fn alone(&self) -> f64 {
        self.strongest.as_ref().map_or(f64::NEG_INFINITY, |winner| winner.merit)
    }

    /// Of all its places, if they show in different channels.
    fn merit(&self) -> f64 {
        if self.overlap { self.alone() } else { self.together.max(self.alone()) }
    }
}

impl Search<'_, '_> {
    /// Chooses the effects; `None` if a fit is singular. `progress` is told what was taken in.
    pub fn run(&mut self, progress: &mut dyn FnMut(&str)) -> Option<()> {
        self.weigh_anew()?;
        self.improve_validated(progress)?;
        if self.chosen.len() > 1 {
            progress("searching from the friction of every joint");
            let first = std::mem::take(&mut self.chosen);
            self.barred.clear();
            self.take_usual()?;
            self.improve_validated(progress)?;
            self.keep_better(first)?;
        }
        self.look_beneath(progress)?;
        if self.merge(progress)? {
            self.look_beneath(progress)?;
        }
        self.settle()
    }

    /// Moves shapes off their grid, and searches on in what these leave: the edges of a push that were off by a little hide what is small.
    fn look_beneath(&mut self, progress: &mut dyn FnMut(&str)) -> Option<()> {
        for _ in 0..DEPTH {
            let known: Vec<usize> = self.chosen.iter().map(|chosen| chosen.hypothesis).collect();
            if !self.refine()? {
                break;
            }
            self.improve_validated(progress)?;
            if self.chosen.iter().all(|chosen| known.contains(&chosen.hypothesis)) {
                break;
            }
        }
        Some(())
    }

    /// Improves, drops what does not stand the cross-validation, and goes on without that.
    pub fn improve_validated(&mut self, progress: &mut dyn FnMut(&str)) -> Option<()> {
        for _ in 0..VALIDATIONS {
            self.improve(progress)?;
            if !self.prune(progress)? {
                break;
            }
        }
        Some(())
    }

    /// Drops the effects that say nothing of what they were not fitted to, the worst first, and bars them; whether there were any.
    fn prune(&mut self, progress: &mut dyn FnMut(&str)) -> Option<bool> {
        let before = self.chosen.len();
        while !self.chosen.is_empty() {
            let validation = Validation::of(self)?;
            let gains = (0..self.chosen.len()).filter_map(|index| Some((index, validation.gain(index)?)));
            let Some((worst, gain)) = gains.min_by(|a, b| a.1.total_cmp(&b.1)) else { break };
            if gain >= LEAST_GAIN {
                break;
            }
            progress(&format!("{} fails the cross-validation: {:.0} %", self.in_words(worst), 100.0 * gain));
            self.bar(worst);
        }
        Some(self.chosen.len() < before)
    }

    /// Forward, backward, exchanges, until nothing moves.
    fn improve(&mut self, progress: &mut dyn FnMut(&str)) -> Option<()> {
        for _ in 0..EXCHANGES {
            self.grow(progress)?;
            while self.drop_one()? || self.drop_rich()? {}
            self.weigh_anew()?;
            progress(&format!("{} effect(s) so far", self.chosen.len()));
            if !self.exchange(progress)? {
                break;
            }
        }
        while self.drop_one()? {}
        self.settle()
    }

    /// Takes effects in until none counts, or too many in a row did not stand the cross-validation: what is left then has no name here.
    fn grow(&mut self, progress: &mut dyn FnMut(&str)) -> Option<()> {
        let mut in_vain = 0;
        while self.chosen.len() < self.most_effects() && in_vain < PATIENCE {
            let before = self.chosen.len();
            if !self.step(progress)? {
                break;
            }
            in_vain = if self.chosen.len() > before { 0 } else { in_vain + 1 };
        }
        Some(())
    }

    fn most_effects(&self) -> usize {
        MOST_EFFECTS + MOST_A_JOINT * self.case.stages[0].arm().dof()
    }

    /// The effect number `index`, for people.
    pub fn in_words(&self, index: usize) -> String {
        self.hypothesis_in_words(self.chosen[index].hypothesis)
    }

    /// The hypothesis number `hypothesis`, for people.
    pub fn hypothesis_in_words(&self, hypothesis: usize) -> String {
        let (named, joints) = (&self.hypotheses[hypothesis], self.case.stages[0].arm().joints());
        let site = named.joint.map_or("arm", |joint| joints[joint].name.as_str());
        format!("{} ({site})", named.kind.title)
    }

    /// Takes in the friction and the offset of every joint, and drops what of it does not count.
    fn take_usual(&mut self) -> Option<()> {
        let usual: Vec<usize> = (0..self.hypotheses.len())
            .filter(|&index| USUAL.contains(&self.hypotheses[index].kind.name))
            .collect();
        self.chosen = usual.into_iter().map(|index| self.admit(index)).collect();
        self.weigh_anew()?;
        while self.drop_one()? {}
        self.weigh_anew()
    }

    /// Goes back to `first` if that says what it was not fitted to as well, with fewer effects, or better; keeps the other one in mind.
    fn keep_better(&mut self, first: Vec<Chosen>) -> Option<()> {
        let now = Validation::of(self)?.size();
        let mut other = std::mem::replace(&mut self.chosen, first);
        self.weigh_anew()?;
        let before = Validation::of(self)?.size();
        let as_good = (now - before).abs() < AS_GOOD;
        let fewer = other.len() < self.chosen.len();
        if if as_good { fewer } else { now < before } {
            std::mem::swap(&mut self.chosen, &mut other);
        }
        self.runner_up = other;
        self.weigh_anew()
    }

    /// Puts what the search from the other start had found in the place of what was taken in; whether it was something else.
    pub fn turn_to_runner_up(&mut self) -> Option<bool> {
        let runner_up = std::mem::take(&mut self.runner_up);
        let is_known = |it: &Chosen| self.chosen.iter().any(|chosen| chosen.hypothesis == it.hypothesis);
        if runner_up.is_empty() || runner_up.len() == self.chosen.len() && runner_up.iter().all(is_known) {
            return Some(false);
        }
        self.barred.clear();
        self.chosen = runner_up.iter().map(|chosen| self.admit(chosen.hypothesis)).collect();
        self.refine()?;
        self.settle()?;
        Some(true)
    }

    /// Takes the strongest effect in if it counts; whether it did. `None` if a fit is singular.
    fn step(&mut self, progress: &mut dyn FnMut(&str)) -> Option<bool> {
        let weights = self.system.weights.clone();
        let won = match self.agreed()? {
            None => self.second_look()?,
            agreed => agreed,
        };
        let Some(winner) = won else {
            self.system.weights = weights;
            return Some(false);
        };
        let chosen = self.admit(winner.hypothesis);
        self.chosen.push(Chosen { gain: winner.score.gain, ..chosen });
        let last = self.chosen.len() - 1;
        let validated = Validation::of(self)?.gain(last);
        progress(&format!(
            "+ {} ({:.0}; validated {:.2})",
            self.in_words(last),
            self.chosen[last].gain,
            validated.unwrap_or(f64::NAN)
        ));
        let least = if is_above_the_floor(self, last)? { LEAST_GAIN } else { LEAST_IN_NOISE };
        if validated.is_some_and(|gain| gain < least) || is_brief_and_weak(self, last)? {
            self.bar(last);
            self.weigh_anew()?;
        }
        Some(true)
    }

    /// The strongest effect that counts, the channels weighed by what it leaves itself; `None` inside if there is none.
    fn agreed(&mut self) -> Option<Option<Winner>> {
        let mut last = None;
        let mut won = None;
        for _ in 0..ROUNDS {
            let fit = self.system.fit(&self.active(None))?;
            let weighing = self.weighing(&self.system.residual(&fit), &fit);
            let Some(winner) = self.winner(&fit, &weighing) else { break };
            self.reweigh_with(&fit, &winner);
            let same = last == Some(winner.hypothesis);
            last = Some(winner.hypothesis);
            won = Some(winner);
            if same {
                break;
            }
        }
        Some(won.filter(|winner| winner.score.gain >= self.threshold(&self.hypotheses[winner.hypothesis])))
    }

    /// The same where what is missing is itself taken for noise, since even the unnamed correction leaves it: the channels weighed first
    /// by what the strongest of those that don't count leave, as if it were known.
    fn second_look(&mut self) -> Option<Option<Winner>> {
        let weights = self.system.weights.clone();
        let fit = self.system.fit(&self.active(None))?;
        let weighing = self.weighing(&self.system.residual(&fit), &fit);
        let mut strongest: Vec<Winner> = self.by_place(&fit, &weighing, None).into_values().collect();
        strongest.sort_by(|a, b| b.score.gain.total_cmp(&a.score.gain));
        for first in strongest.into_iter().take(LOOKS) {
            self.reweigh_with(&fit, &first);
            if let Some(winner) = self.agreed()? {
                return Some(Some(winner));
            }
            self.system.weights.clone_from(&weights);
        }
        Some(None)
    }

    /// Weighs the channels by what `winner` leaves beside `fit`.
    fn reweigh_with(&mut self, fit: &Fit, winner: &Winner) {
        let left = self.left_by(fit, winner);
        self.reweigh(&left, fit);
    }

    /// What `winner` leaves beside `fit`.
    pub(super) fn left_by(&self, fit: &Fit, winner: &Winner) -> Vec<Vec<f64>> {
        self.system.residual_with(fit, &self.hypotheses[winner.hypothesis].block, &winner.score)
    }

    /// Drops the effect number `index`, which did not prove itself on held-out data, for good; what could not stand beside it may.
    pub fn veto(&mut self, index: usize) {
        self.bar(index);
        self.vetoed.extend(self.barred.pop());
        self.barred.clear();
    }

    /// Drops the effect number `index` for this search.
    fn bar(&mut self, index: usize) {
        self.barred.push((self.named(index).kind.name, self.named(index).joint));
        self.chosen.remove(index);
    }

    /// The best shape of every kind at every place that is free, beside `fit`, the effect number `but` being left out of it.
    pub(super) fn by_place(
        &self,
        fit: &Fit,
        weighing: &Weighing,
        but: Option<usize>,
    ) -> BTreeMap<(&'static str, Option<usize>), Winner> {
        let mut best: BTreeMap<(&str, Option<usize>), Winner> = BTreeMap::new();
        let site_of = |hypothesis: &Hypothesis| (hypothesis.kind.name, hypothesis.joint);
        let is_free = |hypothesis: &Hypothesis| {
            let site = site_of(hypothesis);
            !(self.is_taken(hypothesis, but) || self.barred.contains(&site) || self.vetoed.contains(&site))
                && but.is_none_or(|index| hypothesis.meets(self.named(index)))
        };
        let free: Vec<usize> =
            (0..self.hypotheses.len()).filter(|&index| is_free(&self.hypotheses[index])).collect();
        let blocks: Vec<_> = free.iter().map(|&index| &self.hypotheses[index].block).collect();
        for (index, score) in free.into_iter().zip(self.system.scores(fit, &blocks)) {
            let Some(score) = score else { continue };
            let hypothesis = &self.hypotheses[index];
            let site = site_of(hypothesis);
            let merit = self.merit(hypothesis, score.gain, weighing);
            let better = best.get(&site).is_none_or(|winner| merit > winner.merit);
            // Where a law may stand, so may its special cases.
            let is_inside = but.is_some_and(|index| self.named(index).contains(hypothesis));
            let others = &fit.active[self.nuisances().len()..];
            if better
                && hypothesis.is_physical(&score)
                && self.system.is_material(&hypothesis.block, &score.beta)
                && (is_inside || self.system.is_apart(others, &hypothesis.block))
            {
                best.insert(site, Winner { hypothesis: index, score, merit });
            }
        }
        best
    }

    /// `winner` with the nuisances at their bounds free to come back, in another shape if it is then not physical in its own; `None` if it is
    /// in none.
    pub(super) fn exact(&self, fit: &Fit, weighing: &Weighing, mut winner: Winner) -> Option<Winner> {
        let hypothesis = &self.hypotheses[winner.hypothesis];
        if winner.merit > 0.0 {
            winner.score = self.system.exact_score(fit, &hypothesis.block)?;
            winner.merit = self.merit(hypothesis, winner.score.gain, weighing);
            if !hypothesis.is_physical(&winner.score) {
                return self.exact_in_another_shape(fit, weighing, winner.hypothesis);
            }
        }
        hypothesis.is_physical(&winner.score).then_some(winner)
    }

    /// The effect of the hypothesis number `but` in the other shape in which it explains most and is physical.
    fn exact_in_another_shape(&self, fit: &Fit, weighing: &Weighing, but: usize) -> Option<Winner> {
        let others = &fit.active[self.nuisances().len()..];
        let in_shape = |at: usize| {
            let hypothesis = &self.hypotheses[at];
            let score = self.system.exact_score(fit, &hypothesis.block)?;
            let merit = self.merit(hypothesis, score.gain, weighing);
            let may_stand = merit > 0.0
                && hypothesis.is_physical(&score)
                && self.system.is_material(&hypothesis.block, &score.beta)
                && self.system.is_apart(others, &hypothesis.block);
            may_stand.then_some(Winner { hypothesis: at, score, merit })
        };
        let is_other = |&at: &usize| at != but && self.hypotheses[at].same_effect(&self.hypotheses[but]);
        let shapes = (0..self.hypotheses.len()).filter(is_other).filter_map(in_shape);
        shapes.max_by(|a, b| a.merit.total_cmp(&b.merit))
    }

    /// The strongest member of the strongest kind, of all that count: the kind whose members explain most together where they show in different
    /// channels, as friction on several joints does; else the kind of the strongest single hypothesis.
    fn winner(&mut self, fit: &Fit, weighing: &Weighing) -> Option<Winner> {
        let mut families: BTreeMap<&str, Family> = BTreeMap::new();
        for ((kind, _), winner) in self.by_place(fit, weighing, None) {
            let Some(winner) = self.exact(fit, weighing, winner) else { continue };
            let hypothesis = &self.hypotheses[winner.hypothesis];
            if winner.merit > 0.0 && winner.score.gain > self.threshold(hypothesis) {
                families.entry(kind).or_default().join(winner, hypothesis.channels().collect());
            }
        }
        // What members explain together is not sharp: the fit without them is bent by what is missing.
        let most = families.values().map(Family::merit).fold(f64::NEG_INFINITY, f64::max);
        let as_much = most - ALIKE * most.abs();
        let single = families.values().max_by(|a, b| a.alone().total_cmp(&b.alone()))?.strongest.clone()?;
        if single.merit < as_much && single.merit > NEARLY * most {
            let one = self.one_for_all(fit, weighing, single).filter(|one| one.merit >= as_much);
            if one.is_some() {
                return one;
            }
        }
        let near = families.into_values().filter(|family| family.merit() >= as_much);
        near.max_by(|a, b| a.alone().total_cmp(&b.alone())).and_then(|family| family.strongest)
    }

    /// `single` in the shape in which it explains most, if it is far from linear: one delay of all torques in place of a low-pass of each.
    fn one_for_all(&mut self, fit: &Fit, weighing: &Weighing, single: Winner) -> Option<Winner> {
        let for_small = self.admit(single.hypothesis).columns;
        if !self.take_about(fit, single.hypothesis) {
            return None;
        }
        // In whatever shape, what has a name is no tolerance any more.
        let there = self.admit(single.hypothesis).columns;
        self.system.inherit(&for_small, &there);
        self.exact(fit, weighing, single)
    }

    /// Puts another effect in the place of each where that explains more, or as much with a plainer law; whether anything moved.
    fn exchange(&mut self, progress: &mut dyn FnMut(&str)) -> Option<bool> {
        let mut moved = false;
        for index in 0..self.chosen.len() {
            let fit = self.system.fit(&self.active(Some(index)))?;
            let all = self.system.fit(&self.active(None))?;
            let left = self.system.residual(&all);
            let weighing = self.weighing(&left, &all);
            let said = self.said(self.named(index), &self.coefficients(&all, index));
            let merit = self.merit(self.named(index), fit.left - all.left, &weighing);
            let mut places = self.by_place(&fit, &weighing, Some(index));
            let plainer = places.values().filter(|rival| rival.merit > CLOSE * merit);
            let mut refined = self.refine_plainer(index, &fit, plainer);
            refined |=
                self.centre_near(index, &fit, places.values().filter(|rival| rival.merit > NEARLY * merit));
            if refined {
                places = self.by_place(&fit, &weighing, Some(index));
            }
            if let Some(plain) = self.special_case(index, &left, &fit, &weighing, &places) {
                let was = self.in_words(index);
                self.chosen[index] = self.admit(plain);
                progress(&format!("{was} is no better than {}", self.in_words(index)));
                moved = true;
                continue;
            }
            if let Some(members) = self.many_for_one(index, &fit, &weighing, merit) {
                let was = self.in_words(index);
                let new: Vec<Chosen> = members.into_iter().map(|at| self.admit(at)).collect();
                self.chosen.splice(index..=index, new);
                progress(&format!("{was} exchanged for {} on several joints", self.named(index).kind.title));
                return Some(true);
            }
            let (plain, size) = (plainness(self.named(index)), self.named(index).size());
            let places = places.into_values().filter(|winner| {
                winner.merit > merit - TOLD_APART && self.hypotheses[winner.hypothesis].size() <= size + 1
            });
            let mut rivals: Vec<Winner> = self
                .in_place(places, [&fit, &all], &weighing)
                .filter(|winner| {
                    let rival = &self.hypotheses[winner.hypothesis];
                    !rival.contains(self.named(index))
                        || self.is_worth_more(rival, [&self.left_by(&fit, winner), &left], said)
                })
                .filter(|winner| {
                    let plainer = plainness(&self.hypotheses[winner.hypothesis]) < plain;
                    winner.merit > merit + if plainer { -TOLD_APART } else { TOLD_APART }
                })
                .collect();
            rivals.sort_by(|a, b| b.merit.total_cmp(&a.merit));
            let Some(best) = rivals.first().map(|best| best.merit) else { continue };
            let near = rivals.into_iter().filter(|rival| rival.merit > best - TOLD_APART);
            let Some(winner) = near.min_by_key(|rival| plainness(&self.hypotheses[rival.hypothesis])) else {
                continue;
            };
            let was = self.in_words(index);
            self.chosen[index] = self.admit(winner.hypothesis);
            progress(&format!(
                "{was} exchanged for {} ({merit:.0} to {:.0})",
                self.in_words(index),
                winner.merit
            ));
            moved = true;
        }
        Some(moved)
    }

    /// `places` with the merit that each has in the place of an effect, which is left out of the first of two fits: what it explains beside
    /// that effect, too, is no reason to put it there.
    fn in_place(
        &self,
        places: impl Iterator<Item = Winner>,
        [without, all]: [&Fit; 2],
        weighing: &Weighing,
    ) -> impl Iterator<Item = Winner> {
        places.filter_map(move |winner| self.exact(without, weighing, winner)).map(move |mut winner| {
            let block = &self.hypotheses[winner.hypothesis].block;
            let beside = self.system.exact_score(all, block).map_or(0.0, |score| score.gain);
            winner.merit -= beside.max(0.0);
            winner
        })
    }

    /// Hypotheses that explain nearly as much in the place of the effect number `index`; those at the same joint that are far from linear, in
    /// the shape in which they explain most there. What did not prove itself beside that effect may well stand in its place.
    pub fn rivals_of(&mut self, index: usize) -> Vec<usize> {
        let vetoed = std::mem::take(&mut self.vetoed);
        let rivals = self.rivals_of_all(index);
        self.vetoed = vetoed;
        rivals
    }

    fn rivals_of_all(&mut self, index: usize) -> Vec<usize> {
        let fits = [Some(index), None].map(|but| self.system.fit(&self.active(but)));
        let [Some(without), Some(all)] = fits else { return Vec::new() };
        let weighing = self.weighing(&self.system.residual(&all), &all);
        let whole = self.merit(self.named(index), without.left - all.left, &weighing);
        let places = self.by_place(&without, &weighing, Some(index));
        let joint = self.named(index).joint;
        let hints = places.values().filter(|winner| winner.merit > HINT * whole).map(|it| it.hypothesis);
        let there: Vec<usize> = hints.filter(|&at| self.hypotheses[at].joint == joint).collect();
        let moved = there.into_iter().filter(|&at| self.take_about(&without, at)).count();
        let places = if moved > 0 { self.by_place(&without, &weighing, Some(index)) } else { places };
        let is_near = |winner: &Winner| winner.merit > NEARLY * whole;
        let near = self.in_place(places.into_values().filter(is_near), [&without, &all], &weighing);
        near.filter(is_near).map(|winner| winner.hypothesis).collect()
    }

    /// What sits on every joint of a real machine and was not taken in.
    pub fn usual_left(&self) -> Vec<usize> {
        let is_left = |hypothesis: &Hypothesis| {
            let site = (hypothesis.kind.name, hypothesis.joint);
            USUAL.contains(&site.0) && !self.vetoed.contains(&site) && !self.is_taken(hypothesis, None)
        };
        (0..self.hypotheses.len()).filter(|&index| is_left(&self.hypotheses[index])).collect()
    }

    /// Those of `hypotheses` that are on one joint, if they are several.
    pub fn by_joint(&self, hypotheses: &[usize]) -> Vec<Vec<usize>> {
        let mut joints: BTreeMap<Option<usize>, Vec<usize>> = BTreeMap::new();
        for &hypothesis in hypotheses {
            joints.entry(self.hypotheses[hypothesis].joint).or_default().push(hypothesis);
        }
        joints.into_values().filter(|on_joint| on_joint.len() > 1).collect()
    }

    /// Puts `hypotheses` in the place of the effect number `index`, which does not come back, or behind the last.
    pub fn put(&mut self, index: usize, hypotheses: &[usize]) -> Option<()> {
        let new: Vec<Chosen> = hypotheses.iter().map(|&hypothesis| self.admit(hypothesis)).collect();
        let replaced = index..self.chosen.len().min(index + 1);
        for index in replaced.clone() {
            self.vetoed.push((self.named(index).kind.name, self.named(index).joint));
        }
        self.chosen.splice(replaced, new);
        self.settle()
    }

    /// Drops what is not physical beside the others, or else the weakest effect if the others made it idle; whether one was dropped.
    pub(super) fn drop_one(&mut self) -> Option<bool> {
        self.update_gains()?;
        if self.drop_unphysical()? {
            return Some(true);
        }
        let fit = self.system.fit(&self.active(None))?;
        if let Some(index) = self.weakest(|index| !self.is_material(&fit, index)) {
            self.bar(index);
            return Some(true);
        }
        let dropped = self.weakest(|index| self.margin(index) < 0.0);
        if let Some(index) = dropped {
            self.chosen.remove(index);
        }
        Some(dropped.is_some())
    }

    /// Where an effect is not physical beside the others, drops the weakest of those without which it is, itself among them, and bars it:
    /// it would come back as strong, and do the same again.
    fn drop_unphysical(&mut self) -> Option<bool> {
        let fit = self.system.fit(&self.active(None))?;
        let Some(victim) = self.weakest(|index| !self.is_sayable(&fit, index)) else { return Some(false) };
        let restores = |index: usize| {
            let without = || self.system.fit(&self.active(Some(index)));
            index == victim || without().is_some_and(|fit| self.is_sayable(&fit, victim))
        };
        let dropped = self.weakest(restores).unwrap_or(victim);
        self.bar(dropped);
        Some(true)
    }

    /// Whether an arm can have all that was taken in.
    pub fn is_possible(&self) -> bool {
        self.system.fit(&self.active(None)).is_some_and(|fit| self.is_possible_with(&fit))
    }

    /// Whether an arm can have all that was taken in with the coefficients of `fit`.
    pub fn is_possible_with(&self, fit: &Fit) -> bool {
        (0..self.chosen.len()).all(|index| self.is_sayable(fit, index))
    }

    /// Whether the effect number `index` is physical in `fit`, an arm file can say it, and an arm can have it beside those before it.
    fn is_sayable(&self, fit: &Fit, index: usize) -> bool {
        let arm = self.case.stages[0].arm();
        let placed = |index: usize| self.named(index).placed(arm, &self.coefficients(fit, index));
        let Some(one) = placed(index) else { return false };
        let before: Vec<Placed> = (0..index).filter_map(placed).collect();
        changed(arm, before.iter().chain([&one])).is_ok() || changed(arm, &before).is_err()
    }

    /// Whether the effect number `index` says enough in `fit` to be a finding.
    fn is_material(&self, fit: &Fit, index: usize) -> bool {
        let beta = DVector::from_vec(self.coefficients(fit, index));
        self.system.is_material(&self.named(index).block, &beta)
    }

    /// By how much the effect number `index` explains more than counts.
    fn margin(&self, index: usize) -> f64 {
        self.chosen[index].gain - self.threshold(self.named(index))
    }

    /// Whether the effect number `index` explains less than counts.
    pub(super) fn is_idle(&self, index: usize) -> bool {
        self.margin(index) < 0.0
    }

    /// The effect that explains least of those that are `such`.
    fn weakest(&self, such: impl Fn(usize) -> bool) -> Option<usize> {
        let among = (0..self.chosen.len()).filter(|&index| such(index));
        among.min_by(|&a, &b| self.margin(a).total_cmp(&self.margin(b)))
    }

    /// Weights and gains under what was taken in, less what is not physical under these.
    pub fn settle(&mut self) -> Option<()> {
        self.weigh_anew()?;
        self.update_gains()?;
        while self.drop_unphysical()? {
            self.weigh_anew()?;
            self.update_gains()?;
        }
        Some(())
    }
}

/// How plain a law is: fewer numbers are plainer.
pub(super) fn plainness(hypothesis: &Hypothesis) -> usize {
    let numbers = hypothesis
        .shape
        .iter()
        .filter(|(name, value)| value.is_float() && ![ABOUT, START].contains(&name.as_str()));
    hypothesis.size() + numbers.count()
}
