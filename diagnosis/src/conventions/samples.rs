//! A recording as few, effectively independent rows: smoothed, differentiated, one row every [`SPACING`] s.

use freeplay_recording::Recording;

use crate::error::ResidualError;
use crate::signals::filter::{LowPass, derivatives};
use crate::signals::grid::{Grid, Stretch};
use crate::signals::motion::{GREATEST_TRIM, LEAST_CUTOFF};
use crate::signals::stuck::Stuck;

/// Time between two rows, s: a quarter of a period of 1.5 Hz, about where the motions of arms end.
pub(super) const SPACING: f64 = 0.15;
/// Most rows: a fault of the reading is so large that more rows don't change the decision.
const MOST_ROWS: usize = 240;

/// Trimmed time at each end, s, an eighth of a stretch at most: columns shifted by the longest tested delay, half a second, stay inside.
const ENDS: f64 = 0.55;

/// The rows of a recording, in recorded units.
pub(crate) struct Samples {
    /// Time of each row, s.
    pub t: Vec<f64>,
    /// Positions and their derivatives, `[column][row]`.
    pub motion: [Vec<Vec<f64>>; 3],
    torques: Option<Vec<Smooth>>,
    tool: Option<Vec<Smooth>>,
    places: Vec<(usize, f64)>,
    step: f64,
    spans: Vec<(usize, usize)>,
}

/// A column, smoothed, on every grid point.
type Smooth = Vec<f64>;

impl Samples {
    /// The rows of `recording`; `q` holds the positions without jumps.
    ///
    /// # Errors
    /// [`ResidualError`] for stamps without a uniform grid or a rate that is too low.
    pub fn new(recording: &Recording, q: &[Vec<f64>]) -> Result<Self, ResidualError> {
        let grid = Grid::new(recording)?;
        let filter = LowPass::new(grid.rate_hz(), LEAST_CUTOFF.min(grid.rate_hz() / 4.0))?;
        let smooth = |column: &Vec<f64>| -> Smooth {
            let parts = grid.stretches.iter();
            parts.flat_map(|stretch| filter.apply(&grid.resample(stretch, recording, column))).collect()
        };
        let (mut spans, mut begin) = (Vec::new(), 0);
        for stretch in &grid.stretches {
            spans.push((begin, begin + stretch.len));
            begin += stretch.len;
        }
        let there = |columns: &[Vec<f64>]| -> Vec<bool> {
            let around = ENDS.max(filter.settling_time());
            let of = |stretch: &Stretch| {
                let mut all = vec![true; stretch.len];
                for column in columns {
                    let present = grid.present(stretch, recording, column, around);
                    all.iter_mut().zip(present.iter().flatten()).for_each(|(all, one)| *all &= *one);
                }
                all
            };
            grid.stretches.iter().flat_map(of).collect()
        };
        let mut places = places(&spans, grid.step);
        let mut recorded = |columns: Option<&[Vec<f64>]>| -> Option<Vec<Smooth>> {
            let columns = columns?;
            let present = there(columns);
            let kept: Vec<usize> = places.iter().copied().filter(|&point| present[point]).collect();
            // Torques and the tool count as recorded if most of their samples are there.
            if 2 * kept.len() < places.len() {
                return None;
            }
            places = kept;
            Some(columns.iter().map(smooth).collect())
        };
        let mut torques = recorded(recording.tau.as_deref());
        let tool = recorded(recording.tool.as_ref().map(<[_; 3]>::as_slice));
        let mut motion: [Vec<Vec<f64>>; 3] = [const { Vec::new() }; 3];
        for column in q {
            let smooth = smooth(column);
            let mut whole = [const { Vec::new() }; 3];
            for &(start, end) in &spans {
                let (first, second) = derivatives(&smooth[start..end], grid.step);
                whole[0].extend_from_slice(&smooth[start..end]);
                whole[1].extend(first);
                whole[2].extend(second);
            }
            for (motion, whole) in motion.iter_mut().zip(&whole) {
                motion.push(places.iter().map(|&point| whole[point]).collect());
            }
        }
        let raw = |column: &Vec<f64>| -> Vec<f64> {
            let parts = grid.stretches.iter();
            parts.flat_map(|stretch| grid.resample(stretch, recording, column).into_owned()).collect()
        };
        let columns = torques.iter_mut().flatten().zip(recording.tau.iter().flatten());
        for ((torque, column), (v, a)) in columns.zip(motion[1].iter().zip(&motion[2])) {
            let whole = raw(column);
            let rows: Vec<f64> = places.iter().map(|&point| whole[point]).collect();
            // A torque that stays at one value while its joint moves is no measurement, in any unit.
            if Stuck::along(&rows, v, a).is_some() {
                torque.fill(f64::NAN);
            }
        }
        let starts = grid.stretches.iter().zip(&spans);
        let times: Vec<f64> = starts
            .flat_map(|(stretch, &(start, end))| {
                (start..end).map(move |k| stretch.start + (k - start) as f64 * grid.step)
            })
            .collect();
        let in_span = |point: usize| spans.iter().position(|&(_, end)| point < end).unwrap_or(0);
        Ok(Self {
            t: places.iter().map(|&point| times[point]).collect(),
            motion,
            torques,
            tool,
            places: places.iter().map(|&point| (in_span(point), point as f64)).collect(),
            step: grid.step,
            spans,
        })
    }

