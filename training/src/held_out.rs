//! Held-out paths: the prediction of each by a network trained on the others, and its quality.

use freeplay_predictor::{Narx, Series, Window};
use freeplay_terminal::exit::Failure;
use freeplay_terminal::parallel::on_all_cores;
use nalgebra::Vector3;
use serde::Serialize;

use crate::data::Data;
use crate::structure::{Fitting, Structure, fitted, predictions};

/// Predictions of one held-out path.
pub struct Answers {
    /// Fold number of the path.
    pub fold: usize,
    /// Windows of the predictions.
    pub windows: Vec<Window>,
    /// Predictions at these windows, m.
    pub predicted: Vec<Vector3<f64>>,
}

/// One held-out path with the network trained on the others.
pub struct HeldOut {
    /// Network trained on the other paths.
    pub narx: Narx,
    /// Predictions by that network.
    pub answers: Answers,
}

/// Quality of a predictor on held-out paths.
#[derive(Clone, Debug, Serialize)]
pub struct Tried {
    /// Description of the predictor.
    pub name: String,
    /// RMS of the residual along x, y and z, m.
    pub left: [f64; 3],
    /// Correlation of prediction and truth along the axes; `None` if one is constant.
    pub r: [Option<f64>; 3],
}

/// Predicts every path of `data` by `structure`, trained on the others.
///
/// # Errors
/// Too few samples for the network.
pub fn held_out(data: &Data, structure: &Structure, fitting: Fitting) -> Result<Vec<HeldOut>, Failure> {
    let series = data.series(&structure.inputs)?;
    on_all_cores(data.fold_count(), |fold| one(data, &series, structure, fitting, fold))
}

fn one(
    data: &Data,
    series: &Series,
    structure: &Structure,
    fitting: Fitting,
    fold: usize,
) -> Result<HeldOut, Failure> {
    let narx = fitted(data, series, structure, fitting, |run| data.folds[run] != fold)?;
    let windows = data.windows(fitting.stride, structure.layout().memory(), |run| data.folds[run] == fold);
    let found = predictions(&narx, series, &windows)?;
    // Predictions are limited to the range of the training.
    let trained = data.windows(fitting.stride, 0, |run| data.folds[run] != fold);
    let (lowest, highest) = range(data, &trained);
    let predicted = found
        .iter()
        .map(|predicted| Vector3::from_fn(|axis, _| predicted[axis].max(lowest[axis]).min(highest[axis])))
        .collect();
    Ok(HeldOut { narx, answers: Answers { fold, windows, predicted } })
}

/// Least and greatest remainder at `windows`, with zero included in the range, m.
pub fn range(data: &Data, windows: &[Window]) -> (Vector3<f64>, Vector3<f64>) {
    let mut bounds = (Vector3::zeros(), Vector3::zeros());
    for window in windows {
        let left = data.residual(window.run, window.target);
        bounds = (bounds.0.inf(&left), bounds.1.sup(&left));
    }
    bounds
}

/// The quality of the predictions `all`, under the name `name`.
pub fn scored<'a>(data: &Data, name: String, all: impl Iterator<Item = &'a Answers> + Clone) -> Tried {
    let pairs = |axis: usize| {
        all.clone().flat_map(move |held| {
            held.windows.iter().zip(&held.predicted).map(move |(window, predicted)| {
                (data.residual(window.run, window.target)[axis], predicted[axis])
            })
        })
    };
    let left = [0, 1, 2].map(|axis| rms(pairs(axis).map(|(truth, predicted)| truth - predicted)));
    let r = [0, 1, 2].map(|axis| correlation(&pairs(axis).collect::<Vec<_>>()));
    Tried { name, left, r }
}

/// Root of the mean square.
pub fn rms(values: impl Iterator<Item = f64>) -> f64 {
    let (count, sum) = values.fold((0.0_f64, 0.0), |(count, sum), value| (count + 1.0, sum + value * value));
    (sum / count.max(1.0)).sqrt()
}

/// Pearson's correlation; `None` if one of the two is constant.
pub fn correlation(pairs: &[(f64, f64)]) -> Option<f64> {
    let count = pairs.len() as f64;
    let (a, b) = pairs.iter().fold((0.0, 0.0), |(a, b), pair| (a + pair.0 / count, b + pair.1 / count));
    let sums = pairs.iter().fold([0.0; 3], |[aa, bb, ab], (x, y)| {
        let (x, y) = (x - a, y - b);
        [aa + x * x, bb + y * y, ab + x * y]
    });
    let scale = (sums[0] * sums[1]).sqrt();
    (scale > 0.0).then(|| sums[2] / scale)
}
