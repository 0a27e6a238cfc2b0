//! Moments of a signal, quantiles of the normal distribution, bootstrap intervals, and the constants that several questions of statistics share.

use std::f64::consts::TAU;
use std::ops::Range;

use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// Natural logarithm of the odds from which a name is given, 20 to 1: Kass & Raftery (1995, J. Am. Stat. Assoc. 90:773) call such evidence strong.
pub const STRONG: f64 = 2.995_732_273_553_991;

/// Chance below which something is no accident: 5 % is the usual level (Fisher 1925), and every interval of a report is one of 95 %.
pub(crate) const SIGNIFICANT: f64 = 0.05;

/// Fewest rows of which a share or a mean says anything: with fewer its deviation is a tenth of its range or more, √(0.25/20).
pub(crate) const FEWEST_ROWS: usize = 20;

/// Draws of a bootstrap and of a posterior: the share of draws beyond a 2.5 % quantile scatters by √(0.025 · 0.975/1000), half a per cent.
pub(crate) const DRAWS: usize = 1000;

/// Share of a channel's span that no sensor resolves: a little over 23 bits. A simulated recording has no noise, and without this limit every rounding
/// error would be a finding.
pub(crate) const FINEST: f64 = 1e-7;

/// Shares of one recording in the fit part, and in the fit and the choice part together: what is fitted needs most of the motion, and a third for the
/// test is what the field holds out.
pub(crate) const SHARES: [f64; 2] = [0.55, 0.70];

/// Standard deviations of its encoder's noise within which a position stays that stands still: one in 10⁵ samples of normal noise is outside.
pub(crate) const UNMOVED: f64 = 4.5;

/// Deviation of a prior that says nothing, in deviations of what is measured: any data outweigh it by far, and double precision still holds both.
pub(crate) const WIDE: f64 = 1e6;

/// Rounds after which an iteration ends that has not settled: most settle in a few, and rounding can keep one of them going back and forth.
pub(crate) const MOST_ROUNDS: usize = 30;

/// Shares of a step that a descent tries, because the whole step may lead too far where a problem is not linear: each share is half the one before.
pub(crate) const BACKTRACKING: [f64; 3] = [1.0, 0.5, 0.25];

/// Length of a block of rows that are taken to be alike, s: longer than what neighbours share, shorter than a motion.
pub(crate) const BLOCK_S: f64 = 0.5;

/// The blocks of `stretch`, whose rows are `step` s apart, each [`BLOCK_S`] long but for the last.
pub(crate) fn blocks(stretch: Range<usize>, step: f64) -> impl Iterator<Item = Range<usize>> {
    let (long, end) = (((BLOCK_S / step.max(1e-12)) as usize).max(1), stretch.end);
    stretch.step_by(long).map(move |from| from..(from + long).min(end))
}

/// A quantile of |x|.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Quantile {
    /// Half of all |x| is below it.
    Median,
    /// A quarter of all |x| is below it.
    LowerQuartile,
}

impl Quantile {
    /// The share of all |x| that is below it.
    pub fn below(self) -> f64 {
        match self {
            Self::Median => 0.5,
            Self::LowerQuartile => 0.25,
        }
    }

    /// It over the standard deviation of a normal x.
    pub fn of_normal(self) -> f64 {
        normal_quantile(0.5 * (1.0 + self.below()))
    }
}

/// The number below which a standard normal is with the chance `below`, at least one half. Newton's steps come from below, as the distribution is concave there, and end where
/// rounding does.
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

/// The ends of the interval of 95 % of `values`, sorted; NaN of none.
fn interval(mut values: Vec<f64>) -> [f64; 2] {
    values.sort_by(f64::total_cmp);
    let outside = (0.5 * SIGNIFICANT * values.len() as f64) as usize;
    let at = |place: Option<usize>| place.and_then(|place| values.get(place)).copied().unwrap_or(f64::NAN);
    [at(Some(outside)), at(values.len().checked_sub(1 + outside))]
}

/// The interval of 95 % of a number that `of` makes of some of `blocks` blocks of rows, by drawing as many with replacement (Künsch 1989, Ann. Statist. 17:1217).
pub(crate) fn bootstrap(
    blocks: usize,
    seed: u64,
    of: impl Fn(&mut dyn Iterator<Item = usize>) -> f64,
) -> [f64; 2] {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut draw = || of(&mut (0..blocks).map(|_| rng.next_u64() as usize % blocks));
    interval((0..DRAWS).map(|_| draw()).filter(|value| value.is_finite()).collect())
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
    let square: f64 = [1.0_f64, -4.0, 6.0, -4.0, 1.0].iter().map(|weight| weight * weight).sum();
    roughness(samples) / Quantile::Median.of_normal() / square.sqrt()
}

/// Greatest less least of `samples`; 0 of none.
pub(crate) fn span(samples: &[f64]) -> f64 {
    let (low, high) = extremes(samples);
    (high - low).max(0.0)
}

/// The least and the greatest of `values` that are numbers; infinite, the wrong way round, where none is.
pub(crate) fn extremes(values: &[f64]) -> (f64, f64) {
    values.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(least, most), value| {
        (least.min(*value), most.max(*value))
    })
}

/// `a − b`, number by number.
pub(crate) fn difference(a: &[f64], b: &[f64]) -> Vec<f64> {
    a.iter().zip(b).map(|(a, b)| a - b).collect()
}

/// Whether two candidates may be told apart at all: the odds are beyond what is as good.
pub(crate) fn is_told(log_odds: f64) -> bool {
    log_odds > STRONG
}

/// Deviation of the white noise of an encoder that read `q`, or its step, if that is more: the least change between two samples.
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
    use super::{Quantile, bootstrap, half_width, normal_quantile};

    /// Published quantiles (Abramowitz & Stegun 1964, table 26.5), and that of the middle.
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
        assert!((Quantile::Median.of_normal() - 0.674_489_750_196_081_7).abs() < 1e-15);
    }

    /// The mean of 400 blocks that are 0 or 1: its deviation is 1/√1600.
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
