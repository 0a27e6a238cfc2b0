//! Which effects explain what the model leaves: forward selection under thresholds that twins set, and backward elimination.

use std::collections::BTreeMap;

use super::case::{Case, Weighing};
use super::hypothesis::{Hypothesis, hypothesis};
use super::system::{Fit, Score, System};

/// Most effects that are named, and most kinds among them: friction sits on every joint of a real machine.
const MOST_EFFECTS: usize = 24;
const MOST_KINDS: usize = 6;
/// How often weights and winner are brought into agreement.
const ROUNDS: usize = 4;
/// Chance that a perfect recording makes any hypothesis as strong as the threshold.
const ALARM: f64 = 1e-4;
/// Factors by which the numbers of a shape are moved.
const REFINEMENTS: [f64; 4] = [1.2, 1.08, 1.03, 1.01];
/// Kinds whose merits differ by less than this share are judged by their strongest place.
const ALIKE: f64 = 0.05;
/// Twins are few: the threshold stands this much above the strongest thing they showed.
const ABOVE_TWINS: f64 = 1.5;

/// What twins say: the noise floor, and what each kind finds in nothing.
#[derive(Clone, Debug, Default)]
pub(crate) struct Null {
    /// Standard deviation of what a perfect model leaves, by channel.
    pub floor: Vec<f64>,
    /// Effective samples of that, by channel.
    pub effective: Vec<f64>,
    /// Greatest gain of any hypothesis of a kind.
    pub gains: BTreeMap<&'static str, f64>,
}

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
    /// Number of nuisances.
    nuisances: usize,
    rows: Vec<f64>,
}

/// The strongest hypothesis of a step.
struct Winner {
    hypothesis: usize,
    score: Score,
}

/// The places of one kind.
#[derive(Default)]
struct Family {
    strongest: Option<(f64, Winner)>,
    together: f64,
    channels: Vec<usize>,
    overlap: bool,
}

impl Family {
    /// Takes a place in; it adds to the others if it `counts`.
    fn join(&mut self, merit: f64, winner: Winner, counts: bool, channels: Vec<usize>) {
        if counts {
            self.together += merit;
            self.overlap |= channels.iter().any(|channel| self.channels.contains(channel));
            self.channels.extend(channels);
        }
        if self.strongest.as_ref().is_none_or(|(strongest, _)| merit > *strongest) {
            self.strongest = Some((merit, winner));
        }
    }

    /// Of its strongest place.
    fn alone(&self) -> f64 {
        self.strongest.as_ref().map_or(f64::NEG_INFINITY, |(merit, _)| *merit)
    }

    /// Of all its places, if they show in different channels.
    fn merit(&self) -> f64 {
        if self.overlap { self.alone() } else { self.together.max(self.alone()) }
    }
}

impl<'a, 'b> Search<'a, 'b> {
    /// A search of `hypotheses` in `system`.
    pub fn new(case: &'b Case<'a>, system: System, hypotheses: Vec<Hypothesis>, null: Null) -> Self {
        let (nuisances, rows) = (system.base.len(), case.rows());
        Self { case, system, hypotheses, null, chosen: Vec::new(), nuisances, rows }
    }

    /// Base columns of the nuisances and of all that was taken in, without the effect number `left_out`.
    pub fn active(&self, left_out: Option<usize>) -> Vec<usize> {
        let chosen = self.chosen.iter().enumerate().filter(|(k, _)| Some(*k) != left_out);
        (0..self.nuisances).chain(chosen.flat_map(|(_, chosen)| chosen.columns.iter().copied())).collect()
    }

    /// Base columns of the nuisances.
    pub fn nuisances(&self) -> Vec<usize> {
        (0..self.nuisances).collect()
    }

    /// Least gain that counts for a hypothesis.
    pub fn threshold(&self, hypothesis: &Hypothesis) -> f64 {
        let chance = ALARM / self.hypotheses.len().max(1) as f64;
        let by_twins = ABOVE_TWINS * self.null.gains.get(hypothesis.kind.name).copied().unwrap_or(0.0);
        chi_square(hypothesis.size(), chance).max(by_twins)
    }

