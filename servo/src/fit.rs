//! The fit of servo parameters: rollouts through windows of recordings, Levenberg–Marquardt with Student weights inside physical bounds.

use std::ops::Range;

use nalgebra::{DMatrix, DVector, SymmetricEigen};

use crate::bounded::descend;
use crate::noise::Noise;
use crate::parallel::each;
use crate::rollout::Rollout;
use crate::servo_arm::ServoArm;
use crate::track::Track;
use crate::unknowns::Unknown;

/// Factors by which a leap multiplies a parameter whose least value is 0.
const LEAPS: [f64; 4] = [0.0, 0.5, 0.8, 1.25];
/// Most steps; a fit that has not converged by then reports it.
const MOST_STEPS: usize = 40;
/// A fit ends with a step whose gain in log-likelihood per parameter is smaller: such a step moves a parameter by a tenth of a standard
/// deviation (½ · 0.1²).
const LEAST_GAIN: f64 = 5e-3;
/// The coarse problem, on which a search compares initial values, keeps one window in this many: a tenth of the work finds most of the
/// improvement.
const COARSE: usize = 5;
/// Factor on the steps of finite differences at the end, once full steps gain no more.
const NEARER: f64 = 0.15;
/// Damping of the first step, and its factors after a successful and a failed step (Marquardt 1963; Nielsen 1999).
const DAMPING: [f64; 3] = [1e-3, 0.2, 5.0];
/// Attempts at a step before the fit ends.
const TRIES: usize = 8;
/// Groups of rows that intervals need: with fewer, the scatter of the groups' estimates has itself a relative error of a quarter or more
/// (1/√(2 · 16)).
const GROUPS: usize = 16;
/// Most groups per window: each group then still lasts some seconds, many lags of a servo, so that groups are independent.
const MOST_CUTS: usize = 6;

/// The data of a fit.
#[derive(Clone, Debug)]
pub struct Problem<'a> {
    /// The recordings.
    pub tracks: &'a [Track],
    /// Windows: index of the track, and its rows.
    pub windows: Vec<(usize, Range<usize>)>,
    /// Rows that count, `[window][row][joint]`: those on which the initial state of their window has no effect. Empty if all count.
    pub counted: Vec<Vec<bool>>,
    /// Lower bound of the noise of each joint, rad (m): that of rounding.
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
    /// Inverse Hessian of the loss, in the same order: how the other parameters follow if one of them moves.
    pub inverse: DMatrix<f64>,
    /// The noise estimate at the end.
    pub noise: Noise,
    /// Steps taken.
    pub steps: usize,
}

impl Fitted {
    /// The model with `value` for unknown number `index` of `unknowns`. The other parameters move to their conditional optimum, to first
    /// order, inside their bounds.
    pub fn with(&self, unknowns: &[Unknown], index: usize, value: f64) -> ServoArm {
        let moved = value - self.values[index].0;
        let share = moved / self.inverse[(index, index)];
        let others = unknowns.iter().zip(&self.values).enumerate();
        let x: Vec<f64> = others
            .map(|(at, (unknown, (x, _)))| {
                let followed = x + share * self.inverse[(at, index)];
                if at == index { value } else { followed.max(unknown.least) }
            })
            .collect();
        placed(&self.model, unknowns, &x)
    }
}

