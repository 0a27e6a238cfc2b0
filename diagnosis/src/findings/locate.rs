//! Location of the difference between model and machine: the channel, and the part of the motion.

use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

use crate::data::linearised::LinearisedRecording;
use crate::findings::variables::variables;
use crate::report::diagnosis::{Map, Variable};
use crate::sorting::rising_order;

/// Bins of a map over a variable: wide enough that each holds many rows of a short recording, narrow enough for the sign and the curvature of a law.
pub(crate) const BINS: usize = 12;
/// Circular shifts of the null distribution: with 199 the least p-value is 1/200 (Davison & Hinkley 1997, §4.2.5), a tenth of the threshold for a name.
const SHIFTS: usize = 199;

/// The maps of the residual `rows` of channel number `channel` of `recording`, with p-values not yet corrected.
pub(crate) fn maps(
    recording: &LinearisedRecording,
    channel: usize,
    rows: &[f64],
    kept: &[f64],
    seed: u64,
) -> Vec<Map> {
    let described = &recording.channels[channel];
    let mut rng = ChaCha8Rng::seed_from_u64(seed ^ channel as u64);
    let counted: Vec<usize> = (0..rows.len()).filter(|&k| kept[k] > 0.0).collect();
    let residual: Vec<f64> = counted.iter().map(|&k| rows[k]).collect();
    let all = variables(recording, described.kind).into_iter();
    let map = |variable: Variable| {
        let x: Vec<f64> = counted.iter().map(|&k| variable.values[k]).collect();
        let bins = Bins::new(&x)?;
        let explained = bins.explained(&residual, 0);
        let shifted: Vec<f64> = (0..SHIFTS)
            .map(|_| {
                // Neighbouring rows are similar: a shift by less than a tenth would be no null sample.
                let n = residual.len();
                let shift = n / 10 + rng.next_u64() as usize % (n - n / 5).max(1);
                bins.explained(&residual, shift)
            })
            .collect();
        Some(Map {
            channel: described.name.clone(),
            variable: variable.name,
            variable_unit: variable.unit,
            unit: described.unit,
            at: bins.at.clone(),
            mean: bins.means(&residual, 0),
            explained,
            p: chance(&shifted, explained),
        })
    };
    all.filter_map(map).collect()
}

/// Probability that a value like `shifted` is at least `explained`: the counted share, and beyond all of them the tail of a gamma distribution with their mean
/// and variance (Wilson & Hilferty 1931), at least 10⁻⁹.
fn chance(shifted: &[f64], explained: f64) -> f64 {
    let count = shifted.len() as f64;
    let stronger = shifted.iter().filter(|x| **x >= explained).count();
    if stronger > 0 {
        return (stronger + 1) as f64 / (count + 1.0);
    }
    let mean = shifted.iter().sum::<f64>() / count;
    let variance = shifted.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / count;
    if variance <= 0.0 || mean <= 0.0 {
        return 1.0 / (count + 1.0);
    }
    let shape = mean * mean / variance;
    let z = ((explained / mean).cbrt() - 1.0 + 1.0 / (9.0 * shape)) * 3.0 * shape.sqrt();
    // Bound of Mills (1926) on the tail of a normal.
    let tail = (-0.5 * z * z).exp() / (z.max(1.0) * std::f64::consts::TAU.sqrt());
    tail.clamp(1e-9, 1.0 / (count + 1.0))
}

/// Corrects the p-values of all maps for their number (Holm 1979).
pub(crate) fn correct(maps: &mut [Map]) {
    let p: Vec<f64> = maps.iter().map(|map| map.p).collect();
    let mut least = 0.0_f64;
    for (rank, index) in rising_order(&p).into_iter().enumerate() {
        least = least.max((maps[index].p * (maps.len() - rank) as f64).min(1.0));
        maps[index].p = least;
    }
}

/// Points sorted into bins of equal count.
struct Bins {
    of: Vec<usize>,
    counts: Vec<f64>,
    at: Vec<f64>,
}

impl Bins {
    /// Bins of `x`; `None` if it hardly varies or has too few values.
    fn new(x: &[f64]) -> Option<Self> {
        let order = rising_order(x);
        let (least, most) = (x[*order.first()?], x[*order.last()?]);
        if most - least <= 1e-12 || x.len() < 4 * BINS {
            return None;
        }
        let mut of = vec![0; x.len()];
        let (mut bin, mut filled, mut edges) = (0, 0, vec![0]);
        for (rank, &index) in order.iter().enumerate() {
            // Equal values share a bin.
            let fresh = rank > 0 && x[index] > x[order[rank - 1]];
            if fresh && filled * BINS >= x.len() {
                bin += 1;
                filled = 0;
                edges.push(rank);
            }
            filled += 1;
            of[index] = bin;
        }
        if bin == 0 {
            return None;
        }
        edges.push(x.len());
        let mut counts = vec![0.0; bin + 1];
        of.iter().for_each(|&bin| counts[bin] += 1.0);
        let at = edges.windows(2).map(|edge| x[order[(edge[0] + edge[1]) / 2]]).collect();
        Some(Self { of, counts, at })
    }

    /// Mean of `y`, shifted circularly by `shift`, in each bin.
    fn means(&self, y: &[f64], shift: usize) -> Vec<f64> {
        let mut sums = vec![0.0; self.counts.len()];
        for (k, &bin) in self.of.iter().enumerate() {
            sums[bin] += y[(k + shift) % y.len()];
        }
        sums.iter().zip(&self.counts).map(|(sum, count)| sum / count).collect()
    }

    /// Share of the variance of `y` that the means explain.
    fn explained(&self, y: &[f64], shift: usize) -> f64 {
        let mean = y.iter().sum::<f64>() / y.len() as f64;
        let variance: f64 = y.iter().map(|y| (y - mean).powi(2)).sum();
        let means = self.means(y, shift);
        let between: f64 = means.iter().zip(&self.counts).map(|(m, count)| count * (m - mean).powi(2)).sum();
        if variance > 0.0 { between / variance } else { 0.0 }
    }
}
