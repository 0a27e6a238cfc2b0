//! Samples of one prediction, and the instants at which predictions are possible.
//!
//! # Formula
//! ŷ\[k+h\] = f(u\[k−i\] for each input lag i, y\[k−j\] for each output lag j), horizon h ≥ 1. Lag 0 is the present. The network
//! of Erkaya (2018), Eq. 10, y(t) = f(u(t), u(t−1), …, y(t−1), …), is the case h = 1 with the input *at the predicted instant*
//! ([`Layout::input_at_target`]), which a controller knows only for planned inputs.

use crate::series::Series;
use serde::{Deserialize, Serialize};

/// Largest lag and horizon, samples: more than a minute at 1 kHz, and small enough for the memory.
pub const LONGEST: usize = 100_000;

/// Samples of a prediction, and its instant.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Layout {
    /// Lags of all input channels, samples; 0 is the present.
    pub input_lags: Vec<usize>,
    /// Lags of all output channels, samples; 0 is the present.
    pub output_lags: Vec<usize>,
    /// Samples from the present to the predicted instant, at least 1.
    pub horizon: usize,
    /// True if the inputs at the predicted instant are also known.
    pub input_at_target: bool,
}

/// One prediction to make: from the samples of `run` up to `present`, for instant `target`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct Window {
    /// Index of the run.
    pub run: usize,
    /// Latest sample that the prediction may use (apart from a layout's inputs at the target).
    pub present: usize,
    /// Sample to predict: `present` + horizon.
    pub target: usize,
}

/// Reasons why windows cannot be made.
#[derive(Debug, thiserror::Error, PartialEq, Eq)]
pub enum WindowError {
    /// The horizon is 0.
    #[error("horizon 0 predicts nothing: give 1 or more samples")]
    NoHorizon,
    /// A lag or the horizon is beyond [`LONGEST`].
    #[error("a lag or horizon of {samples} samples is too long: at most {LONGEST}")]
    TooLong {
        /// The given number of samples.
        samples: usize,
    },
    /// A lag appears twice.
    #[error("{kind} lag {lag} appears twice: give each lag once")]
    RepeatedLag {
        /// `input` or `output`.
        kind: &'static str,
        /// The lag.
        lag: usize,
    },
    /// The layout has no regressors.
    #[error("the layout uses no sample: give at least one lag of a channel")]
    NoRegressors,
    /// A window exceeds its run, or has another horizon.
    #[error(
        "window with present {present} and target {target} of run {run}: it must have {memory} samples before the \
         present, look {horizon} ahead, and end inside the run; make windows with this memory and horizon"
    )]
    Outside {
        /// Index of the run.
        run: usize,
        /// Present sample of the window.
        present: usize,
        /// Target sample of the window.
        target: usize,
        /// Required samples before the present.
        memory: usize,
        /// Required horizon.
        horizon: usize,
    },
    /// A run is shorter than one window.
    #[error(
        "run `{run}` has {samples} samples, but looking {memory} back and {horizon} ahead takes at least {needed}"
    )]
    TooFewSamples {
        /// Name of the run.
        run: String,
        /// Number of its samples.
        samples: usize,
        /// Samples before the present.
        memory: usize,
        /// Samples after the present.
        horizon: usize,
        /// Required samples.
        needed: usize,
    },
}

impl Layout {
    /// Checks the layout for the given numbers of channels.
    ///
    /// # Errors
    /// If the horizon is 0, a lag or the horizon is too long, a lag appears twice, or there are no regressors.
    pub fn check(&self, inputs: usize, outputs: usize) -> Result<(), WindowError> {
        if self.horizon == 0 {
            return Err(WindowError::NoHorizon);
        }
        let samples = self.memory().max(self.horizon);
        if samples > LONGEST {
            return Err(WindowError::TooLong { samples });
        }
        for (kind, lags) in [("input", &self.input_lags), ("output", &self.output_lags)] {
            if let Some(i) = (1..lags.len()).find(|&i| lags[..i].contains(&lags[i])) {
                return Err(WindowError::RepeatedLag { kind, lag: lags[i] });
            }
        }
        if self.width(inputs, outputs) == 0 { Err(WindowError::NoRegressors) } else { Ok(()) }
    }

    /// Largest lag, which is the number of samples that a prediction needs before the present.
    #[must_use]
    pub fn memory(&self) -> usize {
        self.input_lags.iter().chain(&self.output_lags).copied().max().unwrap_or(0)
    }

    /// Number of regressors for the given numbers of channels.
    #[must_use]
    pub fn width(&self, inputs: usize, outputs: usize) -> usize {
        inputs * (self.input_lags.len() + usize::from(self.input_at_target))
            + outputs * self.output_lags.len()
    }

    /// Writes the regressors into `into`: inputs lag by lag, inputs at the target if the layout has them, outputs
    /// lag by lag. `input(i)` and `output(i)` give all channels i samples ago, `at_target` the inputs at the target.
    pub(crate) fn gather<'a>(
        &self,
        input: impl Fn(usize) -> &'a [f64],
        at_target: Option<&'a [f64]>,
        output: impl Fn(usize) -> &'a [f64],
        into: &mut [f64],
    ) {
        let inputs = self.input_lags.iter().map(|&lag| input(lag));
        let outputs = self.output_lags.iter().map(|&lag| output(lag));
        let mut rest = into;
        for part in inputs.chain(at_target).chain(outputs) {
            let (here, after) = rest.split_at_mut(part.len());
            here.copy_from_slice(part);
            rest = after;
        }
    }

    /// The regressors of one window, unscaled.
    pub(crate) fn regressors(&self, series: &Series, window: Window, into: &mut [f64]) {
        let Window { run, present, target } = window;
        self.gather(
            |lag| series.input(run, present - lag),
            self.input_at_target.then(|| series.input(run, target)),
            |lag| series.output(run, present - lag),
            into,
        );
    }
}

