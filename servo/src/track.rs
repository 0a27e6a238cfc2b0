//! A recording of commanded and measured positions, and its windows for rollouts.

use std::ops::Range;

use crate::command::Commands;
use crate::joint_load::Load;
use crate::rollout::{Course, Rollout, State};
use crate::servo_arm::ServoArm;

/// Rows at the beginning of a window that determine its initial state.
const START_ROWS: usize = 5;
/// Rows on each side for velocities, accelerations and increments.
pub(crate) const REACH: usize = 2;

/// A recording of commanded and measured positions.
#[derive(Clone, Debug)]
pub struct Track {
    /// Stamps, s, increasing.
    pub stamps: Vec<f64>,
    /// Measured position, `[joint][row]`, rad (m); NaN where it is missing.
    pub measured: Vec<Vec<f64>>,
    /// Commands, one per joint.
    pub commands: Vec<Commands>,
    /// The load of its only joint in each row ([`Track::by_joint`]); empty if the arm computes the loads.
    pub loads: Vec<Load>,
}

impl Track {
    /// Rows without a gap longer than `gap` s in the stamps, in pieces of at most `longest` s.
    pub fn windows(&self, gap: f64, longest: f64) -> Vec<Range<usize>> {
        let mut windows = Vec::new();
        let mut begin = 0;
        for end in 1..=self.stamps.len() {
            let is_end = end == self.stamps.len()
                || self.stamps[end] - self.stamps[end - 1] > gap
                || self.stamps[end] - self.stamps[begin] >= longest;
            if is_end {
                windows.push(begin..end);
                begin = end;
            }
        }
        windows.retain(|window| window.len() > START_ROWS);
        windows
    }

    /// Position and velocity of all joints at the beginning of `rows`: a straight line through the first rows of each. For a joint without
    /// a measurement, its command.
    pub fn start(&self, rows: &Range<usize>) -> State {
        let first = rows.start..rows.end.min(rows.start + START_ROWS);
        let line = |joint: usize| {
            let points: Vec<(f64, f64)> = first
                .clone()
                .map(|row| (self.stamps[row] - self.stamps[rows.start], self.measured[joint][row]))
                .filter(|(_, q)| q.is_finite())
                .collect();
            line_through(&points).unwrap_or((self.commands[joint].held(self.stamps[rows.start]), 0.0))
        };
        let (q, v) = (0..self.measured.len()).map(line).unzip();
        State { q, v }
    }

    /// Measured minus simulated position of `model` on `rows`, `[row][joint]`; NaN without a measurement, infinite where the simulation
    /// diverged.
    pub fn residual(&self, model: &ServoArm, rollout: &mut Rollout, rows: &Range<usize>) -> Vec<f64> {
        let mut out = self.simulated(model, rollout, rows);
        let joints = self.measured.len();
        for (offset, row) in rows.clone().enumerate() {
            for joint in 0..joints {
                let at = offset * joints + joint;
                let (measured, simulated) = (self.measured[joint][row], out[at]);
                let is_lost = measured.is_finite() && !simulated.is_finite();
                out[at] = if is_lost { f64::INFINITY } else { measured - simulated };
            }
        }
        out
    }

    /// True where the position of `model` on `rows`, `[row][joint]`, does not depend on the initial state: simulations from two initial
    /// states, the estimated one and rest at the first measured position, agree within `noise` (rad (m), one number per joint). Rows where
    /// they disagree carry information on the initial state, not on the servo.
    pub fn forgets(
        &self,
        model: &ServoArm,
        rollout: &mut Rollout,
        rows: &Range<usize>,
        noise: &[f64],
    ) -> Vec<bool> {
        let estimated = self.start(rows);
        let first = |joint: usize| {
            let q = self.measured[joint][rows.start];
            if q.is_finite() { q } else { estimated.q[joint] }
        };
        let at_rest = State { q: (0..noise.len()).map(first).collect(), v: vec![0.0; noise.len()] };
        let [one, other] = [&estimated, &at_rest].map(|start| self.begun(model, rollout, rows, start));
        let differ = one.iter().zip(&other).enumerate();
        differ.map(|(at, (a, b))| (a - b).abs() <= noise[at % noise.len()]).collect()
    }

    /// Position of `model` simulated along the commands on `rows`, `[row][joint]`, rad (m).
    pub fn simulated(&self, model: &ServoArm, rollout: &mut Rollout, rows: &Range<usize>) -> Vec<f64> {
        self.begun(model, rollout, rows, &self.start(rows))
    }

    fn begun(&self, model: &ServoArm, rollout: &mut Rollout, rows: &Range<usize>, start: &State) -> Vec<f64> {
        let mut out = vec![0.0; rows.len() * self.measured.len()];
        let loads = if self.loads.is_empty() { &[] } else { &self.loads[rows.clone()] };
        let course = Course { commands: &self.commands, stamps: &self.stamps[rows.clone()], loads };
        rollout.run(model, course, start, &mut out);
        out
    }
}

/// Value at zero and slope of the least-squares line through `points`; `None` without a point.
fn line_through(points: &[(f64, f64)]) -> Option<(f64, f64)> {
    let n = points.len() as f64;
    let (t, q) = points.iter().fold((0.0, 0.0), |sum, point| (sum.0 + point.0 / n, sum.1 + point.1 / n));
    let spread: f64 = points.iter().map(|point| (point.0 - t).powi(2)).sum();
    let slope = points.iter().map(|point| (point.0 - t) * (point.1 - q)).sum::<f64>();
    let slope = if spread > 0.0 { slope / spread } else { 0.0 };
    (!points.is_empty()).then_some((q - slope * t, slope))
}