impl Problem<'_> {
    /// Residuals of `model` in every window, `[window][row][joint]`; NaN where the recording has no value or a row does not count.
    pub fn residuals(&self, model: &ServoArm) -> Vec<Vec<f64>> {
        each(self.windows.len(), self.threads, |index| {
            self.residual(index, model, &mut Rollout::new(model, self.longest_step))
        })
    }

    fn residual(&self, index: usize, model: &ServoArm, rollout: &mut Rollout) -> Vec<f64> {
        let (track, rows) = &self.windows[index];
        let mut residual = self.tracks[*track].residual(model, rollout, rows);
        if let Some(counted) = self.counted.get(index) {
            residual.iter_mut().zip(counted).filter(|(_, counts)| !**counts).for_each(|(r, _)| *r = f64::NAN);
        }
        residual
    }

    /// The same problem with only those rows on which, under `model`, the initial state of their window has no effect.
    #[must_use]
    pub fn forgetting(mut self, model: &ServoArm) -> Self {
        self.counted.clear();
        let noise = Noise::of(&self.residuals(model), &self.rounding);
        self.counted = each(self.windows.len(), self.threads, |index| {
            let (track, rows) = &self.windows[index];
            let mut rollout = Rollout::new(model, self.longest_step);
            self.tracks[*track].forgets(model, &mut rollout, rows, &noise.size)
        });
        self
    }

    /// The problem of `joint` alone, on one thread; `tracks` are those of that joint ([`Track::by_joint`]).
    pub fn alone<'a>(&self, joint: usize, tracks: &'a [Track]) -> Problem<'a> {
        let joints = self.rounding.len();
        let of_joint = |rows: &Vec<bool>| rows.iter().skip(joint).step_by(joints).copied().collect();
        Problem {
            tracks,
            windows: self.windows.clone(),
            counted: self.counted.iter().map(of_joint).collect(),
            rounding: vec![self.rounding[joint]],
            longest_step: self.longest_step,
            threads: 1,
        }
    }

    /// Loss of log-likelihood from `residuals` under `noise`, by joint.
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

    /// The same problem with one window in five; `None` if there are too few windows.
    pub fn coarse(&self) -> Option<Problem<'_>> {
        let few: Vec<_> = self.windows.iter().skip(COARSE / 2).step_by(COARSE).cloned().collect();
        (few.len() > 1).then(|| Problem {
            windows: few,
            counted: Vec::new(),
            rounding: self.rounding.clone(),
            ..*self
        })
    }

    /// Fits `unknowns`, starting from `model`, in at most 40 steps. `progress` receives the number and the gain of each step.
    pub fn fit(
        &self,
        model: &ServoArm,
        unknowns: &[Unknown],
        progress: &mut dyn FnMut(usize, f64),
    ) -> Fitted {
        let mut state = self.state(model.clone(), unknowns);
        let mut damping = DAMPING[0];
        let (mut steps, least) = (0, LEAST_GAIN * unknowns.len() as f64);
        while steps < MOST_STEPS {
            let slopes = self.slopes(&state, unknowns);
            let gain = self.step(&mut state, (&slopes, unknowns), &mut damping);
            steps += 1;
            progress(steps, gain);
            if gain < least {
                if state.reach < 1.0 {
                    break;
                }
                state.reach = NEARER;
                damping = DAMPING[0];
            }
        }
        // Derivatives from wide differences would understate the standard deviations.
        state.reach = 1.0;
        self.fitted(state, unknowns, steps)
    }

    /// `model` itself, as the result of a fit of `unknowns` without steps.
    pub fn unfitted(&self, model: &ServoArm, unknowns: &[Unknown]) -> Fitted {
        self.fitted(self.state(model.clone(), unknowns), unknowns, 0)
    }

    fn fitted(&self, state: FitState, unknowns: &[Unknown], steps: usize) -> Fitted {
        let groups = self.groups(&state, &self.slopes(&state, unknowns), unknowns.len());
        let (deviations, inverse) = deviations(&groups, unknowns);
        let values = state.x.iter().copied().zip(deviations).collect();
        Fitted { model: state.model, values, inverse, noise: state.noise, steps }
    }

    /// Escapes from local minima of `fitted`: multiplies one parameter by each of 0, 0.5, 0.8 and 1.25, moves the others to their
    /// conditional optimum, and fits again, as long as the loss decreases. Stick-slip makes valleys that no derivative leads out of.
    pub fn escape_local_minimum(
        &self,
        mut fitted: Fitted,
        unknowns: &[Unknown],
        progress: &mut dyn FnMut(usize, f64),
    ) -> Fitted {
        for _ in unknowns {
            let Some(model) = self.nearest_leap(&fitted, unknowns) else { break };
            fitted = self.fit(&model, unknowns, progress);
        }
        fitted
    }

    /// The leap from `fitted` with the smallest loss, if any has a smaller loss than `fitted`.
    fn nearest_leap(&self, fitted: &Fitted, unknowns: &[Unknown]) -> Option<ServoArm> {
        let state = self.state(fitted.model.clone(), unknowns);
        let here = self.lost(&state.residuals, &state.noise, &state.x, unknowns);
        let positive = unknowns.iter().enumerate().filter(|(_, unknown)| unknown.least == 0.0);
        let leaps = positive.flat_map(|(index, _)| LEAPS.map(|share| (index, share)));
        let tried = leaps.map(|(index, share)| {
            let model = fitted.with(unknowns, index, share * state.x[index]);
            (here - self.loss_of(&model, &state.noise, unknowns), model)
        });
        tried.filter(|(gain, _)| *gain > 0.0).max_by(|a, b| a.0.total_cmp(&b.0)).map(|(_, model)| model)
    }

    /// The predicted gain in likelihood for each unknown of `more`, added to the `unknowns` of `fitted` with all of them at their optimum,
    /// to second order: Rao's score test of one more parameter. Zero where the parameter would have to cross its bound.
    pub fn scores(&self, fitted: &Fitted, unknowns: &[Unknown], more: &[Unknown]) -> Vec<f64> {
        let all: Vec<Unknown> = unknowns.iter().chain(more).copied().collect();
        let state = self.state(fitted.model.clone(), &all);
        let curvature = self.curvature(&state, &self.slopes(&state, &all), &all);
        let count = unknowns.len();
        let own = curvature.hessian.view((0, 0), (count, count)).clone_owned().cholesky();
        let score = |index: usize| {
            let beside = curvature.hessian.view((0, index), (count, 1));
            let follow = own.as_ref()?.solve(&beside);
            let slope = curvature.gradient[index] - follow.column(0).dot(&curvature.gradient.rows(0, count));
            let open = curvature.hessian[(index, index)] - follow.dot(&beside);
            let unknown = &all[index];
            let reached = unknown.of(&fitted.model) - slope / open;
            (open > 0.0 && reached > unknown.least).then(|| 0.5 * slope * slope / open)
        };
        (count..all.len()).map(|index| score(index).unwrap_or(0.0)).collect()
    }

    fn state(&self, model: ServoArm, unknowns: &[Unknown]) -> FitState {
        let residuals = self.residuals(&model);
        let noise = Noise::of(&residuals, &self.rounding);
        let x = values(&model, unknowns);
        FitState { x, model, residuals, noise, reach: 1.0 }
    }

    /// Takes a step along `slopes`; returns its gain in log-likelihood and prior.
    fn step(
        &self,
        state: &mut FitState,
        (slopes, unknowns): (&[Slopes], &[Unknown]),
        damping: &mut f64,
    ) -> f64 {
        let curvature = self.curvature(state, slopes, unknowns);
        let before = self.lost(&state.residuals, &state.noise, &state.x, unknowns);
        for _ in 0..TRIES {
            let x = curvature.next(&state.x, unknowns, *damping);
            let model = placed(&state.model, unknowns, &x);
            let residuals = self.residuals(&model);
            let gain = before - self.lost(&residuals, &state.noise, &x, unknowns);
            if gain > 0.0 {
                *damping *= DAMPING[1];
                let noise = Noise::of(&residuals, &self.rounding);
                *state = FitState { x, model, residuals, noise, reach: state.reach };
                return gain;
            }
            *damping *= DAMPING[2];
        }
        0.0
    }

    /// Loss of `model` under `noise`: negative log-likelihood and prior.
    pub fn loss_of(&self, model: &ServoArm, noise: &Noise, unknowns: &[Unknown]) -> f64 {
        self.lost(&self.residuals(model), noise, &values(model, unknowns), unknowns)
    }

    fn lost(&self, residuals: &[Vec<f64>], noise: &Noise, x: &[f64], unknowns: &[Unknown]) -> f64 {
        let prior =
            |(unknown, x): (&Unknown, &f64)| 0.5 * ((x - unknown.expected) / unknown.deviation).powi(2);
        self.losses(residuals, noise).iter().sum::<f64>() + unknowns.iter().zip(x).map(prior).sum::<f64>()
    }

    /// First and second derivatives (Gauss–Newton) of the loss, priors included.
    fn curvature(&self, state: &FitState, slopes: &[Slopes], unknowns: &[Unknown]) -> Curvature {
        let mut sum = Curvature::of_beliefs(unknowns, &state.x);
        self.groups(state, slopes, unknowns.len()).iter().for_each(|group| sum.add(group));
        sum
    }

    /// Derivatives of the residuals of each window by finite differences, on all threads.
    fn slopes(&self, state: &FitState, unknowns: &[Unknown]) -> Vec<Slopes> {
        each(self.windows.len(), self.threads, |index| {
            let mut rollout = Rollout::new(&state.model, self.longest_step);
            let of = |(unknown, x): (&Unknown, &f64)| {
                let mut model = state.model.clone();
                let reach = state.reach * unknown.step;
                unknown.set(&mut model, x + reach);
                let moved = self.residual(index, &model, &mut rollout);
                moved
                    .iter()
                    .zip(&state.residuals[index])
                    .map(|(moved, base)| (moved - base) / reach)
                    .collect()
            };
            unknowns.iter().zip(&state.x).map(of).collect()
        })
    }

    /// Derivatives of the loss in groups of rows that count as independent, window by window on all threads.
    fn groups(&self, state: &FitState, slopes: &[Slopes], count: usize) -> Vec<Curvature> {
        let cuts = GROUPS.div_ceil(self.windows.len().max(1)).min(MOST_CUTS);
        let joints = self.rounding.len();
        let windows = each(self.windows.len(), self.threads, |index| {
            let base = &state.residuals[index];
            let length = self.windows[index].1.len().div_ceil(cuts).max(1) * joints;
            let group = |begin: usize| {
                let of_group = base.iter().enumerate().skip(begin).take(length);
                // The square root of the weight of each row with a weight.
                let rows: Vec<(usize, f64)> = of_group
                    .map(|(at, r)| (at, state.noise.weight(at % joints, *r).sqrt()))
                    .filter(|(_, root)| *root > 0.0)
                    .collect();
                let columns = DMatrix::from_fn(rows.len(), count, |row, column| {
                    let (at, root) = rows[row];
                    root * slopes[index][column][at]
                });
                let right =
                    DVector::from_iterator(rows.len(), rows.iter().map(|(at, root)| root * base[*at]));
                let transposed = columns.transpose();
                Curvature { gradient: &transposed * right, hessian: &transposed * columns }
            };
            (0..base.len()).step_by(length).map(group).collect::<Vec<_>>()
        });
        windows.into_iter().flatten().collect()
    }
}

