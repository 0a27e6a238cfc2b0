//! What explains most: the best shape of every kind at every place, and the strongest of all.

use std::collections::BTreeMap;

use super::case::Weighing;
use super::hypothesis::Hypothesis;
use super::search::Search;
use super::select::NEARLY;
use super::system::{Fit, Score};

/// Kinds whose merits differ by less than this share are judged by their strongest place.
const ALIKE: f64 = 0.05;

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
    /// What `winner` leaves beside `fit`.
    pub(super) fn left_by(&self, fit: &Fit, winner: &Winner) -> Vec<Vec<f64>> {
        self.system.residual_with(fit, &self.hypotheses[winner.hypothesis].block, &winner.score)
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
        let is_other = |&at: &usize| at != but && self.hypotheses[at].same_effect(&self.hypotheses[but]);
        let shapes =
            (0..self.hypotheses.len()).filter(is_other).filter_map(|at| self.in_its_shape(fit, weighing, at));
        shapes.max_by(|a, b| a.merit.total_cmp(&b.merit))
    }

    /// The hypothesis number `at` beside `fit`, if it is physical there, says anything and is told from what was taken in.
    pub(super) fn in_its_shape(&self, fit: &Fit, weighing: &Weighing, at: usize) -> Option<Winner> {
        let hypothesis = &self.hypotheses[at];
        let score = self.system.exact_score(fit, &hypothesis.block)?;
        let merit = self.merit(hypothesis, score.gain, weighing);
        let others = &fit.active[self.nuisances().len()..];
        let may_stand = merit > 0.0
            && hypothesis.is_physical(&score)
            && self.system.is_material(&hypothesis.block, &score.beta)
            && self.system.is_apart(others, &hypothesis.block);
        may_stand.then_some(Winner { hypothesis: at, score, merit })
    }

    /// The strongest member of the strongest kind, of all that count: the kind whose members explain most together where they show in different
    /// channels, as friction on several joints does; else the kind of the strongest single hypothesis.
    pub(super) fn winner(&mut self, fit: &Fit, weighing: &Weighing) -> Option<Winner> {
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

    /// `places` with the merit that each has in the place of an effect, which is left out of the first of two fits: what it explains beside
    /// that effect, too, is no reason to put it there.
    pub(super) fn in_place(
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
}
