//! Third-party FMUs as controllers: FMI 2.0 and 3.0 Co-Simulation.
//!
//! - [`unpack`]: unpacks the archive into a folder; no entry can lead out of it.
//! - [`Guest`]: the description: identifier, token, and the numeric inputs and outputs.
//! - [`Mapping`]: the signal of a run for each variable, by its name or by a table in TOML.
//! - [`Opened`]: an unpacked and described FMU; [`Slave`]: its running shared library, the only other place with `unsafe`.
//! - [`FmuController`]: all of these as a controller.

mod archive;
mod controller;
mod describe;
mod mapping;
mod opened;
mod slave;

pub use archive::unpack;
pub use controller::FmuController;
pub use describe::{Guest, Version};
pub use mapping::{Mapping, Signal};
pub use opened::Opened;
pub use slave::Slave;

use std::path::PathBuf;

use thiserror::Error;

/// Reasons why an FMU cannot be used as a controller.
#[derive(Debug, Error)]
pub enum GuestError {
    /// A file cannot be read or written.
    #[error(transparent)]
    Storage(#[from] freeplay_storage::StorageError),
    /// The archive is invalid or unsafe.
    #[error("{0}; export the FMU again")]
    Archive(String),
    /// The description cannot be used.
    #[error("modelDescription.xml: {0}")]
    Description(String),
    /// The FMU has no library for this platform.
    #[error("the FMU has no library {}; it has {found}: export it for this platform", wanted.display())]
    Platform {
        /// The missing library.
        wanted: PathBuf,
        /// The platforms of its libraries.
        found: String,
    },
    /// The library cannot be loaded, or is not an FMI library.
    #[error("the library of the FMU can't be used: {said}; {remedy}")]
    Library {
        /// The error of the operating system.
        said: String,
        /// The remedy.
        remedy: &'static str,
    },
    /// The FMU refused a call.
    #[error("the FMU refuses {call} (status {status}){}", if said.is_empty() { String::new() } else { format!(": {said}") })]
    Refused {
        /// The call.
        call: &'static str,
        /// Status of the call.
        status: i32,
        /// The last message of the FMU.
        said: String,
    },
    /// A variable without a signal of the run.
    #[error(
        "a run does not know the {role} `{name}` of the FMU; write {name:?} = \"{example}\" under [{role}s] in {}, or \"\" to leave it alone",
        file.display()
    )]
    Unknown {
        /// Input or output.
        role: &'static str,
        /// Name of the variable.
        name: String,
        /// An example of a valid entry.
        example: String,
        /// The mapping file.
        file: PathBuf,
    },
    /// A joint without a command.
    #[error("no output of the FMU is the command of {joint}; name one `command.{joint}`, or write it under [outputs] in {}", file.display())]
    NoCommand {
        /// The joint.
        joint: String,
        /// The mapping file.
        file: PathBuf,
    },
    /// The mapping file cannot be read.
    #[error("{}: {what}", file.display())]
    Mapping {
        /// The file.
        file: PathBuf,
        /// Text of the fault.
        what: String,
    },
}
