//! A centred moving average over a predicted signal, of which the future is known.

use nalgebra::Vector3;

/// The last 2h + 1 values of a signal; their mean belongs to the instant of the middle one, h ticks before the newest.
#[derive(Clone, Debug)]
pub struct Preview {
    values: Vec<Vector3<f64>>,
    /// Where the oldest value is.
    oldest: usize,
}

impl Preview {
    /// With `half` values before and after the middle.
    pub fn new(half: usize) -> Preview {
        Preview { values: vec![Vector3::zeros(); 2 * half + 1], oldest: 0 }
    }

    /// Number of values before, and after, the middle: how far ahead the newest is.
    pub fn half(&self) -> usize {
        self.values.len() / 2
    }

    /// Adds the newest value, dropping the oldest.
    pub fn push(&mut self, value: Vector3<f64>) {
        self.values[self.oldest] = value;
        self.oldest = (self.oldest + 1) % self.values.len();
    }

    /// The mean of all values, summed from the oldest to the newest.
    pub fn mean(&self) -> Vector3<f64> {
        let (newer, older) = self.values.split_at(self.oldest);
        let sum: Vector3<f64> = older.iter().chain(newer).sum();
        sum / self.values.len() as f64
    }
}
