//! A nameless model as a baseline for the servos: each measured position is a weighted sum of the latest commands.

use freeplay_servo::Track;
use nalgebra::{DMatrix, DVector};

use super::parts::Rows;

/// Taps of the filter: four per lag, between which a response without overshoot changes by a fifth.
const TAPS: usize = 16;
/// Lags that the taps cover: a servo's response ends after a few of its lags.
const LAGS: f64 = 4.0;
/// Ridge on the diagonal, as a share of the columns' size: where commands hardly differ from tap to tap, it bounds the weights, and elsewhere it is far below
/// the noise.
const RIDGE: f64 = 1e-6;

/// A finite impulse response for each joint.
pub struct Filters {
    spacing: Vec<f64>,
    taps: Vec<DVector<f64>>,
}

impl Filters {
    /// The least-squares filters on `parts` of `tracks`, whose joints follow their commands with `lags`, s.
    pub fn fit(tracks: &[Track], parts: &[Rows], lags: &[f64]) -> Filters {
        let spacing: Vec<f64> = lags.iter().map(|lag| LAGS * lag.max(1e-3) / TAPS as f64).collect();
        let of_joint = |joint: usize| {
            let mut normal = DMatrix::zeros(TAPS, TAPS);
            let mut right = DVector::zeros(TAPS);
            for (index, rows) in parts {
                let track = &tracks[*index];
                for row in rows.clone().filter(|row| track.measured[joint][*row].is_finite()) {
                    let column = column(track, joint, row, spacing[joint]);
                    normal.ger(1.0, &column, &column, 1.0);
                    right.axpy(track.measured[joint][row], &column, 1.0);
                }
            }
            let ridge = RIDGE * normal.trace() / TAPS as f64;
            (0..TAPS).for_each(|tap| normal[(tap, tap)] += ridge.max(f64::MIN_POSITIVE));
            normal.cholesky().map_or_else(|| DVector::zeros(TAPS), |factor| factor.solve(&right))
        };
        Filters { taps: (0..lags.len()).map(of_joint).collect(), spacing }
    }

    /// Predicted position of `joint` in `row` of `track`, rad (m).
    pub fn position(&self, track: &Track, joint: usize, row: usize) -> f64 {
        self.taps[joint].dot(&column(track, joint, row, self.spacing[joint]))
    }
}

fn column(track: &Track, joint: usize, row: usize, spacing: f64) -> DVector<f64> {
    DVector::from_fn(TAPS, |tap, _| track.commands[joint].between(track.stamps[row] - tap as f64 * spacing))
}
