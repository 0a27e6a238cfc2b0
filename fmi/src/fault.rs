//! Errors of refused calls.

use freeplay_plant::SystemError;
use thiserror::Error;

/// Reasons why a call is refused.
#[derive(Debug, Error)]
pub enum Fault {
    /// A call in a mode in which FMI does not allow it.
    #[error("{call} is not allowed {mode}")]
    Mode {
        /// The call.
        call: &'static str,
        /// Text for the mode.
        mode: &'static str,
    },
    /// A value reference without a variable of this type.
    #[error("no variable of this type has the value reference {0}")]
    Reference(u32),
    /// A variable that cannot be set, or not at this time.
    #[error("`{0}` can't be set now: inputs are set before a step, parameters before the start")]
    ReadOnly(String),
    /// A value out of its range.
    #[error("`{name}` = {value} is out of range; it must be {least:e} to {most:e}")]
    Range {
        /// The variable.
        name: String,
        /// Value of the variable.
        value: f64,
        /// Least value.
        least: f64,
        /// Greatest value.
        most: f64,
    },
    /// A step that is not a multiple of the fixed step.
    #[error("a step of {0} s: the communication step must be a whole multiple of 0.001 s")]
    Step(f64),
    /// A step that starts at a time other than that of the machine.
    #[error("a step from {asked} s, but the machine is at {now} s")]
    Time {
        /// The requested time.
        asked: f64,
        /// The time of the machine.
        now: f64,
    },
    /// A missing state.
    #[error("the state is missing, or its bytes are no state of a Freeplay FMU")]
    NoState,
    /// A state of another FMU.
    #[error(
        "the state is that of another FMU or version; take it from an FMU of the same arm file that this version of freeplay wrote"
    )]
    Foreign,
    /// A truncated or altered serialised state.
    #[error("the bytes of the state are cut or changed; serialise the state again")]
    Damaged,
    /// The machine cannot be built or stepped.
    #[error(transparent)]
    Machine(#[from] SystemError),
}
