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
use freeplay_report::paste::pasted;
use freeplay_storage::plain_words;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use thiserror::Error;

use crate::swap_tables::{CompareTable, SwapTable};

/// Who moves the joints.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Drive {
    /// The controller's torque.
    #[default]
    Torque,
    /// Prescribed motion.
    Driven,
    /// Position servos, those of the arm file: controllers answer with commanded positions.
    Servo,
}

/// When the plant takes its next tick.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, clap::ValueEnum, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Pacing {
    /// The wall clock is the schedule: a late answer is a miss.
    Realtime,
    /// The plant waits for each answer: results are the same to the bit on every machine.
    #[default]
    Lockstep,
}

/// How the motion is recorded.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, clap::ValueEnum, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum RecordingKind {
    /// MCAP: compressed, survives a kill; opens in Foxglove and PlotJuggler.
    #[default]
    Mcap,
    /// CSV: any tool reads it.
    Csv,
    /// No recording.
    None,
}

/// Value of `weights` that switches off the weights next to the model.
pub const NO_WEIGHTS: &str = "none";

/// What the controllers are given to work with.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct ControllerTable {
    /// The model given to the controllers; absent: the plant's own arm with its clearances.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub model: Option<String>,
    /// Weight file of what a network learned beyond the model, for `narx-qp`; absent: `MODEL.weights.json` beside the model, if it is there; "none":
    /// none.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub weights: Option<String>,
    /// Feedback of the joint motion.
    pub gains: Gains,
    /// What the controller itself understands.
    #[serde(skip_serializing_if = "toml::Table::is_empty")]
    #[schemars(with = "serde_json::Map<String, serde_json::Value>")]
    pub options: toml::Table,
}

/// What is asked of the operating system.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct RealtimeTable {
    /// SCHED_FIFO priority, 1 to 99; 0 asks for none.
    pub priority: u8,
    /// Core of the plant.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub plant_cpu: Option<usize>,
    /// Core of the controller.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub controller_cpu: Option<usize>,
    /// Whether memory is locked.
    pub lock_memory: bool,
    /// Whether the evidence for the cause of every missed deadline is gathered.
    pub evidence: bool,
    /// Seconds that a built-in controller computes in vain for each answer, to see where the budget breaks.
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

/// What is run.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Scenario {
    /// The plant's arm: "paper", or the path of a URDF, MJCF or TOML arm file.
    pub model: String,
    /// The link at the end of the arm, of a URDF; absent: what the arm file says, else `tool0`, else the longest chain without fingers.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub tip: Option<String>,
    /// Who moves the joints.
    pub mode: Drive,
    /// In mode servo: commands per second that reach the servos, which hold each until the next; absent: one a tick.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub command_rate: Option<f64>,
    /// Lockstep or real time.
    pub pace: Pacing,
    /// Ticks per second.
    pub rate: f64,
    /// Sub-steps of a tick.
    pub substeps: u32,
    /// Length of the run, s; absent: the path's.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub duration: Option<f64>,
    /// Seed of all noise.
    pub seed: u64,
    /// Ticks for which a missing command is bridged by the last one before the brakes close.
    pub hold: u32,
    /// Seconds to wait for a controller to start, and in lockstep for an answer.
    pub patience: f64,
    /// Gravity in the base frame, m/s²; absent: the arm file's.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub gravity: Option<[f64; 3]>,
    /// Controllers to run one after the other: built-in names, or paths of FMUs (FMI 2.0 or 3.0 Co-Simulation, `.fmu`) or of executables.
    pub controllers: Vec<String>,
    /// Controllers that run beside each of those, warm, named in the same way: they answer the same states and take over where it fails.
    pub standby: Vec<String>,
    /// How many swaps take place at random ticks, drawn from the seed.
    pub random_swaps: u32,
    /// Seconds over which the commands of one controller go over into those of the next.
    pub swap_blend: f64,
    /// Greatest change of each joint's torque from tick to tick as it changes hands by plan, N·m; what is cut off comes with the next tick.
    /// Absent: as much as the old controller would have changed it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub swap_change: Option<Vec<f64>>,
    /// Seconds to wait in lockstep for an answer while a standby could take over; absent: `patience`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub answer_patience: Option<f64>,
    /// How the motion is recorded.
    pub recording: RecordingKind,
    /// The reference path.
    pub path: PathSpec,
    /// Play by joint name, beside what the arm file has.
    pub clearance: BTreeMap<String, ClearanceTable>,
    /// The sensors.
    pub sensors: SensorsSpec,
    /// What the controllers are given.
    pub controller: ControllerTable,
    /// What is asked of the operating system.
    pub realtime: RealtimeTable,
    /// When the arm is stopped for what it does: speed, acceleration, position and tracking error of its joints, and the rate of torques.
    pub reflex: ReflexSpec,
    /// When the standbys contradict the controller in charge; absent: never.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub compare: Option<CompareTable>,
    /// Changes of the controller at given ticks.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub swap: Vec<SwapTable>,
    /// Whether somebody has chosen the feedback: what nobody chose may follow from the model.
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
    #[error("{0} is an arm file, not a scenario: run it with freeplay run --model {command}", path.display(), command = pasted(path))]
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
