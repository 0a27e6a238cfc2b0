//! Levenberg–Marquardt minimisation by the documented rule of MATLAB's `trainlm`.
//!
//! # Rule
//! Each epoch computes JᵀJ and Jᵀe once and tries Δw = −(JᵀJ + μI)⁻¹ Jᵀe. If the step lowers the mean squared error, it is
//! accepted and μ is multiplied by `mu_decrease`; otherwise μ is multiplied by `mu_increase` and the step is tried again (M. T.
//! Hagan, M. B. Menhaj, "Training feedforward networks with the Marquardt algorithm", IEEE Trans. Neural Networks 5(6), 1994;
//! MathWorks, Neural Network Toolbox, `trainlm`). J and e are those of the plain sum of squares. A failed factorisation counts as
//! a rejected step.
//!
//! The training stops at `epochs`, `goal`, `min_gradient` or `mu_max`, or if the validation error has risen above its best in
//! `max_fail` epochs without falling below it. The result has the weights of the best validation error.
//!
//! # Undocumented details
//! The gradient for `min_gradient` is that of the mean squared error, 2 Jᵀe / n, in the Euclidean norm.

use crate::normal_equations::{DampedSolver, NormalEquations};
use std::ops::ControlFlow;

/// Smallest μ; a smaller damping would be lost in rounding.
const MU_MIN: f64 = 1.0e-20;

/// A least-squares problem: weights w with errors e(w).
pub trait LeastSquares {
    /// Number of weights.
    fn weights(&self) -> usize;

    /// Number of errors (residual rows): samples × outputs for a network.
    fn errors(&self) -> usize;

    /// Sum of squared errors at `weights`.
    fn cost(&mut self, weights: &[f64]) -> f64;

    /// Adds JᵀJ and Jᵀe at `weights` to `equations`, which are zero before the call.
    fn linearise(&mut self, weights: &[f64], equations: &mut NormalEquations);

    /// Mean squared error on the validation data, if there are any.
    fn validation(&mut self, _weights: &[f64]) -> Option<f64> {
        None
    }
}

/// Parameters of the rule; the default is MATLAB's.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Settings {
    /// Largest number of epochs (accepted steps).
    pub epochs: usize,
    /// Mean squared error at which the training stops.
    pub goal: f64,
    /// Norm of the gradient of the mean squared error at which the training stops.
    pub min_gradient: f64,
    /// Number of epochs with a validation error above the best one after which the training stops.
    pub max_fail: usize,
    /// Initial damping μ.
    pub mu: f64,
    /// Factor on μ after an accepted step, in (0, 1).
    pub mu_decrease: f64,
    /// Factor on μ after a rejected step, > 1.
    pub mu_increase: f64,
    /// Damping above which the training stops.
    pub mu_max: f64,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            epochs: 1000,
            goal: 0.0,
            min_gradient: 1.0e-7,
            max_fail: 6,
            mu: 1.0e-3,
            mu_decrease: 0.1,
            mu_increase: 10.0,
            mu_max: 1.0e10,
        }
    }
}

/// Reasons why the training ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Stop {
    /// The mean squared error reached the goal.
    Goal,
    /// The largest number of epochs was reached.
    Epochs,
    /// The gradient is small, which indicates a minimum.
    Gradient,
    /// No damping gives a better step: a minimum within the precision of the arithmetic.
    MuMax,
    /// The validation error keeps rising.
    Validation,
    /// The error hardly falls ([`crate::evidence`]).
    Settled,
    /// The caller stopped the training.
    Interrupted,
}

/// State after an epoch (epoch 0: before the first step).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Epoch {
    /// Number of accepted steps.
    pub epoch: usize,
    /// Mean squared training error.
    pub mse: f64,
    /// Mean squared validation error, if there are validation data.
    pub validation_mse: Option<f64>,
    /// Norm of the gradient of the mean squared error at the start of the step.
    pub gradient: f64,
    /// Damping of the next step.
    pub mu: f64,
}

/// Result of a minimisation.
#[derive(Debug, Clone, PartialEq)]
pub struct Outcome {
    /// Best weights: those of the lowest validation error, or of the lowest error without validation.
    pub weights: Vec<f64>,
    /// Reason for the end.
    pub stop: Stop,
    /// Epoch of these weights.
    pub best_epoch: usize,
    /// All epochs, from 0.
    pub history: Vec<Epoch>,
}

/// Reasons why the minimisation cannot start.
#[derive(Debug, thiserror::Error, PartialEq)]
pub enum MinimiseError {
    /// A parameter is out of range.
    #[error("{name} = {value}: it must be {must_be}")]
    BadSetting {
        /// Name of the parameter.
        name: &'static str,
        /// Given value.
        value: f64,
        /// Permitted range.
        must_be: &'static str,
    },
    /// The number of initial weights is wrong.
    #[error("{given} start weights for a problem of {needed}")]
    WrongStart {
        /// Given weights.
        given: usize,
        /// Required weights.
        needed: usize,
    },
    /// The initial error is NaN or infinite.
    #[error(
        "the mean squared error is {mse} at the start: check data and start weights for numbers that are too large"
    )]
    NonFiniteStart {
        /// The error found.
        mse: f64,
    },
}

/// Minimises `problem` from `start`. The function calls `progress` for every epoch; the callback may end the training.
///
/// # Errors
/// If a setting is out of range, `start` has the wrong length, or the initial error is not finite.
pub fn minimise(
    problem: &mut impl LeastSquares,
    start: Vec<f64>,
    settings: &Settings,
    mut progress: impl FnMut(&Epoch) -> ControlFlow<()>,
) -> Result<Outcome, MinimiseError> {
    settings.check()?;
    let needed = problem.weights();
    if start.len() != needed {
        return Err(MinimiseError::WrongStart { given: start.len(), needed });
    }
    let mut search = Search::new(problem, start, settings)?;
    loop {
        search.linearise();
        if let Some(stop) = search.record(&mut progress).or_else(|| search.reason_to_stop()) {
            return Ok(search.finish(stop));
        }
        if !search.step() {
            return Ok(search.finish(Stop::MuMax));
        }
    }
}

