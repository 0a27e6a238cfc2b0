//! Columns by channel, their sums and their inner products.

use nalgebra::{DMatrix, DVector};

/// A column: its rows by channel, `None` where it is zero.
pub(crate) type Column = Vec<Option<Vec<f64>>>;

/// Σ βᵢ columnᵢ by channel, of which there are `channels`; empty where no column says anything.
pub(crate) fn sum_of<'c>(
    columns: impl IntoIterator<Item = (&'c Column, f64)>,
    channels: usize,
) -> Vec<Vec<f64>> {
    let mut said = vec![Vec::new(); channels];
    for (column, beta) in columns {
        for (said, part) in said.iter_mut().zip(column) {
            let Some(part) = part else { continue };
            said.resize(part.len(), 0.0);
            said.iter_mut().zip(part).for_each(|(said, x)| *said += beta * x);
        }
    }
    said
}

/// `rows` less what is `said` of them.
pub(crate) fn less(rows: &[Vec<f64>], said: &[Vec<f64>]) -> Vec<Vec<f64>> {
    let pairs = rows.iter().zip(said);
    pairs.map(|(rows, said)| rows.iter().zip(said).map(|(x, said)| x - said).collect()).collect()
}

/// Subtracts `factor` times `column` from `rows`.
pub(crate) fn subtract(rows: &mut [Vec<f64>], column: &Column, factor: f64) {
    for (rows, part) in rows.iter_mut().zip(column) {
        if let Some(part) = part {
            rows.iter_mut().zip(part).for_each(|(row, x)| *row -= factor * x);
        }
    }
}

/// What is `left` beside `columns` with the coefficients `beta`, and without them.
pub(crate) fn left_without(left: &[Vec<f64>], columns: &[Column], beta: &[f64]) -> Vec<Vec<f64>> {
    let mut rest = left.to_vec();
    columns.iter().zip(beta).for_each(|(column, beta)| subtract(&mut rest, column, -beta));
    rest
}

/// [`gram`] of `columns` with themselves.
pub(super) fn gram_of(columns: &[Column], channel: usize) -> DMatrix<f64> {
    let mut gram = DMatrix::zeros(columns.len(), columns.len());
    for (i, left) in columns.iter().enumerate() {
        let Some(left) = &left[channel] else { continue };
        for (j, right) in columns[..=i].iter().enumerate() {
            let Some(right) = &right[channel] else { continue };
            let product = dot(left, right);
            (gram[(i, j)], gram[(j, i)]) = (product, product);
        }
    }
    gram
}

/// Inner products of the columns `left` with `right` in one channel.
pub(super) fn gram(left: &[Column], right: &[Column], channel: usize) -> DMatrix<f64> {
    DMatrix::from_fn(left.len(), right.len(), |i, j| match (&left[i][channel], &right[j][channel]) {
        (Some(a), Some(b)) => dot(a, b),
        _ => 0.0,
    })
}

/// Inner products of `columns` with `target` in one channel.
pub(super) fn against(columns: &[Column], target: &[Vec<f64>], channel: usize) -> DVector<f64> {
    DVector::from_fn(columns.len(), |i, _| {
        columns[i][channel].as_ref().map_or(0.0, |part| dot(part, &target[channel]))
    })
}

/// Inner product in four sums, which the processor takes at once.
pub(crate) fn dot(a: &[f64], b: &[f64]) -> f64 {
    let (fours_a, rest_a) = a.as_chunks::<4>();
    let (fours_b, rest_b) = b.as_chunks::<4>();
    let mut sums = [0.0; 4];
    for (a, b) in fours_a.iter().zip(fours_b) {
        for k in 0..4 {
            sums[k] += a[k] * b[k];
        }
    }
    let rest: f64 = rest_a.iter().zip(rest_b).map(|(a, b)| a * b).sum();
    sums.iter().sum::<f64>() + rest
}
