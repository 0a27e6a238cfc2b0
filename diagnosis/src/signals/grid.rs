//! The uniform time grid of a recording.

use std::borrow::Cow;
use std::ops::Range;

use freeplay_recording::Recording;

use crate::error::{FEWEST, ResidualError};
use crate::signals::missing::bridged;
use crate::signals::stamps::corrected_stamps;
use crate::statistics::{FINEST, roughness, span};

/// A step this many times longer than the usual ones is a gap; nothing is interpolated across a gap. A bus that delivers in bursts makes shorter steps, and a
/// recorder that stops makes longer ones.
pub(crate) const GAP_STEPS: f64 = 10.0;
/// Greatest distance between stamps and a uniform grid, as a share of a step, at which the samples count as uniform: stamps written with few digits are as
/// near, and interpolation would add a larger error than it removes.
const EVEN: f64 = 0.02;
/// If neighbouring steps differ by more than this factor, interpolation is linear: slopes over such a short step are mostly noise.
const BURST: f64 = 4.0;
/// If the positions are smoother on even times by at least this factor, the samples were even and only the stamps jitter: chance makes a smaller difference.
const SMOOTHER: f64 = 0.8;

/// A part of a recording without a gap, on the uniform grid.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Stretch {
    /// The samples of the recording that belong to this part.
    pub rows: Range<usize>,
    /// Time of its first point, s.
    pub start: f64,
    /// Number of grid points.
    pub len: usize,
    /// True if the stamps lie on the grid: the samples are used unchanged.
    pub even: bool,
    /// The true times of the samples if they differ from the stamps, s.
    pub times: Option<Vec<f64>>,
    /// The grid points used in the comparison; the filters settle on the others.
    pub keep: Range<usize>,
}

/// A uniform time grid with the mean step of the recording, cut where the recording has gaps.
///
/// A gap is a step more than ten times as long as the 90th percentile of all steps; neither jitter nor bursts of stamps make such a step. Stamps within 2 % of
/// a step of the grid count as lying on the grid. Other samples are interpolated by a cubic through the neighbours, with the slopes of the parabola through
/// three of them (error of third order in the step), or linearly where stamps come in bursts. If the positions are smoother on even times, only the stamps
/// jittered, not the samples, and the grid uses even times.
#[derive(Debug, Clone, PartialEq)]
pub struct Grid {
    pub(crate) step: f64,
    pub(crate) stretches: Vec<Stretch>,
    /// A longer step between two stamps is a gap, s.
    pub(crate) longest: f64,
    /// Farthest stamp from the uniform grid, as a share of the step.
    pub(crate) jitter: f64,
    /// True if the samples were taken at more even times than their stamps.
    pub(crate) is_steadied: bool,
}

impl Grid {
    /// Makes the grid of a recording.
    ///
    /// # Errors
    /// [`ResidualError::Stamps`] for fewer than four samples or stamps beyond the range of numbers.
    pub fn new(recording: &Recording) -> Result<Self, ResidualError> {
        let stamped = Self::of(&recording.t).ok_or_else(|| no_grid(recording))?;
        if stamped.is_even() {
            return Ok(stamped);
        }
        let stretches = stamped.stretches.iter().map(|stretch| stretch.rows.clone());
        let steady = corrected_stamps(&recording.t, stretches).and_then(|t| {
            Some(Self { jitter: stamped.jitter, longest: stamped.longest, ..Self::of(&t)?.with_times(&t) })
        });
        Ok(steady.filter(|steady| steady.is_smoother_than(&stamped, recording)).unwrap_or(stamped))
    }

    /// The grid of samples at the times `t`; `None` for fewer than four samples, or numbers out of range.
    fn of(t: &[f64]) -> Option<Self> {
        if t.len() < FEWEST {
            return None;
        }
        let mut steps: Vec<f64> = t.windows(2).map(|w| w[1] - w[0]).collect();
        let place = steps.len() * 9 / 10;
        let longest = GAP_STEPS * *steps.select_nth_unstable_by(place, f64::total_cmp).1;
        let (count, sum) =
            steps.iter().filter(|step| **step <= longest).fold((0.0, 0.0), |(n, s), d| (n + 1.0, s + d));
        Self::laid(t, sum / count, longest)
    }

