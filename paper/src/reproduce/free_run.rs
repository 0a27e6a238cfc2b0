//! Free runs: predictions from earlier predictions instead of measurements.

use std::collections::HashMap;

use freeplay_predictor::{Arx, Series, Window};
use freeplay_terminal::exit::Failure;

use super::dataset::layout;

/// Outputs predicted in free run, by run and sample.
pub struct FreeRun {
    outputs: usize,
    predicted: HashMap<(usize, usize), Vec<f64>>,
}

impl FreeRun {
    /// The predictions for the targets of `windows`, row-major; NaN for a missing one.
    pub fn of(&self, windows: &[Window]) -> Vec<f64> {
        let unknown = vec![f64::NAN; self.outputs];
        let row =
            |window: &Window| self.predicted.get(&(window.run, window.target)).unwrap_or(&unknown).clone();
        windows.iter().flat_map(row).collect()
    }
}

/// Runs freely over the targets of `windows`, run by run from the first target to the last, with `predict` (run, first sample, number of samples).
///
/// # Errors
/// Errors of `predict`.
pub fn free_runs(
    series: &Series,
    windows: &[Window],
    predict: &mut impl FnMut(usize, usize, usize) -> Result<Vec<f64>, Failure>,
) -> Result<FreeRun, Failure> {
    let outputs = series.outputs();
    let mut predicted = HashMap::new();
    for of_run in windows.chunk_by(|a, b| a.run == b.run) {
        let (run, start) = (of_run[0].run, of_run[0].target);
        let steps = of_run[of_run.len() - 1].target - start + 1;
        for (step, row) in predict(run, start, steps)?.chunks(outputs).enumerate() {
            predicted.insert((run, start + step), row.to_vec());
        }
    }
    Ok(FreeRun { outputs, predicted })
}

/// `windows` with the present moved to the last sample before the beginning of the free run over `all`, in the same run.
pub fn starts(windows: &[Window], all: &[Window]) -> Vec<Window> {
    let mut first: HashMap<usize, usize> = HashMap::new();
    for window in all {
        let present = first.entry(window.run).or_insert(window.present);
        *present = window.present.min(*present);
    }
    let moved = |window: &Window| Window {
        present: first.get(&window.run).copied().unwrap_or(window.present),
        ..*window
    };
    windows.iter().map(moved).collect()
}

/// Free run of a linear model, which may diverge: from there on the prediction is infinite.
///
/// # Errors
/// A model that does not fit the series.
pub fn linear(
    arx: &Arx,
    series: &Series,
    run: usize,
    start: usize,
    steps: usize,
) -> Result<Vec<f64>, Failure> {
    let memory = layout().memory();
    let inputs: Vec<&str> = series.input_names().iter().map(String::as_str).collect();
    let outputs: Vec<&str> = series.output_names().iter().map(String::as_str).collect();
    let mut history: Vec<Vec<f64>> =
        (start - 1 - memory..start).map(|sample| series.output(run, sample).to_vec()).collect();
    let mut predictions = Vec::with_capacity(steps * outputs.len());
    for target in start..start + steps {
        // The window's own samples: the memory, the present, and the target, whose output is not used.
        let mut window = Series::new(&inputs, &outputs).map_err(Failure::internal)?;
        let u =
            (target - 1 - memory..=target).flat_map(|sample| series.input(run, sample)).copied().collect();
        let known = &history[history.len() - 1 - memory..];
        let y = known.iter().chain(known.last()).flatten().copied().collect();
        if window.push_run("window", u, y).is_err() {
            predictions.extend(std::iter::repeat_n(f64::INFINITY, (start + steps - target) * outputs.len()));
            return Ok(predictions);
        }
        let row = arx
            .predict(&window, &[Window { run: 0, present: memory, target: memory + 1 }])
            .map_err(Failure::internal)?;
        predictions.extend(&row);
        history.push(row);
    }
    Ok(predictions)
}
