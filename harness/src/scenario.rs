//! Scenarios: one TOML file that describes a run; `--set key=value` changes any key.
//!
//! The user's input ([`Scenario`]) and the inputs of the processes (a `PlantConfig` for the plant, a `Task` for the controller) are
//! different types; [`crate::setup`] converts the first into the others.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use freeplay_controller::Gains;
use freeplay_laws::ClearanceTable;
use freeplay_path::{PathKind, PathSpec};
use freeplay_plant::{ReflexSpec, SensorsSpec};
use freeplay_report::paste::shell_word;
use freeplay_storage::plain_words;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use thiserror::Error;

use crate::swap_tables::{CompareTable, SwapTable};

/// Drive of the joints.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Drive {
    /// The controller commands joint torques.
    #[default]
    Torque,
    /// The controller commands positions, and ideal drives follow them exactly.
    Driven,
    /// The controller commands positions, and the position servos of the arm file follow them.
    Servo,
}

/// Pace of the run.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, clap::ValueEnum, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Pacing {
    /// The plant follows the wall clock and counts a late answer as a missed deadline.
    Realtime,
    /// The plant waits for each answer. The results are identical to the bit on every machine.
    #[default]
    Lockstep,
}

/// File format of the recording.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, clap::ValueEnum, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum RecordingKind {
    /// MCAP: a compressed file that stays readable if the run is killed. Foxglove and PlotJuggler open it.
    #[default]
    Mcap,
    /// CSV: a text file that every tool reads.
    Csv,
    /// No recording.
    None,
}

/// Value of `weights` that switches off the weights next to the model.
pub const NO_WEIGHTS: &str = "none";

/// Inputs of the controllers: model, weights, gains and options.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct ControllerTable {
    /// Path of the controllers' model. Absent: the plant's arm with its clearances.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub model: Option<String>,
    /// Weight file for `narx-qp`: a network that predicts the part of the tool deviation that the model does not predict. Absent:
    /// `MODEL.weights.json` in the folder of the model, if that file exists. "none": no weights.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub weights: Option<String>,
    /// Feedback gains of the joint motion.
    pub gains: Gains,
    /// Options of the controller. Each controller defines its own keys.
    #[serde(skip_serializing_if = "toml::Table::is_empty")]
    #[schemars(with = "serde_json::Map<String, serde_json::Value>")]
    pub options: toml::Table,
}

/// Real-time settings of the processes.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct RealtimeTable {
    /// SCHED_FIFO priority, 1 to 99. 0: no real-time priority.
    pub priority: u8,
    /// CPU core of the plant.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub plant_cpu: Option<usize>,
    /// CPU core of the controller.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub controller_cpu: Option<usize>,
    /// True if the processes lock their memory.
    pub lock_memory: bool,
    /// True if the plant gathers evidence for the cause of each missed deadline.
    pub evidence: bool,
    /// Extra computing time of a built-in controller for each answer, s. It shows at which load the controller misses its deadlines.
    pub load: f64,
}

impl Default for RealtimeTable {
    fn default() -> Self {
        Self {
            priority: freeplay_doctor::DEFAULT_PRIORITY,
            plant_cpu: None,
            controller_cpu: None,
            lock_memory: true,
            evidence: true,
            load: 0.0,
        }
    }
}

