//! The errors of a controller's process that ended before the last tick.

use std::time::Duration;

use freeplay_shm::{LinkError, MessageFault};
use thiserror::Error;

use crate::controller_error::ControllerError;
use crate::task::TaskError;

/// Reasons why a controller's process ended before the last tick.
#[derive(Debug, Error)]
pub enum ServeError {
    /// The command line cannot be understood.
    #[error("{0}")]
    Usage(String),
    /// The run could not be joined, or the link failed.
    #[error(transparent)]
    Link(#[from] LinkError),
    /// The controller could not start.
    #[error(transparent)]
    Controller(#[from] ControllerError),
    /// The welcome contains a value that this version does not know.
    #[error(
        "the plant's welcome says {field} = {code}, which this version does not know: rebuild both sides from one version"
    )]
    UnknownCode {
        /// Name of the field.
        field: &'static str,
        /// Code in the field.
        code: u32,
    },
    /// A state is not one of this run.
    #[error("the state is invalid: {0}")]
    Message(#[from] MessageFault),
    /// The plant is gone.
    #[error("the plant is gone: no state for {waited:?} after {states} states{cause}")]
    PlantGone {
        /// The waiting time without a state.
        waited: Duration,
        /// Number of states received before.
        states: u64,
        /// Further information on the cause, beginning with a separator.
        cause: &'static str,
    },
    /// The controller panicked; its message has been printed.
    #[error("the controller {controller} panicked {at}; the plant has been left to its fallback")]
    Panicked {
        /// Name of the controller.
        controller: String,
        /// Time of the panic.
        at: String,
    },
    /// The handlers of the signals could not be installed.
    #[error("cannot install the handlers of SIGINT and SIGTERM: {0}")]
    Signals(#[from] std::io::Error),
}

impl ServeError {
    /// Exit code of a process that ends in this way: 2 usage, 3 bad input, 5 peer missing, 70 internal fault.
    pub fn exit_code(&self) -> u8 {
        match self {
            ServeError::Usage(_) | ServeError::Link(LinkError::NoAddress | LinkError::BadAddress { .. }) => 2,
            ServeError::Controller(_) | ServeError::UnknownCode { .. } | ServeError::Message(_) => 3,
            ServeError::Link(LinkError::Refused { .. } | LinkError::NoSlot { .. }) => 3,
            ServeError::Link(LinkError::NoRun { .. } | LinkError::NoPlant { .. }) => 5,
            ServeError::PlantGone { .. } => 5,
            ServeError::Link(_) | ServeError::Panicked { .. } | ServeError::Signals(_) => 70,
        }
    }
}

impl From<TaskError> for ServeError {
    fn from(error: TaskError) -> ServeError {
        ServeError::Controller(error.into())
    }
}
