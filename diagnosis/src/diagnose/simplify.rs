//! No more law than there is: special cases in the place of laws, one cause in the place of two.

use std::collections::BTreeMap;

use freeplay_laws::ABOUT;

use super::case::Weighing;
use super::hypothesis::Hypothesis;
use super::places::Winner;
use super::search::{Search, TOLD_APART};
use super::select::{CLOSE, HINT, LEAST_GAIN, NEARLY, plainness};
use super::system::Fit;
use super::trial::squares;

/// A law is followed well that leaves no more than this share of what it says: what is left is no reason for a richer one.
pub(super) const FOLLOWED: f64 = 0.03;

/// By which share of its merit many effects have to say more than one that stands for all of them: one cause is likelier than several that happen to
/// have the same number.
const MORE_OF_MANY: f64 = 0.02;

impl Search<'_, '_> {
    /// Puts its special case in the place of the effect number `index` where that says as much, or one effect in the place of it and of
    /// one behind it; whether anything moved.
    pub fn simplify_at(&mut self, index: usize, progress: &mut dyn FnMut(&str)) -> Option<bool> {
        let fit = self.system.fit(&self.active(Some(index)))?;
        let all = self.system.fit(&self.active(None))?;
        let left = self.system.residual(&all);
        let weighing = self.weighing(&left, &all);
        let places = self.by_place(&fit, &weighing, Some(index));
        let Some(plain) = self.special_case(index, &left, &fit, &weighing, &places) else {
            return self.merge_at(index, progress);
        };
        self.give_way(index, plain, progress);
        self.settle()?;
        Some(true)
    }

    /// Puts its special case, the hypothesis number `plain`, in the place of the effect number `index`.
    pub(super) fn give_way(&mut self, index: usize, plain: usize, progress: &mut dyn FnMut(&str)) {
        let was = self.in_words(index);
        self.chosen[index] = self.admit(plain);
        let now = self.in_words(index);
        progress(&if was == now {
            format!("{was}: fewer of its numbers say as much")
        } else {
            format!("{was} is no better than {now}")
        });
    }

    /// The special case among `places` of the effect number `index` that says as much in its place. `left` is what all effects leave, `fit` has
    /// all but that one in.
    pub(super) fn special_case(
        &self,
        index: usize,
        left: &[Vec<f64>],
        fit: &Fit,
        weighing: &Weighing,
        places: &BTreeMap<(&'static str, Option<usize>), Winner>,
    ) -> Option<usize> {
        let named = self.named(index);
        let inside = |at: usize, is_same: bool| {
            let other = &self.hypotheses[at];
            named.contains(other) && named.same_effect(other) == is_same
        };
        // Of the same law only the strongest shape is among the places, and where that is not physical it is another one, which may be no shorter.
        let shorter = (0..self.hypotheses.len()).filter(|&at| inside(at, true));
        let shorter = shorter.filter_map(|at| self.in_its_shape(fit, weighing, at));
        let plainer = places.values().filter(|winner| inside(winner.hypothesis, false));
        let plainer = plainer.cloned().filter_map(|winner| self.exact(fit, weighing, winner));
        self.as_good(index, left, fit, shorter.chain(plainer))
    }

    /// The hypothesis among the special cases `inside` of the effect number `index` that does as well in its place. `left` is what all
    /// effects leave, `fit` has all but that one in.
    fn as_good(
        &self,
        index: usize,
        left: &[Vec<f64>],
        fit: &Fit,
        inside: impl Iterator<Item = Winner>,
    ) -> Option<usize> {
        inside
            .filter(|plain| plain.score.gain > self.threshold(&self.hypotheses[plain.hypothesis]))
            .find(|plain| {
                let said = self.said(&self.hypotheses[plain.hypothesis], plain.score.beta.as_slice());
                !self.is_worth_more(self.named(index), [left, &self.left_by(fit, plain)], said)
            })
            .map(|plain| plain.hypothesis)
    }

    /// Whether the law `rich` leaves so much less, `with` in place of `without`, of the channels in which it shows that it is worth its
    /// further numbers: no machine follows the plainer law, which says `said`, to the last digit.
    pub(super) fn is_worth_more(
        &self,
        rich: &Hypothesis,
        [with, without]: [&[Vec<f64>]; 2],
        said: f64,
    ) -> bool {
        let square = |rows: &[Vec<f64>]| -> f64 {
            rich.channels().map(|c| self.system.weights[c] * rows[c].iter().map(|x| x * x).sum::<f64>()).sum()
        };
        let (with, without) = (square(with), square(without));
        with < (1.0 - LEAST_GAIN).powi(2) * without && without > FOLLOWED.powi(2) * said
    }

    /// Weighed squares of what `hypothesis` says with these coefficients.
    pub(super) fn said(&self, hypothesis: &Hypothesis, coefficients: &[f64]) -> f64 {
        squares(&hypothesis.block.columns, coefficients, &self.system.weights).iter().sum()
    }

    /// Drops a law beside which its own special case was taken in, if that says as much alone; whether there was one.
    pub(super) fn drop_rich(&mut self) -> Option<bool> {
        for index in 0..self.chosen.len() {
            let inside = |&other: &usize| self.named(index).contains(self.named(other));
            let Some(plain) = (0..self.chosen.len()).find(inside) else { continue };
            let [without, all] = [Some(index), None].map(|but| self.system.fit(&self.active(but)));
            let (without, all) = (without?, all?);
            let said = self.said(self.named(plain), &self.coefficients(&without, plain));
            let left = [&all, &without].map(|fit| self.system.residual(fit));
            if !self.is_worth_more(self.named(index), [&left[0], &left[1]], said) {
                self.chosen.remove(index);
                return Some(true);
            }
        }
        Some(false)
    }

    /// Moves the shapes of those `rivals` off their grid that are plainer than the effect number `index` at its joint, beside `fit`, which
    /// lacks that one: what was refined is not compared with what was not. Whether any moved.
    pub(super) fn refine_plainer<'w>(
        &mut self,
        index: usize,
        fit: &Fit,
        rivals: impl Iterator<Item = &'w Winner>,
    ) -> bool {
        let (plain, joint) = (plainness(self.named(index)), self.named(index).joint);
        let near: Vec<usize> = rivals
            .map(|rival| rival.hypothesis)
            .filter(|&at| self.hypotheses[at].joint == joint && plainness(&self.hypotheses[at]) < plain)
            .collect();
        let mut moved = false;
        for at in near {
            if self.refine_beside(fit, at) {
                self.admitted.remove(&at);
                moved = true;
            }
        }
        moved
    }

