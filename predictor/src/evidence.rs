//! Weight decay chosen by the evidence of the data, for networks that must be accurate between and beyond their samples.
//!
//! # Formula
//! The cost is Σ e² + Σ λ w². Each class of weights has one λ. Between rounds, λ = α/β of each class is set to the maximum of the evidence: α = γ / Σ w² over
//! the weights of the class, β = (n − Σ γ) / Σ e², with n errors and γ = Σ (1 − λ \[(JᵀJ + Λ)⁻¹\]ᵢᵢ) the number of the weights of the class that the data
//! determine (D. J. C. MacKay, "A practical Bayesian framework for backpropagation networks", Neural Computation 4, 1992; F. D. Foresee, M. T. Hagan,
//! "Gauss–Newton approximation to Bayesian learning", ICNN 1997, MATLAB's `trainbr`). With a class for each input, λ of an uninformative input grows until
//! its weights are negligible (automatic relevance determination, R. M. Neal, "Bayesian Learning for Neural Networks", 1996, §1.2.3). The method needs no
//! validation samples to stop the training.
//!
//! A round need not reach its minimum before λ changes: it ends after a share of the epochs, or as soon as its cost hardly falls.

use crate::levenberg_marquardt::{Epoch, LeastSquares, MinimiseError, Outcome, Settings, Stop, minimise};
use crate::normal_equations::NormalEquations;
use std::ops::ControlFlow;

/// Initial λ.
const FIRST: f64 = 1e-2;
/// Least λ; a smaller decay would be lost in rounding.
const LEAST: f64 = 1e-9;
/// Greatest λ; the weights of its class are then negligible.
const MOST: f64 = 1e4;
/// Most rounds before the last one.
const ROUNDS: usize = 30;
/// Each round before the last one may use one of this many parts of the epochs.
const SHARE: usize = 5;
/// A round ends if this many epochs reduce the cost by less than this share.
const HARDLY: (usize, f64) = (5, 1e-3);
/// Factor between successive λ below which λ counts as settled.
const SETTLED: f64 = 1.1;

/// A problem with weight decay; each weight has the λ of its class.
struct Decayed<'a, P> {
    problem: &'a mut P,
    decay: &'a Decay<'a>,
}

/// The λ of each class of weights.
struct Decay<'a> {
    /// The class of each weight.
    classes: &'a [usize],
    /// λ of each class.
    of_class: Vec<f64>,
}

impl Decay<'_> {
    fn of(&self, weight: usize) -> f64 {
        self.of_class[self.classes[weight]]
    }
}

impl<P: LeastSquares> LeastSquares for Decayed<'_, P> {
    fn weights(&self) -> usize {
        self.problem.weights()
    }

    fn errors(&self) -> usize {
        self.problem.errors()
    }

    fn cost(&mut self, weights: &[f64]) -> f64 {
        let penalty: f64 =
            weights.iter().enumerate().map(|(at, weight)| self.decay.of(at) * weight * weight).sum();
        self.problem.cost(weights) + penalty
    }

    fn linearise(&mut self, weights: &[f64], equations: &mut NormalEquations) {
        self.problem.linearise(weights, equations);
        for (at, weight) in weights.iter().enumerate() {
            let decay = self.decay.of(at);
            equations.gradient[at] += decay * weight;
            equations.matrix[(at, at)] += decay;
        }
    }
}

/// Minimises `problem` from `start` in rounds, with decays chosen by the evidence of the data, one for each class of weights; `classes` gives the class of
/// each weight. The last round has at most `settings.epochs` epochs, and the function returns its outcome.
///
/// # Errors
/// See [`minimise`].
pub fn minimise_by_evidence(
    problem: &mut impl LeastSquares,
    classes: &[usize],
    start: Vec<f64>,
    settings: &Settings,
    mut progress: impl FnMut(&Epoch) -> ControlFlow<()>,
) -> Result<Outcome, MinimiseError> {
    let few = Settings { epochs: (settings.epochs / SHARE).max(1), ..*settings };
    let count = classes.iter().max().map_or(0, |last| last + 1);
    let (mut decay, mut weights) = (Decay { classes, of_class: vec![FIRST; count] }, start);
    for _ in 0..ROUNDS {
        weights =
            until_settled(&mut Decayed { problem, decay: &decay }, weights, &few, &mut progress)?.weights;
        let Some(next) = chosen(problem, &weights, &decay) else { break };
        let is_settled =
            next.iter().zip(&decay.of_class).all(|(next, now)| (next / now).max(now / next) < SETTLED);
        decay.of_class = next;
        if is_settled {
            break;
        }
    }
    until_settled(&mut Decayed { problem, decay: &decay }, weights, settings, &mut progress)
}

