//! The feed-forward network: any layer sizes, tanh or logistic hidden units, linear outputs, a bias for every unit.
//!
//! # Formula
//! a₀ = x, aₗ = f(Wₗ aₗ₋₁ + bₗ) for hidden layers, y = W_L a_{L−1} + b_L.
//!
//! # Order of the weights
//! One flat list: layer after layer, in each layer unit after unit, and for each unit its bias and then its weights on
//! the units of the layer before. A 40-10-10-10-10-3 network has 773.
//!
//! # Layout in memory
//! [`Network::forward`] uses a second copy of the weights in panels of four units, padded with zero weights: biases, weights on
//! the first unit of the layer before, weights on the second, …, four numbers each. A panel's sums stay in registers. (Three
//! panels at once, to fetch each input only once, proved slower.)

use crate::activation::{Activation, fused};

/// Units per panel: four doubles fill one 256-bit register.
const LANES: usize = 4;

/// Four units' values, padded with zeros.
type Lanes = [f64; LANES];

/// Reasons why a network cannot be created.
#[derive(Debug, thiserror::Error, PartialEq)]
pub enum NetworkError {
    /// There is no output layer, or a layer is empty.
    #[error("layer sizes {sizes:?}: give at least an input and an output layer, each with one unit or more")]
    BadSizes {
        /// The given sizes.
        sizes: Vec<usize>,
    },
    /// The number of weights does not match the layer sizes.
    #[error("layers {sizes:?} take {needed} weights, but {given} are given")]
    WrongWeightCount {
        /// The layer sizes.
        sizes: Vec<usize>,
        /// Required weights.
        needed: usize,
        /// Given weights.
        given: usize,
    },
    /// A weight is NaN or infinite.
    #[error("weight {index} is {value}: every weight must be finite; train again or restore the file")]
    NonFiniteWeight {
        /// Position in the flat list, from 0.
        index: usize,
        /// The value found.
        value: f64,
    },
}

/// Number of weights, biases included, of a network with these layer sizes (inputs first, outputs last); saturates at the largest
/// `usize`.
#[must_use]
pub fn weight_count(sizes: &[usize]) -> usize {
    let of_layer = |pair: &[usize]| pair[0].saturating_add(1).saturating_mul(pair[1]);
    sizes.windows(2).map(of_layer).fold(0, usize::saturating_add)
}

/// An immutable network; see the module for its formula and the order of its weights.
#[derive(Debug, Clone)]
pub struct Network {
    sizes: Vec<usize>,
    activation: Activation,
    weights: Vec<f64>,
    panels: Vec<Lanes>,
    arch: pulp::Arch,
}

/// Working memory of [`Network::forward`]; one per thread.
#[derive(Debug, Clone)]
pub struct Scratch {
    from: Vec<Lanes>,
    to: Vec<Lanes>,
}

impl Network {
    /// Creates a network of the given layer sizes (inputs first, outputs last) and flat `weights`.
    ///
    /// # Errors
    /// If a layer is missing or empty, the number of weights does not match the layers, or a weight is not finite.
    pub fn new(sizes: &[usize], activation: Activation, weights: Vec<f64>) -> Result<Self, NetworkError> {
        if sizes.len() < 2 || sizes.contains(&0) {
            return Err(NetworkError::BadSizes { sizes: sizes.to_vec() });
        }
        let needed = weight_count(sizes);
        if weights.len() != needed {
            let given = weights.len();
            return Err(NetworkError::WrongWeightCount { sizes: sizes.to_vec(), needed, given });
        }
        if let Some((index, &value)) = weights.iter().enumerate().find(|(_, w)| !w.is_finite()) {
            return Err(NetworkError::NonFiniteWeight { index, value });
        }
        let panels = pack(sizes, &weights);
        Ok(Self { sizes: sizes.to_vec(), activation, weights, panels, arch: pulp::Arch::new() })
    }

