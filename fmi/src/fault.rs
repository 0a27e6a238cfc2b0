//! The reasons for which a call is refused.

use freeplay_plant::SystemError;
use thiserror::Error;

/// Why a call is refused.
#[derive(Debug, Error)]
pub enum Fault {
    /// A call in a mode in which FMI does not allow it.
    #[error("{call} is not allowed {mode}")]
    Mode {
        /// The call.
        call: &'static str,
        /// The mode, in words.
        mode: &'static str,
    },
    /// A value reference that no variable of this type has.
    #[error("no variable of this type has the value reference {0}")]
    Reference(u32),
    /// A variable that can't be set, or not now.
    #[error("`{0}` can't be set now: inputs are set before a step, parameters before the start")]
    ReadOnly(String),
    /// A value out of its range.
    #[error("`{name}` = {value} is out of range; it must be {least:e} to {most:e}")]
    Range {
        /// The variable.
        name: String,
        /// Its value.
        value: f64,
        /// Least value.
        least: f64,
        /// Greatest value.
        most: f64,
    },
    /// A step that the fixed step does not fit into.
    #[error("a step of {0} s: the communication step must be a whole multiple of 0.001 s")]
    Step(f64),
    /// A step from another time than the machine's.
    #[error("a step from {asked} s, but the machine is at {now} s")]
    Time {
        /// The time asked for.
        asked: f64,
        /// The machine's.
        now: f64,
    },
    /// No state where one was to be.
    #[error("no state was given, or bytes that are no state of a Freeplay FMU")]
    NoState,
    /// A state of another FMU.
    #[error(
        "the state is that of another FMU or version; take it from an FMU of the same arm file that this version of freeplay wrote"
    )]
    Foreign,
    /// A serialised state that is cut or changed.
    #[error("the bytes of the state are cut or changed; serialise the state again")]
    Damaged,
    /// The machine can't be built or stepped.
    #[error(transparent)]
    Machine(#[from] SystemError),
}
