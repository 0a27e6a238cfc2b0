//! Small least squares: channels with columns of their own and columns that they share.

use nalgebra::{Cholesky, DMatrix, DVector, Dyn};

/// A channel's own column.
pub(crate) struct Own {
    pub column: Vec<f64>,
    /// Its coefficient can't be below zero.
    pub is_positive: bool,
}

/// One channel: what is to be explained, and by what.
pub(crate) struct Channel {
    pub target: Vec<f64>,
    pub own: Vec<Own>,
    /// As many as every other channel has.
    pub shared: Vec<Vec<f64>>,
    /// Square of the size below which what is left is not looked at.
    pub floor: f64,
}

/// What a fit leaves.
#[derive(Clone)]
pub(crate) struct Fit {
    /// Mean square of what is left of each channel, without the floor.
    pub left: Vec<f64>,
    /// Coefficients of each channel's own columns.
    pub own: Vec<Vec<f64>>,
    /// Coefficients of the shared columns.
    pub shared: Vec<f64>,
    /// What is left, row by row.
    pub residual: Vec<Vec<f64>>,
}

/// Rounds of reweighting the channels by what is left of them.
const ROUNDS: usize = 4;
/// Added to the diagonal, as a share of it: columns of zeros stay out.
const RIDGE: f64 = 1e-9;

/// Fits `channels`: shared coefficients by weights that follow what is left of each channel, own ones with their signs.
pub(crate) fn fit(channels: &[Channel]) -> Fit {
    let count = channels.first().map_or(0, |channel| channel.shared.len());
    let mut shared = vec![0.0; count];
    if count > 0 {
        let products: Vec<Products> = channels.iter().map(Products::of).collect();
        for _ in 0..ROUNDS {
            let weight = |products: &Products| 1.0 / (products.left(&shared) + products.floor);
            let weights: Vec<f64> = products.iter().map(weight).collect();
            let Some(next) = common(&products, &weights, count) else { break };
            shared = next;
        }
    }
    leave(channels, &shared)
}

/// Products of a channel's target and shared columns, its own columns projected out.
struct Products {
    normal: DMatrix<f64>,
    right: DVector<f64>,
    square: f64,
    rows: f64,
    floor: f64,
}

impl Products {
    fn of(channel: &Channel) -> Self {
        let own: Vec<&[f64]> = channel.own.iter().map(|own| own.column.as_slice()).collect();
        let factor = Factor::of(&own);
        let target = factor.cleared(&own, &channel.target);
        let shared: Vec<Vec<f64>> =
            channel.shared.iter().map(|column| factor.cleared(&own, column)).collect();
        let normal = DMatrix::from_fn(shared.len(), shared.len(), |i, k| dot(&shared[i], &shared[k]));
        let right = DVector::from_fn(shared.len(), |i, _| dot(&shared[i], &target));
        let (square, rows) = (dot(&target, &target), target.len().max(1) as f64);
        Self { normal, right, square, rows, floor: channel.floor }
    }

    /// Mean square that `shared` coefficients leave.
    fn left(&self, shared: &[f64]) -> f64 {
        let x = DVector::from_column_slice(shared);
        let left = self.square - 2.0 * x.dot(&self.right) + x.dot(&(&self.normal * &x));
        left.max(0.0) / self.rows
    }
}

/// The shared coefficients.
fn common(products: &[Products], weights: &[f64], count: usize) -> Option<Vec<f64>> {
    let mut normal = DMatrix::zeros(count, count);
    let mut right = DVector::zeros(count);
    for (products, weight) in products.iter().zip(weights) {
        normal += &products.normal * *weight;
        right += &products.right * *weight;
    }
    solve(normal, &right)
}

/// The factored normal equations of some columns.
struct Factor {
    scale: Vec<f64>,
    cholesky: Option<Cholesky<f64, Dyn>>,
}

impl Factor {
    fn of(columns: &[&[f64]]) -> Self {
        let count = columns.len();
        Self::from_normal(DMatrix::from_fn(count, count, |i, k| dot(columns[i], columns[k])))
    }

