//! Bounds of a network's answers, confirmed by held-out paths: a share by distance from the training motions, and a share for each axis.
//!
//! For answers ŷ to truths y, the share with the least residual is Σ yŷ / Σ ŷ², the slope of the regression of the truth on the answer. The program computes it
//! for parts of the held-out samples by their distance ([`Region`]), falling with the distance, and then for each axis. The answer must make no held-out path
//! worse: Σ (y − s ŷ)² ≤ Σ y² holds up to s = 2 Σ yŷ / Σ ŷ² of that path, which limits the share of an axis.

use freeplay_controller::remainder::{Axis, InputGroup, Region};
use freeplay_predictor::Window;

use crate::data::Data;
use crate::held_out::{Answers, correlation, range, rms};

/// Number of centres of the region of training motions.
pub const CENTRE_COUNT: usize = 48;
/// Number of parts of the held-out samples by distance.
const PARTS: usize = 8;

/// One held-out sample.
struct Sample {
    fold: usize,
    distance: f64,
    truth: [f64; 3],
    predicted: [f64; 3],
}

/// Creates the region around the `inputs` at `windows`, without trust.
pub fn around(data: &Data, inputs: &[InputGroup], windows: &[Window]) -> Region {
    let rows: Vec<Vec<f64>> =
        windows.iter().map(|window| data.row(inputs, window.run, window.target)).collect();
    Region::around(&rows, inputs, data.joints(), CENTRE_COUNT)
}

/// Computes the trust by distance, and the axes, confirmed by the `held` paths, for a region with `inputs`; `stride` is that of their windows.
pub fn confirmed(
    data: &Data,
    inputs: &[InputGroup],
    held: &[&Answers],
    stride: usize,
) -> (Vec<[f64; 2]>, [Axis; 3]) {
    let mut samples = Vec::new();
    for one in held {
        let trained = data.windows(stride, 0, |run| data.folds[run] != one.fold);
        let region = around(data, inputs, &trained);
        samples.extend(one.windows.iter().zip(&one.predicted).map(|(window, predicted)| Sample {
            fold: one.fold,
            distance: region.distance(&data.row(inputs, window.run, window.target)),
            truth: data.residual(window.run, window.target).into(),
            predicted: (*predicted).into(),
        }));
    }
    samples.sort_by(|a, b| a.distance.total_cmp(&b.distance));
    let trust = trust(&samples);
    let region = Region { inputs: Vec::new(), gain: Vec::new(), centres: Vec::new(), trust: trust.clone() };
    let all = data.windows(stride, 0, |_| true);
    let (lowest, highest) = range(data, &all);
    let axes = [0, 1, 2].map(|axis| {
        let pairs: Vec<(usize, f64, f64)> = samples
            .iter()
            .map(|sample| {
                (sample.fold, sample.truth[axis], sample.predicted[axis] * region.trust_at(sample.distance))
            })
            .collect();
        let of_fold = |fold: usize| {
            let pairs = pairs.iter().filter(move |(of, ..)| *of == fold);
            slope(pairs.map(|(_, truth, predicted)| (*truth, *predicted)))
        };
        let all = slope(pairs.iter().map(|(_, truth, predicted)| (*truth, *predicted)));
        let share =
            (0..data.fold_count()).map(|fold| 2.0 * of_fold(fold)).fold(all, f64::min).clamp(0.0, 1.0);
        Axis {
            lowest: lowest[axis],
            highest: highest[axis],
            share,
            rms_um: 1e6 * rms(pairs.iter().map(|(_, truth, _)| *truth)),
            left_um: 1e6 * rms(pairs.iter().map(|(_, truth, predicted)| truth - share * predicted)),
            r: correlation(
                &pairs.iter().map(|(_, truth, predicted)| (*truth, *predicted)).collect::<Vec<_>>(),
            ),
        }
    });
    (trust, axes)
}

/// Σ yŷ / Σ ŷ² of pairs (y, ŷ); 0 if all answers are 0.
fn slope(pairs: impl Iterator<Item = (f64, f64)>) -> f64 {
    let (product, square) = pairs.fold((0.0, 0.0), |(product, square), (y, predicted)| {
        (product + y * predicted, square + predicted * predicted)
    });
    if square > 0.0 { product / square } else { 0.0 }
}