    /// Number of rows.
    pub fn len(&self) -> usize {
        self.t.len()
    }

    /// Returns true if torques were recorded.
    pub fn has_torques(&self) -> bool {
        self.torques.is_some()
    }

    /// Returns true if the tool was tracked.
    pub fn has_tool(&self) -> bool {
        self.tool.is_some()
    }

    /// Torque column `source`, read `delay` s later; in its recorded unit.
    pub fn torque(&self, source: usize, delay: f64) -> Vec<f64> {
        self.torques.as_ref().map_or_else(Vec::new, |columns| self.late(&columns[source], delay))
    }

    /// The tool's coordinate `axis`, read `delay` s later, m.
    pub fn tool(&self, axis: usize, delay: f64) -> Vec<f64> {
        self.tool.as_ref().map_or_else(Vec::new, |columns| self.late(&columns[axis], delay))
    }

    fn late(&self, column: &[f64], delay: f64) -> Vec<f64> {
        let shift = delay / self.step;
        let at = |&(span, point): &(usize, f64)| {
            let (start, end) = self.spans[span];
            let place = (point + shift).clamp(start as f64, (end - 1) as f64);
            let below = (place as usize).min(end.saturating_sub(2));
            let u = place - below as f64;
            column[below] + u * (column[(below + 1).min(end - 1)] - column[below])
        };
        self.places.iter().map(at).collect()
    }
}

/// The grid points of the rows.
fn places(spans: &[(usize, usize)], step: f64) -> Vec<usize> {
    let inner = |&(start, end): &(usize, usize)| {
        let trim = ((ENDS / step) as usize).min((GREATEST_TRIM * (end - start) as f64) as usize);
        start + trim..end - trim
    };
    let inside: usize = spans.iter().map(|span| inner(span).len()).sum();
    let every = ((SPACING / step) as usize).max(inside / MOST_ROWS).max(1);
    spans.iter().flat_map(|span| inner(span).step_by(every)).collect()
}

/// A recording of 10 s at 100 Hz: joint k swings by 0.6 rad at 1 + 0.3 k rad/s, and `torque` computes the torques from position, velocity and acceleration.
#[cfg(test)]
pub(super) fn made(joints: usize, torque: impl Fn([&[f64]; 3], &mut [f64])) -> Recording {
    let names = ["q", "tau"].map(|what| (1..=joints).map(move |joint| format!("{what}{joint}")));
    let mut columns: Vec<(String, Vec<f64>)> =
        names.into_iter().flatten().map(|name| (name, Vec::new())).collect();
    columns.insert(0, ("t".to_owned(), Vec::new()));
    let mut tau = vec![0.0; joints];
    for row in 0..1000 {
        let t = f64::from(row) / 100.0;
        let motion = [0, 1, 2].map(|order| -> Vec<f64> {
            let at = |joint: usize| {
                let w = 1.0 + 0.3 * joint as f64;
                let (sin, cos) = (w * t).sin_cos();
                [0.3 + 0.6 * sin, 0.6 * w * cos, -0.6 * w * w * sin][order]
            };
            (0..joints).map(at).collect()
        });
        torque(motion.each_ref().map(Vec::as_slice), &mut tau);
        let row = [t].into_iter().chain(motion[0].iter().copied()).chain(tau.iter().copied());
        columns.iter_mut().zip(row).for_each(|((_, column), x)| column.push(x));
    }
    Recording::new(std::path::Path::new("made.csv"), columns).expect("a recording")
}
