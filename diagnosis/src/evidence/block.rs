//! A candidate as a block of columns, and its inner products with the rows and the tolerances.
//!
//! The weights of the rows change at each step of a search, and most steps need few blocks: the block computes products on demand, and keeps them until the
//! weights change.

use std::cell::{OnceCell, RefCell};
use std::ops::Range;

use nalgebra::{Cholesky, DMatrix, DVector, Dyn};

use crate::candidates::candidate::Candidate;
use crate::data::columns::{Column, dot};

/// One channel under its weights.
#[derive(Clone, Debug)]
pub(super) struct Channel {
    pub weights: Vec<f64>,
    /// The version of these weights; it changes with the weights.
    pub version: u64,
    /// From the first row with a weight to the last: products ignore all other rows.
    pub span: Range<usize>,
    /// The tolerances that act on the channel, and the span of their columns times the weights.
    pub tolerances: Vec<(usize, Vec<f64>)>,
    /// The span of the target times the weights.
    target: Vec<f64>,
    /// Products of these tolerances: NᵀWN.
    pub gram: DMatrix<f64>,
    /// NᵀWy.
    pub against: DVector<f64>,
    /// yᵀWy.
    pub square: f64,
}

/// A product that depends on the weights of a channel. It keeps its values under the last two versions of the weights: when the search rejects a set of
/// effects, the earlier weights return.
#[derive(Clone, Debug)]
pub(super) struct Weighed<T> {
    /// The latest two values, the newest first, each with the version of its weights.
    known: [Option<(u64, T)>; 2],
}

impl<T> Default for Weighed<T> {
    fn default() -> Self {
        Self { known: [None, None] }
    }
}

impl<T> Weighed<T> {
    /// The product under the weights of this `version`; `made` computes it if it is not stored.
    pub fn get(&mut self, version: u64, made: impl FnOnce() -> T) -> &T {
        let is_known = |known: &Option<(u64, T)>| known.as_ref().is_some_and(|(own, _)| *own == version);
        if !is_known(&self.known[0]) {
            self.known.swap(0, 1);
        }
        let known = self.known[0].take().filter(|(own, _)| *own == version);
        &self.known[0].insert(known.unwrap_or_else(|| (version, made()))).1
    }
}

/// Products of a block in one channel, before the tolerances are eliminated.
#[derive(Clone, Debug)]
pub(super) struct InChannel {
    /// NᵀWZ, rows as [`Channel::tolerances`].
    tolerances: DMatrix<f64>,
    /// ZᵀWZ.
    pub own: DMatrix<f64>,
    /// ZᵀWy.
    pub target: DVector<f64>,
}

/// Products of a block over all its channels, the tolerances eliminated.
#[derive(Clone, Debug)]
pub(super) struct Products {
    /// NᵀWZ.
    pub through: DMatrix<f64>,
    /// L⁻¹NᵀWZ, with K = LLᵀ.
    pub whitened: DMatrix<f64>,
    /// G and the precision of the prior.
    pub normal: DMatrix<f64>,
    /// h.
    pub right: DVector<f64>,
}

/// A candidate in the system.
#[derive(Clone, Debug)]
pub(super) struct Block {
    pub candidate: Candidate,
    /// Precision of the prior of its coefficients.
    pub precision: DMatrix<f64>,
    /// The precision times the mean of that prior.
    pub pull: DVector<f64>,
    /// Half the log of its determinant, and the log of the prior odds.
    pub log_prior: f64,
    /// The log of the ratio of the prior's density at its mean to its density at zero, where all coefficients are zero.
    pub log_off_mean: f64,
    channels: RefCell<Vec<(usize, Weighed<InChannel>)>>,
    products: OnceCell<Products>,
}

impl Block {
    /// The block of `candidate`, which shows in these `channels`.
    pub fn new(candidate: Candidate, channels: Vec<usize>, precision: DMatrix<f64>, log_prior: f64) -> Self {
        let channels = RefCell::new(channels.into_iter().map(|c| (c, Weighed::default())).collect());
        let mean = candidate.usual().map_or_else(|| DVector::zeros(candidate.size()), DVector::from_vec);
        let pull = &precision * &mean;
        let log_off_mean = 0.5 * pull.dot(&mean);
        Self { candidate, precision, pull, log_prior, log_off_mean, channels, products: OnceCell::new() }
    }

