//! Shapes off their grid: the numbers of a shape are moved as long as that explains more.

use freeplay_laws::ABOUT;

use super::hypothesis::{Hypothesis, hypothesis};
use super::search::{Chosen, Search};
use super::system::{Fit, Score};

/// Factors by which the numbers of a shape are moved.
const REFINEMENTS: [f64; 6] = [1.2, 1.08, 1.03, 1.01, 1.004, 1.0015];
/// Most moves by one factor: from one shape of the grid to the next, not to another law's.
const MOST_MOVES: usize = 4;
/// Twice the log of the odds below which two such are the same.
const SETTLED: f64 = 0.05;
/// Most times that a term is taken about the coefficient found.
const MOST_CENTRES: usize = 10;
/// A law is linear whose coefficient changes by less than this share when it is taken about it.
const LINEAR: f64 = 0.01;
/// Factors from one coefficient to the next around the best so far, and how many to either side.
const AROUND: [(f64, i32); 3] = [(1.25, 6), (1.08, 2), (1.03, 2)];

/// A law of one term that was taken about the coefficient found.
struct Centred {
    /// That coefficient.
    found: f64,
    /// What the law explained before.
    gain: f64,
    /// Whether the coefficient stays what it was.
    is_linear: bool,
    /// The law there, and what it explains.
    there: (Hypothesis, Score),
}

impl Search<'_, '_> {
    /// Moves the shapes of what was taken in off their grid, as long as that explains more; whether it did.
    pub(super) fn refine(&mut self) -> Option<bool> {
        self.refine_others(&[])
    }

    /// The same but for the hypotheses `known`, whose shapes were moved before.
    pub(super) fn refine_others(&mut self, known: &[usize]) -> Option<bool> {
        let mut any = false;
        for index in 0..self.chosen.len() {
            if known.contains(&self.chosen[index].hypothesis) {
                continue;
            }
            let mut moved = self.centre(index)?;
            let fit = self.system.fit(&self.active(Some(index)))?;
            moved |= self.refine_beside(&fit, self.chosen[index].hypothesis);
            moved |= self.centre(index)?;
            if moved {
                self.take_shape(index);
            }
            any |= moved;
        }
        Some(any)
    }

    /// Moves the shape of the hypothesis number `at` off its grid, as long as that explains more beside `fit`; whether it did.
    pub(super) fn refine_beside(&mut self, fit: &Fit, at: usize) -> bool {
        let mut moved = false;
        for factor in REFINEMENTS {
            for _ in 0..MOST_MOVES {
                if !self.reshape(fit, at, factor) && !self.reshape(fit, at, 1.0 / factor) {
                    break;
                }
                moved = true;
            }
        }
        moved
    }

    /// Multiplies each number of a shape by `factor` where that explains more, and of two numbers the one while it divides the other: a gap
    /// that is wider behind flanks that give less; whether it did.
    fn reshape(&mut self, fit: &Fit, at: usize, factor: f64) -> bool {
        let (kind, joint) = (self.hypotheses[at].kind, self.hypotheses[at].joint);
        let mut moved = false;
        let numbers: Vec<String> = self.hypotheses[at]
            .shape
            .iter()
            .filter(|(name, value)| value.as_float().is_some_and(|value| value != 0.0) && kind.refines(name))
            .map(|(name, _)| name.clone())
            .collect();
        let alone = numbers.iter().map(|name| vec![(name, factor)]);
        let others = |name| numbers.iter().filter(move |other| *other != name);
        let against = numbers
            .iter()
            .flat_map(|name| others(name).map(move |other| vec![(name, factor), (other, 1.0 / factor)]));
        for moves in alone.chain(against) {
            // Tolerances that had taken over what they can of the effect have to be free to give it back.
            let now =
                self.system.exact_score(fit, &self.hypotheses[at].block).map_or(0.0, |score| score.gain);
            let mut shape = self.hypotheses[at].shape.clone();
            for (name, factor) in moves {
                if let Some(toml::Value::Float(value)) = shape.get_mut(name) {
                    *value *= factor;
                }
            }
            let Ok(Some(other)) = hypothesis(self.case, &self.system, kind, joint, shape) else { continue };
            let Some(score) = self.system.exact_score(fit, &other.block) else { continue };
            if score.gain <= now * (1.0 + 1e-4) || !other.is_well_inside(&score) {
                continue;
            }
            self.hypotheses[at] = other;
            moved = true;
        }
        moved
    }

