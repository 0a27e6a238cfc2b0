//! How effects are chosen: forward while they count, backward where others made them idle, one exchanged for another where that
//! explains more; and the same once more from the friction that sits on every joint of a real machine.

use std::collections::BTreeMap;

use freeplay_laws::ABOUT;

use super::hypothesis::Hypothesis;
use super::places::Winner;
use super::search::{Chosen, Search, TOLD_APART};
use super::system::Fit;
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
pub(super) const NEARLY: f64 = 0.7;
/// The same for a plainer law whose shape was not moved off its grid.
pub(super) const CLOSE: f64 = 0.9;
/// Share of an effect's merit from which on what is far from linear may explain more in another shape.
pub(super) const HINT: f64 = 0.1;
/// What sits on every joint of a real machine.
pub(super) const USUAL: [&str; 3] = ["coulomb_friction", "viscous_friction", "torque_offset"];

impl Search<'_, '_> {
    /// Chooses the effects; `None` if a fit is singular. `progress` is told what was taken in.
    pub fn run(&mut self, progress: &mut dyn FnMut(&str)) -> Option<()> {
        self.weigh_anew()?;
        self.improve_all(progress)?;
        if self.chosen.len() > 1 {
            progress("searching from the friction of every joint");
            let first = std::mem::take(&mut self.chosen);
            self.barred.clear();
            self.take_usual()?;
            self.improve_all(progress)?;
            self.keep_better(first)?;
        }
        self.look_beneath(progress)?;
        if self.merge(progress)? {
            self.look_beneath(progress)?;
        }
        self.agree()
    }

    /// Improves, and once more with laws of a measurement that act on what the others say.
    fn improve_all(&mut self, progress: &mut dyn FnMut(&str)) -> Option<()> {
        self.improve_validated(progress)?;
        if self.lay_upon_others()? {
            let before: Vec<usize> = self.chosen.iter().map(|it| it.hypothesis).collect();
            self.improve_validated(progress)?;
            if !self.chosen.iter().map(|it| it.hypothesis).eq(before) {
                self.lay_upon_others()?;
            }
        }
        Some(())
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
        // Of a few coefficients about which it is asked for, to its own: what stands in its place later is taken about its own, too.
        if self.named(last).shape.contains_key(ABOUT) && self.centre(last)? {
            self.take_shape(last);
        }
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

    /// Drops the effect number `index`, which did not prove itself on held-out data, for good; what could not stand beside it may.
    pub fn veto(&mut self, index: usize) {
        self.bar(index);
        self.vetoed.extend(self.barred.pop());
        self.barred.clear();
    }

    /// Drops the effect number `index` for this search.
    pub(super) fn bar(&mut self, index: usize) {
        self.barred.push((self.named(index).kind.name, self.named(index).joint));
        self.chosen.remove(index);
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
            refined |= self.centre_near(index, &fit, merit, places.values());
            if refined {
                places = self.by_place(&fit, &weighing, Some(index));
            }
            if let Some(plain) = self.special_case(index, &left, &fit, &weighing, &places) {
                self.give_way(index, plain, progress);
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
}

/// How plain a law is: fewer numbers are plainer.
pub(super) fn plainness(hypothesis: &Hypothesis) -> usize {
    let numbers = hypothesis.shape.iter().filter(|(name, value)| {
        value.is_float() && name.as_str() != ABOUT && !hypothesis.kind.takes_as_given(name)
    });
    hypothesis.size() + numbers.count()
}
