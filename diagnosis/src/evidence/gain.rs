//! The reduction of an error, with its interval.

use std::collections::BTreeMap;

use serde::Serialize;

use crate::data::stacked::Data;
use crate::sorting::sort_falling;
use crate::statistics::{blocks as blocks_of, bootstrap};

/// A gain with its interval: the removed share of the error, 1 − after/before.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Gain {
    /// The share.
    pub value: f64,
    /// Its 95 % interval.
    pub ci95: [f64; 2],
}

/// Errors of the same rows before and after a change of the model.
pub(crate) struct Compared<'c> {
    /// Errors before, by channel.
    pub before: &'c [Vec<f64>],
    /// Errors after.
    pub after: &'c [Vec<f64>],
    /// The weight of each row, by channel: zero for rows without weight.
    pub weights: &'c [Vec<f64>],
}

impl Compared<'_> {
    /// Weighted squares before and after, block by block.
    fn blocks(&self, data: &Data, channels: &[usize]) -> Vec<[f64; 2]> {
        let mut blocks = Vec::new();
        for &channel in channels {
            for (stretch, step) in data.stretches(channel) {
                for rows in blocks_of(stretch, step) {
                    let square = |errors: &[Vec<f64>]| -> f64 {
                        let weights = &self.weights[channel][rows.clone()];
                        errors[channel][rows.clone()].iter().zip(weights).map(|(x, w)| w * x * x).sum()
                    };
                    let sums = [square(self.before), square(self.after)];
                    if sums[0] > 0.0 || sums[1] > 0.0 {
                        blocks.push(sums);
                    }
                }
            }
        }
        blocks
    }

    /// 1 − |after|/|before| over `channels`, with the interval of a [`bootstrap`] of blocks; `None` if no row has weight.
    pub fn gain(&self, data: &Data, channels: &[usize], seed: u64) -> Option<Gain> {
        let blocks = self.blocks(data, channels);
        let share = |sums: [f64; 2]| if sums[0] > 0.0 { 1.0 - (sums[1] / sums[0]).sqrt() } else { 0.0 };
        let sum = |pick: &mut dyn Iterator<Item = usize>| {
            pick.fold([0.0, 0.0], |sum, k| [sum[0] + blocks[k][0], sum[1] + blocks[k][1]])
        };
        if blocks.is_empty() {
            return None;
        }
        let value = share(sum(&mut (0..blocks.len())));
        if blocks.len() < 2 {
            return Some(Gain { value, ci95: [f64::NEG_INFINITY, f64::INFINITY] });
        }
        Some(Gain { value, ci95: bootstrap(blocks.len(), seed, |picked| share(sum(picked))) })
    }

    /// Removed squares over `channels`, and the names of these channels, the largest reduction first.
    pub fn removed(&self, data: &Data, channels: &[usize]) -> (f64, Vec<String>) {
        let mut by_channel: BTreeMap<usize, f64> = BTreeMap::new();
        for &c in channels {
            let square = |errors: &[Vec<f64>]| -> f64 {
                errors[c].iter().zip(&self.weights[c]).map(|(x, w)| w * x * x).sum()
            };
            *by_channel.entry(c % data.channels_per_recording()).or_default() +=
                square(self.before) - square(self.after);
        }
        let sum = by_channel.values().sum();
        let mut order: Vec<(usize, f64)> = by_channel.into_iter().collect();
        sort_falling(&mut order, |(_, gain)| *gain);
        (sum, order.into_iter().map(|(c, _)| data.recordings[0].channels[c].name.clone()).collect())
    }
}
