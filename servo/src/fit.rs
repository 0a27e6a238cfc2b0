//! The fit of servo parameters: rollouts through windows of recordings, Levenberg–Marquardt with Student weights inside physical bounds.

use std::ops::Range;

use nalgebra::{DMatrix, DVector};

use crate::bounded::descend;
use crate::noise::Noise;
use crate::parallel::each;
use crate::rollout::{Rollout, ServoArm};
use crate::track::Track;
use crate::unknowns::Unknown;

/// Most steps; a fit that is not done by then says so.
const MOST_STEPS: usize = 40;
/// A fit ends with a step that gains less log-likelihood for each number: it moves them by a tenth of a standard deviation (½ · 0.1²).
const LEAST_GAIN: f64 = 5e-3;
/// One window in so many makes the coarse fit that the whole one begins from: a tenth of the work for nearly all of the way.
const COARSE: usize = 5;
/// Damping of the first step, its change after a step that was good and one that was not (Marquardt 1963; Nielsen 1999).
const DAMPING: [f64; 3] = [1e-3, 0.2, 5.0];
/// Tries of a step before the fit ends where it is.
const TRIES: usize = 8;
/// Blocks of a window whose scores are taken as independent of each other, in intervals.
const BLOCKS: usize = 4;

/// What a fit rests on.
#[derive(Clone, Debug)]
pub struct Problem<'a> {
    /// The recordings.
    pub tracks: &'a [Track],
    /// Windows: index of the track, and its rows.
    pub windows: Vec<(usize, Range<usize>)>,
    /// Least size of the noise of each joint, rad (m): that of rounding.
    pub rounding: Vec<f64>,
    /// Longest step of a rollout, s.
    pub longest_step: f64,
    /// Threads.
    pub threads: usize,
}

/// A fitted model.
#[derive(Clone, Debug)]
pub struct Fitted {
    /// The model.
    pub model: ServoArm,
    /// Value and standard deviation of each unknown, in their order.
    pub values: Vec<(f64, f64)>,
    /// The noise at the end.
    pub noise: Noise,
    /// Steps taken.
    pub steps: usize,
}