    /// Gain less what the number of coefficients costs (Schwarz 1978).
    pub fn merit(&self, hypothesis: &Hypothesis, gain: f64, weighing: &Weighing) -> f64 {
        let effective: f64 = hypothesis.channels().map(|c| weighing.effective[c]).sum();
        gain - hypothesis.size() as f64 * effective.max(2.0).ln()
    }

    /// Weighs the channels by what even the unnamed correction leaves of `residual`.
    pub fn reweigh(&mut self, residual: &[Vec<f64>]) -> Weighing {
        let weighing = self.case.weigh(residual);
        self.system.weights = weighing.weights(&self.rows, &self.null.floor);
        weighing
    }

    /// Takes effects in one by one as long as they count, then drops those that the others made idle.
    pub fn run(&mut self) -> Option<()> {
        for _ in 0..3 {
            let fit = self.system.fit(&self.active(None))?;
            let residual = self.system.residual(&fit);
            self.reweigh(&residual);
        }
        while self.chosen.len() < MOST_EFFECTS && self.step()? {}
        while self.drop_one()? {}
        self.settle()?;
        self.refine()?;
        self.settle()
    }

    /// Moves the shapes of what was taken in off their grid, as long as that explains more.
    fn refine(&mut self) -> Option<()> {
        for index in 0..self.chosen.len() {
            for factor in REFINEMENTS {
                while self.reshape(index, factor)? || self.reshape(index, 1.0 / factor)? {}
            }
        }
        Some(())
    }

    /// Multiplies each number of a shape by `factor` where that explains more; whether it did.
    fn reshape(&mut self, index: usize, factor: f64) -> Option<bool> {
        let at = self.chosen[index].hypothesis;
        let fit = self.system.fit(&self.active(Some(index)))?;
        let (kind, joint) = (self.hypotheses[at].kind, self.hypotheses[at].joint);
        let mut moved = false;
        let numbers: Vec<(String, f64)> = self.hypotheses[at]
            .shape
            .iter()
            .filter_map(|(name, value)| Some((name.clone(), value.as_float()?)))
            .filter(|(_, value)| *value != 0.0)
            .collect();
        for (name, value) in numbers {
            let now = self.system.score(&fit, &self.hypotheses[at].block).map_or(0.0, |score| score.gain);
            let mut shape = self.hypotheses[at].shape.clone();
            shape.insert(name, toml::Value::Float(value * factor));
            let Ok(Some(other)) = hypothesis(self.case, &self.system, kind, joint, shape) else { continue };
            let Some(score) = self.system.score(&fit, &other.block) else { continue };
            if score.gain <= now * (1.0 + 1e-4) || !other.is_physical(&score) {
                continue;
            }
            self.chosen[index].columns = self.system.admit(&other.block);
            self.hypotheses[at] = other;
            for hypothesis in &mut self.hypotheses {
                self.system.catch_up(&mut hypothesis.block);
            }
            moved = true;
        }
        Some(moved)
    }

    /// Weights and gains under what was taken in.
    pub fn settle(&mut self) -> Option<()> {
        for _ in 0..2 {
            let fit = self.system.fit(&self.active(None))?;
            let residual = self.system.residual(&fit);
            self.reweigh(&residual);
        }
        self.update_gains()
    }

    fn update_gains(&mut self) -> Option<()> {
        let all = self.system.fit(&self.active(None))?;
        for index in 0..self.chosen.len() {
            let without = self.system.fit(&self.active(Some(index)))?;
            self.chosen[index].gain = without.left - all.left;
        }
        Some(())
    }

