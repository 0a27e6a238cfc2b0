//! A network's errors over a set of samples, as a least-squares problem.
//!
//! # Counting
//! Each sample gives one error per output, e = ŷ − y (scaled), so 1500 samples of 3 outputs are 4500 rows of J.
//!
//! # Formula
//! The derivative of output o with respect to weight (i, j) of layer l is δ^o_i a_j: the backpropagated derivative with respect
//! to unit i's sum, times the input of the weight. `layer_pairs.rs` describes the summation of JᵀJ from these.
//!
//! The samples are processed in batches that fit into the cache, in a fixed order on one thread, so that results are
//! reproducible.

use crate::activation::Activation;
use crate::columns::{column, column_mut};
use crate::layer_pairs::{BATCH, Block, Layer, add_product};
use crate::levenberg_marquardt::LeastSquares;
use crate::network::weight_count;
use crate::normal_equations::NormalEquations;
use nalgebra::{DMatrix, DMatrixViewMut};
use std::ops::Range;

/// Scaled regressors and outputs, one column per channel.
#[derive(Debug, Clone)]
pub struct Samples {
    /// Regressors: samples × network inputs.
    pub inputs: DMatrix<f64>,
    /// Outputs: samples × network outputs.
    pub outputs: DMatrix<f64>,
}

/// A network's training (and validation) errors; implements [`LeastSquares`].
#[derive(Debug)]
pub struct NetworkErrors {
    sizes: Vec<usize>,
    activation: Activation,
    arch: pulp::Arch,
    training: Samples,
    validation: Option<Samples>,
    layers: Vec<Layer>,
    blocks: Vec<Block>,
    error: DMatrix<f64>,
    weighted: DMatrix<f64>,
}

impl NetworkErrors {
    /// Creates the errors of networks of these layer sizes (at least two, each ≥ 1) on `training`, with early stopping on
    /// `validation`.
    ///
    /// # Panics
    /// If the columns of the samples do not match the network's inputs and outputs.
    #[must_use]
    pub fn new(
        sizes: &[usize],
        activation: Activation,
        training: Samples,
        validation: Option<Samples>,
    ) -> Self {
        let outputs = sizes[sizes.len() - 1];
        for samples in std::iter::once(&training).chain(&validation) {
            assert_eq!((samples.inputs.ncols(), samples.outputs.ncols()), (sizes[0], outputs));
            assert_eq!(samples.inputs.nrows(), samples.outputs.nrows());
        }
        let layers: Vec<Layer> = (1..sizes.len()).map(|layer| Layer::new(sizes, layer)).collect();
        let pairs = (0..layers.len()).flat_map(|second| (0..=second).map(move |first| (first, second)));
        let blocks = pairs.map(|(first, second)| Block::new(&layers, first, second)).collect();
        Self {
            sizes: sizes.to_vec(),
            activation,
            arch: pulp::Arch::new(),
            training,
            validation,
            layers,
            blocks,
            error: DMatrix::zeros(BATCH, outputs),
            weighted: DMatrix::zeros(BATCH, *sizes.iter().max().unwrap_or(&0)),
        }
    }

    /// Computes the layers' values for a batch of the training samples, or of the validation samples, and the error.
    fn forward(&mut self, weights: &[f64], batch: &Range<usize>, validate: bool) {
        let Some(samples) = (if validate { self.validation.as_ref() } else { Some(&self.training) }) else {
            return;
        };
        let rows = batch.len();
        for index in 0..samples.inputs.ncols() {
            let target = &mut column_mut(&mut self.layers[0].entering, index + 1)[..rows];
            target.copy_from_slice(&column(&samples.inputs, index)[batch.clone()]);
        }
        for index in 0..self.layers.len() {
            let (done, later) = self.layers.split_at_mut(index + 1);
            let layer = &done[index];
            let from = layer.entering.rows(0, rows);
            let matrix = layer.matrix(weights);
            match later.first_mut() {
                Some(next) => {
                    let mut leaving = next.entering.view_mut((0, 1), (rows, layer.units));
                    leaving.gemm(1.0, &from, &matrix, 0.0);
                    for unit in 0..layer.units {
                        let values = &mut column_mut(&mut next.entering, unit + 1)[..rows];
                        self.activation.apply(self.arch, values);
                    }
                }
                None => self.error.rows_mut(0, rows).gemm(1.0, &from, &matrix, 0.0),
            }
        }
        for output in 0..samples.outputs.ncols() {
            let error = &mut column_mut(&mut self.error, output)[..rows];
            let truth = &column(&samples.outputs, output)[batch.clone()];
            error.iter_mut().zip(truth).for_each(|(error, truth)| *error -= truth);
        }
    }

