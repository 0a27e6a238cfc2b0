//! A trained model as a file: JSON with a format name and a version; every number is restored bit for bit.
//!
//! ```text
//! { "format": "freeplay.narx", "version": 1,
//!   "provenance": { "arm": …, "arm_hash": …, "command": … },
//!   "inputs": [names], "outputs": [names],
//!   "layout": { "input_lags": […], "output_lags": […], "horizon": …, "input_at_target": … },
//!   "layers": [regressors, hidden…, outputs], "activation": "tanh" | "logistic",
//!   "input_scaling": { "minimum": […], "gain": […] }, "output_scaling": {…},
//!   "weights": [layer by layer, unit by unit, bias first] }
//! ```

use crate::activation::Activation;
use crate::narx::{Narx, NarxError, Provenance};
use crate::network::{Network, NetworkError};
use crate::scaling::Scaling;
use crate::window::Layout;
use freeplay_storage::plain_words;
use serde::{Deserialize, Serialize};
use std::path::Path;

/// Name of the format.
pub const FORMAT: &str = "freeplay.narx";
/// Version of written files; the reader accepts no other.
pub const VERSION: u64 = 1;

/// Reasons why a weight file cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum WeightFileError {
    /// The file cannot be read or written.
    #[error("{origin}: {source}: check the path and its permissions, or train to make the file")]
    Io {
        /// The file.
        origin: String,
        /// The error of the operating system.
        source: std::io::Error,
    },
    /// The file is not JSON, or a field is missing, unknown or of another type (the message gives line and column).
    #[error("{origin}: not a readable weight file: {}; give one that freeplay train wrote", plain_words(&source.to_string()))]
    Syntax {
        /// The file.
        origin: String,
        /// The error of the parser.
        source: serde_json::Error,
    },
    /// The file is JSON of another format.
    #[error("{origin}: format is `{found}`, not `{FORMAT}`: give a file made by training")]
    OtherFormat {
        /// The file.
        origin: String,
        /// The format found.
        found: String,
    },
    /// The file has another version of the format.
    #[error(
        "{origin}: version {found} of {FORMAT}, but only {VERSION} can be read: train again with this program"
    )]
    OtherVersion {
        /// The file.
        origin: String,
        /// The version found.
        found: u64,
    },
    /// A weight is not a finite number.
    #[error("{origin}: weight {index} is not a finite number: train again or restore the file")]
    NonFiniteWeight {
        /// The file.
        origin: String,
        /// Index in the list, from 0.
        index: usize,
    },
    /// Layer sizes and weights are inconsistent.
    #[error("{origin}: {source}: train again or restore the file")]
    Network {
        /// The file.
        origin: String,
        /// The inconsistency.
        source: NetworkError,
    },
    /// Layout, channels, scaling and network are inconsistent.
    #[error("{origin}: {source}: train again or restore the file")]
    Model {
        /// The file.
        origin: String,
        /// The inconsistency.
        source: NarxError,
    },
}

/// The model was trained for another purpose than its use.
#[derive(Debug, thiserror::Error, PartialEq, Eq)]
pub enum MismatchError {
    /// The model was trained on another arm.
    #[error(
        "the weights were trained on arm `{trained}` (hash {trained_hash}), not on `{wanted}` (hash {wanted_hash}): \
         train for this arm; they were made by: {command}"
    )]
    OtherArm {
        /// Arm of the weights.
        trained: String,
        /// Hash of that arm.
        trained_hash: String,
        /// Required arm.
        wanted: String,
        /// Hash of the required arm.
        wanted_hash: String,
        /// The command that made the weights.
        command: String,
    },
    /// The model was trained on play in another joint.
    #[error(
        "the weights were trained on play in `{trained}`, not in `{wanted}`: train for this joint; they were made by: {command}"
    )]
    OtherJoint {
        /// Joint of the weights.
        trained: String,
        /// Required joint.
        wanted: String,
        /// The command that made the weights.
        command: String,
    },
    /// The model has other channels.
    #[error(
        "the weights have other {kind} channels than the controller: {}: train with this program",
        first_difference(expected, found)
    )]
    OtherChannels {
        /// `input` or `output`.
        kind: &'static str,
        /// Required channels.
        expected: Vec<String>,
        /// Channels of the weights.
        found: Vec<String>,
    },
    /// The model uses other samples.
    #[error(
        "the weights use {}, but the controller uses {}: train with this program",
        in_words(found),
        in_words(expected)
    )]
    OtherLayout {
        /// Required layout.
        expected: Box<Layout>,
        /// Layout of the weights.
        found: Box<Layout>,
    },
}

/// The first difference between two lists of channels.
fn first_difference(expected: &[String], found: &[String]) -> String {
    let differs = |at: &usize| expected.get(*at) != found.get(*at);
    let at = (0..expected.len().max(found.len())).find(differs).unwrap_or_default();
    let name = |list: &[String]| list.get(at).map_or_else(|| "none".to_owned(), |name| format!("`{name}`"));
    format!("channel {} of {} is {}, not {}", at + 1, found.len(), name(found), name(expected))
}

/// A layout as text for a message.
fn in_words(layout: &Layout) -> String {
    let Layout { input_lags, output_lags, horizon, input_at_target } = layout;
    let ahead = if *input_at_target { " and the inputs of the predicted sample" } else { "" };
    format!(
        "inputs {input_lags:?} and outputs {output_lags:?} samples ago{ahead}, to predict {horizon} ahead"
    )
}