    /// The grid of `step` s through samples at the times `t`, cut at steps longer than `longest`; `None` for numbers out of range.
    pub(crate) fn laid(t: &[f64], step: f64, longest: f64) -> Option<Self> {
        if !(step > 0.0 && step.is_finite()) {
            return None;
        }
        let mut grid = Self { step, stretches: Vec::new(), longest, jitter: 0.0, is_steadied: false };
        let mut begin = 0;
        for run in t.chunk_by(|before, after| after - before <= longest) {
            grid.add(t, begin..begin + run.len());
            begin += run.len();
        }
        Some(grid)
    }

    fn with_times(mut self, t: &[f64]) -> Self {
        self.is_steadied = true;
        for stretch in self.stretches.iter_mut().filter(|stretch| !stretch.even) {
            stretch.times = Some(t[stretch.rows.clone()].to_vec());
        }
        self
    }

    /// Returns true if the stamps lie on the grid.
    pub(crate) fn is_even(&self) -> bool {
        self.jitter <= EVEN
    }

    /// Returns true if the positions of `recording` are clearly smoother on this grid than on `other`.
    fn is_smoother_than(&self, other: &Self, recording: &Recording) -> bool {
        let ratio = |q: &Vec<f64>| (self.roughness(recording, q) / other.roughness(recording, q)).ln();
        let sum: f64 = recording.q.iter().map(ratio).sum();
        sum < SMOOTHER.ln() * recording.joints() as f64
    }

    /// Roughness of `column` of `recording` on the grid.
    fn roughness(&self, recording: &Recording, column: &[f64]) -> f64 {
        let even = self.stretches.iter().flat_map(|s| self.resample(s, recording, column).into_owned());
        roughness(&even.collect::<Vec<_>>()) + FINEST * span(column).max(f64::MIN_POSITIVE)
    }

    fn add(&mut self, t: &[f64], rows: Range<usize>) {
        let stamps = &t[rows.clone()];
        let (start, end) = (stamps[0], stamps[stamps.len() - 1]);
        let off = |(k, stamp): (usize, &f64)| (stamp - start - k as f64 * self.step).abs() / self.step;
        let jitter = stamps.iter().enumerate().map(off).fold(0.0, f64::max);
        let even = jitter <= EVEN;
        let len = if even { stamps.len() } else { ((end - start) / self.step + EVEN) as usize + 1 };
        self.jitter = self.jitter.max(jitter);
        self.stretches.push(Stretch { rows, start, len, even, times: None, keep: 0..len });
    }

    /// Grid points per second, Hz.
    pub fn rate_hz(&self) -> f64 {
        1.0 / self.step
    }

    /// The samples of `column` on the grid points of `stretch`; missing samples are bridged.
    pub(crate) fn resample<'a>(
        &self,
        stretch: &Stretch,
        recording: &Recording,
        column: &'a [f64],
    ) -> Cow<'a, [f64]> {
        let t = stretch.times.as_deref().unwrap_or_else(|| &recording.t[stretch.rows.clone()]);
        let column = bridged(t, &column[stretch.rows.clone()]);
        if stretch.even {
            return column;
        }
        let mut below = 0;
        let point = |k: usize| {
            let time = stretch.start + k as f64 * self.step;
            while below + 2 < t.len() && t[below + 1] <= time {
                below += 1;
            }
            interpolate(t, &column, below, time)
        };
        Cow::Owned((0..stretch.len).map(point).collect())
    }
}

/// The error of a recording whose stamps make no grid.
pub(crate) fn no_grid(recording: &Recording) -> ResidualError {
    ResidualError::Stamps {
        origin: recording.origin.clone(),
        samples: recording.len(),
        duration_s: recording.duration(),
    }
}

/// The value of `y` at `time` between the samples `i` and `i + 1`: the cubic Hermite polynomial.
fn interpolate(t: &[f64], y: &[f64], i: usize, time: f64) -> f64 {
    let width = t[i + 1] - t[i];
    let u = ((time - t[i]) / width).clamp(0.0, 1.0);
    let chord = (y[i + 1] - y[i]) / width;
    let left = slope(t, y, i, width).unwrap_or(chord);
    let right = slope(t, y, i + 1, width).unwrap_or(chord);
    let bulge = u * (1.0 - u) * width;
    y[i] + u * width * chord + bulge * ((1.0 - u) * (left - chord) - u * (right - chord))
}