    /// Takes those `rivals` that explain nearly the `merit` of the effect number `index` and are far from linear about the coefficient with which
    /// they explain most beside `fit`, which lacks that one, if it was so taken: a delay is not compared for small delays with a low-pass as slow as it
    /// is. Of two laws of a measurement a hint is enough. Whether any was.
    pub(super) fn centre_near<'w>(
        &mut self,
        index: usize,
        fit: &Fit,
        merit: f64,
        rivals: impl Iterator<Item = &'w Winner>,
    ) -> bool {
        if !self.named(index).shape.contains_key(ABOUT) {
            return false;
        }
        let measures = self.named(index).measures();
        let least = |at: usize| if measures && self.hypotheses[at].measures() { HINT } else { NEARLY };
        let near = rivals.filter(|rival| rival.merit > least(rival.hypothesis) * merit);
        let near: Vec<usize> = near.map(|rival| rival.hypothesis).collect();
        near.into_iter().filter(|&at| self.take_about(fit, at)).count() > 0
    }

    /// What explains more than the effect of the whole arm number `index`, which `fit` lacks and which is worth `merit`, if that is far from linear and
    /// was taken for all at once: effects of one kind on several joints that show in different channels, as a low-pass of every drive in the place of
    /// one delay.
    pub(super) fn many_for_one(
        &mut self,
        index: usize,
        fit: &Fit,
        weighing: &Weighing,
        merit: f64,
    ) -> Option<Vec<usize>> {
        let named = self.named(index);
        if named.joint.is_some() || named.channels().count() < 2 || !named.shape.contains_key(ABOUT) {
            return None;
        }
        let mut kinds: BTreeMap<&str, Vec<usize>> = BTreeMap::new();
        for ((kind, joint), winner) in self.by_place(fit, weighing, Some(index)) {
            let of_kind = kinds.entry(kind).or_default();
            let here = &self.hypotheses[winner.hypothesis];
            let is_apart = of_kind.iter().all(|&other| !self.hypotheses[other].meets(here));
            if joint.is_some() && is_apart && winner.merit > self.share_of(here, merit) {
                of_kind.push(winner.hypothesis);
            }
        }
        let least = merit + (MORE_OF_MANY * merit).max(TOLD_APART);
        let mut best: Option<(f64, Vec<usize>)> = None;
        for members in kinds.into_values().filter(|members| members.len() > 1) {
            members.iter().filter(|&&at| self.take_about(fit, at)).count();
            let merit_of = |at: usize| {
                let (hypothesis, score) =
                    (&self.hypotheses[at], self.system.exact_score(fit, &self.hypotheses[at].block)?);
                hypothesis.is_physical(&score).then(|| self.merit(hypothesis, score.gain, weighing))
            };
            let Some(merits) = members.iter().map(|&at| merit_of(at)).collect::<Option<Vec<f64>>>() else {
                continue;
            };
            // One delay may stand for what many low-passes say a little better, each with a number of its own.
            let together = merits.iter().sum::<f64>() - TOLD_APART * (members.len() - 1) as f64;
            if together > best.as_ref().map_or(least, |(most, _)| *most) {
                best = Some((together, members));
            }
        }
        best.map(|(_, members)| members)
    }

    /// The least merit that is worth looking at of `member` of a family in the place of an effect that is worth `merit`.
    fn share_of(&self, member: &Hypothesis, merit: f64) -> f64 {
        HINT * merit * member.channels().count() as f64 / self.case.kept.len().max(1) as f64
    }

    /// Puts one effect in the place of two that show in one channel where it explains as much: one cause is likelier than two. Whether it did.
    pub(super) fn merge(&mut self, progress: &mut dyn FnMut(&str)) -> Option<bool> {
        let (mut merged, mut first) = (false, 0);
        while first < self.chosen.len() {
            if self.merge_at(first, progress)? {
                merged = true;
            } else {
                first += 1;
            }
        }
        Some(merged)
    }

    /// The same for the effect number `first` and one behind it.
    fn merge_at(&mut self, first: usize, progress: &mut dyn FnMut(&str)) -> Option<bool> {
        for second in first + 1..self.chosen.len() {
            if !self.named(first).meets(self.named(second)) {
                continue;
            }
            let Some(one) = self.one_for_two([first, second])? else { continue };
            let were = [first, second].map(|index| self.in_words(index)).join(" and ");
            self.chosen[first] = self.admit(one);
            self.chosen.remove(second);
            progress(&format!("{were} are no better than {}", self.in_words(first)));
            self.settle()?;
            return Some(true);
        }
        Some(false)
    }

    /// What explains as much as the effects of both numbers together, with no more numbers; `None` inside if nothing does.
    fn one_for_two(&mut self, pair: [usize; 2]) -> Option<Option<usize>> {
        let fit = self.system.fit(&self.active_without(pair))?;
        let all = self.system.fit(&self.active(None))?;
        let left = self.system.residual(&all);
        let weighing = self.weighing(&left, &all);
        let costs: f64 = pair.iter().map(|&index| self.cost(self.named(index), &weighing)).sum();
        let both = fit.left - all.left - costs;
        let places = self.by_place(&fit, &weighing, Some(pair[0]));
        let most: usize = pair.iter().map(|&index| plainness(self.named(index))).sum();
        let is_hint = |winner: &&Winner| {
            let one = &self.hypotheses[winner.hypothesis];
            winner.merit > HINT * both && plainness(one) <= most && one.meets(self.named(pair[1]))
        };
        let exact = places.values().filter(is_hint).cloned().filter_map(|it| self.exact(&fit, &weighing, it));
        let near: Vec<usize> =
            exact.filter(|winner| winner.merit > CLOSE * both).map(|winner| winner.hypothesis).collect();
        let mut best: Option<Winner> = None;
        for at in near {
            if self.refine_beside(&fit, at) {
                self.admitted.remove(&at);
            }
            let score = self.system.exact_score(&fit, &self.hypotheses[at].block)?;
            let merit = self.merit(&self.hypotheses[at], score.gain, &weighing);
            // Friction that drives one way and brakes the other is an offset.
            let contains = |&index: &usize| self.hypotheses[at].contains(self.named(index));
            if pair.iter().any(contains) && score.beta.min() < 0.0 && score.beta.max() > 0.0 {
                continue;
            }
            let winner = Winner { hypothesis: at, score, merit };
            let is_better = best.as_ref().is_none_or(|best| winner.merit > best.merit);
            if merit > both - TOLD_APART && self.hypotheses[at].is_physical(&winner.score) && is_better {
                best = Some(winner);
            }
        }
        Some(best.map(|winner| winner.hypothesis))
    }
}
