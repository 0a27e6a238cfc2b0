//! What is collected, as series for the predictor: three views of the same runs.

use freeplay_controller::features::{LARGEST_ERROR, OUTPUTS, REGRESSORS};
use freeplay_predictor::window::{Layout, Window};
use freeplay_predictor::{Narx, Series};
use freeplay_terminal::exit::Failure;

use crate::train::collect::{Collected, Row};

/// Which view.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum View {
    /// What ships: the extractor's regressors as they are (they hold their own past), and the error of the twin's forecast in its own
    /// scale.
    Twin,
    /// A plain NARX: the measured residual to rest in units of c, with lags, and what is known of the load and the journal.
    Plain,
    /// The paper's NARX (Erkaya 2018, Eq. 10): torques, path and clearance, that of the predicted instant included, and the deviation
    /// itself, with two delays.
    Paper,
}

/// Regressors of the plain view, by their place among the extractor's.
const PLAIN: [usize; 7] = [12, 13, 14, 18, 19, 20, 21];
/// One more: a horizon's fall in units of c.
const FALL: &str = "fall";
/// Lags of the plain view, and of the paper's.
const LAGS: [usize; 4] = [0, 1, 2, 3];
const PAPER_LAGS: [usize; 2] = [0, 1];

impl View {
    /// Which samples a prediction `horizon` ticks ahead looks at.
    pub fn layout(self, horizon: usize) -> Layout {
        match self {
            View::Twin => {
                Layout { input_lags: vec![0], output_lags: vec![], horizon, input_at_target: false }
            }
            View::Plain => Layout {
                input_lags: LAGS.to_vec(),
                output_lags: LAGS.to_vec(),
                horizon,
                input_at_target: false,
            },
            View::Paper => Layout {
                input_lags: PAPER_LAGS.to_vec(),
                output_lags: PAPER_LAGS.to_vec(),
                horizon,
                input_at_target: true,
            },
        }
    }

    /// Names of inputs and outputs for an arm of `joints` joints.
    fn names(self, joints: usize) -> [Vec<String>; 2] {
        let owned = |names: &[&str]| names.iter().map(|&name| name.to_owned()).collect::<Vec<_>>();
        match self {
            View::Twin => [owned(&REGRESSORS), owned(&OUTPUTS)],
            View::Plain => {
                let names: Vec<&str> = PLAIN.iter().map(|&at| REGRESSORS[at]).chain([FALL]).collect();
                [owned(&names), owned(&["residual_n", "residual_t"])]
            }
            View::Paper => {
                let torques = (1..=joints).map(|joint| format!("tau{joint}"));
                let others = owned(&["path_x", "path_y", "path_z", "clearance"]);
                [torques.chain(others).collect(), owned(&["x", "y", "z"])]
            }
        }
    }

    /// The runs as a series.
    ///
    /// # Errors
    /// A value that is not finite: run, sample and channel are named.
    pub fn series(self, runs: &[Collected], horizon: usize) -> Result<Series, Failure> {
        let names = self.names(runs.first().map_or(0, |run| run.joints));
        let [inputs, outputs] =
            names.each_ref().map(|names| names.iter().map(String::as_str).collect::<Vec<_>>());
        let mut series = Series::new(&inputs, &outputs).map_err(Failure::internal)?;
        for run in runs {
            let c = run.spec.clearance;
            let mut values = [Vec::new(), Vec::new()];
            for (index, row) in run.rows.iter().enumerate() {
                match self {
                    View::Twin => {
                        values[0].extend(row.regressors);
                        values[1].extend(forecast_error(&run.rows, index, horizon));
                    }
                    View::Plain => {
                        values[0].extend(PLAIN.iter().map(|&at| row.regressors[at]));
                        values[0].push(9.81 * (horizon as f64 * 1e-3).powi(2) / c);
                        values[1].extend([row.regressors[10], row.regressors[11]]);
                    }
                    View::Paper => {
                        values[0].extend(&row.torque[..run.joints]);
                        values[0].extend(row.path);
                        values[0].push(c);
                        values[1].extend(row.deviation);
                    }
                }
            }
            let [inputs, outputs] = values;
            series.push_run(&run.spec.name, inputs, outputs).map_err(Failure::input)?;
        }
        Ok(series)
    }

    /// Where the journal will be, slides, m, for what a model of this view says at `window`.
    pub fn journal(self, runs: &[Collected], window: &Window, said: &[f64]) -> [f64; 2] {
        let run = &runs[window.run];
        let row = &run.rows[window.present];
        let (base, unit) = match self {
            View::Twin => (row.forecast, row.scale),
            View::Plain => (row.rests[1], run.spec.clearance),
            View::Paper => {
                let deviation = nalgebra::Vector3::from_column_slice(&said[..3]);
                return row.directions.map(|slide| slide.dot(&deviation));
            }
        };
        let beyond = Collected::along_slides(row, [said[0] * unit, said[1] * unit]);
        [base[0] + beyond[0], base[1] + beyond[1]]
    }
}

/// Error of the forecast that comes due at `index`, in units of its scale; zero where there was none.
fn forecast_error(rows: &[Row], index: usize, horizon: usize) -> [f64; 2] {
    let Some(made) = index.checked_sub(horizon).map(|at| &rows[at]) else { return [0.0; 2] };
    let journal = rows[index].journal;
    let error = [journal[0] - made.forecast[0], journal[1] - made.forecast[1]];
    Collected::in_contact(made, error).map(|e| (e / made.scale).clamp(-LARGEST_ERROR, LARGEST_ERROR))
}

/// What `model` says for `windows`, as journals.
///
/// # Errors
/// Windows that do not suit the model.
pub fn journals(
    view: View,
    runs: &[Collected],
    series: &Series,
    windows: &[Window],
    model: &Narx,
) -> Result<Vec<[f64; 2]>, Failure> {
    let said = model.predict(series, windows).map_err(Failure::internal)?;
    let outputs = series.outputs();
    Ok(windows
        .iter()
        .zip(said.chunks(outputs))
        .map(|(window, said)| view.journal(runs, window, said))
        .collect())
}
