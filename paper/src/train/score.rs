//! How well the journal's place is predicted: every method on the same windows, axis by axis, in steady contact and around detachments.

use freeplay_predictor::window::Window;
use freeplay_predictor::{Arx, Series};
use freeplay_terminal::exit::Failure;
use serde::Serialize;

use crate::train::collect::{Collected, Row};
use crate::train::series::View;

/// Time after which predictions are scored, s: before, the journal falls from the middle.
const AFTER: f64 = 0.5;
/// Ticks before and after a detachment that count as around it.
const AROUND: usize = 25;
/// An axis whose deviation varies by less than this, m, has nothing to predict.
pub const LEAST_VARIATION: f64 = 1e-7;

/// Where the best baseline is off by less than this, m, nothing is left to predict: no tracker would see it.
pub const LEAST_ERROR: f64 = 1e-8;

/// In which part of a run.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Part {
    /// Where no detachment is near.
    Steady,
    /// The 50 ms around detachments.
    Detachment,
    /// The whole run, predicted without ever seeing the tool.
    FreeRun,
}

/// The windows of run `run` that are scored, by part; from `from` ticks of the run on.
pub fn windows(
    runs: &[Collected],
    run: usize,
    horizon: usize,
    memory: usize,
    from: usize,
) -> [Vec<Window>; 2] {
    let collected = &runs[run];
    let rows = &collected.rows;
    let near = around(rows);
    let start = ((AFTER * 1e3) as usize).saturating_sub(collected.first as usize).max(memory).max(from);
    let mut parts = [Vec::new(), Vec::new()];
    for present in start..rows.len().saturating_sub(horizon) {
        let target = present + horizon;
        parts[usize::from(near[target])].push(Window { run, present, target });
    }
    parts
}

/// Every window of run `run` that is scored.
pub fn whole(runs: &[Collected], run: usize, horizon: usize) -> Vec<Window> {
    let mut all = windows(runs, run, horizon, horizon, 0).concat();
    all.sort_by_key(|window| window.present);
    all
}

/// Whether each row is around a detachment.
pub fn around(rows: &[Row]) -> Vec<bool> {
    let mut near = vec![false; rows.len()];
    for index in 1..rows.len() {
        if rows[index].free && !rows[index - 1].free {
            let end = (index + AROUND).min(rows.len());
            near[index.saturating_sub(AROUND)..end].fill(true);
        }
    }
    near
}

/// What one predictor says at each window: its name, and where the journal will be, m.
pub type Said = (&'static str, Vec<[f64; 2]>);

/// What each baseline says, as journals, with its name; the previous lap only where there is one.
pub fn baselines(
    runs: &[Collected],
    windows: &[Window],
    plain: Option<(&Series, &Arx)>,
    lap: Option<usize>,
) -> Result<Vec<Said>, Failure> {
    let row = |window: &Window| &runs[window.run].rows[window.present];
    let persistence = windows.iter().map(|w| row(w).journal).collect();
    let statics = windows.iter().map(|w| {
        let Row { journal, rests, .. } = row(w);
        [0, 1].map(|i| rests[1][i] + journal[i] - rests[0][i])
    });
    let mut all = vec![("persistence", persistence), ("quasi-static + residual", statics.collect())];
    if let Some((series, arx)) = plain {
        let said = arx.predict(series, windows).map_err(Failure::internal)?;
        let arx = windows.iter().zip(said.chunks(2)).map(|(w, said)| View::Plain.journal(runs, w, said));
        all.push(("ridge ARX", arx.collect()));
    }
    if let Some(lap) = lap {
        let before = windows.iter().map(|w| runs[w.run].rows[w.target - lap].journal);
        all.push(("previous lap", before.collect()));
    }
    Ok(all)
}

/// The truth at the windows' targets.
pub fn truth(runs: &[Collected], windows: &[Window]) -> Vec<[f64; 2]> {
    windows.iter().map(|w| runs[w.run].rows[w.target].journal).collect()
}

/// Mean squared error of the tool's place along x, y, z of the base frame, m²; and the truth's variance.
pub fn errors(runs: &[Collected], windows: &[Window], truth: &[[f64; 2]], said: &[[f64; 2]]) -> [f64; 3] {
    let mut sum = [0.0; 3];
    for ((window, truth), said) in windows.iter().zip(truth).zip(said) {
        let [first, second] = &runs[window.run].rows[window.present].directions;
        let error = first * (said[0] - truth[0]) + second * (said[1] - truth[1]);
        sum.iter_mut().zip(error.iter()).for_each(|(sum, error)| *sum += error * error);
    }
    sum.map(|sum| sum / windows.len().max(1) as f64)
}

/// Variance of the deviation along x, y, z, m².
pub fn variance(runs: &[Collected], windows: &[Window], truth: &[[f64; 2]]) -> [f64; 3] {
    let count = windows.len().max(1) as f64;
    let place = |window: &Window, truth: &[f64; 2]| {
        let [first, second] = &runs[window.run].rows[window.present].directions;
        first * truth[0] + second * truth[1]
    };
    let places: Vec<_> = windows.iter().zip(truth).map(|(w, t)| place(w, t)).collect();
    let mean = places.iter().sum::<nalgebra::Vector3<f64>>() / count;
    let squares: nalgebra::Vector3<f64> =
        places.iter().map(|p| (p - mean).component_mul(&(p - mean))).sum::<nalgebra::Vector3<f64>>() / count;
    [squares.x, squares.y, squares.z]
}
