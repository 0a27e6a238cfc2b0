//! Baselines without learning that a network should beat: persistence, the previous lap, a given physical prediction.
//!
//! All of them predict the same windows as the network (row-major, in the outputs' own units); ridge ARX is in [`crate::arx`].

use crate::series::Series;
use crate::window::Window;

/// Reasons why a baseline cannot predict.
#[derive(Debug, thiserror::Error, PartialEq, Eq)]
pub enum BaselineError {
    /// At the present sample, no sample a whole number of laps before the target is known yet.
    #[error(
        "run {run}, target {target}: no sample lies a whole number of laps of {period} samples back; \
         use windows with at least {needed} samples before the target"
    )]
    NoPreviousLap {
        /// Index of the run.
        run: usize,
        /// The window's target.
        target: usize,
        /// Samples per lap.
        period: usize,
        /// Samples needed before the target.
        needed: usize,
    },
    /// The physical prediction does not have one row per sample of the series.
    #[error("physics prediction of run {run}: {found} values, but the series has {expected} outputs there")]
    PhysicsShape {
        /// Index of the run.
        run: usize,
        /// Required values.
        expected: usize,
        /// Given values.
        found: usize,
    },
}

/// Persistence: the prediction equals the present outputs, ŷ\[k+h\] = y\[k\].
///
/// # Panics
/// If a window exceeds its run (as in the other functions of this module).
#[must_use]
pub fn persistence(series: &Series, windows: &[Window]) -> Vec<f64> {
    windows.iter().flat_map(|w| series.output(w.run, w.present)).copied().collect()
}

/// The outputs a whole number of laps of `period` samples before the target. The function uses the latest such sample that is
/// known at the present, ŷ\[k+h\] = y\[k+h−m·period\].
///
/// # Errors
/// If a window has no such sample.
pub fn previous_lap(series: &Series, windows: &[Window], period: usize) -> Result<Vec<f64>, BaselineError> {
    let mut predictions = Vec::with_capacity(windows.len() * series.outputs());
    for &Window { run, present, target } in windows {
        let back = period.saturating_mul(target.saturating_sub(present).div_ceil(period.max(1)));
        if back == 0 || back > target {
            return Err(BaselineError::NoPreviousLap { run, target, period, needed: back });
        }
        predictions.extend_from_slice(series.output(run, target - back));
    }
    Ok(predictions)
}

/// A physical prediction plus persistence of its residual, ŷ\[k+h\] = p\[k+h\] + (y\[k\] − p\[k\]).
///
/// `physics` contains, for each run, the predicted outputs p of every sample (row-major). The physical model may use only data
/// that are known h samples earlier, such as the reference motion.
///
/// # Errors
/// If the shape of `physics` differs from that of the series.
pub fn physics_with_residual(
    series: &Series,
    windows: &[Window],
    physics: &[Vec<f64>],
) -> Result<Vec<f64>, BaselineError> {
    let outputs = series.outputs();
    for (run, data) in series.runs().iter().enumerate() {
        let (expected, found) = (data.samples() * outputs, physics.get(run).map_or(0, Vec::len));
        if expected != found {
            return Err(BaselineError::PhysicsShape { run, expected, found });
        }
    }
    let value = |w: &Window, channel: usize| {
        let p = |sample: usize| physics[w.run][sample * outputs + channel];
        p(w.target) + (series.output(w.run, w.present)[channel] - p(w.present))
    };
    Ok(windows.iter().flat_map(|w| (0..outputs).map(move |channel| value(w, channel))).collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::metrics::score;
    use crate::window::{targets, windows};
    use std::f64::consts::TAU;

    /// y = sin θ, cos θ with 100 samples a lap.
    fn circle(samples: u32) -> Series {
        let mut series = Series::new(&[], &["s", "c"]).unwrap();
        let angle = |k: u32| f64::from(k) / 100.0 * TAU;
        let y = (0..samples).flat_map(|k| [angle(k).sin(), angle(k).cos()]).collect();
        series.push_run("circle", vec![], y).unwrap();
        series
    }

    #[test]
    fn persistence_of_a_sine_has_its_closed_form_error() {
        // For whole laps, mean (sin(θ + a) − sin θ)² = 1 − cos a.
        let series = circle(303);
        let all = windows(&series, 0, 3).unwrap();
        let scores = score(&targets(&series, &all), &persistence(&series, &all), 2, None).unwrap();
        let expected = 1.0 - (3.0 / 100.0 * TAU).cos();
        eprintln!("{:.3e} {:.3e} expected {expected:.3e}", scores[0].mse, scores[1].mse);
        assert!(scores.iter().all(|s| s.count == 300 && (s.mse - expected).abs() < 1.0e-12));
        // R = cos a is nearly 1 although persistence predicts nothing.
        assert!((scores[0].r.unwrap() - (1.0 - expected)).abs() < 1.0e-12);
    }

    #[test]
    fn the_previous_lap_of_a_periodic_output_is_exact() {
        let series = circle(300);
        let all = windows(&series, 100, 3).unwrap();
        let lap =
            score(&targets(&series, &all), &previous_lap(&series, &all, 100).unwrap(), 2, None).unwrap();
        assert!(lap.iter().all(|s| s.mse < 1.0e-28 && s.count > 100), "{lap:?}");
        let wrong =
            score(&targets(&series, &all), &previous_lap(&series, &all, 99).unwrap(), 2, None).unwrap();
        assert!(wrong[0].mse > 1.0e-4, "a wrong period is noticed");
    }

    #[test]
    fn laps_shorter_than_the_horizon_reach_back_far_enough() {
        let series = circle(300);
        let window = Window { run: 0, present: 50, target: 75 };
        // Two laps of 20 samples back is sample 35; one lap back, 55, is not known yet.
        assert_eq!(previous_lap(&series, &[window], 20).unwrap(), series.output(0, 35));
        let early = Window { run: 0, present: 10, target: 13 };
        assert!(matches!(
            previous_lap(&series, &[early], 20),
            Err(BaselineError::NoPreviousLap { needed: 20, .. })
        ));
        assert!(previous_lap(&series, &[early], 0).is_err());
        assert!(previous_lap(&series, &[early], usize::MAX).is_err());
    }

    #[test]
    fn a_physics_prediction_with_a_constant_offset_is_made_exact() {
        let series = circle(300);
        let all = windows(&series, 0, 3).unwrap();
        let physics: Vec<f64> = (0..300).flat_map(|k| series.output(0, k).iter().map(|y| y + 0.25)).collect();
        let prediction = physics_with_residual(&series, &all, &[physics]).unwrap();
        let scores = score(&targets(&series, &all), &prediction, 2, None).unwrap();
        assert!(scores.iter().all(|s| s.max < 1.0e-15), "{scores:?}");
        let zero = physics_with_residual(&series, &all, &[vec![0.0; 600]]).unwrap();
        assert_eq!(zero, persistence(&series, &all), "no physics is persistence");
        let short = physics_with_residual(&series, &all, &[vec![0.0; 599]]);
        assert_eq!(short, Err(BaselineError::PhysicsShape { run: 0, expected: 600, found: 599 }));
        assert!(physics_with_residual(&series, &all, &[]).is_err());
    }
}