/// A run: arm, controllers, motion, sensors and recording.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Scenario {
    /// Arm of the plant: "paper", or the path of a URDF, MJCF or TOML arm file.
    pub model: String,
    /// Last link of the arm in a URDF. Absent: the link that the arm file names, else `tool0`, else the end of the longest chain without
    /// fingers.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub tip: Option<String>,
    /// Drive of the joints.
    pub mode: Drive,
    /// Commands per second that reach the servos, in mode servo only. The servos hold each command until the next one. Absent: one command
    /// per tick.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub command_rate: Option<f64>,
    /// Pace of the run: lockstep or real time.
    pub pace: Pacing,
    /// Ticks per second.
    pub rate: f64,
    /// Integration sub-steps per tick.
    pub substeps: u32,
    /// Duration of the run, s. Absent: duration of the path.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub duration: Option<f64>,
    /// Seed of the random numbers, for sensor noise and random swaps.
    pub seed: u64,
    /// Ticks for which the plant holds the last valid command if no new one arrives. After that the plant closes the brakes.
    pub hold: u32,
    /// Time that the plant waits for a controller to start, and in lockstep for an answer, s.
    pub patience: f64,
    /// Gravity in the base frame, m/s². Absent: gravity of the arm file.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub gravity: Option<[f64; 3]>,
    /// Controllers that Freeplay runs one after the other. Each is the name of a built-in controller, or the path of an FMU (FMI 2.0 or 3.0
    /// Co-Simulation, `.fmu`) or of an executable.
    pub controllers: Vec<String>,
    /// Standby controllers, named in the same way. They run in parallel with each of `controllers` and answer the same states. One takes
    /// over if the active controller fails.
    pub standby: Vec<String>,
    /// Number of swaps at random ticks. The seed determines the ticks.
    pub random_swaps: u32,
    /// Time over which the plant blends the commands of the old controller into those of the new one at a swap, s.
    pub swap_blend: f64,
    /// Limit of the change of each joint's torque from one tick to the next at a planned swap, N·m. The rest of the change follows with the
    /// next tick. Absent: the change that the old controller would have made.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub swap_change: Option<Vec<f64>>,
    /// Time that the plant waits in lockstep for an answer while a standby could take over, s. Absent: `patience`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub answer_patience: Option<f64>,
    /// File format of the recording.
    pub recording: RecordingKind,
    /// Reference path of the arm.
    pub path: PathSpec,
    /// Clearance of each joint, by joint name, in addition to the effects of the arm file.
    pub clearance: BTreeMap<String, ClearanceTable>,
    /// Sensors of the arm.
    pub sensors: SensorsSpec,
    /// Inputs of the controllers.
    pub controller: ControllerTable,
    /// Real-time settings of the processes.
    pub realtime: RealtimeTable,
    /// Limits beyond which the plant stops the arm: speed, acceleration, position and tracking error of the joints, and the rate of the
    /// commanded torques.
    pub reflex: ReflexSpec,
    /// Comparison of the active controller's commands with those of the standbys. Absent: no comparison.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub compare: Option<CompareTable>,
    /// Planned swaps of the controller.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub swap: Vec<SwapTable>,
    /// True if the user has chosen the feedback. Otherwise the program may choose it from the model.
    #[serde(skip)]
    #[schemars(skip)]
    pub has_gains: bool,
}

impl Default for Scenario {
    /// The paper's arm with 0.6 mm of play in joint 5, the smooth path in 6 s, all built-in controllers.
    fn default() -> Self {
        Self {
            model: freeplay_controller::task::PAPER_MODEL.to_owned(),
            tip: None,
            mode: Drive::default(),
            command_rate: None,
            pace: Pacing::default(),
            rate: 1000.0,
            substeps: 50,
            duration: None,
            seed: 1,
            hold: 20,
            patience: 5.0,
            gravity: None,
            controllers: freeplay_controller::BUILT_IN.iter().map(|name| (*name).to_owned()).collect(),
            standby: Vec::new(),
            random_swaps: 0,
            swap_blend: 0.3,
            swap_change: None,
            answer_patience: None,
            recording: RecordingKind::default(),
            path: PathSpec::default(),
            clearance: BTreeMap::from([("joint_5".to_owned(), ClearanceTable::new(0.6e-3))]),
            sensors: SensorsSpec::default(),
            controller: ControllerTable::default(),
            realtime: RealtimeTable::default(),
            reflex: ReflexSpec::default(),
            compare: None,
            swap: Vec::new(),
            has_gains: false,
        }
    }
}

