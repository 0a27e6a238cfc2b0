//! A controller's model of the arm: the model file of its task.

use freeplay_controller_sdk::RunInfo;
use std::path::Path;
use std::sync::Arc;

use freeplay_arm::{Arm, Limits};
use freeplay_laws::{Clearance, Effects};
use nalgebra::Vector3;

use crate::identity::{identity, model_identity};
use crate::not_ready::NotReady;
use crate::task::{LimitsFrom, PAPER_MODEL, Task};

/// The arm, and the play and other effects that the controller assumes.
#[derive(Clone, Debug)]
pub struct Model {
    /// The arm with the changes by its effects, such as a payload or a tilt, and with the gravity and the limits of the task.
    pub arm: Arm,
    /// The arm without its effects, with the gravity of the task; deviations are relative to it.
    pub nominal: Arm,
    /// All effects of the model file.
    pub effects: Arc<Effects>,
    /// Clearances by joint index of `arm`, in ascending order.
    pub clearances: Vec<(usize, Clearance)>,
    /// Hash of the arm without its effects, and hash of the model ([`identity`], [`model_identity`]).
    pub hashes: [String; 2],
}

impl Model {
    /// Loads the model of `task` and checks task and model against the plant's `run`.
    ///
    /// # Errors
    /// A model file that cannot be used, or one that does not fit the run.
    pub fn load(task: &Task, run: &RunInfo) -> Result<Model, NotReady> {
        let file = if task.model == PAPER_MODEL {
            freeplay_model::paper_arm()
        } else {
            freeplay_model::load(Path::new(&task.model))?
        };
        task.check(file.arm.dof(), run)?;
        let effects = Effects::of(&file)?;
        let hashes = [identity(&file.arm), model_identity(&file)];
        let mut arm = file.arm;
        if let Some(gravity) = task.gravity {
            arm = arm.with_gravity(Vector3::from(gravity));
        }
        let nominal = arm.clone();
        arm = effects.changed(&arm)?;
        if task.limits == LimitsFrom::None {
            arm = without_limits(&arm)?;
        }
        Ok(Model { arm, nominal, clearances: effects.clearances.clone(), effects: Arc::new(effects), hashes })
    }
}

fn without_limits(arm: &Arm) -> Result<Arm, NotReady> {
    let mut joints = arm.joints().to_vec();
    for joint in &mut joints {
        joint.limits = Limits::NONE;
    }
    Ok(Arm::derived(arm.name(), joints, *arm.tool(), *arm.gravity(), arm.fitness())?)
}