    /// Takes the only term of a law about the coefficient that it has, as long as that explains more; whether it did. A law that is far from
    /// linear, as a spring that swings, is taken about the best of many first.
    pub(super) fn centre(&mut self, index: usize) -> Option<bool> {
        let at = self.chosen[index].hypothesis;
        let fit = self.system.fit(&self.active(Some(index)))?;
        if self.hypotheses[at].size() != 1 {
            return Some(self.centre_many(&fit, at));
        }
        let mut moved = false;
        for _ in 0..MOST_CENTRES {
            let Some(centred) = self.centred(&fit, at) else { break };
            let wide =
                if centred.is_linear || moved { None } else { self.best_about(&fit, at, centred.found) };
            let best = wide.unwrap_or(centred.there);
            if best.1.gain <= centred.gain + SETTLED {
                break;
            }
            self.hypotheses[at] = best.0;
            moved = true;
        }
        Some(moved)
    }

    /// Takes all terms of a smooth law about the coefficients that they have beside `fit`, as long as that explains more: a centre of mass that is
    /// far off turns the tensor of its link, too. Whether it did.
    fn centre_many(&mut self, fit: &Fit, at: usize) -> bool {
        let mut moved = false;
        for _ in 0..MOST_CENTRES {
            let now = &self.hypotheses[at];
            if now.kind.rough {
                break;
            }
            let Some(score) = self.system.exact_score(fit, &now.block) else { break };
            let shape = now.shape_around(score.beta.as_slice());
            let Ok(Some(other)) = hypothesis(self.case, &self.system, now.kind, now.joint, shape) else {
                break;
            };
            let there = self.system.exact_score(fit, &other.block).filter(|there| other.is_physical(there));
            if there.is_none_or(|there| there.gain <= score.gain + SETTLED) {
                break;
            }
            self.hypotheses[at] = other;
            moved = true;
        }
        moved
    }

    /// Takes the hypothesis number `at`, which is not taken in, about the coefficient with which it explains most beside `fit`, if it is far from
    /// linear; whether that is another one.
    pub(super) fn take_about(&mut self, fit: &Fit, at: usize) -> bool {
        let now = &self.hypotheses[at];
        if now.size() != 1 || self.chosen.iter().any(|chosen| chosen.hypothesis == at) {
            return false;
        }
        let Some(centred) = self.centred(fit, at).filter(|centred| !centred.is_linear) else { return false };
        let best = self.best_about(fit, at, centred.found);
        let best = best.filter(|(_, best)| best.gain > centred.gain + SETTLED);
        let Some((other, _)) = best else { return false };
        self.hypotheses[at] = other;
        self.admitted.remove(&at);
        true
    }

    /// The only term of the hypothesis number `at` as it is, and taken about the coefficient that it has beside `fit`; `None` if it is not
    /// physical there.
    fn centred(&self, fit: &Fit, at: usize) -> Option<Centred> {
        let score = self.system.exact_score(fit, &self.hypotheses[at].block)?;
        let found = score.beta[0];
        let there = self.about(fit, at, found)?;
        let is_linear = (there.1.beta[0] / found - 1.0).abs() < LINEAR;
        Some(Centred { found, gain: score.gain, is_linear, there })
    }

    /// The hypothesis number `at` taken about the coefficient `about`, beside `fit`; `None` if it is not physical there.
    fn about(&self, fit: &Fit, at: usize, about: f64) -> Option<(Hypothesis, Score)> {
        let now = &self.hypotheses[at];
        let mut shape = now.shape.clone();
        shape.insert(ABOUT.to_owned(), toml::Value::Float(about));
        let other = hypothesis(self.case, &self.system, now.kind, now.joint, shape).ok()??;
        let score = self.system.exact_score(fit, &other.block)?;
        other.is_physical(&score).then_some((other, score))
    }

    /// The same about the one of many coefficients around `found` that explains most.
    fn best_about(&self, fit: &Fit, at: usize, found: f64) -> Option<(Hypothesis, Score)> {
        let (mut best, mut middle): (Option<(Hypothesis, Score)>, f64) = (None, found);
        for (factor, reach) in AROUND {
            let around: Vec<f64> = (-reach..=reach).map(|k| middle * factor.powi(k)).collect();
            for about in around {
                let Some(other) = self.about(fit, at, about) else { continue };
                if best.as_ref().is_none_or(|best| other.1.gain > best.1.gain) {
                    (best, middle) = (Some(other), about);
                }
            }
        }
        best
    }

    /// Brings the columns of the effect number `index` up to its shape.
    pub(super) fn take_shape(&mut self, index: usize) {
        let at = self.chosen[index].hypothesis;
        self.admitted.remove(&at);
        let moved = self.admit(at);
        // In whatever shape, what has a name is no tolerance any more.
        self.system.inherit(&self.chosen[index].columns, &moved.columns);
        self.chosen[index] = Chosen { gain: self.chosen[index].gain, ..moved };
    }
}
