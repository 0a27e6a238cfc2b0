//! The tool's deviation: true tool position minus that of the nominal arm at the desired joint positions.

use nalgebra::Vector3;
use serde::Serialize;

/// Statistics of one component of the deviation, mm.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Deviation {
    /// Root mean square.
    pub rms: f64,
    /// Greatest magnitude.
    pub max: f64,
    /// Mean.
    pub mean: f64,
    /// Standard deviation about the mean.
    pub std: f64,
    /// Root mean square after the start; NaN without samples after it.
    pub rms_after_start: f64,
    /// Greatest magnitude after the start; NaN without samples after it.
    pub max_after_start: f64,
}

#[derive(Clone, Copy, Debug, Default)]
struct Sums {
    count: u64,
    sum: f64,
    squares: f64,
    max: f64,
}

impl Sums {
    fn add(&mut self, value: f64) {
        self.count += 1;
        self.sum += value;
        self.squares += value * value;
        self.max = self.max.max(value.abs());
    }

    fn per(&self, value: f64) -> f64 {
        if self.count == 0 { 0.0 } else { value / self.count as f64 }
    }
}

/// Collects the deviation over a run: the norm and the three axes of the base frame.
#[derive(Clone, Copy, Debug)]
pub struct DeviationStatistics {
    start: f64,
    all: [Sums; 4],
    after: [Sums; 4],
}

impl DeviationStatistics {
    /// Until this time the drop of a centred journal dominates, which no controller can compensate, s.
    pub const START_DURATION: f64 = 0.5;

    /// Statistics whose "after the start" begins at `start` s.
    pub fn new(start: f64) -> Self {
        Self { start, all: [Sums::default(); 4], after: [Sums::default(); 4] }
    }

    /// Adds the deviation (m) at the time `t` (s).
    pub fn add(&mut self, t: f64, deviation: &Vector3<f64>) {
        let values = [deviation.norm(), deviation.x, deviation.y, deviation.z];
        for (component, value) in values.into_iter().enumerate() {
            self.all[component].add(value * 1e3);
            if t >= self.start {
                self.after[component].add(value * 1e3);
            }
        }
    }

    /// The norm, then x, y and z, in mm.
    pub fn components(&self) -> [Deviation; 4] {
        std::array::from_fn(|i| {
            let (all, after) = (&self.all[i], &self.after[i]);
            let mean = all.per(all.sum);
            let square = all.per(all.squares);
            Deviation {
                rms: square.sqrt(),
                max: all.max,
                mean,
                std: (square - mean * mean).max(0.0).sqrt(),
                rms_after_start: if after.count == 0 { f64::NAN } else { after.per(after.squares).sqrt() },
                max_after_start: if after.count == 0 { f64::NAN } else { after.max },
            }
        })
    }
}