    /// Scaled to a diagonal of one.
    fn from_normal(mut normal: DMatrix<f64>) -> Self {
        let count = normal.nrows();
        let inverse = |x: f64| if x > 0.0 { 1.0 / x.sqrt() } else { 0.0 };
        let scale: Vec<f64> = (0..count).map(|i| inverse(normal[(i, i)])).collect();
        for i in 0..count {
            for k in 0..count {
                normal[(i, k)] *= scale[i] * scale[k];
            }
            normal[(i, i)] = if scale[i] > 0.0 { 1.0 + RIDGE } else { 1.0 };
        }
        Self { scale, cholesky: normal.cholesky() }
    }

    fn solve(&self, right: &DVector<f64>) -> Option<Vec<f64>> {
        let right = DVector::from_fn(right.len(), |i, _| right[i] * self.scale[i]);
        let solved = self.cholesky.as_ref()?.solve(&right);
        Some(solved.iter().zip(&self.scale).map(|(x, scale)| x * scale).collect())
    }

    /// `column` without what the columns say of it.
    fn cleared(&self, columns: &[&[f64]], column: &[f64]) -> Vec<f64> {
        let right = DVector::from_fn(columns.len(), |i, _| dot(columns[i], column));
        let coefficients = self.solve(&right).unwrap_or_else(|| vec![0.0; columns.len()]);
        minus(column, columns, &coefficients)
    }
}

/// What is left of each channel under the `shared` coefficients.
fn leave(channels: &[Channel], shared: &[f64]) -> Fit {
    let mut fit = Fit { left: Vec::new(), own: Vec::new(), shared: shared.to_vec(), residual: Vec::new() };
    for channel in channels {
        let columns: Vec<&[f64]> = channel.shared.iter().map(Vec::as_slice).collect();
        let target = minus(&channel.target, &columns, shared);
        let own = bounded(&channel.own, &target);
        let columns: Vec<&[f64]> = channel.own.iter().map(|own| own.column.as_slice()).collect();
        let residual = minus(&target, &columns, &own);
        fit.left.push(dot(&residual, &residual) / residual.len().max(1) as f64);
        fit.own.push(own);
        fit.residual.push(residual);
    }
    fit
}

/// Coefficients of `own` columns of which some can't be below zero (Lawson & Hanson 1974, chapter 23, by leaving out the most
/// negative one until none is; columns that would be left out again are few and nearly orthogonal here).
fn bounded(own: &[Own], target: &[f64]) -> Vec<f64> {
    let mut active: Vec<usize> = (0..own.len()).collect();
    loop {
        let columns: Vec<&[f64]> = active.iter().map(|&k| own[k].column.as_slice()).collect();
        let fitted = free(&columns, target);
        let negative = active.iter().zip(&fitted).filter(|(k, value)| own[**k].is_positive && **value < 0.0);
        let worst = negative.min_by(|a, b| a.1.total_cmp(b.1)).map(|(k, _)| *k);
        let Some(worst) = worst else {
            let mut all = vec![0.0; own.len()];
            active.iter().zip(fitted).for_each(|(&k, value)| all[k] = value);
            return all;
        };
        active.retain(|&k| k != worst);
    }
}

/// Least squares of `target` on `columns`.
fn free(columns: &[&[f64]], target: &[f64]) -> Vec<f64> {
    let right = DVector::from_fn(columns.len(), |i, _| dot(columns[i], target));
    Factor::of(columns).solve(&right).unwrap_or_else(|| vec![0.0; columns.len()])
}

/// The solution of a system of normal equations.
fn solve(normal: DMatrix<f64>, right: &DVector<f64>) -> Option<Vec<f64>> {
    Factor::from_normal(normal).solve(right)
}

fn minus(target: &[f64], columns: &[&[f64]], coefficients: &[f64]) -> Vec<f64> {
    let mut left = target.to_vec();
    for (column, coefficient) in columns.iter().zip(coefficients) {
        left.iter_mut().zip(*column).for_each(|(left, x)| *left -= coefficient * x);
    }
    left
}

pub(crate) fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}
