//! The motion of an arm as points in time.

use std::ops::Range;

/// A motion of all joints over time, from the motor-side encoders.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Trajectory {
    /// Time, s; evenly spaced within a stretch.
    pub t: Vec<f64>,
    /// Position, `[joint][point]`, rad (m).
    pub q: Vec<Vec<f64>>,
    /// Velocity, `[joint][point]`, rad/s (m/s).
    pub v: Vec<Vec<f64>>,
    /// Acceleration, `[joint][point]`, rad/s² (m/s²).
    pub a: Vec<Vec<f64>>,
    /// Stretches without gaps, as ranges of points. A law with state variables restarts in each.
    pub stretches: Vec<Range<usize>>,
}

impl Trajectory {
    /// Number of points.
    pub fn len(&self) -> usize {
        self.t.len()
    }

    /// True if there are no points.
    pub fn is_empty(&self) -> bool {
        self.t.is_empty()
    }

    /// Time between two points of `stretch`, s.
    pub fn step(&self, stretch: &Range<usize>) -> f64 {
        let points = stretch.len().saturating_sub(1).max(1);
        (self.t[stretch.end - 1] - self.t[stretch.start]) / points as f64
    }

    /// For each point, the share of the time up to halfway to its neighbours in which something acts that acts from `start` to `end`, s. A low-pass sees no
    /// difference between a part of a sample and an instant between two samples.
    #[must_use]
    pub fn acting(&self, start: f64, end: f64) -> Vec<f64> {
        let mut shares = vec![0.0; self.len()];
        for stretch in &self.stretches {
            let step = self.step(stretch).max(f64::MIN_POSITIVE);
            for point in stretch.clone() {
                let within = end.min(self.t[point] + 0.5 * step) - start.max(self.t[point] - 0.5 * step);
                shares[point] = (within / step).clamp(0.0, 1.0);
            }
        }
        shares
    }

    /// The same motion with `shift`, `[joint][point]`, added to the positions; velocities and accelerations by central differences within
    /// each stretch.
    #[must_use]
    pub fn shifted(&self, shift: &[Vec<f64>]) -> Trajectory {
        let mut shifted = self.clone();
        for (joint, shift) in shift.iter().enumerate().filter(|(_, shift)| shift.iter().any(|&x| x != 0.0)) {
            shifted.q[joint].iter_mut().zip(shift).for_each(|(q, shift)| *q += shift);
            for stretch in self.stretches.iter().filter(|stretch| stretch.len() > 2) {
                let step = self.step(stretch);
                for point in stretch.clone() {
                    let middle = point.clamp(stretch.start + 1, stretch.end - 2);
                    let [before, at, after] = [shift[middle - 1], shift[middle], shift[middle + 1]];
                    shifted.v[joint][point] += (after - before) / (2.0 * step);
                    shifted.a[joint][point] += (after - 2.0 * at + before) / (step * step);
                }
            }
        }
        shifted
    }

    /// Writes position, velocity and acceleration of all joints at `point` into slices with one number per joint.
    pub fn at(&self, point: usize, q: &mut [f64], v: &mut [f64], a: &mut [f64]) {
        for joint in 0..self.q.len() {
            (q[joint], v[joint], a[joint]) =
                (self.q[joint][point], self.v[joint][point], self.a[joint][point]);
        }
    }
}