    fn sum_of_squares(&mut self, weights: &[f64], count: usize, validate: bool) -> f64 {
        let mut sum = 0.0;
        for batch in batches(count) {
            self.forward(weights, &batch, validate);
            for output in 0..self.error.ncols() {
                sum += column(&self.error, output)[..batch.len()].iter().map(|e| e * e).sum::<f64>();
            }
        }
        sum
    }

    /// Computes the derivatives of every output with respect to every unit's sum, from the last layer to the first.
    fn backward(&mut self, weights: &[f64], rows: usize) {
        for index in (0..self.layers.len() - 1).rev() {
            let (before, after) = self.layers.split_at_mut(index + 1);
            let (layer, next) = (&mut before[index], &after[0]);
            for unit in 0..layer.units {
                let value = &column(&next.entering, unit + 1)[..rows];
                let slope = &mut column_mut(&mut layer.slope, unit)[..rows];
                slope.iter_mut().zip(value).for_each(|(slope, value)| *slope = self.activation.slope(*value));
            }
            // The biases are excluded, because no unit of this layer feeds them.
            let back = next.matrix(weights).rows(1, next.fan_in).transpose();
            for (delta, later) in layer.delta.iter_mut().zip(&next.delta) {
                delta.rows_mut(0, rows).gemm(1.0, &later.rows(0, rows), &back, 0.0);
                for unit in 0..layer.units {
                    let slope = &column(&layer.slope, unit)[..rows];
                    let delta = &mut column_mut(delta, unit)[..rows];
                    delta.iter_mut().zip(slope).for_each(|(delta, slope)| *delta *= slope);
                }
            }
        }
    }

    /// Adds a batch's Jᵀe: for each layer (entering)ᵀ · Σ_o e_o δ^o.
    fn add_gradient(&mut self, rows: usize, gradient: &mut [f64]) {
        for layer in &self.layers {
            for unit in 0..layer.units {
                let sum = &mut column_mut(&mut self.weighted, unit)[..rows];
                sum.fill(0.0);
                for (output, delta) in layer.delta.iter().enumerate() {
                    let error = &column(&self.error, output)[..rows];
                    add_product(sum, error, &column(delta, unit)[..rows]);
                }
            }
            let target = &mut gradient[layer.weights.clone()];
            let mut target = DMatrixViewMut::from_slice(target, layer.fan_in + 1, layer.units);
            let weighted = self.weighted.view((0, 0), (rows, layer.units));
            target.gemm(1.0, &layer.samples.columns(0, rows), &weighted, 1.0);
        }
    }
}

impl LeastSquares for NetworkErrors {
    fn weights(&self) -> usize {
        weight_count(&self.sizes)
    }

    fn errors(&self) -> usize {
        self.training.outputs.nrows() * self.training.outputs.ncols()
    }

    fn cost(&mut self, weights: &[f64]) -> f64 {
        self.sum_of_squares(weights, self.training.inputs.nrows(), false)
    }

    fn linearise(&mut self, weights: &[f64], equations: &mut NormalEquations) {
        for block in &mut self.blocks {
            block.clear();
        }
        for batch in batches(self.training.inputs.nrows()) {
            self.forward(weights, &batch, false);
            self.backward(weights, batch.len());
            self.layers.iter_mut().for_each(Layer::transpose);
            self.add_gradient(batch.len(), &mut equations.gradient);
            for block in &mut self.blocks {
                block.add(&self.layers, batch.len());
            }
        }
        for block in &self.blocks {
            block.scatter(&self.layers, &mut equations.matrix);
        }
    }

    #[expect(clippy::cast_precision_loss)]
    fn validation(&mut self, weights: &[f64]) -> Option<f64> {
        let samples = self.validation.as_ref()?.outputs.nrows();
        let errors = samples * self.error.ncols();
        Some(self.sum_of_squares(weights, samples, true) / errors as f64)
    }
}

