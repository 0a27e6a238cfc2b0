//! The task file: the complete input of a controller for a run.
//!
//! ```toml
//! model = "paper"              # or the path of an arm file, relative to this file
//! weights = "model.weights.json"  # optional: the learned remainder beyond the model
//! gravity = [0.0, 0.0, -9.81]  # optional; default: that of the model
//! mode = "torque"              # or "driven"
//! rate = 1000.0                # ticks per second
//! limits = "model"             # or "none"
//! [path]                       # as in a scenario
//! kind = "lissajous"
//! [gains]
//! natural_frequency = 50.0     # rad/s
//! damping_ratio = 1.0
//! [options]                    # options of the controller
//! ```
//!
//! The file does not contain the true clearances of the plant. The model may assume clearances of its own, right or wrong.

use std::path::{Path, PathBuf};

use freeplay_path::PathSpec;
use freeplay_storage::plain_words;
#[cfg(feature = "schema")]
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use thiserror::Error;

/// Name of the model that ships with the project: the arm of Erkaya (2018), Table 1.
pub const PAPER_MODEL: &str = "paper";

/// Mode of the joints' motion, which defines the meaning of the controller's answers.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum TaskMode {
    /// Answers are joint torques, held for a tick.
    #[default]
    Torque,
    /// Answers are joint positions with velocity and acceleration, followed exactly.
    Driven,
    /// Answers are joint positions, the commands of position servos.
    Servo,
}

impl TaskMode {
    /// Ticks from a state to the instant of its answer: a torque and the command of a servo act from the start of the next tick; a joint
    /// reaches a driven position at its end.
    pub fn lead(self) -> u64 {
        match self {
            TaskMode::Torque | TaskMode::Servo => 1,
            TaskMode::Driven => 2,
        }
    }
}

/// Source of the joint limits.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum LimitsFrom {
    /// The model file.
    #[default]
    Model,
    /// There are none.
    None,
}

/// Feedback of the joint motion: `q̈ = q̈_d + 2ζω (q̇_d − q̇) + ω² (q_d − q)`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(JsonSchema))]
#[serde(deny_unknown_fields, default)]
pub struct Gains {
    /// Natural frequency ω, rad/s.
    pub natural_frequency: f64,
    /// Damping ratio ζ.
    pub damping_ratio: f64,
}

impl Default for Gains {
    fn default() -> Gains {
        Gains { natural_frequency: 50.0, damping_ratio: 1.0 }
    }
}

/// The task of a controller.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Task {
    /// Path of an arm file, or [`PAPER_MODEL`].
    pub model: String,
    /// Weight file of the learned remainder beyond the model; absent: none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub weights: Option<String>,
    /// Gravity in the base frame, m/s²; overrules the model's.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub gravity: Option<[f64; 3]>,
    /// Mode of the joints' motion.
    #[serde(default)]
    pub mode: TaskMode,
    /// Ticks per second, 1/s.
    #[serde(default = "Task::default_rate")]
    pub rate: f64,
    /// In mode servo: commands per second that reach the servos; absent: one a tick.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub command_rate: Option<f64>,
    /// Source of the joint limits.
    #[serde(default)]
    pub limits: LimitsFrom,
    /// The reference motion.
    #[serde(default)]
    pub path: PathSpec,
    /// The feedback.
    #[serde(default)]
    pub gains: Gains,
    /// Options of the controller; each controller refuses unknown keys.
    #[serde(default, skip_serializing_if = "toml::Table::is_empty")]
    pub options: toml::Table,
}

impl Default for Task {
    fn default() -> Task {
        Task {
            model: PAPER_MODEL.to_owned(),
            weights: None,
            gravity: None,
            mode: TaskMode::default(),
            rate: Task::default_rate(),
            command_rate: None,
            limits: LimitsFrom::default(),
            path: PathSpec::default(),
            gains: Gains::default(),
            options: toml::Table::new(),
        }
    }
}

