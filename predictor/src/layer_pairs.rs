//! JᵀJ of a network, layer by layer, without J.
//!
//! # Formula
//! With bias inputs a₀ = 1, the derivative of output o with respect to weight (i, j) of layer l is δ^o_i a_j: the backpropagated
//! slope of unit i times the input of the weight. Therefore
//!
//! (JᵀJ)_{(i,j),(i′,j′)} = Σ_samples (Σ_o δ^o_i δ^o_i′) · (a_j a_j′),
//!
//! a sum of Kronecker products, because the bracket with the outputs does not depend on j, j′. (J. Martens, R. Grosse,
//! "Optimizing neural networks with Kronecker-factored approximate curvature", ICML 2015, and A. Botev, H. Ritter, D. Barber,
//! "Practical Gauss–Newton optimisation for deep learning", ICML 2017, approximate this sum by one product of means; here it is
//! exact.) For each pair of layers the sum is one matrix product over the samples, of all pairs (j, j′) with all pairs (i, i′).
//! For a layer with itself, both factors are symmetric and only half of each is computed. The program never forms J itself, and
//! only one triangle of JᵀJ. The work hardly depends on the number of outputs, whereas that of a plain JᵀJ grows with it.

use crate::columns::{column, column_mut};
use crate::network::weight_count;
use nalgebra::{DMatrix, DMatrixView};
use std::ops::Range;

/// Samples per batch; the products of the largest pair of layers of the usual networks then fit into the second-level cache (64,
/// 128, 192 and 320 were tried).
pub const BATCH: usize = 128;

/// One layer of weights, with its inputs and derivatives for a batch.
#[derive(Debug)]
pub struct Layer {
    /// Index range of its weights in the flat list.
    pub weights: Range<usize>,
    pub fan_in: usize,
    pub units: usize,
    /// Inputs of the layer, with 1 for the bias first: batch × (fan-in + 1).
    pub entering: DMatrix<f64>,
    /// The same, one column a sample: (fan-in + 1) × batch.
    pub samples: DMatrix<f64>,
    /// Slopes of the activation at the outputs: batch × units.
    pub slope: DMatrix<f64>,
    /// Derivatives of output o with respect to the units' sums; for each output, batch × units.
    pub delta: Vec<DMatrix<f64>>,
}

impl Layer {
    pub fn new(sizes: &[usize], layer: usize) -> Self {
        let (fan_in, units, outputs) = (sizes[layer - 1], sizes[layer], sizes[sizes.len() - 1]);
        let start = weight_count(&sizes[..layer]);
        let entering = DMatrix::from_fn(BATCH, fan_in + 1, |_, value| f64::from(value == 0));
        // The derivative of output o with respect to the last layer's sum i is 1 for o = i; earlier layers are overwritten.
        let last = |output: usize| DMatrix::from_fn(BATCH, units, |_, unit| f64::from(unit == output));
        Self {
            weights: start..start + (fan_in + 1) * units,
            fan_in,
            units,
            samples: entering.transpose(),
            entering,
            slope: DMatrix::zeros(BATCH, units),
            delta: (0..outputs).map(last).collect(),
        }
    }

    /// Fills [`Layer::samples`] from [`Layer::entering`].
    pub fn transpose(&mut self) {
        self.entering.transpose_to(&mut self.samples);
    }

    /// This layer's weights as (fan-in + 1) × units.
    pub fn matrix<'w>(&self, weights: &'w [f64]) -> DMatrixView<'w, f64> {
        DMatrixView::from_slice(&weights[self.weights.clone()], self.fan_in + 1, self.units)
    }
}

/// The block of JᵀJ between two layers (`first` ≤ `second`), and a batch's products for it.
#[derive(Debug)]
pub struct Block {
    first: usize,
    second: usize,
    /// Pairs (of `second`, of `first`) of layer inputs: pairs × batch.
    entering: DMatrix<f64>,
    /// Pairs (of `second`, of `first`) of units: batch × pairs.
    units: DMatrix<f64>,
    /// The sums: pairs of layer inputs × pairs of units.
    sum: DMatrix<f64>,
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
            entering: DMatrix::zeros(entering, BATCH),
            units: DMatrix::zeros(BATCH, units),
            sum: DMatrix::zeros(entering, units),
        }
    }

    /// Pairs (k of `second`, k′ of `first`), k fastest; for a layer with itself only k ≥ k′.
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
        let diagonal = self.first == self.second;
        for sample in 0..rows {
            let mut products = column_mut(&mut self.entering, sample);
            let left = column(&second.samples, sample);
            for (index, right) in column(&first.samples, sample).iter().enumerate() {
                let left = if diagonal { &left[index..] } else { left };
                let (now, later) = products.split_at_mut(left.len());
                now.iter_mut().zip(left).for_each(|(product, left)| *product = left * right);
                products = later;
            }
        }
        for (pair, (left, right)) in self.pairs(second.units, first.units).enumerate() {
            let sum = &mut column_mut(&mut self.units, pair)[..rows];
            sum.fill(0.0);
            for (second, first) in second.delta.iter().zip(&first.delta) {
                add_product(sum, &column(second, left)[..rows], &column(first, right)[..rows]);
            }
        }
        self.sum.gemm(1.0, &self.entering.columns(0, rows), &self.units.rows(0, rows), 1.0);
    }

    /// Writes the sums into the lower triangle.
    pub fn scatter(&self, layers: &[Layer], matrix: &mut DMatrix<f64>) {
        let (second, first) = (&layers[self.second], &layers[self.first]);
        let (height, width) = (second.fan_in + 1, first.fan_in + 1);
        for (pair, (unit, other)) in self.pairs(second.units, first.units).enumerate() {
            let sums = column(&self.sum, pair);
            let (top, left_edge) =
                (second.weights.start + unit * height, first.weights.start + other * width);
            for (sum, (left, right)) in sums.iter().zip(self.pairs(height, width)) {
                matrix[(top + left, left_edge + right)] = *sum;
                if self.first == self.second && unit != other {
                    matrix[(top + right, left_edge + left)] = *sum;
                }
            }
        }
    }
}

/// sum += a · b, element by element.
pub fn add_product(sum: &mut [f64], a: &[f64], b: &[f64]) {
    sum.iter_mut().zip(a).zip(b).for_each(|((sum, a), b)| *sum += a * b);
}
