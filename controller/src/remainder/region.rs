//! Region of validity of a learned remainder: the distance of a motion from the training motions, and the share of the output that held-out
//! motions at that distance confirmed.

use freeplay_predictor::scaling::LEAST_RANGE;
use serde::{Deserialize, Serialize};

use crate::remainder::InputGroup;

/// The trained region; see the module.
///
/// The region includes position and velocity even if the network does not use them, because the network is not valid on a path elsewhere. An
/// input x is scaled channel by channel, s = x · gain. The distance of x is that from the nearest of the `centres` (Euclidean, scaled), a
/// selection of the training inputs. The trust at that distance is interpolated in `trust`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Region {
    /// Inputs of the region: first those of the network, then position and velocity ([`Region::inputs_for`]).
    pub inputs: Vec<InputGroup>,
    /// Gain of each channel: 2 over its training range.
    pub gain: Vec<f64>,
    /// Training inputs, scaled; one row each.
    pub centres: Vec<Vec<f64>>,
    /// Pairs of distance, rising, and confirmed share of the network's output, falling, 0 to 1. Beyond the last distance the share is 0.
    pub trust: Vec<[f64; 2]>,
}

impl Region {
    /// Inputs of the region for a network with the inputs `network`: these, position and velocity.
    pub fn inputs_for(network: &[InputGroup]) -> Vec<InputGroup> {
        let more =
            [InputGroup::Position, InputGroup::Velocity].into_iter().filter(|group| !network.contains(group));
        network.iter().copied().chain(more).collect()
    }

    /// Creates the region around `rows`, the training `inputs` of an arm with `joints` joints, with at most `most` centres and without trust.
    /// The centres are selected one after the other; each is the input farthest from those already selected (Gonzalez 1985: within twice the
    /// least radius for that number of centres).
    ///
    /// A channel is scaled by half its training range, but its range is at least [`LEAST_RANGE`] of the widest of its group. Otherwise a
    /// channel that never moved in training would have an infinite distance for a rounding error.
    pub fn around(rows: &[Vec<f64>], inputs: &[InputGroup], joints: usize, most: usize) -> Region {
        let width = rows.first().map_or(0, Vec::len);
        let range = |channel: usize| {
            let values = rows.iter().map(|row| row[channel]);
            let (low, high) =
                values.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), x| (l.min(x), h.max(x)));
            (high - low).max(0.0)
        };
        let ranges: Vec<f64> = (0..width).map(range).collect();
        let mut gain = Vec::with_capacity(width);
        for group in inputs {
            let of_group = &ranges[gain.len()..gain.len() + group.width(joints)];
            let widest = of_group.iter().copied().fold(0.0, f64::max);
            gain.extend(of_group.iter().map(|range| {
                let range = range.max(LEAST_RANGE * widest);
                if range > 0.0 { 2.0 / range } else { 1.0 }
            }));
        }
        let scaled: Vec<Vec<f64>> =
            rows.iter().map(|row| row.iter().zip(&gain).map(|(x, gain)| x * gain).collect()).collect();
        Region { inputs: inputs.to_vec(), gain, centres: spread(&scaled, most), trust: Vec::new() }
    }

    /// The distance of `row` from the training inputs; not finite if `row` is not.
    pub fn distance(&self, row: &[f64]) -> f64 {
        let square = |centre: &Vec<f64>| -> f64 {
            row.iter().zip(&self.gain).zip(centre).map(|((x, gain), c)| (x * gain - c).powi(2)).sum()
        };
        self.centres.iter().map(square).fold(f64::INFINITY, f64::min).sqrt()
    }

    /// Trust in the network at `row`, 0 to 1.
    pub fn trust(&self, row: &[f64]) -> f64 {
        self.trust_at(self.distance(row))
    }

    /// Trust at the distance `distance`.
    pub fn trust_at(&self, distance: f64) -> f64 {
        let Some(after) = self.trust.iter().position(|[at, _]| *at >= distance) else { return 0.0 };
        let [to, share] = self.trust[after];
        let Some([from, before]) = after.checked_sub(1).map(|before| self.trust[before]) else {
            return share;
        };
        let way = if to > from { (distance - from) / (to - from) } else { 1.0 };
        before + (share - before) * way
    }

    /// Returns true if the numbers are consistent.
    pub fn is_usable(&self) -> bool {
        let width = self.gain.len();
        let finite = |values: &[f64]| values.iter().all(|value| value.is_finite());
        let rises = self.trust.windows(2).all(|pair| pair[0][0] <= pair[1][0] && pair[0][1] >= pair[1][1]);
        let shares = self.trust.iter().all(|[at, share]| *at >= 0.0 && (0.0..=1.0).contains(share));
        finite(&self.gain)
            && self.gain.iter().all(|gain| *gain > 0.0)
            && self.centres.iter().all(|centre| centre.len() == width && finite(centre))
            && rises
            && shares
    }
}