impl Problem<'_> {
    /// Residuals of `model` in every window, `[window][row][joint]`.
    pub fn residuals(&self, model: &ServoArm) -> Vec<Vec<f64>> {
        each(self.windows.len(), self.threads, |index| {
            let (track, rows) = &self.windows[index];
            let mut rollout = Rollout::new(&model.arm, self.longest_step);
            self.tracks[*track].residual(model, &mut rollout, rows)
        })
    }

    /// Log-likelihood lost to `residuals` under `noise`, for each joint.
    pub fn losses(&self, residuals: &[Vec<f64>], noise: &Noise) -> Vec<f64> {
        let joints = self.rounding.len();
        let mut losses = vec![0.0; joints];
        for window in residuals {
            for (at, r) in window.iter().enumerate() {
                losses[at % joints] += noise.loss(at % joints, *r);
            }
        }
        losses
    }

    /// Fits `unknowns` from `model` onwards, first to a few of the windows. `progress` is told the step's number and what it gained.
    pub fn fit(
        &self,
        model: &ServoArm,
        unknowns: &[Unknown],
        progress: &mut dyn FnMut(usize, f64),
    ) -> Fitted {
        let few: Vec<_> = self.windows.iter().skip(COARSE / 2).step_by(COARSE).cloned().collect();
        if few.len() < 2 {
            return self.fit_all(model, unknowns, progress);
        }
        let coarse = Problem { windows: few, rounding: self.rounding.clone(), ..*self };
        let begun = coarse.fit_all(model, unknowns, progress);
        self.fit_all(&begun.model, unknowns, progress)
    }

    fn fit_all(
        &self,
        model: &ServoArm,
        unknowns: &[Unknown],
        progress: &mut dyn FnMut(usize, f64),
    ) -> Fitted {
        let mut state = self.state(model.clone(), unknowns);
        let mut damping = DAMPING[0];
        let mut steps = 0;
        while steps < MOST_STEPS {
            let gain = self.step(&mut state, unknowns, &mut damping);
            steps += 1;
            progress(steps, gain);
            if gain < LEAST_GAIN * unknowns.len() as f64 {
                break;
            }
        }
        let curvature = self.curvature(&state, unknowns);
        let values = state.x.iter().copied().zip(curvature.deviations(unknowns)).collect();
        Fitted { model: state.model, values, noise: state.noise, steps }
    }

    fn state(&self, model: ServoArm, unknowns: &[Unknown]) -> Standing {
        let residuals = self.residuals(&model);
        let noise = Noise::of(&residuals, &self.rounding);
        Standing { x: unknowns.iter().map(|unknown| unknown.of(&model)).collect(), model, residuals, noise }
    }

    /// Takes a step; what it gained, log-likelihood and prior.
    fn step(&self, state: &mut Standing, unknowns: &[Unknown], damping: &mut f64) -> f64 {
        let curvature = self.curvature(state, unknowns);
        let before = self.lost(&state.residuals, &state.noise, &state.x, unknowns);
        for _ in 0..TRIES {
            let x = curvature.next(&state.x, unknowns, *damping);
            let model = placed(&state.model, unknowns, &x);
            let residuals = self.residuals(&model);
            let gain = before - self.lost(&residuals, &state.noise, &x, unknowns);
            if gain > 0.0 {
                *damping *= DAMPING[1];
                let noise = Noise::of(&residuals, &self.rounding);
                *state = Standing { x, model, residuals, noise };
                return gain;
            }
            *damping *= DAMPING[2];
        }
        0.0
    }

    fn lost(&self, residuals: &[Vec<f64>], noise: &Noise, x: &[f64], unknowns: &[Unknown]) -> f64 {
        let prior =
            |(unknown, x): (&Unknown, &f64)| 0.5 * ((x - unknown.expected) / unknown.deviation).powi(2);
        self.losses(residuals, noise).iter().sum::<f64>() + unknowns.iter().zip(x).map(prior).sum::<f64>()
    }

    /// First and second derivatives (Gauss–Newton) of what is lost, window by window on all threads.
    fn curvature(&self, state: &Standing, unknowns: &[Unknown]) -> Curvature {
        let parts = each(self.windows.len(), self.threads, |index| self.part(state, unknowns, index));
        let count = unknowns.len();
        let mut sum = Curvature {
            gradient: DVector::zeros(count),
            hessian: DMatrix::zeros(count, count),
            scores: DMatrix::zeros(count, count),
        };
        for part in parts {
            sum.gradient += part.gradient;
            sum.hessian += part.hessian;
            sum.scores += part.scores;
        }
        for (i, unknown) in unknowns.iter().enumerate() {
            let precision = unknown.deviation.powi(-2);
            sum.gradient[i] += precision * (state.x[i] - unknown.expected);
            sum.hessian[(i, i)] += precision;
            sum.scores[(i, i)] += precision;
        }
        sum
    }

    fn part(&self, state: &Standing, unknowns: &[Unknown], index: usize) -> Curvature {
        let (track, rows) = &self.windows[index];
        let mut rollout = Rollout::new(&state.model.arm, self.longest_step);
        let (base, joints) = (&state.residuals[index], self.rounding.len());
        let slopes: Vec<Vec<f64>> = unknowns
            .iter()
            .zip(&state.x)
            .map(|(unknown, x)| {
                let mut model = state.model.clone();
                unknown.set(&mut model, x + unknown.step);
                let moved = self.tracks[*track].residual(&model, &mut rollout, rows);
                moved.iter().zip(base).map(|(moved, base)| (moved - base) / unknown.step).collect()
            })
            .collect();
        let count = unknowns.len();
        let mut sum = Curvature {
            gradient: DVector::zeros(count),
            hessian: DMatrix::zeros(count, count),
            scores: DMatrix::zeros(count, count),
        };
        let block = base.len().div_ceil(BLOCKS).max(1);
        for begin in (0..base.len()).step_by(block) {
            let mut score = DVector::zeros(count);
            for at in begin..base.len().min(begin + block) {
                let weight = state.noise.weight(at % joints, base[at]);
                if weight == 0.0 {
                    continue;
                }
                for (i, slope) in slopes.iter().enumerate() {
                    let weighed = weight * slope[at];
                    score[i] += weighed * base[at];
                    for (j, other) in slopes.iter().enumerate().take(i + 1) {
                        sum.hessian[(i, j)] += weighed * other[at];
                    }
                }
            }
            sum.scores += &score * score.transpose();
            sum.gradient += score;
        }
        sum.hessian.fill_upper_triangle_with_lower_triangle();
        sum
    }
}

/// Where a fit stands.
struct Standing {
    x: Vec<f64>,
    model: ServoArm,
    residuals: Vec<Vec<f64>>,
    noise: Noise,
}

/// Derivatives of what is lost.
struct Curvature {
    gradient: DVector<f64>,
    hessian: DMatrix<f64>,
    /// Sum over blocks of the outer products of their gradients.
    scores: DMatrix<f64>,
}

impl Curvature {
    /// The values after a damped step inside the bounds.
    fn next(&self, x: &[f64], unknowns: &[Unknown], damping: f64) -> Vec<f64> {
        let mut hessian = self.hessian.clone();
        for i in 0..x.len() {
            hessian[(i, i)] *= 1.0 + damping;
        }
        let least: Vec<f64> =
            unknowns.iter().zip(x).map(|(unknown, x)| unknown.quantity.least() - x).collect();
        let step = descend(&hessian, &self.gradient, &least);
        x.iter().zip(step.iter()).zip(unknowns).map(|((x, d), u)| (x + d).max(u.quantity.least())).collect()
    }

    /// Standard deviations that hold although the rows of a block are correlated and the model is not exact: H⁻¹ S H⁻¹ (Huber 1967; White 1982,
    /// Econometrica 50:1).
    fn deviations(&self, unknowns: &[Unknown]) -> Vec<f64> {
        match self.hessian.clone().cholesky() {
            Some(factor) => {
                let inverse = factor.inverse();
                let covariance = &inverse * &self.scores * &inverse;
                covariance.diagonal().iter().map(|variance| variance.max(0.0).sqrt()).collect()
            }
            None => unknowns.iter().map(|unknown| unknown.deviation).collect(),
        }
    }
}

/// `model` with the values `x`.
fn placed(model: &ServoArm, unknowns: &[Unknown], x: &[f64]) -> ServoArm {
    let mut model = model.clone();
    unknowns.iter().zip(x).for_each(|(unknown, x)| unknown.set(&mut model, *x));
    model
}
