//! Columns with missing samples: bridged before filters, and masked where they are missing.
//!
//! A run of missing samples is interpolated if it is no longer than the longest step between two stamps that makes no gap ([`Grid`]). A longer run is missing,
//! together with the settling time of the filter on either side.

use freeplay_recording::Recording;

use crate::signals::grid::{Grid, Stretch};
use crate::signals::missing::runs;
use crate::signals::motion::Treatment;

impl Grid {
    /// True for each grid point of `stretch` at which `column` of `recording` has samples; false also within `around` s of missing ones. `None` if nothing is
    /// missing.
    pub(crate) fn present(
        &self,
        stretch: &Stretch,
        recording: &Recording,
        column: &[f64],
        around: f64,
    ) -> Option<Vec<bool>> {
        let column = &column[stretch.rows.clone()];
        let t = stretch.times.as_deref().unwrap_or_else(|| &recording.t[stretch.rows.clone()]);
        let mut present: Option<Vec<bool>> = None;
        for run in runs(column) {
            let ends = [run.start.checked_sub(1), Some(run.end).filter(|end| *end < t.len())];
            if let [Some(before), Some(after)] = ends
                && t[after] - t[before] <= self.longest
            {
                continue;
            }
            let point = |time: f64| (time - stretch.start) / self.step;
            let from = ends[0].map_or(0.0, |before| point(t[before] - around).ceil().max(0.0)) as usize;
            let to = ends[1].map_or(stretch.len, |after| (point(t[after] + around).max(-1.0) + 1.0) as usize);
            let present = present.get_or_insert_with(|| vec![true; stretch.len]);
            present[from.min(stretch.len)..to.min(stretch.len)].fill(false);
        }
        present
    }
}

impl Treatment {
    /// True for each kept point at which `column` of `recording` has samples; `None` if it has all of them.
    pub fn present(&self, recording: &Recording, column: &[f64]) -> Option<Vec<bool>> {
        let around = self.filter.settling_time();
        self.presence(recording, column, around, |stretch, present| {
            stretch
                .keep
                .clone()
                .step_by(self.decimation)
                .map(|k| present.is_none_or(|present| present[k]))
                .collect()
        })
    }

    /// The same at each grid point, without a margin around missing samples.
    pub(crate) fn whole_present(&self, recording: &Recording, column: &[f64]) -> Option<Vec<bool>> {
        self.presence(recording, column, 0.0, |stretch, present| match present {
            Some(present) => present.to_vec(),
            None => vec![true; stretch.len],
        })
    }

    fn presence(
        &self,
        recording: &Recording,
        column: &[f64],
        around: f64,
        of_stretch: impl Fn(&Stretch, Option<&[bool]>) -> Vec<bool>,
    ) -> Option<Vec<bool>> {
        if !column.iter().any(|value| value.is_nan()) {
            return None;
        }
        let present = self.grid.stretches.iter().flat_map(|stretch| {
            of_stretch(stretch, self.grid.present(stretch, recording, column, around).as_deref())
        });
        let present: Vec<bool> = present.collect();
        present.contains(&false).then_some(present)
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use freeplay_recording::Recording;

    use crate::signals::grid::Grid;
    use crate::signals::missing::bridged;

    const NAN: f64 = f64::NAN;

    #[test]
    fn bridges_are_straight_and_level_at_the_ends() {
        let t = [0.0, 1.0, 2.0, 4.0, 5.0];
        assert_eq!(*bridged(&t, &[1.0, NAN, NAN, 5.0, NAN]), [1.0, 2.0, 3.0, 5.0, 5.0]);
        assert_eq!(*bridged(&t, &[NAN; 5]), [0.0; 5]);
    }

    #[test]
    fn a_short_run_is_bridged_and_a_long_one_is_missing() {
        let t: Vec<f64> = (0..1000).map(|k| f64::from(k) * 0.01).collect();
        let lacks = |k: usize| (100..105).contains(&k) || (500..700).contains(&k) || k >= 990;
        let tau: Vec<f64> = (0..1000).map(|k| if lacks(k) { NAN } else { 1.0 }).collect();
        let columns = vec![("t".into(), t.clone()), ("q1".into(), t), ("tau1".into(), tau)];
        let made = Recording::new(Path::new("made"), columns).expect("a recording");
        let grid = Grid::new(&made).expect("a grid");
        let tau = &made.tau.as_ref().expect("torques")[0];
        let present = grid.present(&grid.stretches[0], &made, tau, 0.5).expect("something is missing");
        let gone: Vec<usize> = (0..1000).filter(|&k| !present[k]).collect();
        println!("{} points are missing, {:?} to {:?}", gone.len(), gone.first(), gone.last());
        let edges = [449, 750].map(|k| present[k]);
        assert!(present[102] && edges == [true, true] || (!present[450] && present[448]), "{edges:?}");
        assert!((450..749).all(|k| !present[k]) && (940..1000).all(|k| !present[k]) && present[930]);
    }
}
