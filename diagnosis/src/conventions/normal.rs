//! Least squares by normal equations: columns of each channel, some of which have non-negative coefficients, and columns that all channels share.

use nalgebra::{Cholesky, DMatrix, DVector, Dyn};

use crate::statistics::TURNS;

/// Ridge on the diagonal, as a share of it: a zero column, or a linear combination of others, gets no coefficient. The ridge is well above the rounding errors of
/// sums over 240 rows, 3·10⁻¹⁴.
const RIDGE: f64 = 1e-9;

/// One channel: inner products of its columns (own ones, then shared ones) and of its target with them.
pub(super) struct Channel {
    /// Products of all columns.
    pub normal: DMatrix<f64>,
    /// Products of the columns with the target.
    pub right: DVector<f64>,
    /// Square of the target.
    pub square: f64,
    /// For each own column: true if the coefficient can't be negative.
    pub is_positive: Vec<bool>,
    /// Floor of the squared residual times the number of rows: the fit ignores smaller residuals.
    pub floor: f64,
}

/// The result of a fit.
pub(super) struct Fit {
    /// Residual sum of squares of each channel.
    pub left: Vec<f64>,
    /// Coefficients of each channel's own columns.
    pub own: Vec<Vec<f64>>,
    /// Coefficients of the shared columns.
    pub shared: Vec<f64>,
}

/// Fits `channels`, which share `count` columns. The weights of the shared coefficients follow the residual of each channel; the own coefficients keep their
/// signs.
pub(super) fn fit(channels: &[Channel], count: usize) -> Fit {
    let mut shared = vec![0.0; count];
    if count > 0 {
        let cleared: Vec<Cleared> = channels.iter().map(Cleared::of).collect();
        for _ in 0..TURNS {
            let (mut normal, mut right) = (DMatrix::zeros(count, count), DVector::zeros(count));
            for (cleared, channel) in cleared.iter().zip(channels) {
                let weight = 1.0 / (cleared.residual_square(&shared) + channel.floor);
                normal += &cleared.normal * weight;
                right += &cleared.right * weight;
            }
            let Some(next) = Factor::of(normal).solve(&right) else { break };
            shared = next;
        }
    }
    let (mut left, mut own) = (Vec::with_capacity(channels.len()), Vec::with_capacity(channels.len()));
    for channel in channels {
        let (rest, coefficients) = channel.own(&shared);
        left.push(rest);
        own.push(coefficients);
    }
    Fit { left, own, shared }
}

impl Channel {
    /// Residual sum of squares with the given `shared` coefficients, and the own coefficients.
    pub fn own(&self, shared: &[f64]) -> (f64, Vec<f64>) {
        let own = self.is_positive.len();
        let x = DVector::from_column_slice(shared);
        let between = self.normal.view((0, own), (own, shared.len()));
        let right = self.right.rows(0, own) - between * &x;
        let among = self.normal.view((own, own), (shared.len(), shared.len()));
        let square = self.square - 2.0 * x.dot(&self.right.rows(own, shared.len())) + x.dot(&(among * &x));
        let normal = self.normal.view((0, 0), (own, own)).into_owned();
        let coefficients = bounded(&normal, &right, &self.is_positive);
        let b = DVector::from_column_slice(&coefficients);
        let left = square - 2.0 * b.dot(&right) + b.dot(&(&normal * &b));
        (left.max(0.0), coefficients)
    }
}

/// Products of a channel's shared columns and its target, its own columns projected out.
pub(super) struct Cleared {
    pub normal: DMatrix<f64>,
    pub right: DVector<f64>,
    pub square: f64,
}

impl Cleared {
    pub fn of(channel: &Channel) -> Self {
        let own = channel.is_positive.len();
        let shared = channel.right.len() - own;
        let factor = Factor::of(channel.normal.view((0, 0), (own, own)).into_owned());
        let between = channel.normal.view((0, own), (own, shared));
        let mut solved = DMatrix::zeros(own, shared + 1);
        for column in 0..=shared {
            let right = if column < shared {
                between.column(column).into_owned()
            } else {
                channel.right.rows(0, own).into_owned()
            };
            let found = factor.solve(&right).unwrap_or_else(|| vec![0.0; own]);
            solved.column_mut(column).copy_from_slice(&found);
        }
        let target = solved.column(shared);
        Self {
            normal: channel.normal.view((own, own), (shared, shared))
                - between.tr_mul(&solved.columns(0, shared)),
            right: channel.right.rows(own, shared) - between.tr_mul(&target),
            square: channel.square - channel.right.rows(0, own).dot(&target),
        }
    }

    pub fn residual_square(&self, shared: &[f64]) -> f64 {
        let x = DVector::from_column_slice(shared);
        (self.square - 2.0 * x.dot(&self.right) + x.dot(&(&self.normal * &x))).max(0.0)
    }
}

/// A factored normal matrix, scaled to a diagonal of one.
struct Factor {
    scale: Vec<f64>,
    cholesky: Option<Cholesky<f64, Dyn>>,
}

impl Factor {
    fn of(mut normal: DMatrix<f64>) -> Self {
        let inverse = |x: f64| if x > 0.0 { 1.0 / x.sqrt() } else { 0.0 };
        let scale: Vec<f64> = (0..normal.nrows()).map(|i| inverse(normal[(i, i)])).collect();
        for i in 0..scale.len() {
            for k in 0..scale.len() {
                normal[(i, k)] *= scale[i] * scale[k];
            }
            normal[(i, i)] = if scale[i] > 0.0 { 1.0 + RIDGE } else { 1.0 };
        }
        Self { scale, cholesky: normal.cholesky() }
    }

