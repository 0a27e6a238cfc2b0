//! What a controller knows of the arm: the model file of its task.

use std::path::Path;
use std::sync::Arc;

use freeplay_arm::{Arm, ArmFile, Limits};
use freeplay_laws::{Clearance, Effects};
use freeplay_shm::Mode;
use nalgebra::Vector3;

use crate::controller::{ControllerError, RunInfo};
use crate::task::{LimitsFrom, PAPER_MODEL, Task, TaskMode};

/// The arm, and the play and other effects that the controller believes its joints to have.
#[derive(Clone, Debug)]
pub struct Model {
    /// The arm with what its effects change of it, a payload or a tilt, with the gravity and the limits of the task.
    pub arm: Arm,
    /// All effects of the model file.
    pub effects: Arc<Effects>,
    /// Clearances by joint index of `arm`, in ascending order.
    pub clearances: Vec<(usize, Clearance)>,
}

impl Model {
    /// Loads the model of `task` and checks task and model against the plant's `run`.
    ///
    /// # Errors
    /// A model file that cannot be used, or one that does not fit the run.
    pub fn load(task: &Task, run: &RunInfo) -> Result<Model, ControllerError> {
        let file = if task.model == PAPER_MODEL {
            freeplay_arm::paper_arm()
        } else {
            freeplay_arm::load(Path::new(&task.model))?
        };
        check(task, &file, run)?;
        let effects = Effects::of(&file)?;
        let mut arm = file.arm;
        if let Some(gravity) = task.gravity {
            arm = arm.with_gravity(Vector3::from(gravity));
        }
        arm = effects.changed(&arm)?;
        if task.limits == LimitsFrom::None {
            arm = without_limits(&arm)?;
        }
        Ok(Model { arm, clearances: effects.clearances.clone(), effects: Arc::new(effects) })
    }
}

fn without_limits(arm: &Arm) -> Result<Arm, ControllerError> {
    let mut joints = arm.joints().to_vec();
    for joint in &mut joints {
        joint.limits = Limits::NONE;
    }
    Ok(Arm::with_fitness(arm.name(), joints, *arm.tool(), *arm.gravity(), arm.fitness())?)
}

fn check(task: &Task, file: &ArmFile, run: &RunInfo) -> Result<(), ControllerError> {
    let found = file.arm.dof();
    if found != run.joints {
        return Err(ControllerError::JointCount { model: task.model.clone(), found, expected: run.joints });
    }
    let mode = match task.mode {
        TaskMode::Torque => Mode::Torque,
        TaskMode::Driven => Mode::Driven,
    };
    if mode != run.mode {
        return Err(ControllerError::Disagreement {
            key: "mode",
            task: format!("{:?}", task.mode).to_lowercase(),
            plant: format!("{:?}", run.mode).to_lowercase(),
        });
    }
    // The plant counts in whole nanoseconds.
    if (task.period() * 1e9 - run.period_ns as f64).abs() > 1.0 {
        return Err(ControllerError::Disagreement {
            key: "rate",
            task: format!("{} per second", task.rate),
            plant: format!("{} ns between ticks", run.period_ns),
        });
    }
    Ok(())
}