/// Reasons why a scenario cannot be used.
#[derive(Debug, Error)]
pub enum ScenarioError {
    /// The file cannot be read.
    #[error("cannot read the scenario {}: {}; {}", .0.path.display(), .0.source, .0.remedy())]
    Unreadable(#[from] freeplay_storage::StorageError),
    /// The file is an arm file, not a scenario.
    #[error("{0} is an arm file, not a scenario: run it with freeplay run --model {command}", path.display(), command = shell_word(path))]
    Arm {
        /// The file.
        path: PathBuf,
    },
    /// The file is not TOML, or has an unknown key or a value of the wrong type; the message gives line and column.
    #[error("scenario {}: {}", path.display(), plain_words(&source.to_string()))]
    Syntax {
        /// The file.
        path: PathBuf,
        /// Line, column and cause.
        source: Box<toml::de::Error>,
    },
    /// A `--set` is invalid.
    #[error("--set {given}: {message}")]
    Set {
        /// The given text.
        given: String,
        /// Fault of the text.
        message: String,
    },
    /// A number is out of its range.
    #[error("scenario: {key} = {value} is out of range; it must be {range}")]
    OutOfRange {
        /// The key.
        key: &'static str,
        /// The value found.
        value: f64,
        /// The permitted range.
        range: &'static str,
    },
    /// The settings of a group contradict each other.
    #[error("scenario: {0}")]
    Contradiction(String),
    /// The scenario cannot be written.
    #[error("the scenario cannot be written as TOML: {0}")]
    Unwritable(#[from] toml::ser::Error),
}

impl Scenario {
    /// Ticks between the commands that reach the servos.
    pub fn command_every(&self) -> u32 {
        self.command_rate.map_or(1, |rate| (self.rate / rate).round().max(1.0) as u32)
    }

    /// Loads the scenario of `file` (or the default one without a file), changed by `sets` of the form `key=value`.
    ///
    /// # Errors
    /// See [`ScenarioError`].
    pub fn load(file: Option<&Path>, sets: &[String]) -> Result<Self, ScenarioError> {
        let (scenario, given) = match file {
            None => (Self::default(), toml::Table::new()),
            Some(path) => Self::read(path)?,
        };
        let chosen = |key| is_given(&given, sets, key);
        let (has_path, has_gains) = (chosen("path"), chosen("controller.gains"));
        let mut scenario = if sets.is_empty() { scenario } else { scenario.set(given, sets)? };
        scenario.has_gains = has_gains;
        // The default path lies within the reach of the paper's arm; for every other arm the default is a swing of its joints.
        if scenario.model != freeplay_controller::task::PAPER_MODEL && !has_path {
            scenario.path.kind = PathKind::JointSine;
        }
        scenario.check()?;
        Ok(scenario)
    }

    fn read(path: &Path) -> Result<(Self, toml::Table), ScenarioError> {
        let syntax = |source| ScenarioError::Syntax { path: path.to_owned(), source: Box::new(source) };
        let text = freeplay_storage::read_config(path)?;
        if text.trim_start().starts_with('<') {
            return Err(ScenarioError::Arm { path: path.to_owned() });
        }
        let mut scenario: Self = toml::from_str(&text).map_err(syntax)?;
        let given: toml::Table = toml::from_str(&text).map_err(syntax)?;
        // A file with its own arm does not inherit the play of the paper's joint 5.
        if given.contains_key("model") && !given.contains_key("clearance") {
            scenario.clearance.clear();
        }
        let folder = path.parent().unwrap_or(Path::new("."));
        scenario.model = beside(folder, &scenario.model);
        scenario.controller.model = scenario.controller.model.map(|model| beside(folder, &model));
        scenario.controller.weights =
            scenario.controller.weights.map(|weights| beside_unless_none(folder, &weights));
        scenario.path.file = scenario.path.file.map(|file| folder.join(file));
        if let Some(sound) = scenario.compare.as_mut().and_then(|compare| compare.sound.as_mut()) {
            *sound = folder.join(&*sound);
        }
        Ok((scenario, given))
    }

    /// Applies `sets` in order.
    fn set(self, given: toml::Table, sets: &[String]) -> Result<Self, ScenarioError> {
        let mut table = toml::Table::try_from(&self)?;
        for set in sets {
            let fault =
                |message: &str| ScenarioError::Set { given: set.clone(), message: message.to_owned() };
            let (key, value) =
                set.split_once('=').ok_or_else(|| fault("write key=value, as in path.period=12"))?;
            if key.trim() == "model" && !given.contains_key("clearance") {
                table.remove("clearance");
                table.insert("clearance".to_owned(), toml::Value::Table(toml::Table::new()));
            }
            let value = parse_value(value.trim());
            insert(&mut table, key.trim(), value).map_err(|message| fault(&message))?;
            let checked: Result<Self, toml::de::Error> = table.clone().try_into();
            checked.map_err(|error| fault(&plain_words(error.message())))?;
        }
        table
            .try_into()
            .map_err(|source: toml::de::Error| ScenarioError::Contradiction(plain_words(source.message())))
    }

    fn check(&self) -> Result<(), ScenarioError> {
        let within = |key, value: f64, fits: bool, range| {
            if value.is_finite() && fits {
                Ok(())
            } else {
                Err(ScenarioError::OutOfRange { key, value, range })
            }
        };
        within("rate", self.rate, self.rate >= 1.0 && self.rate <= 1e5, "1 to 100000 ticks per second")?;
        if let Some(rate) = self.command_rate {
            let range = "above 0 and at most `rate`, commands per second";
            within("command_rate", rate, rate > 0.0 && rate <= self.rate, range)?;
            if self.mode != Drive::Servo {
                let text = "command_rate needs mode = \"servo\"; set that mode, or remove command_rate";
                return Err(ScenarioError::Contradiction(text.to_owned()));
            }
        }
        within(
            "substeps",
            f64::from(self.substeps),
            (1..=100_000).contains(&self.substeps),
            "1 to 100000 sub-steps a tick",
        )?;
        within(
            "patience",
            self.patience,
            self.patience > 0.0 && self.patience <= 3600.0,
            "above 0 to 3600 s",
        )?;
        within("swap_blend", self.swap_blend, (0.0..=10.0).contains(&self.swap_blend), "0 to 10 s")?;
        if let Some(patience) = self.answer_patience {
            within("answer_patience", patience, patience > 0.0 && patience <= 3600.0, "above 0 to 3600 s")?;
        }
        if let Some(duration) = self.duration {
            within("duration", duration, duration > 0.0 && duration <= 86_400.0, "above 0 to 86400 s")?;
        }
        for value in self.gravity.unwrap_or_default() {
            within("gravity", value, value.abs() <= 1e3, "three finite numbers of at most 1000 m/s²")?;
        }
        let priority = self.realtime.priority;
        within("realtime.priority", f64::from(priority), priority <= 99, "0 (none) to 99")?;
        let load = self.realtime.load;
        within("realtime.load", load, (0.0..=1.0).contains(&load), "0 to 1 s")?;
        if self.controllers.is_empty() {
            return Err(ScenarioError::Contradiction("controllers is empty; name at least one".into()));
        }
        self.sensors.fault().map_or(Ok(()), |fault| Err(ScenarioError::Contradiction(fault)))
    }

    /// The scenario as TOML that [`Scenario::load`] reads back.
    ///
    /// # Errors
    /// [`ScenarioError::Unwritable`] for numbers that TOML cannot express.
    pub fn to_toml(&self) -> Result<String, ScenarioError> {
        Ok(toml::to_string(self)?)
    }
}

/// Returns true if `key` is in the file's table `given` or in one of the changes `sets`.
fn is_given(given: &toml::Table, sets: &[String], key: &str) -> bool {
    let mut parts = key.split('.');
    let first = parts.next().and_then(|part| given.get(part));
    let in_file = parts.try_fold(first, |value, part| Some(value?.get(part)));
    let is_set = |set: &String| {
        let name = set.split('=').next().unwrap_or_default().trim();
        name == key || name.starts_with(&format!("{key}.")) || key.starts_with(&format!("{name}."))
    };
    in_file.flatten().is_some() || sets.iter().any(is_set)
}

/// The path of the model `name` relative to `folder`; the name of the paper's arm stays unchanged.
fn beside(folder: &Path, name: &str) -> String {
    if name == freeplay_controller::task::PAPER_MODEL {
        name.to_owned()
    } else {
        folder.join(name).display().to_string()
    }
}

/// Does the same for weights, which may be [`NO_WEIGHTS`].
fn beside_unless_none(folder: &Path, name: &str) -> String {
    if name == NO_WEIGHTS { name.to_owned() } else { folder.join(name).display().to_string() }
}

/// Parses a value as TOML; any other text becomes a string.
fn parse_value(text: &str) -> toml::Value {
    let document: Result<toml::Table, _> = toml::from_str(&format!("value = {text}"));
    document
        .ok()
        .and_then(|mut table| table.remove("value"))
        .unwrap_or_else(|| toml::Value::String(text.to_owned()))
}

/// Inserts `value` at the dotted `key`; an integer becomes a float if the present value is one.
fn insert(table: &mut toml::Table, key: &str, value: toml::Value) -> Result<(), String> {
    let (head, rest) = key.split_once('.').map_or((key, None), |(head, rest)| (head, Some(rest)));
    if head.is_empty() {
        return Err("the key is empty".to_owned());
    }
    let Some(rest) = rest else {
        let value = match (table.get(head), value) {
            (Some(toml::Value::Float(_)), toml::Value::Integer(number)) => toml::Value::Float(number as f64),
            (_, value) => value,
        };
        table.insert(head.to_owned(), value);
        return Ok(());
    };
    match table.entry(head.to_owned()).or_insert_with(|| toml::Value::Table(toml::Table::new())) {
        toml::Value::Table(inner) => insert(inner, rest, value),
        _ => Err(format!("{head} is not a table")),
    }
}
