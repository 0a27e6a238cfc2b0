//! Small least squares: channels with columns of their own and columns that they share.

use nalgebra::{DMatrix, DVector};

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
    let mut best = leave(channels, &shared);
    if count == 0 {
        return best;
    }
    for _ in 0..ROUNDS {
        let weights: Vec<f64> =
            channels.iter().zip(&best.left).map(|(channel, left)| 1.0 / (left + channel.floor)).collect();
        let Some(next) = common(channels, &weights, count) else { break };
        shared = next;
        best = leave(channels, &shared);
    }
    best
}

/// The shared coefficients, each channel's own columns projected out.
fn common(channels: &[Channel], weights: &[f64], count: usize) -> Option<Vec<f64>> {
    let mut normal = DMatrix::zeros(count, count);
    let mut right = DVector::zeros(count);
    for (channel, weight) in channels.iter().zip(weights) {
        let own: Vec<&[f64]> = channel.own.iter().map(|own| own.column.as_slice()).collect();
        let target = cleared(&own, &channel.target);
        let shared: Vec<Vec<f64>> = channel.shared.iter().map(|column| cleared(&own, column)).collect();
        for (i, one) in shared.iter().enumerate() {
            right[i] += weight * dot(one, &target);
            for (k, other) in shared.iter().enumerate().take(i + 1) {
                let value = weight * dot(one, other);
                normal[(i, k)] += value;
                if i != k {
                    normal[(k, i)] += value;
                }
            }
        }
    }
    solve(normal, &right)
}

/// `column` without what the `own` columns say of it.
fn cleared(own: &[&[f64]], column: &[f64]) -> Vec<f64> {
    let coefficients = free(own, column);
    minus(column, own, &coefficients)
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
    let count = columns.len();
    let mut normal = DMatrix::zeros(count, count);
    let mut right = DVector::zeros(count);
    for (i, one) in columns.iter().enumerate() {
        right[i] = dot(one, target);
        for (k, other) in columns.iter().enumerate().take(i + 1) {
            let value = dot(one, other);
            (normal[(i, k)], normal[(k, i)]) = (value, value);
        }
    }
    solve(normal, &right).unwrap_or_else(|| vec![0.0; count])
}

/// The solution of a system of normal equations, scaled to a diagonal of one.
fn solve(mut normal: DMatrix<f64>, right: &DVector<f64>) -> Option<Vec<f64>> {
    let count = right.len();
    let scale: Vec<f64> = (0..count)
        .map(|i| if normal[(i, i)] > 0.0 { 1.0 / normal[(i, i)].sqrt() } else { 0.0 })
        .collect();
    for i in 0..count {
        for k in 0..count {
            normal[(i, k)] *= scale[i] * scale[k];
        }
        normal[(i, i)] = if scale[i] > 0.0 { 1.0 + RIDGE } else { 1.0 };
    }
    let right = DVector::from_fn(count, |i, _| right[i] * scale[i]);
    let solved = normal.cholesky()?.solve(&right);
    Some(solved.iter().zip(&scale).map(|(x, scale)| x * scale).collect())
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
