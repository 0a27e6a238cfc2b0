//! [`LinkError`]: reasons why a link could not be opened or used.

use std::io;
use std::path::{Path, PathBuf};
use std::time::Duration;

use thiserror::Error;

use crate::handshake::Verdict;
use crate::limits::{MAX_ROOT, MAX_SLOTS};

/// Reasons why a run or a link could not be opened or used, with the remedy.
#[derive(Debug, Error)]
pub enum LinkError {
    /// No address was given.
    #[error(
        "no run to join: set FREEPLAY_RUN or pass --run, as `freeplay run` does for the controllers it starts"
    )]
    NoAddress,
    /// The text is not an address.
    #[error(
        "'{text}' is no address of a run: expected an absolute path of at most {MAX_ROOT} bytes ending in a run id"
    )]
    BadAddress {
        /// The given text.
        text: String,
    },
    /// The run's folder does not exist.
    #[error("no run lives at {}: it has ended, or the address is wrong", path.display())]
    NoRun {
        /// The missing folder.
        path: PathBuf,
    },
    /// A folder or file of the run could not be made or read.
    #[error("cannot {doing} {}: {source}; set FREEPLAY_SHM to a folder of yours on tmpfs", path.display())]
    Folder {
        /// The attempted operation.
        doing: &'static str,
        /// The path of the operation.
        path: PathBuf,
        /// The error of the operating system.
        source: io::Error,
    },
    /// Other users can write to the folder of all runs, and could read or change messages.
    #[error(
        "{} is not a folder of this user alone (owner {owner}, mode {mode:o}): have its owner remove it, or set FREEPLAY_SHM to a folder of yours on tmpfs",
        path.display()
    )]
    NotPrivate {
        /// The folder.
        path: PathBuf,
        /// User id of its owner.
        owner: u32,
        /// Permission bits of the folder.
        mode: u32,
    },
    /// A link or a file has the path of the folder of all runs.
    #[error(
        "{} is not a folder of this user alone but a file or a link of user {owner}: have it removed, or set FREEPLAY_SHM to a folder of yours on tmpfs",
        path.display()
    )]
    NoFolder {
        /// The expected path of the folder.
        path: PathBuf,
        /// User id of the owner of the link or file.
        owner: u32,
    },
    /// Another user could replace the folder of all runs.
    #[error(
        "other users can rename files in {} (owner {owner}, mode {mode:o}): take their right to write with chmod go-w, set its sticky bit with chmod +t, or set FREEPLAY_SHM to a folder of yours on tmpfs",
        path.display()
    )]
    Open {
        /// The parent of the folder of all runs.
        path: PathBuf,
        /// User id of its owner.
        owner: u32,
        /// Permission bits of the folder.
        mode: u32,
    },
    /// Another user has created a file with the name of a segment of this run.
    #[error("{} belongs to user {owner} or is no file: somebody interferes with this run; start it again", path.display())]
    Planted {
        /// The file.
        path: PathBuf,
        /// User id of its owner.
        owner: u32,
    },
    /// Shared memory is full or nearly full.
    #[error(
        "no room for a run in {}: {} KiB are free, {} KiB are needed; remove what fills it, or give it more with mount -o remount,size=",
        path.display(),
        free >> 10,
        needed >> 10
    )]
    NoRoom {
        /// Path of the shared memory.
        path: PathBuf,
        /// Free space, bytes.
        free: u64,
        /// Required space, bytes.
        needed: u64,
    },
    /// This process cannot allocate the memory for the messages of a run.
    #[error(
        "no memory for the messages of a run ({} MiB): allow this process more (ulimit -v), or end other programs",
        bytes >> 20
    )]
    NoMemory {
        /// Requested memory, bytes.
        bytes: usize,
    },
    /// No plant answered the hello in time.
    #[error("no plant answered within {patience:?}{}: is it running?", waiting_for(last.as_ref()))]
    NoPlant {
        /// Time for which the controller tried.
        patience: Duration,
        /// The last obstacle.
        last: Option<String>,
    },
    /// The plant refused this controller.
    #[error("the plant refused this controller: {reason}")]
    Refused {
        /// The plant's verdict; `None` if this version does not know its code.
        verdict: Option<Verdict>,
        /// The mismatch and its remedy.
        reason: String,
    },
    /// The link has no slot of that number.
    #[error("slot {slot} was requested, but this run has slots 0 to {}", slots.saturating_sub(1))]
    NoSlot {
        /// The requested number.
        slot: usize,
        /// Number of slots.
        slots: usize,
    },
    /// The requested number of slots exceeds the maximum of a run.
    #[error("{slots} slots were requested, but a run has 1 to {MAX_SLOTS}")]
    SlotCount {
        /// The requested number.
        slots: usize,
    },
    /// The run already has a plant.
    #[error("the run at {} has a plant already: end it first, or start a run of its own", path.display())]
    PlantExists {
        /// The run's folder.
        path: PathBuf,
    },
    /// The transport failed.
    #[error("cannot {doing} {service}: iceoryx2 says {cause}")]
    Transport {
        /// The attempted operation.
        doing: &'static str,
        /// The service of the operation.
        service: String,
        /// The error of iceoryx2.
        cause: String,
    },
}

/// Converts the error of the operating system during `doing` on `path` into a [`LinkError`].
pub(crate) fn folder_fault(doing: &'static str, path: &Path) -> impl FnOnce(io::Error) -> LinkError + use<> {
    let path = path.to_owned();
    move |source| LinkError::Folder { doing, path, source }
}

fn waiting_for(last: Option<&String>) -> String {
    last.map_or_else(String::new, |last| format!(" (last: {last})"))
}
