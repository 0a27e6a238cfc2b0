//! Do recording and model speak of the same arm, in the same units, signs, order and on the same clock?

mod change;
mod kinds;
mod problem;
mod reading;
mod regression;
mod samples;
mod search;

pub use reading::{PositionReading, Reading, TorqueReading};

use freeplay_arm::Arm;
use freeplay_recording::Recording;

/// Debugging aid while building.
pub fn explore(arm: &Arm, recording: &Recording) -> String {
    let q: Vec<Vec<f64>> =
        recording.q.iter().map(|c| kinds::angle_wrap::unwrapped(c, std::f64::consts::TAU)).collect();
    let Ok(samples) = samples::Samples::new(recording, &q) else { return "no samples".into() };
    let search = search::Search::new(arm, &samples);
    let plain = search.whole.outcome(&[]);
    let best = search.best();
    format!(
        "rows {}\nplain {:.1} {:.4?}\nbest  {:.1} {:.4?}\n  {:?}\n  g {:?} scale {:.4?}",
        samples.len(),
        plain.evidence,
        plain.left,
        best.evidence,
        best.left,
        best.changes,
        best.gravity.as_slice(),
        best.scale
    )
}