    /// The products of the block over the rows of `channels`, with the given number of `tolerances`: `factor` is that of K, `target` L⁻¹NᵀWy.
    pub fn products(
        &self,
        channels: &[Channel],
        tolerances: usize,
        factor: &Cholesky<f64, Dyn>,
        target: &DVector<f64>,
    ) -> &Products {
        self.products.get_or_init(|| {
            let size = self.candidate.size();
            let mut through = DMatrix::zeros(tolerances, size);
            let (mut normal, mut right) = (self.precision.clone(), self.pull.clone());
            for (c, part) in &mut *self.channels.borrow_mut() {
                let part = part.get(channels[*c].version, || channels[*c].of(&self.candidate.columns, *c));
                for (row, (index, _)) in channels[*c].tolerances.iter().enumerate() {
                    let mut there = through.row_mut(*index);
                    there += part.tolerances.row(row);
                }
                normal += &part.own;
                right += &part.target;
            }
            let mut whitened = through.clone();
            factor.l_dirty().solve_lower_triangular_mut(&mut whitened);
            normal -= whitened.tr_mul(&whitened);
            right -= whitened.tr_mul(target);
            Products { through, whitened, normal, right }
        })
    }

    /// Deletes the products given the tolerances.
    pub fn forget(&mut self) {
        self.products.take();
    }
}

impl Channel {
    /// The channel number `c`, whose rows have these `weights` of this `version`.
    pub fn new(
        c: usize,
        tolerances: &[Column],
        target: &[Vec<f64>],
        (version, weights): (u64, Vec<f64>),
    ) -> Self {
        let span = span_of(&weights);
        let weighed = |rows: &[f64]| weighed(&rows[span.clone()], &weights[span.clone()]);
        let shown: Vec<(usize, Vec<f64>)> = tolerances
            .iter()
            .enumerate()
            .filter(|_| !span.is_empty())
            .filter_map(|(index, column)| Some((index, weighed(column[c].as_ref()?))))
            .collect();
        let column =
            |index: usize| tolerances[index][c].as_deref().map_or(&[][..], |rows| &rows[span.clone()]);
        let gram = DMatrix::from_fn(shown.len(), shown.len(), |i, j| {
            if i <= j { dot(column(shown[i].0), &shown[j].1) } else { 0.0 }
        });
        let gram = &gram + gram.transpose() - DMatrix::from_diagonal(&gram.diagonal());
        let target_there = &target[c][span.clone()];
        let against = DVector::from_fn(shown.len(), |i, _| dot(&shown[i].1, target_there));
        let target_weighed = weighed(&target[c]);
        let square = dot(&target_weighed, target_there);
        Self { tolerances: shown, target: target_weighed, gram, against, square, weights, version, span }
    }

    /// Products of the block of `columns` in this channel, which is number `c`.
    pub fn of(&self, columns: &[Column], c: usize) -> InChannel {
        let part = |k: usize| columns[k][c].as_deref().map(|rows| &rows[self.span.clone()]);
        let size = columns.len();
        let with = |rows: &[f64], k: usize| part(k).map_or(0.0, |column| dot(column, rows));
        InChannel {
            tolerances: DMatrix::from_fn(self.tolerances.len(), size, |i, k| with(&self.tolerances[i].1, k)),
            own: own(columns, c, &self.weights),
            target: DVector::from_fn(size, |k, _| with(&self.target, k)),
        }
    }
}

/// From the first row with a weight to the last.
fn span_of(weights: &[f64]) -> Range<usize> {
    let is_weighed = |w: &f64| *w != 0.0;
    match weights.iter().position(is_weighed) {
        Some(first) => first..weights.iter().rposition(is_weighed).map_or(first, |last| last + 1),
        None => 0..0,
    }
}

/// `rows` times their weights.
pub(super) fn weighed(rows: &[f64], weights: &[f64]) -> Vec<f64> {
    rows.iter().zip(weights).map(|(x, w)| x * w).collect()
}

/// ZᵀWZ of `columns` in the channel number `c`.
pub(super) fn own(columns: &[Column], c: usize, weights: &[f64]) -> DMatrix<f64> {
    let size = columns.len();
    let span = span_of(weights);
    let mut own = DMatrix::zeros(size, size);
    for (i, left) in columns.iter().enumerate() {
        let Some(left) = &left[c] else { continue };
        let weighed = weighed(&left[span.clone()], &weights[span.clone()]);
        for (j, right) in columns[..=i].iter().enumerate() {
            let Some(right) = &right[c] else { continue };
            let product = dot(&weighed, &right[span.clone()]);
            (own[(i, j)], own[(j, i)]) = (product, product);
        }
    }
    own
}

/// Half the log of the determinant of the matrix of `factor`.
pub(super) fn half_log_determinant(factor: &Cholesky<f64, Dyn>) -> f64 {
    factor.l_dirty().diagonal().iter().map(|x| x.ln()).sum()
}

#[cfg(test)]
mod tests {
    use super::Weighed;

    #[test]
    fn a_product_is_kept_under_the_last_two_versions_of_the_weights() {
        let (mut product, mut made) = (Weighed::default(), Vec::new());
        for version in [1, 1, 2, 1, 2, 3, 2, 1] {
            let of_version = *product.get(version, || {
                made.push(version);
                10 * version
            });
            assert_eq!(of_version, 10 * version);
        }
        assert_eq!(made, [1, 2, 3, 1], "1 was asked for again after 2 and 3");
    }
}
