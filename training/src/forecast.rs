//! Forecasts of held-out paths as a controller would compute them, with the tracker's measurement, for the page.

use freeplay_controller::remainder::{Axis, InputGroup, Region};

use crate::bounds::around;
use crate::data::Data;
use crate::held_out::Answers;

/// The forecast of one held-out run.
#[derive(Clone, Debug, Default)]
pub struct Forecast {
    /// Name of the run.
    pub name: String,
    /// Instants, s.
    pub t: Vec<f64>,
    /// Residual of the model in the tool's position along x, y and z, as the tracker measured it, m.
    pub tracked: [Vec<f64>; 3],
    /// Prediction by the network of the other paths, within its bounds, m.
    pub predicted: [Vec<f64>; 3],
    /// Distance from the training motions, in half ranges of the inputs.
    pub distance: Vec<f64>,
}

/// The forecasts of all runs of the `held` paths, with the bounds `trust` and `axes` of a region with `inputs`; `stride` is that of the windows.
pub fn forecasts(
    data: &Data,
    inputs: &[InputGroup],
    held: &[&Answers],
    (trust, axes): (&[[f64; 2]], &[Axis; 3]),
    stride: usize,
) -> Vec<Forecast> {
    let mut all: Vec<Forecast> =
        data.runs.iter().map(|run| Forecast { name: run.name.clone(), ..Forecast::default() }).collect();
    for one in held {
        let trained = data.windows(stride, 0, |run| data.folds[run] != one.fold);
        let region = Region { trust: trust.to_vec(), ..around(data, inputs, &trained) };
        for (window, predicted) in one.windows.iter().zip(&one.predicted) {
            let forecast = &mut all[window.run];
            let distance = region.distance(&data.row(inputs, window.run, window.target));
            let left = data.residual(window.run, window.target);
            forecast.t.push(window.target as f64 * data.runs[window.run].period);
            forecast.distance.push(distance);
            for axis in 0..3 {
                forecast.tracked[axis].push(left[axis]);
                forecast.predicted[axis]
                    .push(axes[axis].bounded(predicted[axis]) * region.trust_at(distance));
            }
        }
    }
    all
}
