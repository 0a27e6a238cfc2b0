//! The weight file of a learned remainder: JSON with the machine, model and conditions of its training, its error there, and its
//! region of validity.
//!
//! ```text
//! { "format": "freeplay.remainder", "version": 2,
//!   "learned": {
//!     "machine": { "arm": …, "arm_hash": …, "model_hash": …, "mode": "torque", "rate": …, "gains": {…} },
//!     "command": …, "conditions": [ { "name": …, "duration": …, "rms_um": […] } ],
//!     "inputs": ["position", …], "axes": [ three: lowest, highest, share, rms_um, left_um, r ],
//!     "region": { "inputs": […], "gain": […], "centres": [[…]], "trust": [[distance, share]] } },
//!   "network": { a freeplay.narx file },
//!   "receipt": { "proved": …, "chance": …, "runs": [ { "name": …, "without_mm": …, "with_mm": … } ] } }
//! ```

use std::path::Path;

use freeplay_predictor::Narx;
use freeplay_predictor::weight_file::WeightFileError;
use freeplay_storage::plain_words;
use serde::{Deserialize, Serialize};
use thiserror::Error;

use crate::remainder::{InputGroup, Region};
use crate::task::{Gains, Task, TaskMode};

/// Name of the format.
pub const FORMAT: &str = "freeplay.remainder";
/// Version of written files; the reader accepts no other.
pub const VERSION: u64 = 2;

/// Reasons why a weight file cannot be used.
#[derive(Debug, Error)]
pub enum WeightError {
    /// The file cannot be read.
    #[error("{path}: {source}: check the path; freeplay train makes such a file")]
    Unreadable {
        /// The file.
        path: String,
        /// Error of the operating system.
        source: std::io::Error,
    },
    /// The file is not JSON, or a field is missing, unknown or of another type (the message gives line and column).
    #[error("{path}: not a weight file: {}; give one that freeplay train --recording wrote", plain_words(&source.to_string()))]
    Syntax {
        /// The file.
        path: String,
        /// Error of the parser, with line and column.
        source: serde_json::Error,
    },
    /// The file is JSON of another format or version.
    #[error("{path}: the format is {found}, not {FORMAT:?} version {VERSION}: train again with this program")]
    OtherFormat {
        /// The file.
        path: String,
        /// Format and version found.
        found: String,
    },
    /// The numbers of the file contradict each other.
    #[error("the weights don't fit together: {what}; train again or restore the file")]
    Inconsistent {
        /// The contradiction, in words.
        what: String,
    },
    /// The network in the file cannot be used.
    #[error(transparent)]
    Network(#[from] WeightFileError),
    /// The weights were trained for another machine, model, mode, rate or feedback.
    #[error(
        "the weights are for {what} {trained}, this run has {wanted}: train for it; they were made by: {command}"
    )]
    Other {
        /// The property that differs: arm, model, mode, rate or feedback.
        what: &'static str,
        /// Value of the property in the weight file.
        trained: String,
        /// Value of the property in this run.
        wanted: String,
        /// The command that made the weights.
        command: String,
    },
}

/// Machine, model and feedback to which a remainder belongs.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Machine {
    /// Name of the arm.
    pub arm: String,
    /// Hash of the dynamics of the arm ([`crate::identity::identity`]).
    pub arm_hash: String,
    /// Hash of the model that the remainder complements, arm and effects ([`crate::identity::model_identity`]).
    pub model_hash: String,
    /// The mode in which the joints move: torque, driven or servo.
    pub mode: TaskMode,
    /// Ticks per second, 1/s.
    pub rate: f64,
    /// Feedback of the joints; the deviation by an unmodelled torque depends on it.
    pub gains: Gains,
}

/// One training recording.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Condition {
    /// Name of the recording.
    pub name: String,
    /// Duration of the recording, s.
    pub duration: f64,
    /// RMS of the residual of the model along x, y and z, µm.
    pub rms_um: [f64; 3],
}

