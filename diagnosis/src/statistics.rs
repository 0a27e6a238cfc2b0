//! Moments of a signal, quantiles of the normal distribution, bootstrap intervals, and the constants that several questions of statistics share.

use std::f64::consts::TAU;
use std::ops::Range;

use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

use crate::sorting::sort;

/// Natural logarithm of the odds that a name requires, 20 to 1: Kass & Raftery (1995, J. Am. Stat. Assoc. 90:773) call such evidence strong.
pub const STRONG: f64 = 2.995_732_273_553_991;

/// Significance level: 5 % is the usual one (Fisher 1925), and every interval of a report has a coverage of 95 %.
pub(crate) const SIGNIFICANT: f64 = 0.05;

/// Smallest number of rows for a share or a mean: with fewer its standard deviation is a tenth of its range or more, √(0.25/20).
pub(crate) const FEWEST_ROWS: usize = 20;

/// Draws of a bootstrap and of a posterior: the share of draws beyond a 2.5 % quantile has the standard deviation √(0.025 · 0.975/1000), half a per
/// cent.
pub(crate) const DRAWS: usize = 1000;

/// Share of a channel's span below the resolution of any sensor: a little over 23 bits. A simulated recording has no noise, and without this limit
/// every rounding error would be a finding.
pub(crate) const FINEST: f64 = 1e-7;

/// Shares of one recording in the fit part, and in the fit and the choice part together: the fit needs most of the motion, and it is common in the
/// field to hold out a third for the test.
pub(crate) const SHARES: [f64; 2] = [0.55, 0.70];

/// Bound on the position of a joint at rest, in standard deviations of its encoder's noise: one in 10⁵ samples of normal noise is outside.
pub(crate) const UNMOVED: f64 = 4.5;

/// Standard deviation of a prior without information, in standard deviations of the measurement: any data outweigh it by far, and double precision
/// still holds both.
pub(crate) const WIDE: f64 = 1e6;

/// Largest number of rounds of an iteration: most converge in a few, and rounding errors can keep one of them oscillating.
pub(crate) const MOST_ROUNDS: usize = 30;

/// Turns of an iteration whose quantities follow each other, such as weights and residuals: each turn takes most of the change that remains, so that four settle
/// them.
pub(crate) const TURNS: usize = 4;

/// Shares of a step that a descent tries, because the whole step may lead too far in a nonlinear problem: each share is half the one before.
pub(crate) const BACKTRACKING: [f64; 3] = [1.0, 0.5, 0.25];

/// Length of a block of rows for the bootstrap, s: longer than the correlation of neighbouring rows, shorter than a motion.
pub(crate) const BLOCK_S: f64 = 0.5;

/// The blocks of `stretch`, whose rows are `step` s apart, each [`BLOCK_S`] long except the last.
pub(crate) fn blocks(stretch: Range<usize>, step: f64) -> impl Iterator<Item = Range<usize>> {
    let (long, end) = (((BLOCK_S / step.max(1e-12)) as usize).max(1), stretch.end);
    stretch.step_by(long).map(move |from| from..(from + long).min(end))
}

/// The median of |x| divided by the standard deviation of a normal x.
pub(crate) fn median_of_normal() -> f64 {
    normal_quantile(0.75)
}

/// The quantile of the standard normal distribution at the probability `below`, at least one half. Newton's steps approach it from below, because the
/// distribution function is concave there, and end when rounding stops their increase.
pub(crate) fn normal_quantile(below: f64) -> f64 {
    let density = |x: f64| (-0.5 * x * x).exp() / TAU.sqrt();
    let above_middle = |x: f64| 0.5 * libm::erf(x / std::f64::consts::SQRT_2);
    let mut x = 0.0;
    loop {
        let next = x + (below - 0.5 - above_middle(x)) / density(x);
        if next <= x {
            return x;
        }
        x = next;
    }
}

/// Half the width of an interval of 95 % in standard deviations of a normal.
pub(crate) fn half_width() -> f64 {
    normal_quantile(1.0 - 0.5 * SIGNIFICANT)
}

/// The ends of the interval of 95 % of `values`; NaN for no values.
fn interval(mut values: Vec<f64>) -> [f64; 2] {
    sort(&mut values);
    let outside = (0.5 * SIGNIFICANT * values.len() as f64) as usize;
    let at = |place: Option<usize>| place.and_then(|place| values.get(place)).copied().unwrap_or(f64::NAN);
    [at(Some(outside)), at(values.len().checked_sub(1 + outside))]
}

/// The 95 % interval of a statistic `of` over `blocks` blocks of rows, from draws of as many blocks with replacement (Künsch 1989, Ann. Statist.
/// 17:1217).
pub(crate) fn bootstrap(
    blocks: usize,
    seed: u64,
    of: impl Fn(&mut dyn Iterator<Item = usize>) -> f64,
) -> [f64; 2] {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut draw = || of(&mut (0..blocks).map(|_| rng.next_u64() as usize % blocks));
    interval((0..DRAWS).map(|_| draw()).filter(|value| value.is_finite()).collect())
}