/// Minimises as [`minimise`] does, but ends with [`Stop::Settled`] as soon as the cost hardly falls ([`HARDLY`]).
fn until_settled(
    problem: &mut impl LeastSquares,
    start: Vec<f64>,
    settings: &Settings,
    progress: &mut impl FnMut(&Epoch) -> ControlFlow<()>,
) -> Result<Outcome, MinimiseError> {
    let (epochs, share) = HARDLY;
    let (mut costs, mut is_interrupted) = (Vec::new(), false);
    let mut outcome = minimise(problem, start, settings, |epoch| {
        costs.push(epoch.mse);
        is_interrupted = progress(epoch).is_break();
        let before = costs.len().checked_sub(1 + epochs).map(|before| costs[before]);
        let hardly = before.is_some_and(|before| epoch.mse > before * (1.0 - share));
        if is_interrupted || hardly { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    })?;
    if outcome.stop == Stop::Interrupted && !is_interrupted {
        outcome.stop = Stop::Settled;
    }
    Ok(outcome)
}

/// λ of each class by the evidence at `weights`; `None` if the matrix is singular or the residual is zero.
fn chosen(problem: &mut impl LeastSquares, weights: &[f64], decay: &Decay<'_>) -> Option<Vec<f64>> {
    let mut equations = NormalEquations::new(weights.len());
    problem.linearise(weights, &mut equations);
    let mut matrix = equations.matrix;
    matrix.fill_upper_triangle_with_lower_triangle();
    for at in 0..weights.len() {
        matrix[(at, at)] += decay.of(at);
    }
    let inverse = matrix.cholesky()?.inverse();
    let count = decay.of_class.len();
    let (mut determined, mut squares) = (vec![0.0; count], vec![0.0; count]);
    for (at, weight) in weights.iter().enumerate() {
        let class = decay.classes[at];
        determined[class] += 1.0 - decay.of(at) * inverse[(at, at)];
        squares[class] += weight * weight;
    }
    let (errors, left) = (problem.errors() as f64, problem.cost(weights));
    let noise = left / (errors - determined.iter().sum::<f64>()).max(1.0);
    let of_class = |(determined, square): (&f64, &f64)| {
        let found = determined.max(0.0) / square * noise;
        if found.is_finite() { found.clamp(LEAST, MOST) } else { MOST }
    };
    noise.is_finite().then(|| determined.iter().zip(&squares).map(of_class).collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};

    fn square(values: &[f64]) -> f64 {
        values.iter().map(|value| value * value).sum()
    }

    /// y = x₀ w₀ with noise, and irrelevant columns.
    struct Linear {
        rows: Vec<(Vec<f64>, f64)>,
    }

    impl LeastSquares for Linear {
        fn weights(&self) -> usize {
            self.rows[0].0.len()
        }

        fn errors(&self) -> usize {
            self.rows.len()
        }

        fn cost(&mut self, weights: &[f64]) -> f64 {
            self.rows.iter().map(|row| error(row, weights).powi(2)).sum()
        }

        fn linearise(&mut self, weights: &[f64], equations: &mut NormalEquations) {
            self.rows.iter().for_each(|row| equations.add_row(error(row, weights), &row.0));
        }
    }

    fn error((x, y): &(Vec<f64>, f64), weights: &[f64]) -> f64 {
        x.iter().zip(weights).map(|(x, w)| x * w).sum::<f64>() - y
    }

    /// With few noisy rows and many columns, the estimated weights are closer to the true ones than those of least squares, and λ is close to its true value
    /// σ² / σ_w².
    #[test]
    fn the_decay_is_the_one_that_made_the_data() {
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(5);
        let (columns, count, noise) = (30, 60, 0.5_f64);
        let mut uniform = |size: f64| rng.random_range(-size..size);
        let truth: Vec<f64> = (0..columns).map(|_| uniform(0.3)).collect();
        let rows = (0..count)
            .map(|_| {
                let x: Vec<f64> = (0..columns).map(|_| uniform(1.0)).collect();
                let y = x.iter().zip(&truth).map(|(x, w)| x * w).sum::<f64>() + uniform(noise);
                (x, y)
            })
            .collect();
        let mut problem = Linear { rows };
        let settings = Settings::default();
        let off = |weights: &[f64]| -> f64 { weights.iter().zip(&truth).map(|(w, t)| (w - t).powi(2)).sum() };
        let go = |_: &Epoch| ControlFlow::Continue(());
        let plain = minimise(&mut problem, vec![0.0; columns], &settings, go).unwrap();
        let found =
            minimise_by_evidence(&mut problem, &vec![0; columns], vec![0.0; columns], &settings, go).unwrap();
        let classes = vec![0; columns];
        let decay = chosen(&mut problem, &found.weights, &Decay { classes: &classes, of_class: vec![1.0] })
            .unwrap()[0];
        let expected = (noise * noise) / (0.3 * 0.3);
        eprintln!(
            "off {:.3} and {:.3}, decay {decay:.2} of {expected:.2}",
            off(&plain.weights),
            off(&found.weights)
        );
        assert!(off(&found.weights) < off(&plain.weights), "nearer to the truth than least squares");
        assert!(decay > 0.3 * expected && decay < 3.0 * expected);
    }

    /// One half of the columns generated the data, the other half is irrelevant: the decay of the latter is far greater, and their weights are negligible.
    #[test]
    fn a_class_that_tells_nothing_decays_away() {
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(6);
        let mut uniform = |size: f64| rng.random_range(-size..size);
        let rows = (0..80)
            .map(|_| {
                let x: Vec<f64> = (0..20).map(|_| uniform(1.0)).collect();
                let y = x[..10].iter().sum::<f64>() + uniform(0.5);
                (x, y)
            })
            .collect();
        let classes: Vec<usize> = (0..20).map(|column| column / 10).collect();
        let mut problem = Linear { rows };
        let go = |_: &Epoch| ControlFlow::Continue(());
        let found =
            minimise_by_evidence(&mut problem, &classes, vec![0.1; 20], &Settings::default(), go).unwrap();
        let decay = Decay { classes: &classes, of_class: vec![1.0, 1.0] };
        let chosen = chosen(&mut problem, &found.weights, &decay).unwrap();
        let [told, silent] = [&found.weights[..10], &found.weights[10..]].map(square);
        eprintln!("decays {chosen:?}, squares {told:.2} and {silent:.4}");
        assert!(chosen[1] > 100.0 * chosen[0]);
        assert!((told - 10.0).abs() < 3.0 && silent < 1e-2 * told);
    }
}
