//! Runs as training series: the inputs of the paper's network, at its 125 Hz.

use freeplay_harness::scenario::Drive;
use freeplay_path::PathKind;
use freeplay_predictor::{Layout, Series};
use freeplay_terminal::exit::Failure;
use serde::Serialize;

use super::case::{CLEARANCES, Case, lapping};
use super::trace::{Runs, Trace};
use crate::simulation::TICK;

/// Ticks of a sample: 125 Hz, the paper's 750 samples in 6 s.
pub const STRIDE: usize = 8;
/// Torque and path, the inputs of the paper's network.
const INPUTS: [&str; 9] = ["tau1", "tau2", "tau3", "tau4", "tau5", "tau6", "path_x", "path_y", "path_z"];
/// Constants that distinguish the runs of several clearances: size, number and place of the joints with play.
const CONSTANTS: [&str; 3] = ["clearance", "joints_with_play", "joint"];
/// The deviation, mm.
const OUTPUTS: [&str; 3] = ["x", "y", "z"];

/// The runs that train a network.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum TrainingRuns {
    /// One run, c = 0.6 mm.
    Single,
    /// The runs of all clearances, distinguished by constant inputs: the paper's network.
    Clearances,
    /// Three laps, c = 0.6 mm.
    Laps,
}

impl TrainingRuns {
    /// In words.
    pub fn name(self) -> &'static str {
        match self {
            Self::Single => "c = 0.6 mm",
            Self::Clearances => "c = 0.2, 0.4, 0.6 mm",
            Self::Laps => "3 laps, c = 0.6 mm",
        }
    }

    /// The runs.
    pub fn cases(self, drive: Drive, path: PathKind, period: f64) -> Vec<Case> {
        match self {
            Self::Single => vec![Case::new(drive, path, period, CLEARANCES[2])],
            Self::Clearances => CLEARANCES.map(|c| Case::new(drive, path, period, c)).to_vec(),
            Self::Laps => vec![lapping(drive, path, period)],
        }
    }
}

/// Series for training, with the physics prediction for them.
pub struct Dataset {
    /// Inputs and outputs.
    pub series: Series,
    /// The quasi-static deviation for each run, row-major, mm.
    pub physics: Vec<Vec<f64>>,
    /// Samples of a lap; `None` for a single lap.
    pub lap: Option<usize>,
}

/// The paper's regressors: u(t), u(t−1), u(t−2), y(t−1), y(t−2) (Eq. 10).
///
/// The torque at the predicted instant contains the contact force of that instant: a controller would not have it.
pub fn layout() -> Layout {
    Layout { input_lags: vec![0, 1], output_lags: vec![0, 1], horizon: 1, input_at_target: true }
}

impl Dataset {
    /// The series of `pool`; `None` if a run is missing.
    ///
    /// # Errors
    /// NaN or infinity in a sample.
    pub fn new(
        runs: &Runs,
        pool: TrainingRuns,
        (drive, path): (Drive, PathKind),
        period: f64,
    ) -> Result<Option<Self>, Failure> {
        let told_apart = pool == TrainingRuns::Clearances;
        let names: Vec<&str> =
            INPUTS.into_iter().chain(CONSTANTS.into_iter().filter(|_| told_apart)).collect();
        let mut series = Series::new(&names, &OUTPUTS).map_err(Failure::internal)?;
        let mut physics = Vec::new();
        for case in pool.cases(drive, path, period) {
            let Some(run) = runs.get(&case) else { return Ok(None) };
            let constants = [case.clearance, 1.0, 5.0];
            let constants = if told_apart { &constants[..] } else { &[] };
            let (inputs, outputs, predicted) = rows(&run.trace, constants);
            series.push_run(&case.situation(), inputs, outputs).map_err(Failure::internal)?;
            physics.push(predicted);
        }
        let lap = (pool == TrainingRuns::Laps).then(|| (period / TICK).round() as usize / STRIDE);
        Ok(Some(Self { series, physics, lap }))
    }
}

/// Inputs, outputs and predictions of a run, row-major, without the last tick, which repeats the first of the next lap.
fn rows(trace: &Trace, constants: &[f64]) -> (Vec<f64>, Vec<f64>, Vec<f64>) {
    let (mut inputs, mut outputs, mut predicted) = (Vec::new(), Vec::new(), Vec::new());
    for tick in (0..trace.ticks().saturating_sub(1)).step_by(STRIDE) {
        inputs.extend(trace.torque.iter().map(|joint| joint[tick]));
        inputs.extend(trace.path.iter().map(|axis| axis[tick]));
        inputs.extend(constants);
        outputs.extend(trace.deviation.iter().map(|axis| axis[tick]));
        predicted.extend(trace.predicted.iter().map(|axis| axis[tick]));
    }
    (inputs, outputs, predicted)
}
