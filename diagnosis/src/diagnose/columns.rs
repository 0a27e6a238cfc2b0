//! Columns by channel, their sums and their inner products.

use nalgebra::{DMatrix, DVector};

use super::data::Column;

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
