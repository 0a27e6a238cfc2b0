//! Scaling to \[-1, 1\], channel by channel, like MATLAB's `mapminmax`.
//!
//! # Formula
//! s = (v − min) · gain − 1, gain = 2 / (max − min). A channel that is constant in the training data (or whose range is not a normal number) gets gain 1, as in
//! MATLAB. It becomes −1 and carries no information; the scaling keeps the unit of later values.

use serde::{Deserialize, Serialize};

/// Least range of a channel, share of the widest of its group.
pub const LEAST_RANGE: f64 = 0.05;

/// The map of each channel, fitted to the training data alone.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Scaling {
    minimum: Vec<f64>,
    gain: Vec<f64>,
}

impl Scaling {
    /// Fits the scaling of `channels` channels: the smallest and largest values among `rows` become −1 and 1.
    #[must_use]
    pub fn fit<'a>(channels: usize, rows: impl IntoIterator<Item = &'a [f64]>) -> Self {
        let mut range = vec![(f64::INFINITY, f64::NEG_INFINITY); channels];
        for row in rows {
            for ((low, high), value) in range.iter_mut().zip(row) {
                *low = low.min(*value);
                *high = high.max(*value);
            }
        }
        let gain = |&(low, high): &(f64, f64)| {
            let gain = 2.0 / (high - low);
            if gain.is_normal() && gain > 0.0 { gain } else { 1.0 }
        };
        let minimum = |&(low, _): &(f64, f64)| if low.is_finite() { low } else { 0.0 };
        Self { gain: range.iter().map(gain).collect(), minimum: range.iter().map(minimum).collect() }
    }

    /// This scaling with the range of each channel raised to its least range, in its own unit; an empty `least_ranges` changes nothing.
    ///
    /// It serves channels with a common unit: the least range is [`LEAST_RANGE`] of the widest of them. Otherwise the rounding errors of a constant channel
    /// would fill the whole of \[-1, 1\].
    #[must_use]
    pub fn with_least_ranges(mut self, least_ranges: &[f64]) -> Self {
        for (gain, least) in self.gain.iter_mut().zip(least_ranges) {
            let most = 2.0 / least;
            if most.is_normal() && most > 0.0 {
                *gain = gain.min(most);
            }
        }
        self
    }

    /// The scaling of `channels` channels in which those of this one have the indices `places`; the others keep their unit.
    #[must_use]
    pub(crate) fn widened(&self, channels: usize, places: &[usize]) -> Self {
        let mut wide = Self { minimum: vec![0.0; channels], gain: vec![1.0; channels] };
        for ((place, minimum), gain) in places.iter().zip(&self.minimum).zip(&self.gain) {
            (wide.minimum[*place], wide.gain[*place]) = (*minimum, *gain);
        }
        wide
    }

    /// Number of channels.
    #[must_use]
    pub fn channels(&self) -> usize {
        self.gain.len()
    }

    /// Returns true if the map works in both directions: as many minima as gains, all finite, gains positive.
    #[must_use]
    pub fn is_usable(&self) -> bool {
        self.minimum.len() == self.gain.len()
            && self.minimum.iter().all(|m| m.is_finite())
            && self.gain.iter().all(|g| g.is_finite() && *g > 0.0)
    }

    /// Scales one row in place.
    pub fn apply(&self, row: &mut [f64]) {
        for ((value, minimum), gain) in row.iter_mut().zip(&self.minimum).zip(&self.gain) {
            *value = (*value - minimum) * gain - 1.0;
        }
    }

    /// Converts one row back to its own units, in place.
    pub fn reverse(&self, row: &mut [f64]) {
        for ((value, minimum), gain) in row.iter_mut().zip(&self.minimum).zip(&self.gain) {
            *value = (*value + 1.0) / gain + minimum;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The second channel moves by a rounding error, the third by a tenth of the first, the fourth not at all; the fifth has its own unit.
    #[test]
    fn what_hardly_moves_is_not_blown_up() {
        let rows: [&[f64]; 2] = [&[0.0, 1.0, 0.0, 3.0, 0.0], &[2.0, 1.0 + 4e-16, 0.2, 3.0, 1e-6]];
        let plain = Scaling::fit(5, rows);
        let grouped = plain.clone().with_least_ranges(&[0.1, 0.1, 0.1, 0.1, 0.0]);
        let moved = |scaling: &Scaling, channel: usize| {
            let [mut low, mut high] = rows.map(<[f64]>::to_vec);
            scaling.apply(&mut low);
            scaling.apply(&mut high);
            high[channel] - low[channel]
        };
        assert!((moved(&plain, 1) - 2.0).abs() < 1e-12 && moved(&grouped, 1) < 1e-13);
        for channel in [0, 2, 4] {
            assert!((moved(&grouped, channel) - 2.0).abs() < 1e-12, "{channel}");
        }
        assert!(moved(&grouped, 3).abs() < 1e-15 && grouped.is_usable());
    }

    #[test]
    fn the_training_range_becomes_minus_one_to_one_and_comes_back() {
        let rows: [&[f64]; 3] = [&[0.2, -5.0, 1.0e-3], &[0.6, 10.0, 3.0e-3], &[0.3, 0.0, 2.0e-3]];
        let scaling = Scaling::fit(3, rows);
        let scaled = |row: &[f64]| {
            let mut row = row.to_vec();
            scaling.apply(&mut row);
            row
        };
        assert_eq!(scaled(rows[0]), [-1.0, -1.0, -1.0]);
        let top = scaled(rows[1]);
        let mut worst = top.iter().fold(0.0_f64, |m, s| m.max((s - 1.0).abs()));
        let mut middle = scaled(rows[2]);
        worst = worst.max((middle[2] - 0.0).abs()).max((middle[0] + 0.5).abs());
        scaling.reverse(&mut middle);
        worst = middle.iter().zip(rows[2]).fold(worst, |m, (a, b)| m.max((a - b).abs()));
        eprintln!("largest difference {worst:.1e}");
        assert!(worst < 1.0e-14);
    }

    #[test]
    fn constant_and_degenerate_channels_keep_their_unit() {
        let rows: [&[f64]; 2] = [&[4.0, -f64::MAX, 0.0], &[4.0, f64::MAX, 5.0e-324]];
        let scaling = Scaling::fit(3, rows);
        assert!(scaling.is_usable());
        let mut row = [4.0, -f64::MAX, 0.0];
        scaling.apply(&mut row);
        assert_eq!(row, [-1.0, -1.0, -1.0]);
        let mut other = [4.5, 0.0, 0.0];
        scaling.apply(&mut other);
        assert_eq!(other[0], -0.5);
        scaling.reverse(&mut other);
        assert_eq!(other[0], 4.5);
        assert!(Scaling::fit(2, []).is_usable(), "no rows at all");
    }
}
