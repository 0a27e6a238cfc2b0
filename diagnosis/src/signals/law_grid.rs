//! The grid on which the search evaluates lasting laws with jumps or a memory.
//!
//! A fast recording has many more samples than such a law needs, because the low-pass removes all that is far above its cutoff. This grid takes every n-th point
//! of the recording's grid, among them all points that the treatment keeps.

use std::ops::Range;

use freeplay_laws::{Change, Columns, Trajectory};

use crate::error::ResidualError;
use crate::signals::filter::LowPass;
use crate::signals::motion::{POINTS_PER_PERIOD, Treatment, laid};

/// The grid.
#[derive(Clone, Debug)]
pub(crate) struct LawGrid {
    filter: LowPass,
    /// The grid takes every n-th point of the recording's grid.
    pub every: usize,
    /// The numbers of these points.
    points: Vec<usize>,
    /// The stretches without gaps, as ranges of these points.
    stretches: Vec<Range<usize>>,
    /// Those of these points that the treatment keeps, by their numbers on this grid.
    kept: Vec<usize>,
}

impl Treatment {
    /// The coarsest grid that holds all kept points and resolves the fine cutoff as these resolve the cutoff.
    ///
    /// # Errors
    /// [`ResidualError::Cutoff`] if the low-pass does not fit the grid.
    pub(crate) fn law_grid(&self) -> Result<LawGrid, ResidualError> {
        let most = self.rate_hz() / (POINTS_PER_PERIOD * self.fine.cutoff_hz());
        let divides = |every: &usize| self.decimation.is_multiple_of(*every) && *every as f64 <= most;
        let every = (1..=self.decimation).rev().find(divides).unwrap_or(1);
        let (mut points, mut lengths, mut kept, mut begin) = (Vec::new(), Vec::new(), Vec::new(), 0);
        for stretch in &self.grid.stretches {
            let first = stretch.keep.start % every;
            let before = points.len();
            kept.extend(self.kept(stretch).map(|k| before + (k - first) / every));
            points.extend((first..stretch.len).step_by(every).map(|k| begin + k));
            lengths.push(points.len() - before);
            begin += stretch.len;
        }
        let filter = LowPass::new(self.rate_hz() / every as f64, self.filter.cutoff_hz())?;
        Ok(LawGrid { filter, every, points, stretches: laid(lengths.into_iter()), kept })
    }
}

impl LawGrid {
    /// The points of this grid of a `column` on all points of the recording's grid.
    fn taken(&self, column: &[f64]) -> Vec<f64> {
        self.points.iter().map(|&k| column[k]).collect()
    }

    /// `motion` on this grid, from all points of the recording's grid.
    pub fn motion(&self, motion: &Trajectory) -> Trajectory {
        let each = |columns: &[Vec<f64>]| columns.iter().map(|column| self.taken(column)).collect();
        let (q, v, a) = (each(&motion.q), each(&motion.v), each(&motion.a));
        Trajectory { t: self.taken(&motion.t), q, v, a, stretches: self.stretches.clone() }
    }

    /// `change` on this grid, from all points of the recording's grid.
    pub fn change(&self, change: &Change) -> Change {
        let each = |columns: &Columns| columns.resampled(self.points.len(), |column| self.taken(column));
        Change { torque: each(&change.torque), tool: each(&change.tool), link: each(&change.link) }
    }

    /// The low-pass of the treatment on one column of this grid, stretch by stretch.
    pub fn low_pass(&self, column: &[f64]) -> Vec<f64> {
        self.filter.apply_to_each(self.stretches.iter().map(Range::len), column)
    }

    /// The points of one column of this grid that the treatment keeps.
    pub fn keep(&self, column: &[f64]) -> Vec<f64> {
        self.kept.iter().map(|&k| column[k]).collect()
    }
}

#[cfg(test)]
mod tests {
    use freeplay_arm::{Arm, JointFriction, JointKind};
    use freeplay_recording::Recording;

    use crate::made::{arm, columns, even, link, nothing, recording};
    use crate::signals::motion::{POINTS_PER_PERIOD, Settings, Treatment};

    fn one_joint() -> Arm {
        arm(vec![link("elbow", JointKind::Revolute, JointFriction::default())])
    }

    /// A recording of 60 s at `rate_hz` with a gap.
    fn with_a_gap(rate_hz: f64) -> Recording {
        let t: Vec<f64> =
            even(60.0, rate_hz).into_iter().map(|t| t + if t > 23.4 { 1.0 } else { 0.0 }).collect();
        recording(columns(&one_joint(), &t, nothing))
    }

    fn treatment(recording: &Recording, lowpass_hz: f64) -> Treatment {
        let settings = Settings { lowpass_hz: Some(lowpass_hz), trim_s: None };
        Treatment::new(&one_joint(), recording, &settings).expect("a treatment")
    }

    /// The grid has the kept points of the treatment, is as coarse as it may be, and its low-pass is that of the treatment.
    #[test]
    fn the_grid_keeps_the_points_and_the_low_pass_of_the_treatment() {
        for (rate_hz, lowpass_hz, every) in [
            (1000.0, 30.0, 2),
            (1000.0, 10.0, 5),
            (1000.0, 7.5, 11),
            (500.0, 15.0, 2),
            (125.0, 10.0, 1),
            (40.0, 10.0, 1),
        ] {
            let recording = with_a_gap(rate_hz);
            let treatment = treatment(&recording, lowpass_hz);
            let grid = treatment.law_grid().expect("a grid");
            let points = rate_hz / every as f64 / treatment.fine.cutoff_hz();
            assert!(grid.every == every && (every == 1 || points >= POINTS_PER_PERIOD), "{}", grid.every);
            let motion = treatment.whole_motion(&recording);
            let on_grid = grid.motion(&motion);
            assert_eq!(grid.keep(&on_grid.t), treatment.keep(&motion.t));
            assert_eq!(on_grid.stretches.len(), 2);
            let tones = |t: &[f64]| -> Vec<f64> {
                let tone = |t: f64, share: f64| (std::f64::consts::TAU * share * lowpass_hz * t).sin();
                t.iter().map(|t| tone(*t, 0.31) + tone(*t, 0.83) + tone(*t, 1.7)).collect()
            };
            let (all, some) = (tones(&motion.t), tones(&on_grid.t));
            let there = grid.keep(&grid.low_pass(&some));
            let off = there.iter().zip(treatment.keep(&treatment.low_pass(&all)));
            let off = off.map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
            println!("{rate_hz} Hz, low-pass at {lowpass_hz} Hz: one point in {every}, off by {off:.1e}");
            assert!(off < 0.02, "the low-pass of a coarser grid has nearly the same gain");
        }
    }
}
