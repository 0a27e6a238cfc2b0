//! Set-up of a run: from the scenario to the plant and its path.

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Duration;

use freeplay_arm::{Arm, Purpose};
pub use freeplay_controller::task::PAPER_MODEL;
use freeplay_controller::{LimitsFrom, Task, TaskMode};
use freeplay_laws::{Clearance, Effects, LawError, Placed};
use freeplay_model::{ArmFile, EffectTable, Selection};
use freeplay_path::JointPath;
use freeplay_plant::{ControllerSet, PlantConfig, SystemError};
use freeplay_shm::{MAX_JOINTS, Mode, Pace, RtRequest};
use freeplay_terminal::exit::Failure;
use freeplay_terminal::files::write;
use freeplay_terminal::messages;
use nalgebra::Vector3;

use crate::scenario::{Drive, Pacing, Scenario};

/// A scenario with its files loaded and its path planned.
pub struct Setup {
    /// Configuration of the plant.
    pub plant: PlantConfig,
    /// The reference motion.
    pub path: Arc<JointPath>,
    /// The arm file with all plays of the scenario as effects: the simulated true arm.
    pub truth: ArmFile,
}

/// Reads the arm file `model`, or the paper's arm.
///
/// # Errors
/// An error of the file, as bad input.
pub fn load_model(model: &str) -> Result<ArmFile, Failure> {
    load_selected(model, &Selection::default())
}

/// Reads the arm file with the chain of its robot given by `selection`.
///
/// # Errors
/// An error of the file, as bad input.
pub fn load_selected(model: &str, selection: &Selection) -> Result<ArmFile, Failure> {
    if model == PAPER_MODEL {
        return match &selection.tip {
            None => Ok(freeplay_model::paper_arm()),
            Some(tip) => {
                Err(Failure::input(format!("tip `{tip}`: the arm of the paper has no links to choose from")))
            }
        };
    }
    let file = freeplay_model::load_selected(Path::new(model), selection).map_err(Failure::input)?;
    let (arm, effects) = (&file.arm, file.effects.len());
    messages::detail(format_args!("read {model}: {} of {} joints, {effects} effects", arm.name(), arm.dof()));
    Ok(file)
}

/// The arm file of `scenario` with its gravity and with the scenario's plays as effects.
fn truth(scenario: &Scenario) -> Result<ArmFile, Failure> {
    let selection = Selection { tip: scenario.tip.clone(), joints: Vec::new() };
    let mut file = load_selected(&scenario.model, &selection)?;
    let joints = file.arm.dof();
    if joints > MAX_JOINTS {
        let name = &file.arm.joints()[MAX_JOINTS].name;
        let place =
            file.arm.fitness().place(name).map_or_else(|| scenario.model.clone(), ToString::to_string);
        return Err(Failure::input(format!(
            "{place}: joint `{name}` is one too many: the arm has {joints} joints, and a run carries at most {MAX_JOINTS}: choose a shorter chain with --tip LINK, or give joints that do not move type = \"fixed\""
        )));
    }
    fold_rotors(&mut file)?;
    if let Some(gravity) = scenario.gravity {
        file.arm = file.arm.with_gravity(Vector3::from(gravity));
    }
    for (joint, table) in &scenario.clearance {
        if file.arm.joint_index(joint).is_none() {
            let names: Vec<&str> = file.arm.joints().iter().map(|joint| joint.name.as_str()).collect();
            return Err(Failure::input(format!(
                "scenario: clearance.{joint}: the arm has no joint of that name; it has {}",
                names.join(", ")
            )));
        }
        let parameters = toml::Table::try_from(table).map_err(Failure::internal)?;
        let effect =
            EffectTable { kind: Clearance::KIND.to_owned(), joint: Some(joint.clone()), parameters, line: 0 };
        Clearance::new(table)
            .and_then(|_| Placed::new(&effect, &file.arm))
            .map_err(|error| Failure::input(format!("scenario: clearance.{joint}: {error}")))?;
        file.effects.push(effect);
    }
    Ok(file)
}

