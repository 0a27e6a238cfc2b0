//! The result of a training.

use freeplay_controller::remainder::{Receipt, WeightFile};
use serde::Serialize;

use crate::forecast::Forecast;
use crate::held_out::Tried;
use crate::rehearsal::DeviationCurve;
use crate::selection::is_lower;

/// What a training came to.
#[derive(Debug, Serialize)]
pub struct Trained {
    /// The weights, with their receipt.
    #[serde(skip)]
    pub file: WeightFile,
    /// What was chosen, in words.
    pub structure: String,
    /// What is left of each held-out path: the logarithm of the mean square over all axes, m².
    #[serde(skip)]
    pub left_of_paths: Vec<f64>,
    /// What was tried on held-out paths, the baselines first.
    pub tried: Vec<Tried>,
    /// The proof by simulated runs.
    pub receipt: Receipt,
    /// Forecasts of held-out paths.
    #[serde(skip)]
    pub forecasts: Vec<Forecast>,
    /// The simulated runs that decided.
    #[serde(skip)]
    pub courses: Vec<DeviationCurve>,
}

impl Trained {
    /// Whether less is left of held-out paths than by `other`, which was learned from recordings of the same paths, by the rule by which inputs are taken: by more than one
    /// standard error of the paired differences. What is not proved leaves nothing less, and what is proved less than that. The simulated runs can't be
    /// compared: those of either have a plant of their own.
    pub fn leaves_less_than(&self, other: &Self) -> bool {
        self.receipt.proved && (!other.receipt.proved || is_lower(&self.left_of_paths, &other.left_of_paths))
    }

    /// Whether it is used, and why.
    pub fn verdict_in_words(&self) -> &'static str {
        if self.receipt.proved {
            "proved: runs with this model use it"
        } else if self.receipt.runs.is_empty() {
            "not used: held-out paths confirm nothing of what was learned"
        } else {
            "not used: one of the simulated runs was worse with it, or chance alone could have made them better"
        }
    }
}