    /// Takes the strongest effect in if it counts; whether it did. `None` if a fit is singular.
    fn step(&mut self) -> Option<bool> {
        let weights = self.system.weights.clone();
        let mut last = None;
        let mut won = None;
        for _ in 0..ROUNDS {
            let fit = self.system.fit(&self.active(None))?;
            let residual = self.system.residual(&fit);
            let weighing = self.case.weigh(&residual);
            let Some(winner) = self.winner(&fit, &weighing) else { break };
            let with =
                self.system.residual_with(&fit, &self.hypotheses[winner.hypothesis].block, &winner.score);
            self.reweigh(&with);
            let same = last == Some(winner.hypothesis);
            last = Some(winner.hypothesis);
            won = Some(winner);
            if same {
                break;
            }
        }
        let Some(winner) = won else {
            self.system.weights = weights;
            return Some(false);
        };
        let hypothesis = &self.hypotheses[winner.hypothesis];
        if winner.score.gain < self.threshold(hypothesis) {
            self.system.weights = weights;
            return Some(false);
        }
        let columns = self.system.admit(&hypothesis.block);
        self.chosen.push(Chosen { hypothesis: winner.hypothesis, columns, gain: winner.score.gain });
        for hypothesis in &mut self.hypotheses {
            self.system.catch_up(&mut hypothesis.block);
        }
        Some(true)
    }

    /// The strongest member of the strongest kind: the kind whose members explain most together where they show in different
    /// channels, as friction on several joints does; else the kind of the strongest single hypothesis.
    fn winner(&self, fit: &Fit, weighing: &Weighing) -> Option<Winner> {
        let kinds = self.kinds();
        let mut best: BTreeMap<(&str, Option<usize>), (f64, Winner)> = BTreeMap::new();
        for (index, hypothesis) in self.hypotheses.iter().enumerate() {
            let taken =
                self.chosen.iter().any(|chosen| self.hypotheses[chosen.hypothesis].same_effect(hypothesis));
            if taken || (kinds.len() >= MOST_KINDS && !kinds.contains(&hypothesis.kind.name)) {
                continue;
            }
            let Some(score) = self.system.score(fit, &hypothesis.block) else { continue };
            let merit = self.merit(hypothesis, score.gain, weighing);
            let place = (hypothesis.kind.name, hypothesis.joint);
            let better = best.get(&place).is_none_or(|(least, _)| merit > *least);
            if better && hypothesis.is_physical(&score) {
                best.insert(place, (merit, Winner { hypothesis: index, score }));
            }
        }
        let mut families: BTreeMap<&str, Family> = BTreeMap::new();
        for ((kind, _), (merit, mut winner)) in best {
            let hypothesis = &self.hypotheses[winner.hypothesis];
            let mut merit = merit;
            if merit > 0.0 {
                let Some(score) = self.system.exact_score(fit, &hypothesis.block) else { continue };
                if !hypothesis.is_physical(&score) {
                    continue;
                }
                merit = self.merit(hypothesis, score.gain, weighing);
                winner.score = score;
            }
            let counts = merit > 0.0 && winner.score.gain > self.threshold(hypothesis);
            families.entry(kind).or_default().join(merit, winner, counts, hypothesis.channels().collect());
        }
        // What members explain together is not sharp: the fit without them is bent by what is missing.
        let most = families.values().map(Family::merit).fold(f64::NEG_INFINITY, f64::max);
        let near = families.into_values().filter(|family| family.merit() >= most - ALIKE * most.abs());
        let strongest = near.max_by(|a, b| a.alone().total_cmp(&b.alone()));
        strongest.and_then(|family| family.strongest).map(|(_, winner)| winner)
    }

    /// The kinds taken in.
    fn kinds(&self) -> Vec<&'static str> {
        let mut kinds: Vec<_> =
            self.chosen.iter().map(|chosen| self.hypotheses[chosen.hypothesis].kind.name).collect();
        kinds.sort_unstable();
        kinds.dedup();
        kinds
    }

    /// Drops the weakest effect if the others made it idle; whether one was dropped.
    fn drop_one(&mut self) -> Option<bool> {
        self.update_gains()?;
        let weakest = (0..self.chosen.len())
            .map(|index| {
                let chosen = &self.chosen[index];
                (index, chosen.gain - self.threshold(&self.hypotheses[chosen.hypothesis]))
            })
            .min_by(|a, b| a.1.total_cmp(&b.1));
        match weakest {
            Some((index, margin)) if margin < 0.0 => {
                self.chosen.remove(index);
                Some(true)
            }
            _ => Some(false),
        }
    }
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