/// Mean, standard deviation and root mean square of a signal; zeros for an empty one.
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
        let square = values.iter().map(|value| value * value).sum::<f64>() / count;
        Self { mean, std: variance(values).sqrt(), rms: square.sqrt() }
    }
}

/// Median of the absolute fourth differences of `samples`: these are near zero for a smooth motion, and a few jumps hardly change the median (Hampel
/// 1974). White noise with the standard deviation σ gives 0.674 √70 σ; 0 for fewer than five samples.
pub(crate) fn roughness(samples: &[f64]) -> f64 {
    let fourth = samples.windows(5).map(|x| (x[0] - 4.0 * x[1] + 6.0 * x[2] - 4.0 * x[3] + x[4]).abs());
    quantile(fourth.collect(), 0.5)
}

/// The value below which the `share` of `values` lies, at least 0 and below 1; 0 for no values.
pub(crate) fn quantile(mut values: Vec<f64>, share: f64) -> f64 {
    if values.is_empty() {
        return 0.0;
    }
    let place = (share * values.len() as f64) as usize;
    *values.select_nth_unstable_by(place, f64::total_cmp).1
}

/// Standard deviation of the white noise in `samples` of a smooth motion, from their [`roughness`].
pub(crate) fn white_noise(samples: &[f64]) -> f64 {
    let square: f64 = [1.0_f64, -4.0, 6.0, -4.0, 1.0].iter().map(|weight| weight * weight).sum();
    roughness(samples) / median_of_normal() / square.sqrt()
}

/// Maximum minus minimum of `samples`; 0 for no samples.
pub(crate) fn span(samples: &[f64]) -> f64 {
    let (low, high) = extremes(samples);
    (high - low).max(0.0)
}

/// Minimum and maximum of `values` without NaN; +∞ and −∞ if there are none.
pub(crate) fn extremes(values: &[f64]) -> (f64, f64) {
    values.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(least, most), value| {
        (least.min(*value), most.max(*value))
    })
}

/// `a − b`, element by element.
pub(crate) fn difference(a: &[f64], b: &[f64]) -> Vec<f64> {
    a.iter().zip(b).map(|(a, b)| a - b).collect()
}

/// Returns true if the odds are strong enough to distinguish two candidates.
pub(crate) fn is_strong_evidence(log_odds: f64) -> bool {
    log_odds > STRONG
}

/// Standard deviation of the white noise of an encoder with the readings `q`, or its step, if that is larger: the smallest change between two
/// samples.
pub(crate) fn encoder_noise(q: &[f64]) -> f64 {
    let changes = q.windows(2).map(|pair| (pair[1] - pair[0]).abs()).filter(|change| *change > 0.0);
    let step = changes.fold(f64::INFINITY, f64::min);
    white_noise(q).max(if step.is_finite() { step } else { 0.0 })
}

/// Mean square of a `column` about its mean.
pub(crate) fn variance(column: &[f64]) -> f64 {
    let mean = column.iter().sum::<f64>() / column.len().max(1) as f64;
    column.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / column.len().max(1) as f64
}

#[cfg(test)]
mod tests {
    use super::{bootstrap, half_width, median_of_normal, normal_quantile};

    /// Published quantiles (Abramowitz & Stegun 1964, table 26.5), and that of the median.
    #[test]
    fn quantiles_of_the_normal_are_those_of_the_tables() {
        for (below, published) in [
            (0.5, 0.0),
            (0.9, 1.281_551_565_544_6),
            (0.95, 1.644_853_626_951_473),
            (0.9995, 3.290_526_731_491_926),
        ] {
            let found = normal_quantile(below);
            println!("{below}: {found}");
            assert!((found - published).abs() < 1e-14 * (1.0 + 10.0 * published));
        }
        assert!((half_width() - 1.959_963_984_540_054).abs() < 1e-14);
        assert!((median_of_normal() - 0.674_489_750_196_081_7).abs() < 1e-15);
    }

    /// The mean of 400 blocks with the values 0 and 1: its standard deviation is 1/√1600.
    #[test]
    fn the_interval_of_a_mean_is_as_wide_as_its_deviation_says() {
        let mean =
            |picked: &mut dyn Iterator<Item = usize>| picked.map(|k| (k % 2) as f64).sum::<f64>() / 400.0;
        let [low, high] = bootstrap(400, 3, mean);
        let expected = 2.0 * half_width() / 40.0;
        println!("{low} to {high}, {expected} wide by the closed form");
        assert!(((high - low) / expected - 1.0).abs() < 0.15 && low < 0.5 && high > 0.5);
    }
}
