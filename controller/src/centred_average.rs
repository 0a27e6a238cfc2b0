//! A centred, weighted moving average over a predicted signal, whose future is known.

use std::f64::consts::PI;

/// The last 2h + 1 values of a signal; their mean belongs to the instant of the middle value, h ticks before the newest.
///
/// The weights are those of Hann's window, sin²(π i/(2h + 2)), i = 1…2h + 1. If the signal jumps, the mean changes with a smooth
/// acceleration; with equal weights the acceleration would have two pulses.
#[derive(Clone, Debug)]
pub struct CentredAverage {
    /// Values of the signal, one row an instant.
    values: Vec<f64>,
    width: usize,
    length: usize,
    /// Row of the oldest value.
    oldest: usize,
    /// Weights from the oldest to the newest value; they add up to 1.
    weights: Vec<f64>,
}

impl CentredAverage {
    /// Creates an average of a signal of `width` channels, with `half` values before and after the middle.
    pub fn new(half: usize, width: usize) -> CentredAverage {
        let length = 2 * half + 1;
        let hann = |i: usize| (PI * (i + 1) as f64 / (length + 1) as f64).sin().powi(2);
        let sum: f64 = (0..length).map(hann).sum();
        let weights = (0..length).map(|i| hann(i) / sum).collect();
        CentredAverage { values: vec![0.0; length * width], width, length, oldest: 0, weights }
    }

    /// Number of values before, and after, the middle; the newest value is so many ticks ahead.
    pub fn half_width(&self) -> usize {
        self.length / 2
    }

    /// Adds the newest value, dropping the oldest.
    pub fn push(&mut self, value: impl IntoIterator<Item = f64>) {
        let row = &mut self.values[self.oldest * self.width..][..self.width];
        for (slot, value) in row.iter_mut().zip(value) {
            *slot = value;
        }
        self.oldest = (self.oldest + 1) % self.length;
    }

    /// Writes the weighted mean of all values, summed from the oldest to the newest.
    pub fn mean(&self, mean: &mut [f64]) {
        mean.fill(0.0);
        for age in 0..self.length {
            let row = (self.oldest + age) % self.length;
            let weight = self.weights[age];
            for (sum, value) in mean.iter_mut().zip(&self.values[row * self.width..][..self.width]) {
                *sum += weight * value;
            }
        }
    }
}