/// Derivatives of the residuals of a window, `[unknown][row and joint]`.
type Slopes = Vec<Vec<f64>>;

/// State of a fit.
struct FitState {
    x: Vec<f64>,
    model: ServoArm,
    residuals: Vec<Vec<f64>>,
    noise: Noise,
    /// Factor on the widest steps of finite differences.
    reach: f64,
}

/// Gradient and Hessian of the loss.
struct Curvature {
    gradient: DVector<f64>,
    hessian: DMatrix<f64>,
}

impl Curvature {
    fn zero(count: usize) -> Curvature {
        Curvature { gradient: DVector::zeros(count), hessian: DMatrix::zeros(count, count) }
    }

    /// Derivatives of the prior's loss at `x`.
    fn of_beliefs(unknowns: &[Unknown], x: &[f64]) -> Curvature {
        let mut beliefs = Curvature::zero(unknowns.len());
        for (i, unknown) in unknowns.iter().enumerate() {
            let precision = unknown.deviation.powi(-2);
            beliefs.gradient[i] = precision * (x[i] - unknown.expected);
            beliefs.hessian[(i, i)] = precision;
        }
        beliefs
    }

    fn add(&mut self, other: &Curvature) {
        self.gradient += &other.gradient;
        self.hessian += &other.hessian;
    }

