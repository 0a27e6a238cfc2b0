//! The paper's network trained on the runs, compared with predictions that need no training.
//!
//! 4 hidden layers of 10 sigmoid units, tapped delays of two samples, Levenberg–Marquardt with MATLAB's rule, 50/20/30 % for
//! The scores are one sample ahead on measured deviations (open loop) and in free run (closed loop). The baselines predict the same windows.

use std::ops::ControlFlow;

use freeplay_harness::scenario::Drive;
use freeplay_path::PathKind;
use freeplay_predictor::levenberg_marquardt::Settings;
use freeplay_predictor::metrics::{Parts, Score, by_part};
use freeplay_predictor::split::{Fractions, at_random, by_block};
use freeplay_predictor::training::Recipe;
use freeplay_predictor::window::windows;
use freeplay_predictor::{Activation, Arx, Narx, Provenance, Split, Window, baselines, train};
use freeplay_terminal::exit::Failure;
use serde::Serialize;

use super::dataset::{Dataset, TrainingRuns, layout};
use super::free_run::{free_runs, starts};

/// The paper's hidden layers.
pub const HIDDEN: [usize; 4] = [10; 4];

/// Distribution of the windows over the parts.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Cut {
    /// At random, the default of MATLAB: the test lies between training samples.
    Random,
    /// In blocks of time: the test block comes after the training blocks.
    Block,
}

impl Cut {
    /// In words.
    pub fn name(self) -> &'static str {
        match self {
            Self::Random => "random",
            Self::Block => "block",
        }
    }
}

/// One training experiment.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Experiment {
    /// Drive of the joints.
    pub drive: Drive,
    /// Shape of the path.
    pub path: PathKind,
    /// Time of a lap, s.
    pub period: f64,
    /// Training data.
    pub pool: TrainingRuns,
    /// Distribution of the windows.
    pub cut: Cut,
}

/// Scores of one predictor: for each part, the axes x, y and z in mm.
pub type Scores = Parts<Vec<Score>>;

/// A predictor that needs no network.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Baseline {
    /// Its name.
    pub name: &'static str,
    /// One sample ahead.
    pub open: Scores,
    /// In free run.
    pub closed: Scores,
}

/// One training with its results.
#[derive(Clone, Debug, Serialize)]
pub struct Trial {
    /// Seed of split and start weights.
    pub seed: u64,
    /// Epochs until the best weights.
    pub epochs: usize,
    /// One sample ahead.
    pub open: Scores,
    /// In free run.
    pub closed: Scores,
    /// The baselines on the same windows.
    pub baselines: Vec<Baseline>,
}

/// All trainings for one question.
#[derive(Clone, Debug, Serialize)]
pub struct Study {
    /// The question.
    pub setting: Experiment,
    /// Windows that train, validate and test.
    pub windows: [usize; 3],
    /// Weights of the network.
    pub weights: usize,
    /// The trainings.
    pub trials: Vec<Trial>,
    /// Predictions of the first training, for figures.
    #[serde(skip)]
    pub shown: Prediction,
}

/// Prediction and truth of the last run of a dataset, one sample ahead.
#[derive(Clone, Debug, Default)]
pub struct Prediction {
    /// Sample numbers.
    pub sample: Vec<usize>,
    /// True deviation of each axis, mm.
    pub truth: [Vec<f64>; 3],
    /// Predicted deviation of each axis, mm.
    pub predicted: [Vec<f64>; 3],
    /// True if the sample belongs to the test windows.
    pub tested: Vec<bool>,
}

/// Trains on `data` with the seeds 1 to `seeds`, for at most `epochs` epochs.
///
/// # Errors
/// Data that the network can't be trained on.
pub fn study(setting: Experiment, data: &Dataset, seeds: u64, epochs: usize) -> Result<Study, Failure> {
    let all = windows(&data.series, layout().memory(), 1).map_err(Failure::internal)?;
    let mut study =
        Study { setting, windows: [0; 3], weights: 0, trials: Vec::new(), shown: Prediction::default() };
    for seed in 1..=seeds {
        let split = match setting.cut {
            Cut::Random => at_random(&all, Fractions::PAPER, seed),
            Cut::Block => by_block(&all, Fractions::PAPER, layout().memory() + 1),
        };
        let split = split.map_err(Failure::internal)?;
        let recipe = Recipe {
            least_ranges: Vec::new(),
            layout: layout(),
            hidden: HIDDEN.to_vec(),
            activation: Activation::Tanh,
            seed,
            settings: Settings { epochs, ..Settings::default() },
            decay: false,
        };
        let trained =
            train(&data.series, &split, &recipe, Provenance::default(), |_| ControlFlow::Continue(()))
                .map_err(Failure::internal)?;
        let narx = &trained.narx;
        study.windows = [split.train.len(), split.validation.len(), split.test.len()];
        study.weights = narx.network().weights().len();
        study.trials.push(Trial {
            seed,
            epochs: trained.outcome.best_epoch,
            open: by_part(&data.series, &split, |windows| narx.predict(&data.series, windows))
                .map_err(Failure::internal)?,
            closed: closed(setting.cut, data, &split, &all, |run, start, steps| {
                narx.free_run(&data.series, run, start, steps).map_err(Failure::internal)
            })?,
            baselines: all_baselines(setting.cut, data, &split, &all)?,
        });
        if seed == 1 {
            study.shown = shown(narx, data, &all, &split)?;
        }
    }
    Ok(study)
}