/// Moves rotors from the effects into an arm that lacks inertia without them, so that its controllers can use the arm as well.
fn fold_rotors(file: &mut ArmFile) -> Result<(), Failure> {
    let arm = &file.arm;
    if arm.require(Purpose::Simulation).is_ok() {
        return Ok(());
    }
    let mut joints = arm.joints().to_vec();
    file.effects.retain(|effect| {
        let joint =
            effect.joint.as_ref().filter(|_| effect.kind == ROTOR).and_then(|name| arm.joint_index(name));
        let inertia = effect.parameters.get("inertia").and_then(toml::Value::as_float);
        let Some((joint, inertia)) = joint.zip(inertia.filter(|inertia| *inertia > 0.0)) else { return true };
        joints[joint].rotor_inertia += inertia;
        false
    });
    file.arm = Arm::derived(arm.name(), joints, *arm.tool(), *arm.gravity(), arm.fitness())
        .map_err(Failure::input)?;
    Ok(())
}

/// Name of the effect of a rotor's inertia.
const ROTOR: &str = "rotor_inertia";

/// Error of an unusable effect; it names the file `model` or the scenario as the origin.
fn faulty_effect(model: &str, error: &LawError) -> Failure {
    let place = if error.line().is_some() { model } else { "scenario: clearance" };
    Failure::input(format!("{place}: {error}"))
}

impl Setup {
    /// The joints with play: name, and radial clearance in m.
    pub fn plays(&self) -> Vec<(String, f64)> {
        let of =
            |(joint, play): &(usize, Clearance)| (self.arm().joints()[*joint].name.clone(), play.clearance);
        self.plant.effects.clearances.iter().map(of).collect()
    }

    /// Reads the files of `scenario` and plans its path.
    ///
    /// # Errors
    /// Bad input: an unusable arm file, effect or path.
    pub fn new(scenario: &Scenario) -> Result<Self, Failure> {
        let truth = truth(scenario)?;
        let effects = Effects::of(&truth).map_err(|error| faulty_effect(&scenario.model, &error))?;
        let path = JointPath::plan(&truth.arm, &scenario.path, scenario.rate).map_err(Failure::input)?;
        let period_ns = (1e9 / scenario.rate).round() as u64;
        let duration = scenario.duration.unwrap_or_else(|| path.duration());
        let plant = PlantConfig {
            arm: truth.arm.clone(),
            effects: Arc::new(effects),
            mode: match scenario.mode {
                Drive::Torque => Mode::Torque,
                Drive::Driven => Mode::Driven,
                Drive::Servo => Mode::Servo,
            },
            command_every: scenario.command_every(),
            pace: match scenario.pace {
                Pacing::Lockstep => Pace::Lockstep,
                Pacing::Realtime => Pace::RealTime,
            },
            period_ns,
            substeps: scenario.substeps,
            ticks: (duration * 1e9 / period_ns as f64).round().max(1.0) as u64,
            sensors: scenario.sensors,
            seed: scenario.seed,
            hold: scenario.hold,
            patience: Duration::from_secs_f64(scenario.patience),
            answer_patience: scenario.answer_patience.map(Duration::from_secs_f64),
            evidence: scenario.realtime.evidence,
            controller_set: ControllerSet::default(),
            reflex: scenario.reflex.clone(),
            natural_frequency: scenario.controller.gains.natural_frequency,
        };
        if let Some(fault) = scenario.reflex.fault(truth.arm.dof()) {
            return Err(Failure::input(format!("scenario: {fault}")));
        }
        check_step(&scenario.model, &plant, &path)?;
        Ok(Self { plant, path: Arc::new(path), truth })
    }

    /// The arm without its plays.
    pub fn arm(&self) -> &Arm {
        &self.truth.arm
    }