fn batches(count: usize) -> impl Iterator<Item = Range<usize>> {
    (0..count).step_by(BATCH).map(move |start| start..(start + BATCH).min(count))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::network::Network;
    use rand::{RngExt, SeedableRng};

    struct Case {
        samples: Samples,
        weights: Vec<f64>,
    }

    fn case(sizes: &[usize], count: usize, seed: u64) -> Case {
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(seed);
        let mut matrix = |columns| DMatrix::from_fn(count, columns, |_, _| rng.random_range(-1.0..1.0));
        let samples = Samples { inputs: matrix(sizes[0]), outputs: matrix(sizes[sizes.len() - 1]) };
        let weights = (0..weight_count(sizes)).map(|_| rng.random_range(-0.8..0.8)).collect();
        Case { samples, weights }
    }

    /// Errors of all samples by the streaming network, an independent implementation of the same formula.
    fn errors(sizes: &[usize], activation: Activation, samples: &Samples, weights: &[f64]) -> Vec<f64> {
        let network = Network::new(sizes, activation, weights.to_vec()).unwrap();
        let mut scratch = network.scratch();
        let row = |i: usize| samples.inputs.row(i).iter().copied().collect::<Vec<_>>();
        let of_sample = |i: usize| {
            let y = network.forward(&row(i), &mut scratch).to_vec();
            y.into_iter().zip(samples.outputs.row(i).iter()).map(|(y, t)| y - t).collect::<Vec<_>>()
        };
        (0..samples.inputs.nrows()).flat_map(of_sample).collect()
    }

    /// J by central differences, one column per weight.
    fn jacobian(sizes: &[usize], activation: Activation, case: &Case) -> DMatrix<f64> {
        let h = 1.0e-5;
        let shifted = |weight: usize, by: f64| {
            let mut weights = case.weights.clone();
            weights[weight] += by;
            errors(sizes, activation, &case.samples, &weights)
        };
        let column = |weight| {
            let (up, down) = (shifted(weight, h), shifted(weight, -h));
            up.iter().zip(&down).map(|(u, d)| (u - d) / (2.0 * h)).collect::<Vec<_>>()
        };
        let columns: Vec<Vec<f64>> = (0..case.weights.len()).map(column).collect();
        DMatrix::from_fn(columns[0].len(), columns.len(), |i, j| columns[j][i])
    }

    #[test]
    fn normal_equations_equal_those_of_finite_differences() {
        let shapes: [(&[usize], usize); 6] = [
            (&[4, 5, 3, 2], 40),
            (&[3, 4, 4, 4, 4, 3], 30),
            (&[6, 3, 1], 1),
            (&[2, 7, 3], 2 * BATCH + 17),
            (&[5, 2], 20),
            (&[1, 1, 1], 5),
        ];
        for (index, (sizes, count)) in shapes.into_iter().enumerate() {
            for activation in [Activation::Tanh, Activation::Logistic] {
                let case = case(sizes, count, index as u64);
                let jacobian = jacobian(sizes, activation, &case);
                let error = errors(sizes, activation, &case.samples, &case.weights);
                let mut problem = NetworkErrors::new(sizes, activation, case.samples.clone(), None);
                let mut equations = NormalEquations::new(case.weights.len());
                problem.linearise(&case.weights, &mut equations);
                let expected = jacobian.transpose() * &jacobian;
                let scale = expected.amax();
                let mut worst = 0.0_f64;
                let mut informative = 0;
                for i in 0..case.weights.len() {
                    let gradient: f64 = jacobian.column(i).iter().zip(&error).map(|(j, e)| j * e).sum();
                    worst = worst.max((gradient - equations.gradient()[i]).abs() / scale);
                    for j in 0..=i {
                        informative += usize::from(expected[(i, j)].abs() > 1.0e-6 * scale);
                        worst = worst.max((expected[(i, j)] - equations.element(i, j)).abs() / scale);
                    }
                }
                let elements = case.weights.len() * (case.weights.len() + 1) / 2;
                eprintln!(
                    "{sizes:?} {activation:?}: {informative} of {elements} elements matter, worst {worst:.1e}"
                );
                assert!(informative * 2 > elements && scale > 1.0e-2, "the comparison is not vacuous");
                assert!(worst < 1.0e-7);
            }
        }
    }

    #[test]
    fn cost_and_validation_equal_the_streaming_networks() {
        let sizes = [4, 6, 2];
        let Case { samples, weights } = case(&sizes, BATCH + 5, 3);
        let held_out = case(&sizes, 2 * BATCH, 4).samples;
        let mut problem =
            NetworkErrors::new(&sizes, Activation::Tanh, samples.clone(), Some(held_out.clone()));
        let square = |samples: &Samples| {
            let all = errors(&sizes, Activation::Tanh, samples, &weights);
            (all.iter().map(|e| e * e).sum::<f64>(), all.len())
        };
        let (cost, count) = square(&samples);
        assert_eq!(problem.errors(), count);
        assert!(cost > 1.0 && (problem.cost(&weights) / cost - 1.0).abs() < 1.0e-13);
        let (validation, count) = square(&held_out);
        let mse = problem.validation(&weights).unwrap();
        assert!((mse * count as f64 / validation - 1.0).abs() < 1.0e-13);
        assert!((problem.cost(&weights) / cost - 1.0).abs() < 1.0e-13, "validation leaves training alone");
    }
}
