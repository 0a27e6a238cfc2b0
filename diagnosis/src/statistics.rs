//! Moments of a signal, and blocks of its rows.

use std::ops::Range;

/// Length of a block of rows that are taken to be alike, s: longer than what neighbours share, shorter than a motion.
pub(crate) const BLOCK_S: f64 = 0.5;

/// The blocks of `stretch`, whose rows are `step` s apart, each [`BLOCK_S`] long but for the last.
pub(crate) fn blocks(stretch: Range<usize>, step: f64) -> impl Iterator<Item = Range<usize>> {
    let (long, end) = (((BLOCK_S / step.max(1e-12)) as usize).max(1), stretch.end);
    stretch.step_by(long).map(move |from| from..(from + long).min(end))
}

/// A quantile of |x|.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Quantile {
    /// The share of all |x| that is below it.
    pub below: f64,
    /// It over the standard deviation of a normal x.
    pub of_normal: f64,
}

impl Quantile {
    /// The median.
    pub const MEDIAN: Self = Self { below: 0.5, of_normal: 0.674_489_750_196_081_7 };
    /// The lower quartile.
    pub const LOWER_QUARTILE: Self = Self { below: 0.25, of_normal: 0.318_639_363_964_375_1 };
}

/// Mean, spread and size of a signal; zeros for an empty one.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Moments {
    /// Mean.
    pub mean: f64,
    /// Standard deviation about the mean.
    pub std: f64,
    /// Root of the mean square.
    pub rms: f64,
}

impl Moments {
    /// The moments of `values`.
    pub fn of(values: &[f64]) -> Self {
        let count = values.len().max(1) as f64;
        let mean = values.iter().sum::<f64>() / count;
        let variance = values.iter().map(|value| (value - mean).powi(2)).sum::<f64>() / count;
        let square = values.iter().map(|value| value * value).sum::<f64>() / count;
        Self { mean, std: variance.sqrt(), rms: square.sqrt() }
    }
}

/// Median size of the fourth differences of `samples`: these leave nothing of a smooth motion, and the median does not mind a few jumps
/// (Hampel 1974). White noise of deviation σ has 0.674 √70 σ; 0 for fewer than five samples.
pub(crate) fn roughness(samples: &[f64]) -> f64 {
    let mut fourth: Vec<f64> =
        samples.windows(5).map(|x| (x[0] - 4.0 * x[1] + 6.0 * x[2] - 4.0 * x[3] + x[4]).abs()).collect();
    let middle = fourth.len() / 2;
    if fourth.is_empty() { 0.0 } else { *fourth.select_nth_unstable_by(middle, f64::total_cmp).1 }
}

/// Deviation of the white noise in `samples` of a smooth motion, by their [`roughness`].
pub(crate) fn white_noise(samples: &[f64]) -> f64 {
    /// Sum of the squares of 1, −4, 6, −4, 1.
    const FOURTH_DIFFERENCE: f64 = 70.0;
    roughness(samples) / Quantile::MEDIAN.of_normal / FOURTH_DIFFERENCE.sqrt()
}

/// Greatest less least of `samples`; 0 of none.
pub(crate) fn span(samples: &[f64]) -> f64 {
    let (low, high) =
        samples.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), x| (low.min(*x), high.max(*x)));
    (high - low).max(0.0)
}