/// Why a task file cannot be used.
#[derive(Debug, Error)]
pub enum TaskError {
    /// The file cannot be read.
    #[error("cannot read the task file {}: {source}", path.display())]
    Unreadable {
        /// The file.
        path: PathBuf,
        /// The error of the operating system.
        source: std::io::Error,
    },
    /// The file is not TOML, or has an unknown key, a missing one or one of the wrong type. The message shows the line.
    #[error("task file {origin}: {}", plain_words(&source.to_string()))]
    Syntax {
        /// The file.
        origin: String,
        /// Line, column and cause.
        source: Box<toml::de::Error>,
    },
    /// A number is out of its range.
    #[error("task file {origin}: {key} = {value} is out of range; it must be {range}")]
    OutOfRange {
        /// The file.
        origin: String,
        /// The key.
        key: &'static str,
        /// The value found.
        value: f64,
        /// The permitted range.
        range: &'static str,
    },
    /// The options hold a key that the controller does not know, or a value of the wrong type.
    #[error("options of the controller {controller}: {}", plain_words(&source.to_string()))]
    Options {
        /// Name of the controller.
        controller: String,
        /// Key and cause.
        source: Box<toml::de::Error>,
    },
    /// An option is out of its range.
    #[error("options of the controller {controller}: {fault}")]
    OptionValue {
        /// Name of the controller.
        controller: String,
        /// The key and its permitted range.
        fault: &'static str,
    },
    /// The task cannot be written as TOML.
    #[error("the task cannot be written as TOML: {0}")]
    Unwritable(#[from] toml::ser::Error),
}

impl Task {
    fn default_rate() -> f64 {
        1000.0
    }

    /// Reads a task file. Relative paths in it are taken from the folder of the file.
    ///
    /// # Errors
    /// See [`TaskError`].
    pub fn load(path: &Path) -> Result<Task, TaskError> {
        let text = freeplay_storage::read_text(path)
            .map_err(|error| TaskError::Unreadable { path: path.to_owned(), source: error.into() })?;
        let mut task = Task::parse(&text, &path.display().to_string())?;
        let folder = path.parent().unwrap_or(Path::new("."));
        if task.model != PAPER_MODEL {
            task.model = folder.join(&task.model).display().to_string();
        }
        task.weights = task.weights.map(|weights| folder.join(weights).display().to_string());
        task.path.file = task.path.file.map(|file| folder.join(file));
        Ok(task)
    }

    /// Reads the text of a task file; `origin` names it in errors. Paths stay as they are written.
    ///
    /// # Errors
    /// See [`TaskError`].
    pub fn parse(text: &str, origin: &str) -> Result<Task, TaskError> {
        let task: Task = toml::from_str(text)
            .map_err(|source| TaskError::Syntax { origin: origin.to_owned(), source: Box::new(source) })?;
        match task.out_of_range() {
            Some((key, value, range)) => {
                Err(TaskError::OutOfRange { origin: origin.to_owned(), key, value, range })
            }
            None => Ok(task),
        }
    }

    /// The text of a task file that [`Task::parse`] reads back.
    ///
    /// # Errors
    /// [`TaskError::Unwritable`] for numbers that TOML cannot hold.
    pub fn to_toml(&self) -> Result<String, TaskError> {
        Ok(toml::to_string(self)?)
    }

    /// Time between two ticks T, s.
    pub fn period(&self) -> f64 {
        1.0 / self.rate
    }

    /// The options as the controller `controller` understands them.
    ///
    /// # Errors
    /// [`TaskError::Options`] names the key.
    pub fn options<T: serde::de::DeserializeOwned>(&self, controller: &str) -> Result<T, TaskError> {
        self.options.clone().try_into().map_err(|source| TaskError::Options {
            controller: controller.to_owned(),
            source: Box::new(source),
        })
    }

    fn out_of_range(&self) -> Option<(&'static str, f64, &'static str)> {
        let positive = |value: f64, most: f64| value > 0.0 && value <= most;
        if !positive(self.rate, 1e5) {
            return Some(("rate", self.rate, "above 0 and at most 100000 ticks per second"));
        }
        if !positive(self.gains.natural_frequency, self.rate) {
            return Some((
                "gains.natural_frequency",
                self.gains.natural_frequency,
                "above 0 and at most `rate` rad/s",
            ));
        }
        if !positive(self.gains.damping_ratio, 10.0) {
            return Some(("gains.damping_ratio", self.gains.damping_ratio, "above 0 and at most 10"));
        }
        let gravity = self.gravity.unwrap_or_default();
        let bad = gravity.into_iter().find(|value| !value.is_finite());
        bad.map(|value| ("gravity", value, "three finite numbers"))
    }
}