    /// The parameters after a damped step inside the bounds.
    fn next(&self, x: &[f64], unknowns: &[Unknown], damping: f64) -> Vec<f64> {
        let mut hessian = self.hessian.clone();
        for i in 0..x.len() {
            hessian[(i, i)] *= 1.0 + damping;
        }
        let least: Vec<f64> = unknowns.iter().zip(x).map(|(unknown, x)| unknown.least - x).collect();
        let step = descend(&hessian, &self.gradient, &least);
        // A parameter whose step is not finite, since its change makes the simulation diverge, keeps its value.
        let moved = |x: &f64, d: &f64| if d.is_finite() { x + d } else { *x };
        let steps = x.iter().zip(step.iter()).zip(unknowns);
        steps.map(|((x, d), unknown)| moved(x, d).max(unknown.least)).collect()
    }
}

/// Standard deviations that hold although the rows of a group are correlated and the model is inexact: the scatter of the groups'
/// estimates, plus the share that the priors determine. In the plain form H⁻¹SH⁻¹ (White 1982, Econometrica 50:1) each group has pulled the
/// parameters towards itself, so that the scatter is too small. This form enlarges each group's estimate to correct for its share of the
/// curvature: Σ L⁻ᵀ(1 − L⁻¹H_gL⁻ᵀ)⁻¹ᐟ²L⁻¹g with H = LLᵀ (Bell & McCaffrey 2002, Survey Methodology 28:169). With few groups, Student's t
/// widens the deviations. The second result is H⁻¹.
fn deviations(groups: &[Curvature], unknowns: &[Unknown]) -> (Vec<f64>, DMatrix<f64>) {
    let expected: Vec<f64> = unknowns.iter().map(|unknown| unknown.expected).collect();
    let beliefs = Curvature::of_beliefs(unknowns, &expected).hessian;
    let whole = groups.iter().fold(beliefs.clone(), |sum, group| sum + &group.hessian);
    let Some(factor) = whole.cholesky() else {
        let believed: Vec<f64> = unknowns.iter().map(|unknown| unknown.deviation).collect();
        let inverse =
            DMatrix::from_fn(
                believed.len(),
                believed.len(),
                |i, j| {
                    if i == j { believed[i].powi(2) } else { 0.0 }
                },
            );
        return (believed, inverse);
    };
    let root = factor.l();
    let influences: Vec<DVector<f64>> =
        groups.iter().filter_map(|group| adjusted_influence(group, &root)).collect();
    let wider = student(influences.len() as f64 - 1.0);
    let inverse = factor.inverse();
    let of_beliefs = &inverse * &beliefs * &inverse;
    let deviation = |i: usize| {
        let scatter: f64 = influences.iter().map(|one| one[i] * one[i]).sum();
        (scatter * wider * wider + of_beliefs[(i, i)]).max(0.0).sqrt().min(unknowns[i].deviation * wider)
    };
    ((0..unknowns.len()).map(deviation).collect(), inverse)
}

