//! Which effects explain what the model leaves: what is asked, what was taken in, and what it is worth. How the choice is made is in
//! `select`, how shapes are moved in `refine`.

use std::collections::BTreeMap;

use freeplay_arm::Arm;
use freeplay_laws::{ArmParts, LawError, Placed};
use toml::Table;

use super::case::{Case, Weighing};
use super::columns::sum_of;
use super::hypothesis::{Hypothesis, hypothesis};
use super::system::{Fit, System};

/// Chance that a perfect recording makes any hypothesis as strong as the threshold.
const ALARM: f64 = 1e-4;
/// Twins are few: the threshold stands this much above the strongest thing they showed.
const ABOVE_TWINS: f64 = 1.5;
/// Twice the log of the odds below which two effects are not told apart: 150 to 1.
pub(crate) const TOLD_APART: f64 = 10.0;

/// What twins say: the noise floor, and what each kind finds in nothing.
#[derive(Clone, Debug, Default)]
pub(crate) struct Null {
    /// Standard deviation of what a perfect model leaves, by channel.
    pub floor: Vec<f64>,
    /// Effective samples of that, by channel.
    pub effective: Vec<f64>,
    /// Greatest gain of any hypothesis of a kind.
    pub gains: BTreeMap<&'static str, f64>,
    /// Weights of the channels where nothing is missing.
    pub weights: Vec<f64>,
    /// The twins, which can be measured in another motion, too.
    pub twins: Vec<Twin>,
}

/// A machine inside the tolerances of its model.
#[derive(Clone, Debug)]
pub(crate) struct Twin {
    /// What it is drawn by.
    pub seed: u64,
    /// Coefficients of the nuisances, tuned to its recordings.
    pub tuned: Vec<f64>,
}

