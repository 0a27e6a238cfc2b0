//! The weight file of a learned remainder: JSON that says on which machine, model and conditions it was trained, its error there, and where it
//! may be used.
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
/// Version written, and the only one read.
pub const VERSION: u64 = 2;

/// Why a weight file cannot be used.
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
    /// It is not JSON, or a field is missing, unknown or of another type (line and column are given).
    #[error("{path}: not a weight file: {}; give one that freeplay train --recording wrote", plain_words(&source.to_string()))]
    Syntax {
        /// The file.
        path: String,
        /// Error of the parser, with line and column.
        source: serde_json::Error,
    },
    /// It is JSON, but something else, or of another version.
    #[error("{path}: it says {found}, not {FORMAT:?} version {VERSION}: train again with this program")]
    OtherFormat {
        /// The file.
        path: String,
        /// Format and version found.
        found: String,
    },
    /// Its numbers don't fit together.
    #[error("the weights don't fit together: {what}; train again or restore the file")]
    Inconsistent {
        /// The contradiction, in words.
        what: String,
    },
    /// The network in it cannot be used.
    #[error(transparent)]
    Network(#[from] WeightFileError),
    /// It was trained for another machine, model or way of running.
    #[error(
        "the weights are for {what} {trained}, this run has {wanted}: train for it; they were made by: {command}"
    )]
    Other {
        /// The property that differs: arm, model, mode, rate or feedback.
        what: &'static str,
        /// Its value in the weight file.
        trained: String,
        /// Its value in this run.
        wanted: String,
        /// The command that made them.
        command: String,
    },
}

/// The machine, model and feedback to which a remainder belongs.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Machine {
    /// Name of the arm.
    pub arm: String,
    /// Hash of what its dynamics are made of ([`crate::identity::identity`]).
    pub arm_hash: String,
    /// Hash of the model whose remainder it is, arm and effects ([`crate::identity::model_identity`]).
    pub model_hash: String,
    /// The mode in which the joints move: torque, driven or servo.
    pub mode: TaskMode,
    /// Ticks per second, 1/s.
    pub rate: f64,
    /// Feedback of the joints: what a torque without a name comes to depends on it.
    pub gains: Gains,
}

/// One recording that trained.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Condition {
    /// Name of the recording.
    pub name: String,
    /// Its duration, s.
    pub duration: f64,
    /// RMS of what the model leaves along x, y and z, µm.
    pub rms_um: [f64; 3],
}

/// The learned remainder along one axis of the base frame, and the bounds of its use.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Axis {
    /// Least and greatest remainder in training, m, no farther from zero than they were seen: the answer stays between them.
    pub lowest: f64,
    /// See above.
    pub highest: f64,
    /// Share of the answer that held-out paths confirmed, 0 to 1; 0 where they did not.
    pub share: f64,
    /// RMS of the remainder on held-out paths, and of what was left of it, µm.
    pub rms_um: f64,
    /// See above.
    pub left_um: f64,
    /// Correlation of answer and remainder there; none where one of them is constant.
    pub r: Option<f64>,
}

impl Axis {
    /// The answer `said`, m, within what was proved.
    pub fn bounded(&self, said: f64) -> f64 {
        // Not `clamp`: it panics for bounds that are no numbers.
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

/// A simulated run that decided.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Rehearsed {
    /// The path: that of this recording, which did not train the weights of the run.
    pub name: String,
    /// RMS of the tool's deviation after the start without the network, mm.
    pub without_mm: f64,
    /// With it.
    pub with_mm: f64,
}

/// The proof by simulated runs: a network without it moves nothing.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Receipt {
    /// True if the runs were better with the network, not by chance, and no run was worse.
    pub proved: bool,
    /// Probability of runs this much better or more if the network were of no use, 0 to 1.
    pub chance: f64,
    /// The runs.
    pub runs: Vec<Rehearsed>,
}

impl Default for Receipt {
    /// No runs, nothing proved.
    fn default() -> Self {
        Receipt { proved: false, chance: 1.0, runs: Vec::new() }
    }
}

/// A learned remainder, the recordings that trained it and the region of its use: a weight file without the network and its receipt.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Learned {
    /// The machine to which the remainder belongs.
    pub machine: Machine,
    /// The command that made it.
    pub command: String,
    /// The recordings that trained the network.
    pub conditions: Vec<Condition>,
    /// The groups of signals that are the network's inputs.
    pub inputs: Vec<InputGroup>,
    /// Axes x, y and z of the base frame.
    pub axes: [Axis; 3],
    /// Where it may be used.
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
    /// A file of `network` and what it `learned`, not proved yet.
    ///
    /// # Errors
    /// [`WeightError::Inconsistent`] for parts that don't fit together.
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
    /// [`WeightError::Inconsistent`] for numbers that JSON cannot hold.
    pub fn to_json(&self) -> Result<String, WeightError> {
        let text = serde_json::to_string_pretty(self);
        text.map(|text| text + "\n")
            .map_err(|error| WeightError::Inconsistent { what: plain_words(&error.to_string()) })
    }

    /// The network, if all numbers fit together.
    ///
    /// # Errors
    /// See [`WeightError`].
    pub fn narx(&self) -> Result<Narx, WeightError> {
        let inconsistent = |what: &str| Err(WeightError::Inconsistent { what: what.to_owned() });
        let narx = Narx::from_json(&self.network.to_string(), "the network of the weights")?;
        let layout = narx.layout();
        let is_plain = layout.input_lags.is_empty() && layout.output_lags.is_empty();
        if !(is_plain && layout.horizon == 1 && layout.input_at_target) {
            return inconsistent("the network looks at other instants than the predicted one");
        }
        if narx.output_names().len() != 3 {
            return inconsistent("the network has not three outputs");
        }
        let (learned, region) = (&self.learned, &self.learned.region);
        if !region.inputs.starts_with(&learned.inputs) || !region.is_usable() {
            return inconsistent("the region has inputs or numbers that cannot be");
        }
        if !learned.axes.iter().all(Axis::is_usable) {
            return inconsistent("the bounds of an axis cannot be");
        }
        Ok(narx)
    }

    /// Whether the file is for `machine`, whose arm has `joints` joints.
    ///
    /// # Errors
    /// [`WeightError::Other`] names the first that differs.
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

/// Names of the numbers of `groups` for an arm of `joints` joints.
pub fn input_names(groups: &[InputGroup], joints: usize) -> Vec<String> {
    groups.iter().flat_map(|group| group.names(joints)).collect()
}

impl Machine {
    /// What a run of `task` with the model of these hashes is.
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
