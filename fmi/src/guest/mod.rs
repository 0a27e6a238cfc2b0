//! FMUs of others as controllers: FMI 2.0 and 3.0 Co-Simulation.
//!
//! - [`unpack`]: the archive into a folder, which nothing in it leads out of.
//! - [`Guest`]: the description: identifier, token, and the numbers that go in and out.
//! - [`Mapping`]: which number of a run each variable is, by its name or by a table in TOML.
//! - [`Opened`]: an FMU unpacked and described; [`Slave`]: its shared library at work, the only other place with `unsafe`.
//! - [`FmuController`]: all of it behind the trait of a controller.

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

/// Why an FMU can't be used as a controller.
#[derive(Debug, Error)]
pub enum GuestError {
    /// A file can't be read or written.
    #[error(transparent)]
    Storage(#[from] freeplay_storage::StorageError),
    /// The archive is none, or one that is not to be trusted.
    #[error("{0}; export the FMU again")]
    Archive(String),
    /// The description can't be used.
    #[error("modelDescription.xml: {0}")]
    Description(String),
    /// No library for this platform.
    #[error("the FMU has no library {}; it has {found}: export it for this platform", wanted.display())]
    Platform {
        /// The library that is missing.
        wanted: PathBuf,
        /// The platforms that it is for.
        found: String,
    },
    /// The library can't be loaded, or is none of FMI.
    #[error("the library of the FMU can't be used: {said}; {remedy}")]
    Library {
        /// What the system says.
        said: String,
        /// What to do.
        remedy: &'static str,
    },
    /// The FMU refused a call.
    #[error("the FMU refuses {call} (status {status}){}", if said.is_empty() { String::new() } else { format!(": {said}") })]
    Refused {
        /// The call.
        call: &'static str,
        /// Its status.
        status: i32,
        /// The last message of the FMU.
        said: String,
    },
    /// A variable that is no number of a run.
    #[error(
        "the {role} `{name}` of the FMU is none that a run knows; write {name:?} = \"{example}\" under [{role}s] in {}, or \"\" to leave it alone",
        file.display()
    )]
    Unknown {
        /// Input or output.
        role: &'static str,
        /// Its name.
        name: String,
        /// What could stand there.
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
    /// The mapping file can't be read.
    #[error("{}: {what}", file.display())]
    Mapping {
        /// The file.
        file: PathBuf,
        /// The fault, in words.
        what: String,
    },
}