/// A kind and its joint.
type Site = (&'static str, Option<usize>);

/// An effect that was taken in.
#[derive(Clone, Debug)]
pub(crate) struct Chosen {
    /// Which hypothesis.
    pub hypothesis: usize,
    /// Its columns in the system's base.
    pub columns: Vec<usize>,
    /// What it explains beside the others: twice the log of the likelihood ratio.
    pub gain: f64,
}

/// Where a search stands, to go back to.
#[derive(Clone)]
pub(crate) struct Standing {
    chosen: Vec<Chosen>,
    /// Their shapes.
    shapes: Vec<Table>,
    weights: Vec<f64>,
    barred: Vec<Site>,
    vetoed: Vec<Site>,
}

impl Standing {
    /// Number of effects.
    pub fn len(&self) -> usize {
        self.chosen.len()
    }

    /// The same with the effects of `other` at `joint` of `search` in the place of its own; `None` if these are the same there.
    pub fn crossed(&self, other: &Self, joint: Option<usize>, search: &Search) -> Option<Self> {
        let is_there = |(chosen, _): &(&Chosen, &Table)| search.hypotheses[chosen.hypothesis].joint == joint;
        let at = |it: &Self, there: bool| -> Vec<(Chosen, Table)> {
            let pairs = it.chosen.iter().zip(&it.shapes).filter(|pair| is_there(pair) == there);
            pairs.map(|(chosen, shape)| (chosen.clone(), shape.clone())).collect()
        };
        let laws = |pairs: Vec<(Chosen, Table)>| -> Vec<(usize, Table)> {
            let mut laws: Vec<_> =
                pairs.into_iter().map(|(chosen, shape)| (chosen.hypothesis, shape)).collect();
            laws.sort_by_key(|(hypothesis, _)| *hypothesis);
            laws
        };
        if laws(at(self, true)) == laws(at(other, true)) {
            return None;
        }
        let (chosen, shapes) = at(self, false).into_iter().chain(at(other, true)).unzip();
        Some(Self { chosen, shapes, ..self.clone() })
    }
}

/// The search.
pub(crate) struct Search<'a, 'b> {
    /// The rows.
    pub case: &'b Case<'a>,
    /// The system, effects that were taken in behind the nuisances.
    pub system: System,
    /// Everything that might be missing.
    pub hypotheses: Vec<Hypothesis>,
    /// What twins say.
    pub null: Null,
    /// What was taken in.
    pub chosen: Vec<Chosen>,
    /// What the search from the other start took in.
    pub(super) runner_up: Vec<Chosen>,
    /// Columns of every hypothesis that was ever taken in.
    pub(super) admitted: BTreeMap<usize, Vec<usize>>,
    /// Kinds and places that did not stand the cross-validation.
    pub(super) barred: Vec<Site>,
    /// Kinds and places that did not prove themselves on held-out data.
    pub(super) vetoed: Vec<Site>,
    /// Number of nuisances.
    nuisances: usize,
    rows: Vec<f64>,
}

impl<'a, 'b> Search<'a, 'b> {
    /// A search of `hypotheses` in `system`.
    pub fn new(case: &'b Case<'a>, system: System, hypotheses: Vec<Hypothesis>, null: Null) -> Self {
        let (nuisances, rows) = (system.base.len(), case.rows());
        let (chosen, admitted, barred, vetoed) = (Vec::new(), BTreeMap::new(), Vec::new(), Vec::new());
        let runner_up = Vec::new();
        Self { case, system, hypotheses, null, chosen, runner_up, admitted, barred, vetoed, nuisances, rows }
    }

    /// Where it stands.
    pub fn standing(&self) -> Standing {
        Standing {
            chosen: self.chosen.clone(),
            shapes: self.chosen.iter().map(|it| self.hypotheses[it.hypothesis].shape.clone()).collect(),
            weights: self.system.weights.clone(),
            barred: self.barred.clone(),
            vetoed: self.vetoed.clone(),
        }
    }

    /// Goes back to where it stood.
    pub fn go_back(&mut self, to: Standing) {
        for (chosen, shape) in to.chosen.iter().zip(to.shapes) {
            let now = &mut self.hypotheses[chosen.hypothesis];
            if now.shape == shape {
                continue;
            }
            // It was moved since; its columns of then are still in the base.
            if let Ok(Some(then)) = hypothesis(self.case, &self.system, now.kind, now.joint, shape) {
                *now = then;
                self.admitted.insert(chosen.hypothesis, chosen.columns.clone());
            }
        }
        (self.chosen, self.system.weights, self.barred, self.vetoed) =
            (to.chosen, to.weights, to.barred, to.vetoed);
    }

    /// The same effects with the same weights, laid on `case`, whose nuisances are `base`: another stretch of the same recording.
    ///
    /// # Errors
    /// See [`LawError`].
    pub fn laid_on<'c>(&self, case: &'c Case<'a>, base: &System) -> Result<Search<'a, 'c>, LawError> {
        let mut system = base.clone();
        system.weights.clone_from(&self.system.weights);
        let hypotheses =
            self.chosen.iter().map(|chosen| self.hypotheses[chosen.hypothesis].laid_on(case, &system));
        let hypotheses = hypotheses.collect::<Result<Vec<_>, _>>()?;
        let mut laid = Search::new(case, system, hypotheses, self.null.clone());
        for (index, here) in self.chosen.iter().enumerate() {
            let there = laid.admit(index);
            laid.system.replace_as(&self.system, &here.columns, &there.columns);
            laid.chosen.push(there);
        }
        Ok(laid)
    }

    /// Lays the laws that were taken in on the arm as it was found, here and in the `other` cases: one after the other changes the arm, what the
    /// others do follows. `None` if a fit is singular.
    ///
    /// # Errors
    /// See [`LawError`].
    pub fn lay_upon_found(&mut self, others: &[&Case<'a>]) -> Result<Option<()>, LawError> {
        let Some(fit) = self.system.fit(&self.active(None)) else { return Ok(None) };
        let arm = self.case.stages[0].arm();
        let changes = |index: &usize| {
            let placed = self.named(*index).placed(arm, &self.coefficients(&fit, *index));
            let mut parts = ArmParts::of(arm);
            placed.is_some_and(|placed| placed.effect.arm(&mut parts).is_ok()) && !parts.are_of(arm)
        };
        let (found, others_left): (Vec<usize>, Vec<usize>) = (0..self.chosen.len()).partition(changes);
        if found.is_empty() || others_left.is_empty() {
            return Ok(Some(()));
        }
        let placed = |arm: &Arm| -> Vec<Placed> {
            let of = |&index: &usize| self.named(index).placed(arm, &self.coefficients(&fit, index));
            found.iter().filter_map(of).collect()
        };
        others.iter().chain([&self.case]).for_each(|case| case.lay_upon(placed));
        for index in others_left {
            let at = self.chosen[index].hypothesis;
            let now = &self.hypotheses[at];
            let shape = now.shape.clone();
            if let Some(laid) = hypothesis(self.case, &self.system, now.kind, now.joint, shape)? {
                self.hypotheses[at] = laid;
                self.take_shape(index);
            }
        }
        Ok(self.settle())
    }

    /// Base columns of the nuisances and of all that was taken in, without the effect number `left_out`.
    pub fn active(&self, left_out: Option<usize>) -> Vec<usize> {
        let chosen = self.chosen.iter().enumerate().filter(|(k, _)| Some(*k) != left_out);
        (0..self.nuisances).chain(chosen.flat_map(|(_, chosen)| chosen.columns.iter().copied())).collect()
    }

    /// The same without the effects of both numbers.
    pub(super) fn active_without(&self, pair: [usize; 2]) -> Vec<usize> {
        let mut active = self.active(None);
        let out = pair.map(|index| &self.chosen[index].columns);
        active.retain(|column| !out.iter().any(|columns| columns.contains(column)));
        active
    }

    /// Base columns of the nuisances.
    pub fn nuisances(&self) -> Vec<usize> {
        (0..self.nuisances).collect()
    }

    /// The hypothesis of the effect number `index`.
    pub fn named(&self, index: usize) -> &Hypothesis {
        &self.hypotheses[self.chosen[index].hypothesis]
    }

    /// Whether `hypothesis` is an effect that was taken in, in whatever shape, the effect number `but` aside.
    pub fn is_taken(&self, hypothesis: &Hypothesis, but: Option<usize>) -> bool {
        let mut others = (0..self.chosen.len()).filter(|index| Some(*index) != but);
        others.any(|index| self.named(index).same_effect(hypothesis))
    }

    /// Coefficients of the effect number `index` in `fit`, which has it in.
    pub fn coefficients(&self, fit: &Fit, index: usize) -> Vec<f64> {
        let place = |column: &usize| fit.active.iter().position(|a| a == column);
        self.chosen[index].columns.iter().filter_map(place).map(|k| fit.eta[k]).collect()
    }

    /// Least gain that counts for a hypothesis.
    pub fn threshold(&self, hypothesis: &Hypothesis) -> f64 {
        let chance = ALARM / self.hypotheses.len().max(1) as f64;
        let by_twins = ABOVE_TWINS * self.null.gains.get(hypothesis.kind.name).copied().unwrap_or(0.0);
        chi_square(hypothesis.size(), chance).max(by_twins)
    }

    /// What the coefficients of `hypothesis` cost (Schwarz 1978).
    pub fn cost(&self, hypothesis: &Hypothesis, weighing: &Weighing) -> f64 {
        let effective: f64 = hypothesis.channels().map(|c| weighing.effective[c]).sum();
        hypothesis.size() as f64 * effective.max(2.0).ln()
    }

    /// Gain less that cost.
    pub fn merit(&self, hypothesis: &Hypothesis, gain: f64, weighing: &Weighing) -> f64 {
        gain - self.cost(hypothesis, weighing)
    }

    /// How sure each channel is if `residual` is what `fit` leaves: by what even the unnamed correction leaves of it, and by the error
    /// of the laws that were taken in.
    pub fn weighing(&self, residual: &[Vec<f64>], fit: &Fit) -> Weighing {
        let mut weighing = self.case.weigh(residual);
        let effects = fit.active.iter().zip(&fit.eta).filter(|(column, _)| **column >= self.nuisances);
        let said = sum_of(effects.map(|(column, eta)| (&self.system.base[*column], *eta)), residual.len());
        weighing.misfit = said.iter().zip(&self.rows).map(|(said, rows)| law_error(said, *rows)).collect();
        weighing
    }

    /// Weighs the channels for `residual`, which `fit` leaves.
    pub fn reweigh(&mut self, residual: &[Vec<f64>], fit: &Fit) -> Weighing {
        let weighing = self.weighing(residual, fit);
        self.system.weights = weighing.weights(&self.rows, &self.null.floor);
        weighing
    }

    /// Weights under what was taken in.
    pub fn weigh_anew(&mut self) -> Option<()> {
        for _ in 0..2 {
            let fit = self.system.fit(&self.active(None))?;
            let residual = self.system.residual(&fit);
            self.reweigh(&residual, &fit);
        }
        Some(())
    }

    /// What each effect explains beside the others.
    pub fn update_gains(&mut self) -> Option<()> {
        let all = self.system.fit(&self.active(None))?;
        for index in 0..self.chosen.len() {
            let without = self.system.fit(&self.active(Some(index)))?;
            self.chosen[index].gain = without.left - all.left;
        }
        Some(())
    }

    /// Takes the hypothesis number `hypothesis` in.
    pub fn admit(&mut self, hypothesis: usize) -> Chosen {
        let columns = if let Some(columns) = self.admitted.get(&hypothesis) {
            columns.clone()
        } else {
            let columns = self.system.admit(&self.hypotheses[hypothesis].block);
            for other in &mut self.hypotheses {
                self.system.catch_up(&mut other.block);
            }
            self.admitted.insert(hypothesis, columns.clone());
            columns
        };
        Chosen { hypothesis, columns, gain: 0.0 }
    }
}

/// A law of the catalogue is an idealisation: a machine follows it to about this share of what it says.
const LAW_ERROR: f64 = 0.05;

/// Long-run variance of what laws that say `said` miss: LAW_ERROR² times its power times the number of samples that are alike.
fn law_error(said: &[f64], rows: f64) -> f64 {
    if said.is_empty() || rows < 1.0 {
        return 0.0;
    }
    let mean = said.iter().sum::<f64>() / said.len() as f64;
    let varying: Vec<f64> = said.iter().map(|x| x - mean).collect();
    let alike = said.len() as f64 / super::noise::effective_samples(&varying).max(1.0);
    LAW_ERROR.powi(2) * alike * varying.iter().map(|x| x * x).sum::<f64>() / rows
}

/// The value that a χ² of `degrees` exceeds with the probability `chance` (Wilson & Hilferty 1931; a little too large far out).
pub(crate) fn chi_square(degrees: usize, chance: f64) -> f64 {
    let n = degrees.max(1) as f64;
    let spread = 2.0 / (9.0 * n);
    n * (1.0 - spread + normal_quantile(chance) * spread.sqrt()).powi(3)
}

/// The value that a normal exceeds with the probability `chance` < ½ (Abramowitz & Stegun 26.2.23, to 4.5e-4).
fn normal_quantile(chance: f64) -> f64 {
    let t = (-2.0 * chance.ln()).sqrt();
    let above = 2.515_517 + t * (0.802_853 + t * 0.010_328);
    let below = 1.0 + t * (1.432_788 + t * (0.189_269 + t * 0.001_308));
    t - above / below
}

#[cfg(test)]
mod tests {
    use super::chi_square;

    /// Tables of the distribution: one per cent, and one in a million.
    #[test]
    fn quantiles_match_the_tables() {
        for (degrees, chance, exact) in
            [(1, 0.01, 6.635), (3, 0.01, 11.345), (4, 1e-6, 33.377), (2, 1e-6, 27.631)]
        {
            let ours = chi_square(degrees, chance);
            println!("{degrees} degrees, {chance:.0e}: {ours:.2} against {exact}");
            assert!((ours / exact - 1.0).abs() < 0.12);
        }
    }
}