/// The trust of `samples`, which are sorted by their distance. The function cuts them into equal parts, computes the best non-increasing shares, and sets the
/// share to zero beyond the farthest sample.
///
/// If the share would rise, the function pools the parts (pool adjacent violators, Ayer et al. 1955), so that a part with small answers does not limit the
/// parts farther away.
fn trust(samples: &[Sample]) -> Vec<[f64; 2]> {
    let size = samples.len().div_ceil(PARTS).max(1);
    let mut pools: Vec<Pool> = Vec::with_capacity(PARTS);
    for part in samples.chunks(size) {
        let mut pool = Pool::of(part);
        while let Some(before) = pools.pop_if(|before| before.share() <= pool.share()) {
            pool = before.with(pool);
        }
        pools.push(pool);
    }
    let mut table: Vec<[f64; 2]> = Vec::with_capacity(PARTS + 1);
    for pool in &pools {
        table.extend(pool.middles.iter().map(|middle| [*middle, pool.share()]));
    }
    if let (Some(last), Some(farthest)) = (table.last().copied(), samples.last()) {
        // The end point lies as far beyond the farthest sample as that lies beyond the middle of its part.
        table.push([farthest.distance + (farthest.distance - last[0]), 0.0]);
    }
    table
}

/// Pool of parts with a common share.
struct Pool {
    /// Middle distances of the parts.
    middles: Vec<f64>,
    /// Σ yŷ and Σ ŷ².
    sums: [f64; 2],
}

impl Pool {
    fn of(part: &[Sample]) -> Pool {
        let pairs = part.iter().flat_map(|sample| sample.truth.into_iter().zip(sample.predicted));
        let sums = pairs.fold([0.0, 0.0], |[product, square], (y, predicted)| {
            [product + y * predicted, square + predicted * predicted]
        });
        Pool { middles: vec![part[part.len() / 2].distance], sums }
    }

    fn with(mut self, other: Pool) -> Pool {
        self.middles.extend(other.middles);
        Pool { sums: [self.sums[0] + other.sums[0], self.sums[1] + other.sums[1]], middles: self.middles }
    }

    /// The share with the least residual, limited to 0 to 1.
    fn share(&self) -> f64 {
        let [product, square] = self.sums;
        if square > 0.0 { (product / square).clamp(0.0, 1.0) } else { 0.0 }
    }
}

#[cfg(test)]
mod tests {
    use super::{Sample, slope, trust};

    /// Answers that are correct at small distances, half as much too large at medium ones and of the wrong sign at large ones.
    #[test]
    fn trust_falls_to_what_the_truth_confirms_at_each_distance() {
        let sample = |k: u32| {
            let (distance, truth) = (0.01 * f64::from(k), [f64::from(k % 7) - 3.0, 0.0, 1.0]);
            let factor = match k {
                0..200 => 1.0,
                200..400 => 2.0,
                _ => -1.0,
            };
            Sample { fold: 0, distance, truth, predicted: truth.map(|truth| truth * factor) }
        };
        let table = trust(&(0..600).map(sample).collect::<Vec<_>>());
        println!("{table:?}");
        assert!(table.windows(2).all(|pair| pair[1][0] > pair[0][0] && pair[1][1] <= pair[0][1]));
        assert!((table[0][1] - 1.0).abs() < 1e-12 && (table[4][1] - 0.5).abs() < 1e-12);
        assert!(table[8][1] <= 0.0 && table[7][1] <= 0.0);
    }

    /// At small distances the answers are tiny and wrong; farther away they are correct.
    #[test]
    fn a_part_that_says_little_does_not_hold_down_the_others() {
        let sample = |k: u32| {
            let truth = [f64::from(k % 7) - 3.0, 0.0, 1.0];
            let factor = if k < 75 { -0.01 } else { 1.0 };
            Sample {
                fold: 0,
                distance: 0.01 * f64::from(k),
                truth,
                predicted: truth.map(|truth| truth * factor),
            }
        };
        let table = trust(&(0..600).map(sample).collect::<Vec<_>>());
        println!("{table:?}");
        assert!(table[..8].iter().all(|[_, share]| *share > 0.99) && table[8][1] <= 0.0);
    }

    #[test]
    fn the_slope_is_what_leaves_least() {
        let of = |pairs: &[(f64, f64)]| slope(pairs.iter().copied());
        assert!((of(&[(1.0, 2.0), (2.0, 4.0)]) - 0.5).abs() < 1e-12);
        assert!((of(&[(2.0, 1.0)]) - 2.0).abs() < 1e-12);
        assert!((of(&[(-1.0, 1.0)]) + 1.0).abs() < 1e-12 && of(&[]).abs() < 1e-12);
    }
}
