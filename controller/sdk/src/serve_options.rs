//! The run that a controller is to join, and the options for that.

use std::time::Duration;

use freeplay_shm::realtime::RtRequest;
use freeplay_shm::{Address, LinkError, RUN_ENV};

use crate::serve_error::ServeError;

/// Environment variable with the number of the controller's slot; 0 if it is not set.
pub const SLOT_ENV: &str = "FREEPLAY_SLOT";

/// Environment variable with the least time, s, for which a controller waits for its plant; `freeplay run` sets it to the patience of the scenario.
pub const PATIENCE_ENV: &str = "FREEPLAY_PATIENCE";

/// A controller waits this long for its plant if no longer time is requested.
const PATIENCE: Duration = Duration::from_secs(10);

/// Options for joining a run.
#[derive(Clone, Debug)]
pub struct ServeOptions {
    /// Address of the run.
    pub address: Address,
    /// The requested slot.
    pub slot: u32,
    /// The longest wait for the plant's welcome, and for each state.
    pub patience: Duration,
    /// The priority and the core that the answering thread requests from the system.
    pub realtime: RtRequest,
}

impl ServeOptions {
    /// Options for the run at `address`: slot 0, a patience of ten seconds or [`PATIENCE_ENV`], whichever is longer, and no real-time request.
    pub fn new(address: Address) -> ServeOptions {
        let asked = std::env::var(PATIENCE_ENV).ok().and_then(|seconds| seconds.parse().ok());
        let asked = asked.and_then(|seconds| Duration::try_from_secs_f64(seconds).ok());
        let patience = asked.map_or(PATIENCE, |asked| asked.max(PATIENCE));
        ServeOptions { address, slot: 0, patience, realtime: RtRequest::default() }
    }

    /// Options from the arguments of a command line (`--run ADDRESS`, `--slot N`; others are ignored), or else from the environment variables
    ///
    /// # Errors
    /// [`ServeError::Usage`] for a flag without a value or a slot that is not a number; [`ServeError::Link`] without a valid address.
    pub fn from_args(arguments: impl IntoIterator<Item = String>) -> Result<ServeOptions, ServeError> {
        let mut arguments = arguments.into_iter();
        let (mut run, mut slot) = (std::env::var(RUN_ENV).ok(), std::env::var(SLOT_ENV).ok());
        while let Some(argument) = arguments.next() {
            let (flag, value) = match argument.split_once('=') {
                Some((flag, value)) => (flag, Some(value.to_owned())),
                None => (argument.as_str(), None),
            };
            let target = match flag {
                "--run" => &mut run,
                "--slot" => &mut slot,
                _ => continue,
            };
            let value = value.or_else(|| arguments.next());
            *target = Some(value.ok_or_else(|| ServeError::Usage(format!("{flag} needs a value")))?);
        }
        let address = Address::parse(&run.ok_or(LinkError::NoAddress)?)?;
        let slot = match slot {
            None => 0,
            Some(text) => text.parse().map_err(|_| {
                ServeError::Usage(format!("slot {text:?} is not a number: give --slot 0 or {SLOT_ENV}=0"))
            })?,
        };
        Ok(ServeOptions { slot, ..ServeOptions::new(address) })
    }
}
