//! The errors of a controller that cannot start: its task is unusable or does not match the run.

use freeplay_shm::Mode;
use thiserror::Error;

use crate::run_info::RunInfo;
use crate::task::{Task, TaskError, TaskMode};

/// Reasons why a controller cannot start.
#[derive(Debug, Error)]
pub enum ControllerError {
    /// The task file cannot be used.
    #[error(transparent)]
    Task(#[from] TaskError),
    /// The model has another number of joints than the plant's arm.
    #[error(
        "the model {model} has {found} joints, the plant's arm has {expected}: give the controller a model of the same joints"
    )]
    JointCount {
        /// The model.
        model: String,
        /// Number of joints of the model.
        found: usize,
        /// The number of joints of the plant.
        expected: usize,
    },
    /// Task and plant contradict each other.
    #[error("the task has {key} = {task}, but the plant has {plant}: write the same in both")]
    Disagreement {
        /// The key of the task.
        key: &'static str,
        /// The task's value.
        task: String,
        /// The plant's value.
        plant: String,
    },
    /// A fault of the controller's own: its model, its options or its set-up.
    #[error("{0}")]
    Custom(Box<dyn std::error::Error + Send + Sync>),
}

impl Task {
    /// Checks the task and a model with `joints` joints against the plant's `run`.
    ///
    /// # Errors
    /// [`ControllerError::JointCount`] or [`ControllerError::Disagreement`] with both values.
    pub fn check(&self, joints: usize, run: &RunInfo) -> Result<(), ControllerError> {
        if joints != run.joints {
            let (model, found, expected) = (self.model.clone(), joints, run.joints);
            return Err(ControllerError::JointCount { model, found, expected });
        }
        let mode = match self.mode {
            TaskMode::Torque => Mode::Torque,
            TaskMode::Driven => Mode::Driven,
            TaskMode::Servo => Mode::Servo,
        };
        if mode != run.mode {
            return Err(ControllerError::Disagreement {
                key: "mode",
                task: format!("{:?}", self.mode).to_lowercase(),
                plant: format!("{:?}", run.mode).to_lowercase(),
            });
        }
        // The plant rounds the period to whole nanoseconds.
        if (self.period() * 1e9 - run.period_ns as f64).abs() > 1.0 {
            return Err(ControllerError::Disagreement {
                key: "rate",
                task: format!("{} per second", self.rate),
                plant: format!("{} ns between ticks", run.period_ns),
            });
        }
        Ok(())
    }
}
