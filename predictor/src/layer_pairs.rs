//! JᵀJ of a network, layer by layer, without J.
//!
//! # Formula
//! With bias inputs a₀ = 1, the derivative of output o by weight (i, j) of layer l is δ^o_i a_j: the backpropagated slope of
//! unit i times what enters through the weight. So
//!
//! (JᵀJ)_{(i,j),(i′,j′)} = Σ_samples (Σ_o δ^o_i δ^o_i′) · (a_j a_j′),
//!
//! a sum of Kronecker products: the bracket, which holds the outputs, does not depend on j, j′. (J. Martens, R. Grosse,
//! "Optimizing neural networks with Kronecker-factored approximate curvature", ICML 2015, and A. Botev, H. Ritter, D.
//! Barber, "Practical Gauss–Newton optimisation for deep learning", ICML 2017, replace this sum by one product of means;
//! here it is exact.) For each pair of layers it is one matrix product over the samples of all pairs (j, j′) with all
//! pairs (i, i′); on the diagonal both factors are symmetric and only half of each is formed. J itself is never formed,
//! only one triangle of JᵀJ is, and the work hardly depends on the number of outputs, where a plain JᵀJ grows with it.

use crate::network::weight_count;
use faer::linalg::matmul::matmul;
use faer::{Accum, Mat, MatRef, Par};
use std::ops::Range;

/// Samples per batch: the products of the largest pair of layers of the usual networks then fit into the second-level
/// cache (64, 128, 192 and 320 were tried).
pub const BATCH: usize = 128;

/// One layer of weights and a batch's values around it.
#[derive(Debug)]
pub struct Layer {
    /// Its weights' place in the flat list.
    pub weights: Range<usize>,
    pub fan_in: usize,
    pub units: usize,
    /// What enters, 1 for the bias first: batch × (fan-in + 1).
    pub entering: Mat<f64>,
    /// Slopes of the activation at what leaves: batch × units.
    pub slope: Mat<f64>,
    /// Derivatives of output o by the units' sums: per output batch × units.
    pub delta: Vec<Mat<f64>>,
}

impl Layer {
    pub fn new(sizes: &[usize], layer: usize) -> Self {
        let (fan_in, units, outputs) = (sizes[layer - 1], sizes[layer], sizes[sizes.len() - 1]);
        let start = weight_count(&sizes[..layer]);
        let entering = Mat::from_fn(BATCH, fan_in + 1, |_, column| f64::from(column == 0));
        // The derivative of output o by the last layer's sum i is 1 where o = i; earlier layers are overwritten.
        let last = |output: usize| Mat::from_fn(BATCH, units, |_, unit| f64::from(unit == output));
        Self {
            weights: start..start + (fan_in + 1) * units,
            fan_in,
            units,
            entering,
            slope: Mat::zeros(BATCH, units),
            delta: (0..outputs).map(last).collect(),
        }
    }

    /// This layer's weights as (fan-in + 1) × units.
    pub fn matrix<'w>(&self, weights: &'w [f64]) -> MatRef<'w, f64> {
        MatRef::from_column_major_slice(&weights[self.weights.clone()], self.fan_in + 1, self.units)
    }
}

/// The part of JᵀJ between two layers (`first` ≤ `second`), and a batch's products for it.
#[derive(Debug)]
pub struct Block {
    first: usize,
    second: usize,
    /// Pairs (of `second`, of `first`) of entering values: batch × pairs.
    entering: Mat<f64>,
    /// Pairs (of `second`, of `first`) of units: batch × pairs.
    units: Mat<f64>,
    /// The sums: pairs of entering values × pairs of units.
    sum: Mat<f64>,
}

impl Block {
    pub fn new(layers: &[Layer], first: usize, second: usize) -> Self {
        let count = |of: fn(&Layer) -> usize| {
            let (m, n) = (of(&layers[second]), of(&layers[first]));
            if first == second { n * (n + 1) / 2 } else { m * n }
        };
        let (entering, units) = (count(|layer| layer.fan_in + 1), count(|layer| layer.units));
        Self {
            first,
            second,
            entering: Mat::zeros(BATCH, entering),
            units: Mat::zeros(BATCH, units),
            sum: Mat::zeros(entering, units),
        }
    }

    /// Pairs (k of `second`, k′ of `first`), k fastest; on the diagonal k ≥ k′ only.
    fn pairs(&self, second: usize, first: usize) -> impl Iterator<Item = (usize, usize)> + use<> {
        let diagonal = self.first == self.second;
        (0..first)
            .flat_map(move |right| (if diagonal { right } else { 0 }..second).map(move |left| (left, right)))
    }

    pub fn clear(&mut self) {
        self.sum.fill(0.0);
    }

    /// Adds a batch of `rows` samples, from the values in `layers`.
    pub fn add(&mut self, layers: &[Layer], rows: usize) {
        let (second, first) = (&layers[self.second], &layers[self.first]);
        for (pair, (left, right)) in self.pairs(second.fan_in + 1, first.fan_in + 1).enumerate() {
            let product = &mut self.entering.col_as_slice_mut(pair)[..rows];
            let left = &second.entering.col_as_slice(left)[..rows];
            let right = &first.entering.col_as_slice(right)[..rows];
            product.iter_mut().zip(left).zip(right).for_each(|((p, l), r)| *p = l * r);
        }
        for (pair, (left, right)) in self.pairs(second.units, first.units).enumerate() {
            let sum = &mut self.units.col_as_slice_mut(pair)[..rows];
            sum.fill(0.0);
            for (second, first) in second.delta.iter().zip(&first.delta) {
                add_product(sum, &second.col_as_slice(left)[..rows], &first.col_as_slice(right)[..rows]);
            }
        }
        let entering = self.entering.get(..rows, ..).transpose();
        let units = self.units.get(..rows, ..);
        matmul(self.sum.as_mut(), Accum::Add, entering, units, 1.0, Par::Seq);
    }

    /// Puts the sums where they belong in the lower triangle.
    pub fn scatter(&self, layers: &[Layer], matrix: &mut Mat<f64>) {
        let (second, first) = (&layers[self.second], &layers[self.first]);
        let (height, width) = (second.fan_in + 1, first.fan_in + 1);
        for (pair, (unit, other)) in self.pairs(second.units, first.units).enumerate() {
            let sums = self.sum.col_as_slice(pair);
            let (row, column) = (second.weights.start + unit * height, first.weights.start + other * width);
            for (sum, (left, right)) in sums.iter().zip(self.pairs(height, width)) {
                matrix[(row + left, column + right)] = *sum;
                if self.first == self.second && unit != other {
                    matrix[(row + right, column + left)] = *sum;
                }
            }
        }
    }
}

/// sum += a · b, element by element.
pub fn add_product(sum: &mut [f64], a: &[f64], b: &[f64]) {
    sum.iter_mut().zip(a).zip(b).for_each(|((sum, a), b)| *sum += a * b);
}