/// The learned remainder along one axis of the base frame, and the bounds of its use.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Axis {
    /// Least remainder in training, m, limited to zero or below; the answer stays between the two limits.
    pub lowest: f64,
    /// Greatest remainder in training, m, limited to zero or above.
    pub highest: f64,
    /// Share of the answer that held-out paths confirmed, 0 to 1; 0 if they confirmed none.
    pub share: f64,
    /// RMS of the remainder on held-out paths, µm.
    pub rms_um: f64,
    /// RMS on held-out paths after subtracting the answer, µm.
    pub left_um: f64,
    /// Correlation of answer and remainder on held-out paths; `None` if one of them is constant.
    pub r: Option<f64>,
}

impl Axis {
    /// The network's output `said`, m, limited to the range of the training and scaled by the confirmed share.
    pub fn bounded(&self, said: f64) -> f64 {
        // `clamp` would panic for NaN bounds; `max` and `min` do not.
        said.max(self.lowest).min(self.highest) * self.share
    }

    fn is_usable(&self) -> bool {
        let bounds = [self.lowest, self.highest, self.share];
        bounds.iter().all(|bound| bound.is_finite())
            && self.lowest <= 0.0
            && self.highest >= 0.0
            && (0.0..=1.0).contains(&self.share)
    }
}

/// A simulated run of the proof.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Rehearsed {
    /// Name of the recording whose path the run follows; this recording did not train the weights of the run.
    pub name: String,
    /// RMS of the tool's deviation after the start without the network, mm.
    pub without_mm: f64,
    /// RMS of the tool's deviation after the start with the network, mm.
    pub with_mm: f64,
}

/// The proof by simulated runs. A network without a proof has no effect.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Receipt {
    /// True if the runs were significantly better with the network and no run was worse.
    pub proved: bool,
    /// p-value: probability of an improvement at least as large if the network had no effect, 0 to 1.
    pub chance: f64,
    /// The runs.
    pub runs: Vec<Rehearsed>,
}

impl Default for Receipt {
    /// A receipt without runs and without a proof.
    fn default() -> Self {
        Receipt { proved: false, chance: 1.0, runs: Vec::new() }
    }
}

/// A learned remainder, its training recordings and its region of validity: a weight file without the network and its receipt.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Learned {
    /// The machine to which the remainder belongs.
    pub machine: Machine,
    /// The command that made the weights.
    pub command: String,
    /// The recordings that trained the network.
    pub conditions: Vec<Condition>,
    /// The groups of signals that are the inputs of the network.
    pub inputs: Vec<InputGroup>,
    /// Axes x, y and z of the base frame.
    pub axes: [Axis; 3],
    /// Region of validity.
    pub region: Region,
}

/// The file; see the module.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct WeightFile {
    format: String,
    version: u64,
    /// The learned remainder and the bounds of its use.
    pub learned: Learned,
    network: serde_json::Value,
    /// The proof by simulated runs.
    pub receipt: Receipt,
}

impl WeightFile {
    /// Creates a file of `network` and `learned`, without a proof.
    ///
    /// # Errors
    /// [`WeightError::Inconsistent`] for parts that contradict each other.
    pub fn new(network: &Narx, learned: Learned) -> Result<WeightFile, WeightError> {
        let inconsistent =
            |error: serde_json::Error| WeightError::Inconsistent { what: plain_words(&error.to_string()) };
        let file = WeightFile {
            format: FORMAT.to_owned(),
            version: VERSION,
            learned,
            network: serde_json::from_str(&network.to_json()).map_err(inconsistent)?,
            receipt: Receipt::default(),
        };
        file.narx()?;
        Ok(file)
    }

    /// Reads the file `path`.
    ///
    /// # Errors
    /// See [`WeightError`].
    pub fn load(path: &Path) -> Result<WeightFile, WeightError> {
        let origin = path.display().to_string();
        let text = freeplay_storage::read_text(path)
            .map_err(|error| WeightError::Unreadable { path: origin.clone(), source: error.into() })?;
        WeightFile::parse(&text, &origin)
    }

    /// Reads the text of a file; `path` names it in errors.
    ///
    /// # Errors
    /// See [`WeightError`].
    pub fn parse(text: &str, path: &str) -> Result<WeightFile, WeightError> {
        #[derive(Deserialize)]
        struct Header {
            format: Option<serde_json::Value>,
            version: Option<serde_json::Value>,
        }
        let syntax = |source| WeightError::Syntax { path: path.to_owned(), source };
        let Header { format, version } = serde_json::from_str(text).map_err(syntax)?;
        if format != Some(FORMAT.into()) || version != Some(VERSION.into()) {
            let said = |value: Option<serde_json::Value>| {
                value.map_or_else(|| "nothing".to_owned(), |value| value.to_string())
            };
            let found = format!("{} version {}", said(format), said(version));
            return Err(WeightError::OtherFormat { path: path.to_owned(), found });
        }
        let file: WeightFile = serde_json::from_str(text).map_err(syntax)?;
        file.narx()?;
        Ok(file)
    }