    fn solve(&self, right: &DVector<f64>) -> Option<Vec<f64>> {
        let scaled = DVector::from_fn(right.len(), |i, _| right[i] * self.scale[i]);
        let solved = self.cholesky.as_ref()?.solve(&scaled);
        Some(solved.iter().zip(&self.scale).map(|(x, scale)| x * scale).collect())
    }
}

/// Least squares with some non-negative coefficients, by the active sets of Lawson & Hanson (1974, chapter 23): a coefficient becomes free where the gradient
/// favours it, and a step ends where one reaches zero.
fn bounded(normal: &DMatrix<f64>, right: &DVector<f64>, is_positive: &[bool]) -> Vec<f64> {
    let count = is_positive.len();
    let mut is_in: Vec<bool> = is_positive.iter().map(|positive| !positive).collect();
    let mut x = among(normal, right, &is_in);
    // Without degeneracy each coefficient enters once and leaves once.
    let of = |column: &DVector<f64>, k: usize| column[k] / normal[(k, k)].sqrt().max(f64::MIN_POSITIVE);
    let least = (0..count).map(|k| of(right, k).abs()).fold(0.0, f64::max) * RIDGE.sqrt();
    for _ in 0..2 * count {
        let gradient = right - normal * DVector::from_column_slice(&x);
        let relative = |k: usize| of(&gradient, k);
        let next = (0..count).filter(|&k| !is_in[k]).max_by(|&a, &b| relative(a).total_cmp(&relative(b)));
        let Some(next) = next.filter(|&k| relative(k) > least && normal[(k, k)] > 0.0) else { break };
        is_in[next] = true;
        loop {
            let wanted = among(normal, right, &is_in);
            let share = |k: usize| {
                let falls = is_in[k] && is_positive[k] && wanted[k] < 0.0;
                if falls { x[k] / (x[k] - wanted[k]) } else { 1.0 }
            };
            let step = (0..count).map(share).fold(1.0, f64::min);
            if step >= 1.0 {
                x = wanted;
                break;
            }
            for k in 0..count {
                x[k] += step * (wanted[k] - x[k]);
                if is_in[k] && is_positive[k] && wanted[k] < 0.0 && x[k] <= f64::EPSILON * wanted[k].abs() {
                    (is_in[k], x[k]) = (false, 0.0);
                }
            }
        }
    }
    x
}

/// Least squares on the free columns; zero for the others.
fn among(normal: &DMatrix<f64>, right: &DVector<f64>, is_in: &[bool]) -> Vec<f64> {
    let places: Vec<usize> = (0..is_in.len()).filter(|&k| is_in[k]).collect();
    let some = DMatrix::from_fn(places.len(), places.len(), |i, k| normal[(places[i], places[k])]);
    let of = DVector::from_fn(places.len(), |i, _| right[places[i]]);
    let mut all = vec![0.0; is_in.len()];
    if let Some(found) = Factor::of(some).solve(&of) {
        places.iter().zip(found).for_each(|(&place, x)| all[place] = x);
    }
    all
}

#[cfg(test)]
mod tests {
    use super::{Channel, fit};
    use nalgebra::{DMatrix, DVector};

    /// A coefficient leaves at first and enters again: N = [[1, 0.9], [0.9, 1]] with (−1, 0.5) has (0, 0.5).
    #[test]
    fn the_best_of_all_that_are_not_below_zero_is_found() {
        let channel = |right: [f64; 2]| Channel {
            normal: DMatrix::from_row_slice(2, 2, &[1.0, 0.9, 0.9, 1.0]),
            right: DVector::from_row_slice(&right),
            square: 10.0,
            is_positive: vec![true, true],
            floor: 1.0,
        };
        for (right, expected) in
            [([-1.0, 0.5], [0.0, 0.5]), ([1.0, 1.0], [1.0 / 1.9, 1.0 / 1.9]), ([2.0, -1.0], [2.0, 0.0])]
        {
            let found = fit(&[channel(right)], 0);
            for (found, expected) in found.own[0].iter().zip(expected) {
                assert!((found - expected).abs() < 1e-6, "{found} is not {expected}");
            }
        }
    }

    /// Two channels with one column each and one shared column: y1 = 1·a + 2·s, y2 = 3·b + 2·s on unit columns.
    #[test]
    fn what_is_shared_is_fitted_over_all_channels() {
        let channel = |own: f64| Channel {
            normal: DMatrix::from_row_slice(2, 2, &[1.0, 0.5, 0.5, 1.0]),
            right: DVector::from_row_slice(&[own + 1.0, 0.5 * own + 2.0]),
            square: own * own + 2.0 * own + 4.0,
            is_positive: vec![false],
            floor: 1e-6,
        };
        let found = fit(&[channel(1.0), channel(3.0)], 1);
        assert!((found.shared[0] - 2.0).abs() < 1e-6);
        assert!((found.own[0][0] - 1.0).abs() < 1e-6 && (found.own[1][0] - 3.0).abs() < 1e-6);
        assert!(found.left.iter().all(|left| *left < 1e-6));
    }
}