/// Number of centres whose distances are computed in parallel.
const LANES: usize = 8;

/// The distance from the nearest centre of a region, for use within a tick: numbers in the order of their use, nothing allocated.
#[derive(Clone, Debug)]
pub(crate) struct NearestCentre {
    gain: Vec<f64>,
    scaled: Vec<f64>,
    /// Blocks of [`LANES`] centres, each stored channel by channel; copies of its first centre fill the last block.
    blocks: Vec<[f64; LANES]>,
}

impl NearestCentre {
    /// Stores the centres of `region`.
    pub fn new(region: &Region) -> Self {
        let width = region.gain.len();
        let of_block = |centres: &[Vec<f64>]| -> Vec<[f64; LANES]> {
            let lane = |lane: usize| centres.get(lane).unwrap_or(&centres[0]);
            (0..width).map(|channel| std::array::from_fn(|number| lane(number)[channel])).collect()
        };
        let blocks = region.centres.chunks(LANES).flat_map(of_block).collect();
        Self { gain: region.gain.clone(), scaled: vec![0.0; width], blocks }
    }

    /// Same result as [`Region::distance`].
    pub fn distance(&mut self, row: &[f64]) -> f64 {
        self.scaled.iter_mut().zip(row).zip(&self.gain).for_each(|((scaled, x), gain)| *scaled = x * gain);
        let mut least = [f64::INFINITY; LANES];
        for block in self.blocks.chunks_exact(self.scaled.len().max(1)) {
            let mut squares = [0.0; LANES];
            for (x, centres) in self.scaled.iter().zip(block) {
                for (square, centre) in squares.iter_mut().zip(centres) {
                    *square += (x - centre) * (x - centre);
                }
            }
            // A comparison with NaN is false, so that a NaN never becomes the least distance.
            for (least, square) in least.iter_mut().zip(squares) {
                *least = if square < *least { square } else { *least };
            }
        }
        least.iter().copied().fold(f64::INFINITY, f64::min).sqrt()
    }
}

/// Selects at most `most` of `rows`, starting from the first; each next one is the farthest from those already selected.
fn spread(rows: &[Vec<f64>], most: usize) -> Vec<Vec<f64>> {
    let square = |a: &[f64], b: &[f64]| -> f64 { a.iter().zip(b).map(|(a, b)| (a - b) * (a - b)).sum() };
    let Some(first) = rows.first() else { return Vec::new() };
    let mut taken = vec![first.clone()];
    let mut nearest: Vec<f64> = rows.iter().map(|row| square(row, first)).collect();
    while taken.len() < most {
        let farthest = (0..rows.len()).max_by(|&a, &b| nearest[a].total_cmp(&nearest[b]));
        let Some(farthest) = farthest.filter(|&row| nearest[row] > 0.0) else { break };
        let row = rows[farthest].clone();
        nearest.iter_mut().zip(rows).for_each(|(nearest, other)| *nearest = nearest.min(square(&row, other)));
        taken.push(row);
    }
    taken
}