/// Scores of a free run: over the whole record if the split is random, else over each block anew.
fn closed(
    cut: Cut,
    data: &Dataset,
    split: &Split,
    all: &[Window],
    mut run_free: impl FnMut(usize, usize, usize) -> Result<Vec<f64>, Failure>,
) -> Result<Scores, Failure> {
    let whole = match cut {
        Cut::Random => Some(free_runs(&data.series, all, &mut run_free)?),
        Cut::Block => None,
    };
    by_part(&data.series, split, |windows| match &whole {
        Some(whole) => Ok(whole.of(windows)),
        None => Ok(free_runs(&data.series, windows, &mut run_free)?.of(windows)),
    })
}

/// A predictor of the targets of windows, row-major.
type Predict<'a> = &'a dyn Fn(&[Window]) -> Result<Vec<f64>, Failure>;

/// Persistence, ridge ARX, quasi-static, and, with several laps, the previous lap.
fn all_baselines(cut: Cut, data: &Dataset, split: &Split, all: &[Window]) -> Result<Vec<Baseline>, Failure> {
    let Dataset { series, physics, lap } = data;
    let arx = Arx::fit(series, split, &layout()).map_err(Failure::internal)?;
    // In free run the latest measurement is the one before the run began.
    let last_measured = |windows: &[Window]| match cut {
        Cut::Random => starts(windows, all),
        Cut::Block => starts(windows, windows),
    };
    let scored = |predict: Predict| by_part(series, split, predict);
    let open_and_closed = |name, predict: Predict| {
        let closed = scored(&|windows| predict(&last_measured(windows)))?;
        Ok::<_, Failure>(Baseline { name, open: scored(predict)?, closed })
    };
    let mut found = vec![
        open_and_closed("persistence", &|windows| Ok(baselines::persistence(series, windows)))?,
        Baseline {
            name: "ridge ARX",
            open: scored(&|windows| arx.predict(series, windows).map_err(Failure::internal))?,
            closed: closed(cut, data, split, all, |run, start, steps| {
                super::free_run::linear(&arx, series, run, start, steps)
            })?,
        },
        Baseline {
            name: "quasi-static",
            open: scored(&|windows| {
                baselines::physics_with_residual(series, windows, physics).map_err(Failure::internal)
            })?,
            // Without measurements there is no residual to add.
            closed: scored(&|windows| Ok(targets_of(physics, windows)))?,
        },
    ];
    if let Some(lap) = lap.filter(|lap| split.test.iter().all(|window| window.target >= *lap)) {
        // The earlier parts lack a previous lap: they get the persistence forecast, and no verdict uses them.
        found.push(open_and_closed("previous lap", &|windows| {
            Ok(baselines::previous_lap(series, windows, lap)
                .unwrap_or_else(|_| baselines::persistence(series, windows)))
        })?);
    }
    Ok(found)
}

/// The physics prediction at the windows' targets, row-major.
fn targets_of(physics: &[Vec<f64>], windows: &[Window]) -> Vec<f64> {
    windows.iter().flat_map(|window| &physics[window.run][3 * window.target..][..3]).copied().collect()
}

/// Predictions of `narx` for the last run of the data.
fn shown(narx: &Narx, data: &Dataset, all: &[Window], split: &Split) -> Result<Prediction, Failure> {
    let last = data.series.runs().len() - 1;
    let windows: Vec<Window> = all.iter().filter(|window| window.run == last).copied().collect();
    let predicted = narx.predict(&data.series, &windows).map_err(Failure::internal)?;
    let axis = |values: &dyn Fn(usize) -> f64| (0..windows.len()).map(values).collect::<Vec<f64>>();
    let tested: std::collections::HashSet<Window> = split.test.iter().copied().collect();
    Ok(Prediction {
        sample: windows.iter().map(|window| window.target).collect(),
        truth: std::array::from_fn(|c| axis(&|row| data.series.output(last, windows[row].target)[c])),
        predicted: std::array::from_fn(|c| axis(&|row| predicted[3 * row + c])),
        tested: windows.iter().map(|window| tested.contains(window)).collect(),
    })
}

/// Sum of the axes' mean squared errors, mm².
pub fn total(scores: &[Score]) -> f64 {
    scores.iter().map(|score| score.mse).sum()
}

/// The middle of `values`; NaN for none.
pub fn median(values: impl IntoIterator<Item = f64>) -> f64 {
    let mut sorted: Vec<f64> = values.into_iter().collect();
    sorted.sort_by(f64::total_cmp);
    match sorted.len() {
        0 => f64::NAN,
        count if count % 2 == 1 => sorted[count / 2],
        count => 0.5 * (sorted[count / 2 - 1] + sorted[count / 2]),
    }
}

impl Trial {
    /// The best baseline on the test windows, in the given loop: its name and total error, mm².
    pub fn best_baseline(&self, closed: bool) -> (&'static str, f64) {
        let error =
            |baseline: &Baseline| total(if closed { &baseline.closed.test } else { &baseline.open.test });
        let best = self.baselines.iter().min_by(|a, b| error(a).total_cmp(&error(b)));
        best.map_or(("none", f64::NAN), |baseline| (baseline.name, error(baseline)))
    }

    /// The network's total error on the test windows, in the given loop, mm².
    pub fn error(&self, closed: bool) -> f64 {
        total(if closed { &self.closed.test } else { &self.open.test })
    }
}

impl Study {
    /// Median of a number over the trainings.
    pub fn median(&self, number: impl Fn(&Trial) -> f64) -> f64 {
        median(self.trials.iter().map(number))
    }

    /// Skill against the best baseline, 1 − MSE / MSE of the best baseline; median over the trainings.
    pub fn skill(&self, closed: bool) -> f64 {
        self.median(|trial| 1.0 - trial.error(closed) / trial.best_baseline(closed).1)
    }
}