    /// The text of the file.
    ///
    /// # Errors
    /// [`WeightError::Inconsistent`] for numbers that JSON cannot express.
    pub fn to_json(&self) -> Result<String, WeightError> {
        let text = serde_json::to_string_pretty(self);
        text.map(|text| text + "\n")
            .map_err(|error| WeightError::Inconsistent { what: plain_words(&error.to_string()) })
    }

    /// The network, if all numbers are consistent.
    ///
    /// # Errors
    /// See [`WeightError`].
    pub fn narx(&self) -> Result<Narx, WeightError> {
        let inconsistent = |what: &str| Err(WeightError::Inconsistent { what: what.to_owned() });
        let narx = Narx::from_json(&self.network.to_string(), "the network of the weights")?;
        let layout = narx.layout();
        let is_plain = layout.input_lags.is_empty() && layout.output_lags.is_empty();
        if !(is_plain && layout.horizon == 1 && layout.input_at_target) {
            return inconsistent("the network uses other instants than the predicted one");
        }
        if narx.output_names().len() != 3 {
            return inconsistent("the network must have three outputs");
        }
        let (learned, region) = (&self.learned, &self.learned.region);
        if !region.inputs.starts_with(&learned.inputs) || !region.is_usable() {
            return inconsistent("the region has impossible inputs or numbers");
        }
        if !learned.axes.iter().all(Axis::is_usable) {
            return inconsistent("the bounds of an axis are impossible");
        }
        Ok(narx)
    }

    /// Checks that the file is for `machine`, whose arm has `joints` joints.
    ///
    /// # Errors
    /// [`WeightError::Other`] names the first property that differs.
    pub fn check(&self, machine: &Machine, joints: usize) -> Result<(), WeightError> {
        let (own, wanted) = (&self.learned.machine, machine);
        let arm = |machine: &Machine| format!("`{}` ({})", machine.arm, machine.arm_hash);
        let way = |machine: &Machine| {
            let Gains { natural_frequency, damping_ratio } = machine.gains;
            format!(
                "mode {:?} at {} Hz, natural frequency {natural_frequency} rad/s, damping ratio {damping_ratio}",
                machine.mode, machine.rate
            )
        };
        let other = |what, trained: String, wanted: String| {
            let command = self.learned.command.clone();
            Err(WeightError::Other { what, trained, wanted, command })
        };
        if own.arm_hash != wanted.arm_hash {
            return other("the arm", arm(own), arm(wanted));
        }
        if own.model_hash != wanted.model_hash {
            return other("the model", own.model_hash.clone(), wanted.model_hash.clone());
        }
        if (own.mode, own.rate, own.gains) != (wanted.mode, wanted.rate, wanted.gains) {
            return other("a run in", way(own), way(wanted));
        }
        let (found, names) = (self.narx()?, input_names(&self.learned.inputs, joints));
        if found.input_names() != names {
            return other("the inputs", found.input_names().join(", "), names.join(", "));
        }
        let (found, wanted) =
            (self.learned.region.gain.len(), input_names(&self.learned.region.inputs, joints).len());
        if found != wanted {
            return other("a region of", format!("{found} inputs"), format!("{wanted}"));
        }
        Ok(())
    }
}

/// Names of the input channels of `groups` for an arm of `joints` joints.
pub fn input_names(groups: &[InputGroup], joints: usize) -> Vec<String> {
    groups.iter().flat_map(|group| group.names(joints)).collect()
}

impl Machine {
    /// The machine of a run of `task`, with the hashes of its arm and model.
    pub fn of(arm: &str, arm_hash: String, model_hash: String, task: &Task) -> Machine {
        Machine {
            arm: arm.to_owned(),
            arm_hash,
            model_hash,
            mode: task.mode,
            rate: task.rate,
            gains: task.gains,
        }
    }
}
