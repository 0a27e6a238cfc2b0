//! Initial weights by the rule of Nguyen and Widrow.
//!
//! # Formula
//! A hidden layer has s units on r inputs in \[-1, 1\]. The weight vectors have the length 0.7 s^(1/r) and random directions, and
//! the biases are spread evenly so that the units' active ranges cover the inputs (D. Nguyen, B. Widrow, "Improving the learning
//! speed of 2-layer neural networks by choosing initial values of the adaptive weights", IJCNN 1990). They are then scaled to the
//! unit's active range, |z| < 2 for tanh and |z| < 4 for the logistic function, and shifted to inputs in \[0, 1\] after logistic
//! units, as in MATLAB's `initnw`. Output weights and biases are uniform in (-1, 1).

use crate::activation::Activation;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// Flat weights (order: [`crate::network`]) for a network of these layer sizes; the same seed gives the same weights.
#[must_use]
pub fn nguyen_widrow(sizes: &[usize], activation: Activation, seed: u64) -> Vec<f64> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut weights = Vec::with_capacity(crate::network::weight_count(sizes));
    for (layer, pair) in sizes.windows(2).enumerate() {
        let (fan_in, units) = (pair[0], pair[1]);
        if layer + 2 == sizes.len() {
            weights.extend((0..(fan_in + 1) * units).map(|_| rng.random_range(-1.0..1.0)));
            continue;
        }
        let after_logistic = layer > 0 && activation == Activation::Logistic;
        for unit in 0..units {
            let length = magnitude(fan_in, units, activation);
            let mut row = direction(fan_in, &mut rng);
            row.iter_mut().for_each(|w| *w *= length);
            let mut bias = length * spread(unit, units) * row[0].signum();
            if after_logistic {
                bias -= row.iter().sum::<f64>();
                row.iter_mut().for_each(|w| *w *= 2.0);
            }
            weights.push(bias);
            weights.extend(row);
        }
    }
    weights
}

#[expect(clippy::cast_precision_loss)]
fn magnitude(fan_in: usize, units: usize, activation: Activation) -> f64 {
    let stretch = match activation {
        Activation::Tanh => 2.0,
        Activation::Logistic => 4.0,
    };
    stretch * 0.7 * (units as f64).powf(1.0 / fan_in as f64)
}

/// Normalised position of a unit in its layer, evenly from −1 to 1; a single unit has 0.
#[expect(clippy::cast_precision_loss)]
fn spread(unit: usize, units: usize) -> f64 {
    if units == 1 { 0.0 } else { 2.0 * unit as f64 / (units - 1) as f64 - 1.0 }
}

fn direction(fan_in: usize, rng: &mut ChaCha8Rng) -> Vec<f64> {
    let row: Vec<f64> = (0..fan_in).map(|_| rng.random_range(-1.0..1.0)).collect();
    let length = row.iter().map(|w| w * w).sum::<f64>().sqrt().max(f64::MIN_POSITIVE);
    row.into_iter().map(|w| w / length).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn hidden_weights_have_the_rules_length_and_biases_spread() {
        let sizes = [3, 5, 4, 2];
        let weights = nguyen_widrow(&sizes, Activation::Tanh, 3);
        assert_eq!(weights.len(), crate::network::weight_count(&sizes));
        let first: Vec<&[f64]> = weights[..20].chunks(4).collect();
        let expected = 1.4 * 5.0_f64.powf(1.0 / 3.0);
        for row in &first {
            let length = row[1..].iter().map(|w| w * w).sum::<f64>().sqrt();
            assert!((length - expected).abs() < 1.0e-12, "{length} {expected}");
        }
        let biases: Vec<f64> = first.iter().map(|row| row[0].abs() / expected).collect();
        let spread = [1.0, 0.5, 0.0, 0.5, 1.0];
        assert!(biases.iter().zip(spread).all(|(a, b)| (a - b).abs() < 1.0e-12), "{biases:?}");
    }

    #[test]
    fn logistic_units_see_inputs_centred() {
        // An output of 1/2 from every logistic unit is the centre; there z equals the bias before the shift.
        let weights = nguyen_widrow(&[2, 3, 4, 1], Activation::Logistic, 5);
        let second: Vec<&[f64]> = weights[9..9 + 16].chunks(4).collect();
        let expected = 2.8 * 4.0_f64.powf(1.0 / 3.0);
        for (unit, row) in second.iter().enumerate() {
            let middle = row[0] + 0.5 * row[1..].iter().sum::<f64>();
            let want = expected * spread(unit, 4).abs();
            assert!((middle.abs() - want).abs() < 1.0e-12, "{middle} {want}");
        }
    }

    #[test]
    fn the_seed_decides() {
        let make = |seed| nguyen_widrow(&[4, 6, 1], Activation::Tanh, seed);
        assert_eq!(make(1), make(1));
        assert_ne!(make(1), make(2));
    }
}