/// Slope at sample `i` of the parabola through it and its neighbours; `None` at the ends, and where one of its steps is far shorter than the other or than
/// `width`, since a short step would amplify the noise.
fn slope(t: &[f64], y: &[f64], i: usize, width: f64) -> Option<f64> {
    if i == 0 || i + 1 == t.len() {
        return None;
    }
    let (before, after) = (t[i] - t[i - 1], t[i + 1] - t[i]);
    if before.min(after) * BURST < width || before.min(after) * BURST < before.max(after) {
        return None;
    }
    let (rise, next) = ((y[i] - y[i - 1]) / before, (y[i + 1] - y[i]) / after);
    Some((after * rise + before * next) / (before + after))
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use freeplay_recording::Recording;

    use super::Grid;

    fn recording(t: Vec<f64>) -> Recording {
        let q = t.iter().map(|t| (2.0 * (t % 1e6)).sin()).collect();
        Recording::new(Path::new("made"), vec![("t".into(), t), ("q1".into(), q)]).expect("a recording")
    }

    /// Stamps with a repeating jitter of up to a third of a step.
    fn jittered(count: usize, step: f64) -> Vec<f64> {
        (0..count).map(|k| (k as f64 + 0.33 * (k as f64 * 2.4).sin()) * step).collect()
    }

    #[test]
    fn interpolation_converges_with_the_third_power_of_the_step() {
        let error = |count: usize| {
            let made = recording(jittered(count, 4.0 / count as f64));
            let grid = Grid::new(&made).expect("a grid");
            assert!(grid.jitter > 0.2, "the stamps are jittered: {}", grid.jitter);
            let [stretch] = grid.stretches.as_slice() else { panic!("one stretch") };
            let q = grid.resample(stretch, &made, &made.q[0]);
            let off = |k: usize| (q[k] - (2.0 * (stretch.start + k as f64 * grid.step)).sin()).abs();
            (2..q.len() - 2).map(off).fold(0.0, f64::max)
        };
        let (coarse, fine) = (error(200), error(400));
        println!("off by {coarse:.1e}, then {fine:.1e}: order {:.2}", (coarse / fine).log2());
        assert!((coarse / fine).log2() > 2.5 && coarse < 1e-4);
    }

    #[test]
    fn gaps_cut_and_do_not_stretch_the_grid() {
        let t: Vec<f64> = (0..900).map(|k| f64::from(k) * 0.01 + if k < 300 { 0.0 } else { 1e6 }).collect();
        let grid = Grid::new(&recording(t)).expect("a grid");
        assert!((grid.step - 0.01).abs() < 1e-9, "{}", grid.step);
        assert_eq!(grid.stretches.iter().map(|s| s.len).collect::<Vec<_>>(), [300, 600]);
    }

    #[test]
    fn bursts_of_stamps_stay_bounded() {
        let t: Vec<f64> = (0..1000).map(|k| f64::from(k / 5) * 0.01 + f64::from(k % 5) * 1e-9).collect();
        let made = recording(t);
        let grid = Grid::new(&made).expect("a grid");
        let points: usize = grid.stretches.iter().map(|s| s.len).sum();
        assert!(grid.stretches.len() == 1 && points <= 1001, "{points} points");
        let noisy: Vec<f64> = (0..1000).map(|k| f64::from(k * 7919 % 13) / 13.0).collect();
        let even = grid.resample(&grid.stretches[0], &made, &noisy);
        assert!(even.iter().all(|y| (0.0..=1.0).contains(y)), "no overshoot between noisy neighbours");
    }

    #[test]
    fn odd_stamps_are_an_error_or_a_grid_never_a_panic() {
        assert!(Grid::new(&recording(vec![0.0, 1.0, 2.0])).is_err());
        assert!(
            Grid::new(&recording(vec![-1e308, 0.0, 1e308, 1.7e308])).is_err(),
            "beyond the range of numbers"
        );
        for t in [
            vec![0.0, 1e-300, 2e-300, 1.0],
            vec![0.0, 1.0, 1e9, 1e18, 1e27],
            vec![1e15, 1e15 + 1.0, 1e15 + 2.0, 1e18],
        ] {
            let made = recording(t);
            if let Ok(grid) = Grid::new(&made) {
                for stretch in &grid.stretches {
                    assert!(stretch.len <= 2 * made.len() + 8, "{} points", stretch.len);
                    grid.resample(stretch, &made, &made.q[0]);
                }
            }
        }
    }
}
