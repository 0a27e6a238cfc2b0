//! Columns by channel, their sums and their inner products.

use nalgebra::{DMatrix, DVector};

use crate::statistics::difference;

/// A column of the linear model: its rows by channel, `None` where it is zero.
pub(crate) type Column = Vec<Option<Vec<f64>>>;

/// A law or a tolerance adds these rows to each channel of a recording; `None` where it adds nothing.
pub(crate) type Answer = Vec<Option<Vec<f64>>>;

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

/// Inner product with sixteen partial sums: a processor adds several at once, and starts new additions before the first have ended.
pub(crate) fn dot(a: &[f64], b: &[f64]) -> f64 {
    let (chunks_a, rest_a) = a.as_chunks::<16>();
    let (chunks_b, rest_b) = b.as_chunks::<16>();
    let mut sums = [0.0; 16];
    for (a, b) in chunks_a.iter().zip(chunks_b) {
        for ((sum, a), b) in sums.iter_mut().zip(a).zip(b) {
            *sum += a * b;
        }
    }
    let rest: f64 = rest_a.iter().zip(rest_b).map(|(a, b)| a * b).sum();
    sums.iter().sum::<f64>() + rest
}

/// The sum of `columns` times their coefficients, by channel; `rows` holds the length of each channel.
pub(crate) fn sum_of<'c>(
    columns: impl IntoIterator<Item = (&'c Column, f64)>,
    rows: &[Vec<f64>],
) -> Vec<Vec<f64>> {
    let mut sum: Vec<Vec<f64>> = rows.iter().map(|rows| vec![0.0; rows.len()]).collect();
    add_all(&mut sum, columns);
    sum
}

/// Adds `factor` times `column` to `rows`.
pub(crate) fn add(rows: &mut [Vec<f64>], column: &Column, factor: f64) {
    for (rows, part) in rows.iter_mut().zip(column) {
        if let Some(part) = part {
            rows.iter_mut().zip(part).for_each(|(row, x)| *row += factor * x);
        }
    }
}

/// Adds `columns` times their coefficients to `rows`.
pub(crate) fn add_all<'c>(rows: &mut [Vec<f64>], columns: impl IntoIterator<Item = (&'c Column, f64)>) {
    columns.into_iter().for_each(|(column, factor)| add(rows, column, factor));
}

/// `rows` minus `said`.
pub(crate) fn less(rows: &[Vec<f64>], said: &[Vec<f64>]) -> Vec<Vec<f64>> {
    let pairs = rows.iter().zip(said);
    pairs.map(|(rows, said)| difference(rows, said)).collect()
}
