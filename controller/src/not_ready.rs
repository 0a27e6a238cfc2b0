//! Errors of a built-in controller that cannot start.

use freeplay_arm::ArmError;
use freeplay_controller_sdk::ControllerError;
use freeplay_laws::LawError;
use freeplay_model::ModelError;
use freeplay_path::PathError;
use thiserror::Error;

use crate::horizon::HorizonError;
use crate::qp::QpError;
use crate::remainder::WeightError;

/// A fault in the set-up of a built-in controller.
#[derive(Debug, Error)]
pub enum NotReady {
    /// The arm file cannot be used.
    #[error(transparent)]
    Model(#[from] ModelError),
    /// The arm with play cannot be built.
    #[error(transparent)]
    Arm(#[from] ArmError),
    /// An effect of the arm file cannot be used.
    #[error("the controller's model: {0}")]
    Law(#[from] LawError),
    /// The reference motion cannot be planned on the model.
    #[error("the controller's reference motion: {0}")]
    Path(#[from] PathError),
    /// The compensation programme cannot be set up.
    #[error(transparent)]
    Qp(#[from] QpError),
    /// The compensation's horizon cannot be set up.
    #[error(transparent)]
    Horizon(#[from] HorizonError),
    /// The file of a learned remainder cannot be used.
    #[error(transparent)]
    Weights(#[from] WeightError),
    /// The file of a learned remainder is for another machine or model.
    #[error("{file}: {source}")]
    OtherWeights {
        /// The weight file.
        file: String,
        /// The difference.
        source: Box<WeightError>,
    },
    /// Task and plant contradict each other.
    #[error(transparent)]
    Task(#[from] ControllerError),
}

impl From<NotReady> for ControllerError {
    fn from(fault: NotReady) -> Self {
        match fault {
            NotReady::Task(fault) => fault,
            fault => Self::Custom(Box::new(fault)),
        }
    }
}