#[cfg(test)]
mod tests {
    use super::{NearestCentre, Region};
    use crate::remainder::InputGroup;

    /// The test uses several numbers of centres, also ones that do not fill a block.
    #[test]
    fn the_distance_inside_the_tick_is_that_of_the_region() {
        for count in [1, 7, 8, 48, 51] {
            let row = |k: usize| (0..5).map(|c| ((k * 7 + c * 3) as f64 * 0.37).sin()).collect::<Vec<f64>>();
            let rows: Vec<Vec<f64>> = (0..count).map(row).collect();
            let inputs = [InputGroup::Position, InputGroup::Velocity, InputGroup::Elapsed];
            let region = Region::around(&rows, &inputs, 2, count);
            let mut nearest = NearestCentre::new(&region);
            for k in 100..160 {
                let (fast, plain) = (nearest.distance(&row(k)), region.distance(&row(k)));
                assert!(plain > 0.0 && (fast - plain).abs() < 1e-12, "{fast} {plain}");
            }
            assert!(!nearest.distance(&[f64::NAN; 5]).is_finite());
        }
        let nowhere = Region {
            inputs: vec![InputGroup::Elapsed],
            gain: vec![1.0],
            centres: Vec::new(),
            trust: Vec::new(),
        };
        assert!(!NearestCentre::new(&nowhere).distance(&[0.0]).is_finite());
    }

    fn line() -> Region {
        let rows: Vec<Vec<f64>> = (0..=100).map(|k| vec![f64::from(k) * 0.02, 3.0]).collect();
        Region {
            trust: vec![[0.1, 0.9], [0.5, 0.4], [1.0, 0.0]],
            ..Region::around(&rows, &[InputGroup::Position], 2, 64)
        }
    }

    /// One channel moved by 2, so that its unit is 1; the other never moved, and its range is 5 % of that.
    #[test]
    fn distance_is_measured_in_trained_ranges_and_trust_falls_with_it() {
        let region = line();
        assert!(region.centres.len() == 64 && region.is_usable());
        assert!(region.distance(&[1.0, 3.0]) < 0.021);
        assert!((region.distance(&[2.5, 3.0]) - 0.5).abs() < 1e-9);
        assert!((region.distance(&[0.0, 3.01]) - 0.2).abs() < 1e-9, "{}", region.distance(&[0.0, 3.01]));
        let trust: Vec<f64> =
            [2.0, 2.1, 2.3, 2.5, 2.75, 3.0, 3.01, 1e9].iter().map(|x| region.trust(&[*x, 3.0])).collect();
        let expected = [0.9, 0.9, 0.65, 0.4, 0.2, 0.0, 0.0, 0.0];
        assert!(trust.iter().zip(expected).all(|(t, e)| (t - e).abs() < 1e-9), "{trust:?}");
        assert!(region.trust(&[f64::NAN, 3.0]) <= 0.0, "no number is nowhere");
    }

    #[test]
    fn a_region_looks_at_position_and_velocity_whatever_the_network_looks_at() {
        let [position, velocity] = [InputGroup::Position, InputGroup::Velocity];
        assert_eq!(Region::inputs_for(&[InputGroup::Load]), [InputGroup::Load, position, velocity]);
        assert_eq!(Region::inputs_for(&[velocity]), [velocity, position]);
        assert_eq!(Region::inputs_for(&[position, velocity]), [position, velocity]);
    }

    #[test]
    fn numbers_that_do_not_fit_are_seen() {
        assert!(!Region { centres: vec![vec![0.0; 3]], ..line() }.is_usable());
        assert!(!Region { trust: vec![[0.5, 0.4], [0.1, 0.2]], ..line() }.is_usable());
        assert!(!Region { trust: vec![[0.1, 0.2], [0.5, 0.4]], ..line() }.is_usable());
        assert!(!Region { gain: vec![1.0, f64::NAN], ..line() }.is_usable());
    }
}