impl Settings {
    fn check(&self) -> Result<(), MinimiseError> {
        let rules = [
            ("goal", self.goal, self.goal >= 0.0, "at least 0"),
            ("min_gradient", self.min_gradient, self.min_gradient >= 0.0, "at least 0"),
            ("mu", self.mu, self.mu > 0.0 && self.mu <= self.mu_max, "above 0 and at most mu_max"),
            ("mu_decrease", self.mu_decrease, self.mu_decrease > 0.0 && self.mu_decrease < 1.0, "in (0, 1)"),
            ("mu_increase", self.mu_increase, self.mu_increase > 1.0, "above 1"),
            ("mu_max", self.mu_max, self.mu_max.is_finite(), "finite"),
        ];
        match rules.into_iter().find(|rule| !rule.2) {
            None => Ok(()),
            Some((name, value, _, must_be)) => Err(MinimiseError::BadSetting { name, value, must_be }),
        }
    }
}

/// The running minimisation.
struct Search<'a, P> {
    problem: &'a mut P,
    settings: &'a Settings,
    equations: NormalEquations,
    solver: DampedSolver,
    weights: Vec<f64>,
    trial: Vec<f64>,
    step: Vec<f64>,
    mse: f64,
    mu: f64,
    best: Best,
    history: Vec<Epoch>,
}

/// Best weights so far, by validation error.
struct Best {
    weights: Vec<f64>,
    epoch: usize,
    validation_mse: f64,
    fails: usize,
}

impl<'a, P: LeastSquares> Search<'a, P> {
    fn new(problem: &'a mut P, start: Vec<f64>, settings: &'a Settings) -> Result<Self, MinimiseError> {
        let size = start.len();
        let mse = mean(problem.cost(&start), problem.errors());
        if !mse.is_finite() {
            return Err(MinimiseError::NonFiniteStart { mse });
        }
        let best = Best { weights: start.clone(), epoch: 0, validation_mse: f64::INFINITY, fails: 0 };
        Ok(Self {
            problem,
            settings,
            equations: NormalEquations::new(size),
            solver: DampedSolver::new(size),
            trial: start.clone(),
            step: vec![0.0; size],
            weights: start,
            mse,
            mu: settings.mu,
            best,
            history: Vec::new(),
        })
    }

    fn linearise(&mut self) {
        self.equations.clear();
        self.problem.linearise(&self.weights, &mut self.equations);
    }

    /// Records the epoch and the best weights so far, and reports the epoch to the caller.
    fn record(&mut self, progress: &mut impl FnMut(&Epoch) -> ControlFlow<()>) -> Option<Stop> {
        let norm = self.equations.gradient().iter().map(|g| g * g).sum::<f64>().sqrt();
        let gradient = 2.0 * mean(norm, self.problem.errors());
        let validation_mse = self.problem.validation(&self.weights);
        let epoch = self.history.len();
        self.best.update(epoch, validation_mse, &self.weights);
        self.history.push(Epoch { epoch, mse: self.mse, validation_mse, gradient, mu: self.mu });
        progress(&self.history[epoch]).is_break().then_some(Stop::Interrupted)
    }

    fn reason_to_stop(&self) -> Option<Stop> {
        let last = self.history.last()?;
        if last.mse <= self.settings.goal {
            Some(Stop::Goal)
        } else if last.epoch >= self.settings.epochs {
            Some(Stop::Epochs)
        } else if last.gradient <= self.settings.min_gradient {
            Some(Stop::Gradient)
        } else if last.validation_mse.is_some() && self.best.fails >= self.settings.max_fail {
            Some(Stop::Validation)
        } else {
            None
        }
    }

    /// Moves to better weights; returns false if no damping up to `mu_max` gives any.
    fn step(&mut self) -> bool {
        while self.mu <= self.settings.mu_max {
            if self.solver.step(&self.equations, self.mu, &mut self.step).is_ok() {
                for ((trial, weight), step) in self.trial.iter_mut().zip(&self.weights).zip(&self.step) {
                    *trial = weight + step;
                }
                let mse = mean(self.problem.cost(&self.trial), self.problem.errors());
                if mse < self.mse {
                    self.mse = mse;
                    self.weights.copy_from_slice(&self.trial);
                    self.mu = (self.mu * self.settings.mu_decrease).max(MU_MIN);
                    return true;
                }
            }
            self.mu *= self.settings.mu_increase;
        }
        false
    }

    fn finish(self, stop: Stop) -> Outcome {
        let Best { weights, epoch: best_epoch, .. } = self.best;
        Outcome { weights, stop, best_epoch, history: self.history }
    }
}

impl Best {
    /// Counts failures as MATLAB does: a lower validation error resets the count, a higher one increments it, an equal one leaves
    /// it.
    fn update(&mut self, epoch: usize, validation_mse: Option<f64>, weights: &[f64]) {
        let lower = validation_mse.is_none_or(|mse| mse < self.validation_mse);
        if lower {
            self.validation_mse = validation_mse.unwrap_or(f64::INFINITY);
            self.fails = 0;
            self.epoch = epoch;
            self.weights.copy_from_slice(weights);
        } else {
            self.fails += usize::from(validation_mse != Some(self.validation_mse));
        }
    }
}

#[expect(clippy::cast_precision_loss)]
fn mean(sum: f64, count: usize) -> f64 {
    sum / count as f64
}
