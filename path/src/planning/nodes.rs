//! The nodes of the table: their times, and the limits for their values.

use freeplay_arm::Arm;

use crate::planning::error::PathError;
use crate::planning::file::MOST_VALUES;
use crate::planning::laps::Laps;
use crate::planning::table::JointPath;

/// Nodes per tick.
const NODES_OF_TICK: f64 = 4.0;
/// A lap has at least this many intervals, for any tick, so that the interpolation is exact to rounding…
const FEWEST_INTERVALS: f64 = 1000.0;
/// …and a lap of a minute or longer at 1 kHz has at most about this many, to bound the table.
const MANY_INTERVALS: f64 = 240_000.0;
/// Tolerance of a limit, in its unit.
const LIMIT_TOLERANCE: f64 = 1e-9;
/// If the postures at both ends of a lap differ by less, the lap repeats exactly, rad or m.
const CLOSED: f64 = 1e-9;

/// The spacing of the nodes.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Grid {
    /// Largest distance, s.
    distance: f64,
    /// Fewest intervals of a smooth piece.
    fewest: f64,
}

impl Grid {
    /// The spacing for a lap of `lap` s, with ticks of `rate` Hz and at least `fewest` intervals in each smooth piece.
    pub fn new(rate: f64, lap: f64, fewest: f64) -> Grid {
        let quarter_tick = 1.0 / (NODES_OF_TICK * rate);
        Grid { distance: quarter_tick.max(lap / MANY_INTERVALS).min(lap / FEWEST_INTERVALS), fewest }
    }

    /// The times of a smooth piece: both ends, and evenly between them. Empty for a piece without extent.
    pub fn times(&self, from: f64, to: f64) -> impl Iterator<Item = f64> + use<> {
        let intervals = ((to - from) / self.distance - 1e-9).ceil().max(self.fewest);
        let last = intervals as usize;
        let count = if to > from { last + 1 } else { 0 };
        (0..count).map(move |k| if k == last { to } else { from + (to - from) * (k as f64 / intervals) })
    }
}

/// The nodes so far; each new node is checked against the arm's limits.
pub(crate) struct Nodes<'a> {
    arm: &'a Arm,
    times: Vec<f64>,
    values: Vec<f64>,
}

impl<'a> Nodes<'a> {
    pub fn new(arm: &'a Arm) -> Nodes<'a> {
        Nodes { arm, times: Vec::new(), values: Vec::new() }
    }

    /// Adds the joints' position, velocity and acceleration at `time`.
    pub fn push(&mut self, time: f64, q: &[f64], v: &[f64], a: &[f64]) -> Result<(), PathError> {
        let width = 3 * self.arm.dof() + 1;
        if (self.times.len() + 1) * width > MOST_VALUES {
            return Err(PathError::TooLong { most: MOST_VALUES / width });
        }
        for index in 0..self.arm.dof() {
            self.check(time, index, q[index], v[index], a[index])?;
        }
        self.times.push(time);
        for part in [q, v, a] {
            self.values.extend_from_slice(part);
        }
        Ok(())
    }

    /// Joints of the arm.
    pub fn dof(&self) -> usize {
        self.arm.dof()
    }

    /// True if the last posture equals the first.
    pub fn closed(&self) -> bool {
        let dof = self.arm.dof();
        let last = self.values.len() - 3 * dof;
        (0..dof).all(|j| (self.values[last + j] - self.values[j]).abs() < CLOSED)
    }

    /// The path through the nodes of one lap.
    pub fn into_path(self, rate: f64, laps: Laps) -> JointPath {
        JointPath::new(self.arm.dof(), rate, laps, self.times, self.values)
    }

    fn check(&self, time: f64, index: usize, q: f64, v: f64, a: f64) -> Result<(), PathError> {
        let (joint, limits) = (&self.arm.joints()[index], &self.arm.joints()[index].limits);
        if ![time, q, v, a].iter().all(|x| x.is_finite()) {
            return Err(PathError::NotFinite { joint: joint.name.clone(), time });
        }
        if q < limits.lower - LIMIT_TOLERANCE || q > limits.upper + LIMIT_TOLERANCE {
            let limit = if q < limits.lower { limits.lower } else { limits.upper };
            return Err(PathError::JointLimit { joint: joint.name.clone(), index, time, value: q, limit });
        }
        if v.abs() > limits.velocity + LIMIT_TOLERANCE {
            let limit = limits.velocity;
            return Err(PathError::SpeedLimit { joint: joint.name.clone(), index, time, value: v, limit });
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::Grid;

    #[test]
    fn nodes_lie_on_both_ends_and_on_quarters_of_the_tick() {
        let grid = Grid::new(1000.0, 6.0, 8.0);
        let times: Vec<f64> = grid.times(0.0, 6.0).collect();
        assert_eq!((times.len(), times[0], times[24_000]), (24_001, 0.0, 6.0));
        assert!((times[4] - 0.001).abs() < 1e-15);
        assert_eq!(grid.times(1.0, 1.0 + 1e-6).count(), 9, "a short piece has its fewest intervals");
        assert_eq!(grid.times(1.0, 1.0).count(), 0);
    }

    #[test]
    fn the_table_is_bounded_for_long_laps_and_fine_for_slow_ticks() {
        assert_eq!(Grid::new(1000.0, 86_400.0, 1.0).times(0.0, 86_400.0).count(), 240_001);
        assert_eq!(Grid::new(1.0, 6.0, 1.0).times(0.0, 6.0).count(), 1001);
    }
}