    /// The mean of `networks` as one network: their hidden units side by side, without weights between the units of different
    /// networks. Returns `None` without networks, for networks with different layers or units, and for networks without hidden
    /// units.
    pub(crate) fn mean(networks: &[&Self]) -> Option<Self> {
        let first = networks.first()?;
        let is_alike = |other: &&Self| (&other.sizes, other.activation) == (&first.sizes, first.activation);
        if !networks.iter().all(is_alike) || first.sizes.len() < 3 {
            return None;
        }
        let (count, last) = (networks.len(), first.sizes.len() - 2);
        let is_hidden = |layer: usize| layer > 0 && layer <= last;
        let sizes: Vec<usize> = (0..first.sizes.len())
            .map(|layer| first.sizes[layer] * if is_hidden(layer) { count } else { 1 })
            .collect();
        let mut weights = Vec::with_capacity(weight_count(&sizes));
        let mut before = 0;
        for (layer, pair) in first.sizes.windows(2).enumerate() {
            let (row, units) = (pair[0] + 1, pair[1]);
            let of_unit =
                |network: usize, unit: usize| &networks[network].weights[before + unit * row..][..row];
            if layer == last {
                let share = 1.0 / count as f64;
                for unit in 0..units {
                    let rows = || (0..count).map(|network| of_unit(network, unit));
                    weights.push(rows().map(|row| row[0]).sum::<f64>() * share);
                    weights.extend(rows().flat_map(|row| &row[1..]).map(|weight| weight * share));
                }
            } else {
                for network in 0..count {
                    // The first layer uses the shared inputs, the other layers the units of their own network.
                    let (left, right) = if layer == 0 { (0, 0) } else { (network, count - 1 - network) };
                    let none = |networks: usize| std::iter::repeat_n(0.0, networks * pair[0]);
                    for row in (0..units).map(|unit| of_unit(network, unit)) {
                        weights.push(row[0]);
                        weights.extend(none(left).chain(row[1..].iter().copied()).chain(none(right)));
                    }
                }
            }
            before += row * units;
        }
        Self::new(&sizes, first.activation, weights).ok()
    }

    /// Layer sizes, inputs first, outputs last.
    #[must_use]
    pub fn sizes(&self) -> &[usize] {
        &self.sizes
    }

    /// Kind of the hidden units.
    #[must_use]
    pub fn activation(&self) -> Activation {
        self.activation
    }

    /// The flat weights, in the module's order.
    #[must_use]
    pub fn weights(&self) -> &[f64] {
        &self.weights
    }

    /// Number of inputs.
    #[must_use]
    pub fn inputs(&self) -> usize {
        self.sizes[0]
    }

    /// Number of outputs.
    #[must_use]
    pub fn outputs(&self) -> usize {
        self.sizes[self.sizes.len() - 1]
    }

    /// Working memory for this network.
    #[must_use]
    pub fn scratch(&self) -> Scratch {
        let widest = self.sizes.iter().map(|n| n.div_ceil(LANES)).max().unwrap_or(0);
        Scratch { from: vec![[0.0; LANES]; widest], to: vec![[0.0; LANES]; widest] }
    }

    /// Computes the network's outputs at `x`, without allocation.
    ///
    /// # Panics
    /// If `x` does not have [`Network::inputs`] elements, or `scratch` belongs to a smaller network.
    pub fn forward<'s>(&self, x: &[f64], scratch: &'s mut Scratch) -> &'s [f64] {
        assert_eq!(x.len(), self.inputs(), "number of network inputs");
        self.arch.dispatch(Forward { network: self, x, scratch });
        &scratch.from.as_flattened()[..self.outputs()]
    }

    #[inline(always)]
    fn forward_compiled<const FUSED: bool>(&self, x: &[f64], scratch: &mut Scratch) {
        let Scratch { from, to } = scratch;
        from[(x.len() - 1) / LANES] = [0.0; LANES];
        from.as_flattened_mut()[..x.len()].copy_from_slice(x);
        let mut rest = self.panels.as_slice();
        for (layer, pair) in self.sizes.windows(2).enumerate() {
            let (inputs, panels) = (pair[0].div_ceil(LANES), pair[1].div_ceil(LANES));
            let (weights, others) = rest.split_at(panels * (1 + inputs * LANES));
            rest = others;
            for (panel, sum) in weights.chunks_exact(1 + inputs * LANES).zip(to.iter_mut()) {
                *sum = panel_sum::<FUSED>(panel, &from[..inputs]);
            }
            if layer + 2 < self.sizes.len() {
                activate::<FUSED>(self.activation, &mut to[..panels]);
            }
            std::mem::swap(from, to);
        }
    }
}

