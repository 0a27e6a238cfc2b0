//! The result of a training.

use freeplay_controller::remainder::{Receipt, WeightFile};
use serde::Serialize;

use crate::forecast::Forecast;
use crate::held_out::Tried;
use crate::rehearsal::DeviationCurve;
use crate::selection::is_lower;

/// Result of a training.
#[derive(Debug, Serialize)]
pub struct Trained {
    /// The weights, with their receipt.
    #[serde(skip)]
    pub file: WeightFile,
    /// Text of the chosen structure.
    pub structure: String,
    /// Error on each held-out path: the logarithm of the mean square of the residual over all axes, m².
    #[serde(skip)]
    pub left_of_paths: Vec<f64>,
    /// Predictors tried on held-out paths, the baselines first.
    pub tried: Vec<Tried>,
    /// The proof by simulated runs.
    pub receipt: Receipt,
    /// Forecasts of held-out paths.
    #[serde(skip)]
    pub forecasts: Vec<Forecast>,
    /// The simulated runs of the proof.
    #[serde(skip)]
    pub courses: Vec<DeviationCurve>,
}

impl Trained {
    /// Returns true if the errors on held-out paths are lower than those of `other`, which was trained on recordings of the same paths, by the rule for inputs:
    /// by more than one standard error of the paired differences. A result without a proof never has lower errors, and a result with a proof always has lower
    /// ones than it. The simulated runs are not comparable, because each training has its own plant.
    pub fn leaves_less_than(&self, other: &Self) -> bool {
        self.receipt.proved && (!other.receipt.proved || is_lower(&self.left_of_paths, &other.left_of_paths))
    }

    /// Text of the verdict: used or not, with the reason.
    pub fn verdict_in_words(&self) -> &'static str {
        if self.receipt.proved {
            "proved: runs with this model use the network"
        } else if self.receipt.runs.is_empty() {
            "not used: the held-out paths do not confirm the network"
        } else {
            "not used: one of the simulated runs was worse with the network, or chance alone could explain the improvement"
        }
    }
}
