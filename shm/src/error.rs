//! [`LinkError`]: why a link could not be opened or used.

use std::io;
use std::path::{Path, PathBuf};
use std::time::Duration;

use thiserror::Error;

use crate::handshake::Verdict;
use crate::limits::{MAX_ROOT, MAX_SLOTS};

/// Why a run or a link could not be opened or used, with the remedy.
#[derive(Debug, Error)]
pub enum LinkError {
    /// No address was given.
    #[error(
        "no run to join: set FREEPLAY_RUN or pass --run, as `freeplay run` does for the controllers it starts"
    )]
    NoAddress,
    /// The text is no address.
    #[error(
        "'{text}' is no address of a run: expected an absolute path of at most {MAX_ROOT} bytes ending in a run id"
    )]
    BadAddress {
        /// What was given.
        text: String,
    },
    /// The run's folder is not there.
    #[error("no run lives at {}: it has ended, or the address is wrong", path.display())]
    NoRun {
        /// The folder looked for.
        path: PathBuf,
    },
    /// A folder or file of the run could not be made or read.
    #[error("cannot {doing} {}: {source}; set FREEPLAY_SHM to a folder of yours on tmpfs", path.display())]
    Folder {
        /// What was tried.
        doing: &'static str,
        /// On what.
        path: PathBuf,
        /// What the system said.
        source: io::Error,
    },
    /// The folder of all runs can be written by others, so another user could read or change messages.
    #[error(
        "{} is not a folder of this user alone (owner {owner}, mode {mode:o}): have its owner remove it, or set FREEPLAY_SHM to a folder of yours on tmpfs",
        path.display()
    )]
    NotPrivate {
        /// The folder.
        path: PathBuf,
        /// User id of its owner.
        owner: u32,
        /// Its permission bits.
        mode: u32,
    },
    /// A link or a file is where the folder of all runs should be.
    #[error(
        "{} is not a folder of this user alone but a file or a link of user {owner}: have it removed, or set FREEPLAY_SHM to a folder of yours on tmpfs",
        path.display()
    )]
    NoFolder {
        /// Where the folder should be.
        path: PathBuf,
        /// User id of the owner of what is there.
        owner: u32,
    },
    /// Another user could exchange the folder of all runs for another.
    #[error(
        "other users can rename files in {} (owner {owner}, mode {mode:o}): take their right to write with chmod go-w, set its sticky bit with chmod +t, or set FREEPLAY_SHM to a folder of yours on tmpfs",
        path.display()
    )]
    Open {
        /// The folder in which that of all runs would be.
        path: PathBuf,
        /// User id of its owner.
        owner: u32,
        /// Its permission bits.
        mode: u32,
    },
    /// Somebody else has made a file under the name of a segment of this run.
    #[error("{} belongs to user {owner} or is no file: somebody interferes with this run; start it again", path.display())]
    Planted {
        /// The file.
        path: PathBuf,
        /// User id of its owner.
        owner: u32,
    },
    /// Shared memory is full, or nearly.
    #[error(
        "no room for a run in {}: {} KiB are free, {} KiB are needed; remove what fills it, or give it more with mount -o remount,size=",
        path.display(),
        free >> 10,
        needed >> 10
    )]
    NoRoom {
        /// Where shared memory is.
        path: PathBuf,
        /// What is free, bytes.
        free: u64,
        /// What has to be, bytes.
        needed: u64,
    },
    /// This process may not have the memory that the messages of a run need.
    #[error(
        "no memory for the messages of a run ({} MiB): allow this process more (ulimit -v), or end other programs",
        bytes >> 20
    )]
    NoMemory {
        /// What was asked for, bytes.
        bytes: usize,
    },
    /// Nobody answered the hello in time.
    #[error("no plant answered within {patience:?}{}: is it running, and does it greet?", waiting_for(last.as_ref()))]
    NoPlant {
        /// How long the controller tried.
        patience: Duration,
        /// What stood in the way last.
        last: Option<String>,
    },
    /// The plant answered that this controller may not take part.
    #[error("the plant refused this controller: {reason}")]
    Refused {
        /// The plant's verdict; `None` if this version does not know its code.
        verdict: Option<Verdict>,
        /// What does not fit and what to do.
        reason: String,
    },
    /// The link has no slot of that number.
    #[error("slot {slot} asked for, this run has slots 0 to {}", slots.saturating_sub(1))]
    NoSlot {
        /// The number asked for.
        slot: usize,
        /// How many there are.
        slots: usize,
    },
    /// More slots than a run can have.
    #[error("{slots} slots asked for, a run has 1 to {MAX_SLOTS}")]
    SlotCount {
        /// The number asked for.
        slots: usize,
    },
    /// The run has a plant already.
    #[error("the run at {} has a plant already: end it first, or start a run of its own", path.display())]
    PlantExists {
        /// The run's folder.
        path: PathBuf,
    },
    /// The transport failed.
    #[error("cannot {doing} {service}: iceoryx2 says {cause}")]
    Transport {
        /// What was tried.
        doing: &'static str,
        /// On which service.
        service: String,
        /// What iceoryx2 said.
        cause: String,
    },
}

/// What the system said while `doing` something on `path`, as our error.
pub(crate) fn folder_fault(doing: &'static str, path: &Path) -> impl FnOnce(io::Error) -> LinkError + use<> {
    let path = path.to_owned();
    move |source| LinkError::Folder { doing, path, source }
}

fn waiting_for(last: Option<&String>) -> String {
    last.map_or_else(String::new, |last| format!(" (last: {last})"))
}