#[derive(Deserialize)]
struct Header {
    format: Option<serde_json::Value>,
    version: Option<u64>,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct File {
    format: String,
    version: u64,
    provenance: Provenance,
    inputs: Vec<String>,
    outputs: Vec<String>,
    layout: Layout,
    layers: Vec<usize>,
    activation: Activation,
    input_scaling: Scaling,
    output_scaling: Scaling,
    /// JSON has no NaN or infinity; writers use null for them.
    weights: Vec<Option<f64>>,
}

impl Narx {
    /// The model as text of the weight file.
    #[must_use]
    pub fn to_json(&self) -> String {
        let file = File {
            format: FORMAT.to_owned(),
            version: VERSION,
            provenance: self.provenance.clone(),
            inputs: self.input_names.clone(),
            outputs: self.output_names.clone(),
            layout: self.layout.clone(),
            layers: self.network.sizes().to_vec(),
            activation: self.network.activation(),
            input_scaling: self.input_scaling.clone(),
            output_scaling: self.output_scaling.clone(),
            weights: self.network.weights().iter().map(|&w| Some(w)).collect(),
        };
        let mut text = serde_json::to_string_pretty(&file).expect("names and numbers are always JSON");
        text.push('\n');
        text
    }

    /// Parses a model from the text of a weight file; `origin` names it in messages.
    ///
    /// # Errors
    /// If the text is not a weight file, has another version or is inconsistent, or if a weight is not finite.
    pub fn from_json(text: &str, origin: &str) -> Result<Self, WeightFileError> {
        let named = || origin.to_owned();
        let syntax = |source| WeightFileError::Syntax { origin: named(), source };
        let header: Header = serde_json::from_str(text).map_err(syntax)?;
        let format = header.format.unwrap_or(serde_json::Value::Null);
        if format != FORMAT {
            return Err(WeightFileError::OtherFormat { origin: named(), found: format.to_string() });
        }
        if let Some(found) = header.version.filter(|&version| version != VERSION) {
            return Err(WeightFileError::OtherVersion { origin: named(), found });
        }
        let file: File = serde_json::from_str(text).map_err(syntax)?;
        let missing = file.weights.iter().position(|w| !w.is_some_and(f64::is_finite));
        if let Some(index) = missing {
            return Err(WeightFileError::NonFiniteWeight { origin: named(), index });
        }
        let weights = file.weights.into_iter().flatten().collect();
        let network = Network::new(&file.layers, file.activation, weights)
            .map_err(|source| WeightFileError::Network { origin: named(), source })?;
        let narx = Self {
            layout: file.layout,
            input_names: file.inputs,
            output_names: file.outputs,
            input_scaling: file.input_scaling,
            output_scaling: file.output_scaling,
            network,
            provenance: file.provenance,
        };
        narx.checked().map_err(|source| WeightFileError::Model { origin: named(), source })
    }

    /// Writes the weight file.
    ///
    /// # Errors
    /// If the file cannot be written.
    pub fn save(&self, path: &Path) -> Result<(), WeightFileError> {
        let origin = path.display().to_string();
        let written = freeplay_storage::write(path, self.to_json());
        written.map_err(|error| WeightFileError::Io { origin, source: error.into() })
    }

    /// Reads a weight file.
    ///
    /// # Errors
    /// If the file cannot be read; see also [`Narx::from_json`].
    pub fn load(path: &Path) -> Result<Self, WeightFileError> {
        let origin = path.display().to_string();
        match freeplay_storage::read_text(path) {
            Ok(text) => Self::from_json(&text, &origin),
            Err(error) => Err(WeightFileError::Io { origin, source: error.into() }),
        }
    }

    /// Checks that the model was trained on the arm with this hash (`name` is for the message).
    ///
    /// # Errors
    /// If it was trained on another arm.
    pub fn check_arm(&self, name: &str, hash: &str) -> Result<(), MismatchError> {
        let Provenance { arm, arm_hash, command, .. } = self.provenance.clone();
        if arm_hash == hash {
            return Ok(());
        }
        Err(MismatchError::OtherArm {
            trained: arm,
            trained_hash: arm_hash,
            wanted: name.to_owned(),
            wanted_hash: hash.to_owned(),
            command,
        })
    }

    /// Checks that the model was trained on play in this joint, if it names one.
    ///
    /// # Errors
    /// If it was trained on another joint.
    pub fn check_joint(&self, joint: &str) -> Result<(), MismatchError> {
        let Provenance { joint: trained, command, .. } = &self.provenance;
        if trained.is_empty() || trained == joint {
            return Ok(());
        }
        let (trained, command) = (trained.clone(), command.clone());
        Err(MismatchError::OtherJoint { trained, wanted: joint.to_owned(), command })
    }

    /// Checks that the model has exactly these channels, in this order.
    ///
    /// # Errors
    /// If it has other channels.
    pub fn check_channels(&self, inputs: &[&str], outputs: &[&str]) -> Result<(), MismatchError> {
        for (kind, wanted, found) in
            [("input", inputs, &self.input_names), ("output", outputs, &self.output_names)]
        {
            if wanted != found {
                let expected = wanted.iter().map(|&name| name.to_owned()).collect();
                return Err(MismatchError::OtherChannels { kind, expected, found: found.clone() });
            }
        }
        Ok(())
    }

    /// Checks that the model uses exactly these samples.
    ///
    /// # Errors
    /// If it uses other samples.
    pub fn check_layout(&self, layout: &Layout) -> Result<(), MismatchError> {
        if self.layout == *layout {
            return Ok(());
        }
        let (expected, found) = (Box::new(layout.clone()), Box::new(self.layout.clone()));
        Err(MismatchError::OtherLayout { expected, found })
    }
}