    /// Writes the task of the controllers into `folder`, and the model next to it if the scenario names none.
    ///
    /// # Errors
    /// An unwritable file.
    pub fn write_task(&self, scenario: &Scenario, folder: &Path) -> Result<PathBuf, Failure> {
        let model = match &scenario.controller.model {
            Some(model) if model == PAPER_MODEL => model.clone(),
            Some(model) => self.controller_model(model, folder)?,
            None => {
                let path = folder.join("model.toml");
                write(&path, &freeplay_model::to_toml(&self.truth))?;
                "model.toml".to_owned()
            }
        };
        let mut path = scenario.path.clone();
        path.file = path.file.map(std::path::absolute).transpose().map_err(Failure::input)?;
        let task = Task {
            model,
            weights: crate::weights::of(scenario)?,
            gravity: Some((*self.truth.arm.gravity()).into()),
            mode: match scenario.mode {
                Drive::Torque => TaskMode::Torque,
                Drive::Driven => TaskMode::Driven,
                Drive::Servo => TaskMode::Servo,
            },
            rate: scenario.rate,
            command_rate: scenario.command_rate,
            limits: LimitsFrom::Model,
            path,
            gains: scenario.controller.gains,
            options: scenario.controller.options.clone(),
        };
        let file = folder.join("task.toml");
        write(&file, &task.to_toml().map_err(Failure::internal)?)?;
        std::path::absolute(&file).map_err(Failure::input)
    }
}

impl Setup {
    /// The model file of the controllers: `model` itself, or, if its default chain differs from that of the plant, a file in `folder` with
    /// the chain that has the plant's joints.
    fn controller_model(&self, model: &str, folder: &Path) -> Result<String, Failure> {
        let given = std::path::absolute(model).map_err(Failure::input)?.display().to_string();
        let names = |arm: &Arm| arm.joints().iter().map(|joint| joint.name.clone()).collect::<Vec<_>>();
        let wanted = names(self.arm());
        let selection = Selection { tip: None, joints: wanted.clone() };
        // The controller reports a file that it cannot read.
        let found = freeplay_model::load(Path::new(model)).ok().filter(|file| names(&file.arm) != wanted);
        let chosen = found.and_then(|_| freeplay_model::load_selected(Path::new(model), &selection).ok());
        let Some(chosen) = chosen.filter(|file| names(&file.arm) == wanted) else { return Ok(given) };
        write(&folder.join("controller_model.toml"), &freeplay_model::to_toml(&chosen))?;
        Ok("controller_model.toml".to_owned())
    }
}

/// Checks effects and step size before any process starts.
fn check_step(model: &str, plant: &PlantConfig, path: &JointPath) -> Result<(), Failure> {
    plant.system(path).map(|_| ()).map_err(|error| match error {
        SystemError::Law(error) => Failure::input(error),
        SystemError::Unfit(error) => Failure::input(error),
        SystemError::DampingTooStiff { ref joint, .. } => {
            let line = line_of(model, joint).map_or_else(String::new, |line| format!(":{line}"));
            Failure::input(format!("{model}{line}: {error}"))
        }
        error => Failure::input(format!("scenario: substeps = {}: {error}", plant.substeps)),
    })
}

/// The line of the file `model` with the joint: the first line with its name in quotes and a joint element, in URDF `<joint name="elbow"`;
/// in TOML the first line with the name.
fn line_of(model: &str, joint: &str) -> Option<usize> {
    let text = freeplay_storage::read_text(Path::new(model)).ok()?;
    let names = |line: &str| ['"', '\''].iter().any(|quote| line.contains(&format!("{quote}{joint}{quote}")));
    let of_joint = text.lines().position(|line| line.contains("<joint") && names(line));
    of_joint.or_else(|| text.lines().position(names)).map(|line| line + 1)
}

/// The scenario's real-time request for the plant or for the controller.
pub fn realtime_request(scenario: &Scenario, cpu: Option<usize>) -> RtRequest {
    let wanted = scenario.pace == Pacing::Realtime;
    RtRequest {
        priority: (wanted && scenario.realtime.priority > 0).then_some(scenario.realtime.priority),
        cpu: cpu.filter(|_| wanted),
        lock_memory: wanted && scenario.realtime.lock_memory,
    }
}