/// All windows of a series, run after run, that have `memory` samples before the present and look `horizon` ahead.
///
/// For a comparison of predictors, give the largest memory of all of them, so that they predict the same windows.
///
/// # Errors
/// If the horizon is 0 or a run is too short for a single window.
pub fn windows(series: &Series, memory: usize, horizon: usize) -> Result<Vec<Window>, WindowError> {
    if horizon == 0 {
        return Err(WindowError::NoHorizon);
    }
    let needed = memory.saturating_add(horizon).saturating_add(1);
    let mut all = Vec::new();
    for (index, run) in series.runs().iter().enumerate() {
        let samples = run.samples();
        if samples < needed {
            return Err(WindowError::TooFewSamples {
                run: run.name().to_owned(),
                samples,
                memory,
                horizon,
                needed,
            });
        }
        let presents = memory..samples - horizon;
        all.extend(presents.map(|present| Window { run: index, present, target: present + horizon }));
    }
    Ok(all)
}

/// Checks that all windows lie inside their runs, have `memory` samples before the present, and look `horizon` ahead.
pub(crate) fn check_windows(
    series: &Series,
    windows: &[Window],
    memory: usize,
    horizon: usize,
) -> Result<(), WindowError> {
    let fits = |w: &&Window| {
        let samples = series.runs().get(w.run).map_or(0, crate::series::Run::samples);
        w.present >= memory && w.target.checked_sub(w.present) == Some(horizon) && w.target < samples
    };
    match windows.iter().find(|w| !fits(w)) {
        None => Ok(()),
        Some(&Window { run, present, target }) => {
            Err(WindowError::Outside { run, present, target, memory, horizon })
        }
    }
}

/// The true outputs at the windows' targets, row-major.
///
/// # Panics
/// If a window exceeds its run.
#[must_use]
pub fn targets(series: &Series, windows: &[Window]) -> Vec<f64> {
    windows.iter().flat_map(|window| series.output(window.run, window.target)).copied().collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn series() -> Series {
        let mut series = Series::new(&["u"], &["y"]).unwrap();
        let ramp = |from: f64| (0..6).map(|i| from + f64::from(i)).collect::<Vec<_>>();
        series.push_run("first", ramp(0.0), ramp(100.0)).unwrap();
        series.push_run("second", ramp(10.0), ramp(200.0)).unwrap();
        series
    }

    fn layout() -> Layout {
        Layout { input_lags: vec![0, 2], output_lags: vec![1], horizon: 2, input_at_target: true }
    }

    #[test]
    fn windows_stay_inside_their_run() {
        let all = windows(&series(), 2, 2).unwrap();
        let expected = [(0, 2), (0, 3), (1, 2), (1, 3)].map(|(run, present)| Window {
            run,
            present,
            target: present + 2,
        });
        assert_eq!(all, expected);
        assert_eq!(targets(&series(), &all), [104.0, 105.0, 204.0, 205.0]);
    }

    #[test]
    fn regressors_are_the_samples_named_by_the_layout() {
        let layout = layout();
        assert_eq!((layout.width(1, 1), layout.memory()), (4, 2));
        let mut x = [0.0; 4];
        layout.regressors(&series(), Window { run: 1, present: 3, target: 5 }, &mut x);
        assert_eq!(x, [13.0, 11.0, 15.0, 202.0]);
    }

    #[test]
    fn the_papers_layout_has_the_papers_size() {
        let lags = vec![0, 1];
        let paper = |input_at_target| Layout {
            input_lags: lags.clone(),
            output_lags: lags.clone(),
            horizon: 1,
            input_at_target,
        };
        // PHYSICS 1.1: 9 (12) inputs × 3 + 3 outputs × 2 = 33 (42) regressors.
        assert_eq!((paper(true).width(9, 3), paper(true).width(12, 3)), (33, 42));
        assert_eq!(paper(false).width(9, 3), 24);
    }

    #[test]
    fn bad_layouts_and_short_runs_are_refused() {
        let check = |change: fn(&mut Layout)| {
            let mut layout = layout();
            change(&mut layout);
            layout.check(1, 1)
        };
        assert_eq!(check(|_| ()), Ok(()));
        assert_eq!(check(|l| l.horizon = 0), Err(WindowError::NoHorizon));
        let repeated = check(|l| l.input_lags = vec![0, 2, 0]);
        assert_eq!(repeated, Err(WindowError::RepeatedLag { kind: "input", lag: 0 }));
        let long = check(|l| l.output_lags = vec![usize::MAX]);
        assert_eq!(long, Err(WindowError::TooLong { samples: usize::MAX }));
        let nothing = Layout { input_lags: vec![0], output_lags: vec![], horizon: 1, input_at_target: true };
        assert_eq!(nothing.check(0, 3), Err(WindowError::NoRegressors));
        let short = windows(&series(), 4, 2).unwrap_err();
        assert!(short.to_string().contains("`first` has 6 samples"), "{short}");
        assert!(short.to_string().contains("at least 7"), "{short}");
        assert!(windows(&series(), usize::MAX, 2).is_err());
    }
}