/// The change of the parameters due to `group`, enlarged by (1 − share)^(−1/2) for its share of the curvature; `root` is the lower
/// triangular factor of the curvature of the whole fit.
fn adjusted_influence(group: &Curvature, root: &DMatrix<f64>) -> Option<DVector<f64>> {
    let half = root.solve_lower_triangular(&group.hessian)?;
    let share = root.solve_lower_triangular(&half.transpose())?;
    let score = root.solve_lower_triangular(&group.gradient)?;
    let eigen = SymmetricEigen::new(share);
    let mut along = eigen.eigenvectors.tr_mul(&score);
    for (along, share) in along.iter_mut().zip(eigen.eigenvalues.iter()) {
        *along /= (1.0 - share).max(f64::EPSILON).sqrt();
    }
    root.tr_solve_lower_triangular(&(&eigen.eigenvectors * along))
}

/// The two-sided 95 % quantile of Student's t with `freedom` degrees of freedom, over that of the normal distribution: Cornish–Fisher's
/// expansion, right to 0.1 % from eight degrees on (Abramowitz & Stegun 1964, 26.7.5).
fn student(freedom: f64) -> f64 {
    let (z, n) = (1.96_f64, freedom.max(1.0));
    let first = (z.powi(2) + 1.0) / 4.0;
    let second = (5.0 * z.powi(4) + 16.0 * z.powi(2) + 3.0) / 96.0;
    let third = (3.0 * z.powi(6) + 19.0 * z.powi(4) + 17.0 * z.powi(2) - 15.0) / 384.0;
    1.0 + first / n + second / n.powi(2) + third / n.powi(3)
}