struct Forward<'a> {
    network: &'a Network,
    x: &'a [f64],
    scratch: &'a mut Scratch,
}

impl pulp::WithSimd for Forward<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, _: S) {
        if S::IS_SCALAR {
            self.network.forward_compiled::<false>(self.x, self.scratch);
        } else {
            self.network.forward_compiled::<true>(self.x, self.scratch);
        }
    }
}

#[inline(always)]
fn activate<const FUSED: bool>(activation: Activation, values: &mut [Lanes]) {
    for unit in values.as_flattened_mut() {
        *unit = activation.lane::<FUSED>(*unit);
    }
}

/// Weighted sums of four units. Four partial sums shorten the chain of dependent additions.
#[inline(always)]
fn panel_sum<const FUSED: bool>(panel: &[Lanes], from: &[Lanes]) -> Lanes {
    let mut sums = [panel[0], [0.0; LANES], [0.0; LANES], [0.0; LANES]];
    for (columns, x) in panel[1..].as_chunks::<LANES>().0.iter().zip(from) {
        for ((sum, column), x) in sums.iter_mut().zip(columns).zip(x) {
            for (sum, weight) in sum.iter_mut().zip(column) {
                *sum = fused::<FUSED>(*weight, *x, *sum);
            }
        }
    }
    std::array::from_fn(|i| (sums[0][i] + sums[1][i]) + (sums[2][i] + sums[3][i]))
}