/// The values of `unknowns` in `model`.
fn values(model: &ServoArm, unknowns: &[Unknown]) -> Vec<f64> {
    unknowns.iter().map(|unknown| unknown.of(model)).collect()
}

/// `model` with the values `x`.
fn placed(model: &ServoArm, unknowns: &[Unknown], x: &[f64]) -> ServoArm {
    let mut model = model.clone();
    unknowns.iter().zip(x).for_each(|(unknown, x)| unknown.set(&mut model, *x));
    model
}

#[cfg(test)]
mod tests {
    use nalgebra::{DMatrix, DVector};

    use super::{Curvature, deviations, student};
    use crate::model_parameter::ModelParameter;
    use crate::unknowns::Unknown;

    #[test]
    fn students_points_are_those_of_tables() {
        for (freedom, point) in [(5.0, 2.571), (8.0, 2.306), (15.0, 2.131), (30.0, 2.042), (120.0, 1.980)] {
            let ratio = student(freedom) * 1.96 / point;
            assert!((ratio - 1.0).abs() < 3e-3, "{freedom}: {ratio}");
        }
    }

    /// For numbers with equal weights the scatter is the standard deviation of their mean, s/√n.
    #[test]
    fn groups_give_the_deviation_of_a_mean() {
        let numbers = [1.0, 2.0, 4.0, 3.5, -1.0, 0.5, 2.5, 1.5, 0.0, 3.0];
        let count = numbers.len() as f64;
        let mean: f64 = numbers.iter().sum::<f64>() / count;
        let group = |x: &f64| Curvature {
            gradient: DVector::from_element(1, mean - x),
            hessian: DMatrix::from_element(1, 1, 1.0),
        };
        let groups: Vec<Curvature> = numbers.iter().map(group).collect();
        let unknown = Unknown {
            joint: 0,
            parameter: ModelParameter::Offset,
            expected: 0.0,
            deviation: 1e6,
            step: 1.0,
            is_torque: false,
            least: f64::NEG_INFINITY,
        };
        let found = deviations(&groups, &[unknown]).0[0];
        let square: f64 = numbers.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / (count - 1.0);
        let expected = (square / count).sqrt() * student(count - 1.0);
        assert!((found / expected - 1.0).abs() < 1e-6, "{found} {expected}");
    }

    /// A parameter that no row determines keeps the deviation of its prior.
    #[test]
    fn without_rows_beliefs_stay() {
        let unknown = Unknown {
            joint: 0,
            parameter: ModelParameter::Offset,
            expected: 0.0,
            deviation: 0.3,
            step: 1.0,
            is_torque: false,
            least: f64::NEG_INFINITY,
        };
        let groups: Vec<Curvature> = (0..20).map(|_| Curvature::zero(1)).collect();
        assert!((deviations(&groups, &[unknown]).0[0] - 0.3).abs() < 1e-12);
    }
}