/// The weights in panels; padded units and padded inputs have zero weights.
fn pack(sizes: &[usize], weights: &[f64]) -> Vec<Lanes> {
    let mut panels = Vec::new();
    let mut rest = weights;
    for pair in sizes.windows(2) {
        let (fan_in, units) = (pair[0], pair[1]);
        let (layer, others) = rest.split_at((fan_in + 1) * units);
        rest = others;
        let columns = 1 + fan_in.next_multiple_of(LANES);
        for first in (0..units).step_by(LANES) {
            panels.extend((0..columns).map(|column| {
                std::array::from_fn(|lane| {
                    let unit = first + lane;
                    let inside = unit < units && column <= fan_in;
                    if inside { layer[unit * (fan_in + 1) + column] } else { 0.0 }
                })
            }));
        }
    }
    panels
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_mean_of_networks_is_a_network() {
        let x = [0.3, -0.7];
        for sizes in [vec![2, 3, 2], vec![2, 3, 5, 2], vec![2, 4, 3, 2, 1]] {
            let networks: Vec<Network> = (1..4)
                .map(|seed| {
                    let weights = crate::initialise::nguyen_widrow(&sizes, Activation::Tanh, seed);
                    Network::new(&sizes, Activation::Tanh, weights).unwrap()
                })
                .collect();
            let answer = |network: &Network| network.forward(&x, &mut network.scratch()).to_vec();
            let answers: Vec<Vec<f64>> = networks.iter().map(answer).collect();
            let mean = Network::mean(&networks.iter().collect::<Vec<_>>()).unwrap();
            assert_eq!(
                mean.sizes()[1..sizes.len() - 1],
                sizes[1..sizes.len() - 1].iter().map(|n| 3 * n).collect::<Vec<_>>()
            );
            for (output, found) in answer(&mean).iter().enumerate() {
                let wanted = answers.iter().map(|answer| answer[output]).sum::<f64>() / 3.0;
                assert!((found - wanted).abs() < 1e-14, "{sizes:?}: {found} {wanted}");
            }
        }
        let of =
            |sizes: &[usize]| Network::new(sizes, Activation::Tanh, vec![0.1; weight_count(sizes)]).unwrap();
        assert!(Network::mean(&[]).is_none() && Network::mean(&[&of(&[2, 1])]).is_none());
        assert!(Network::mean(&[&of(&[2, 3, 1]), &of(&[2, 4, 1])]).is_none());
    }
    use rand::{RngExt, SeedableRng};

    /// The same network written as its formula, unit by unit, with the standard library's functions.
    fn plainly(sizes: &[usize], activation: Activation, weights: &[f64], x: &[f64]) -> Vec<f64> {
        let (mut a, mut w) = (x.to_vec(), weights.iter());
        for layer in 1..sizes.len() {
            let mut next = Vec::new();
            for _ in 0..sizes[layer] {
                let bias = *w.next().unwrap();
                let z: f64 = bias + a.iter().map(|a| a * w.next().unwrap()).sum::<f64>();
                let hidden = layer + 1 < sizes.len();
                next.push(match activation {
                    _ if !hidden => z,
                    Activation::Tanh => z.tanh(),
                    Activation::Logistic => 1.0 / (1.0 + (-z).exp()),
                });
            }
            a = next;
        }
        a
    }

    #[test]
    fn forward_equals_the_formula_for_all_shapes() {
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(1);
        let shapes: [&[usize]; 7] = [
            &[40, 10, 10, 10, 10, 3],
            &[1, 1],
            &[3, 2],
            &[5, 4, 1],
            &[8, 17, 6, 5],
            &[2, 1, 9],
            &[33, 10, 10, 10, 10, 3],
        ];
        for sizes in shapes {
            for activation in [Activation::Tanh, Activation::Logistic] {
                let weights: Vec<f64> =
                    (0..weight_count(sizes)).map(|_| rng.random_range(-1.0..1.0)).collect();
                let network = Network::new(sizes, activation, weights.clone()).unwrap();
                let mut scratch = network.scratch();
                let mut worst = 0.0_f64;
                for _ in 0..20 {
                    let x: Vec<f64> = (0..sizes[0]).map(|_| rng.random_range(-1.0..1.0)).collect();
                    let expected = plainly(sizes, activation, &weights, &x);
                    let y = network.forward(&x, &mut scratch);
                    assert_eq!(y.len(), expected.len());
                    assert!(expected.iter().any(|e| e.abs() > 1.0e-3), "something to compare");
                    worst = y.iter().zip(&expected).fold(worst, |m, (a, b)| m.max((a - b).abs()));
                }
                eprintln!("{sizes:?} {activation:?}: largest difference {worst:.1e}");
                assert!(worst < 1.0e-13);
            }
        }
    }

    #[test]
    fn forward_allocates_nothing() {
        let sizes = [40, 10, 10, 10, 10, 3];
        let network = Network::new(&sizes, Activation::Tanh, vec![0.1; weight_count(&sizes)]).unwrap();
        let mut scratch = network.scratch();
        let x = vec![0.3; 40];
        let mut sum = 0.0;
        let info = allocation_counter::measure(|| {
            for _ in 0..100 {
                sum += network.forward(&x, &mut scratch)[0];
            }
        });
        assert!(sum != 0.0);
        assert_eq!(info.count_total, 0);
    }

    #[test]
    fn a_bad_network_is_refused() {
        let make = |sizes: &[usize], weights: Vec<f64>| Network::new(sizes, Activation::Tanh, weights);
        assert!(matches!(make(&[3], vec![]), Err(NetworkError::BadSizes { .. })));
        assert!(matches!(make(&[3, 0, 1], vec![]), Err(NetworkError::BadSizes { .. })));
        let wrong = make(&[40, 10, 10, 10, 10, 3], vec![0.0; 770]);
        assert!(matches!(wrong, Err(NetworkError::WrongWeightCount { needed: 773, given: 770, .. })));
        let huge = make(&[usize::MAX, usize::MAX, 2], vec![0.0; 3]);
        assert!(matches!(huge, Err(NetworkError::WrongWeightCount { .. })));
        let nan = make(&[1, 1], vec![0.0, f64::NAN]);
        assert!(matches!(nan, Err(NetworkError::NonFiniteWeight { index: 1, .. })));
    }
}
