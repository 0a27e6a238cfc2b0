//! [`Seat`]: a part in a run that one process has at a time.

use std::fs::{File, TryLockError};
use std::os::unix::fs::OpenOptionsExt;
use std::thread::sleep;
use std::time::Duration;

use crate::address::Address;
use crate::error::{LinkError, folder_fault};

/// How often to look for a seat that is taken, a millisecond apart: who merely looks at it, and a process that has just been
/// started by one that sits, hold it for a moment.
const LOOKS: u32 = 20;

/// A part in a run that one process has at a time: the plant, or a controller in its slot. It is the exclusive `flock` on a
/// file in the run's folder, `plant.lock` or `slot-<n>.lock`, so the kernel frees it however the process ends.
#[derive(Debug)]
pub(crate) struct Seat {
    file: File,
}

impl Seat {
    /// The seat of the plant.
    pub(crate) fn of_plant(address: &Address) -> Result<Self, LinkError> {
        Self::open(address, "plant.lock")
    }

    /// The seat of the controller in `slot`.
    pub(crate) fn of_controller(address: &Address, slot: u32) -> Result<Self, LinkError> {
        Self::open(address, &format!("slot-{slot}.lock"))
    }

    fn open(address: &Address, name: &str) -> Result<Self, LinkError> {
        let path = address.root().join(name);
        let mut options = File::options();
        options.create(true).append(true).mode(0o600);
        let file = options.open(&path).map_err(folder_fault("open", &path))?;
        Ok(Self { file })
    }

    /// Takes the seat until this is dropped, or returns `false` if another process has it.
    pub(crate) fn take(&self) -> Result<bool, LinkError> {
        for _ in 0..LOOKS {
            match self.file.try_lock() {
                Ok(()) => return Ok(true),
                Err(TryLockError::WouldBlock) => sleep(Duration::from_millis(1)),
                Err(TryLockError::Error(source)) => {
                    return Err(LinkError::Folder {
                        doing: "lock a file of",
                        path: "the run".into(),
                        source,
                    });
                }
            }
        }
        Ok(false)
    }

    /// Whether another living process has taken the seat. Not for who has taken it itself.
    pub(crate) fn is_taken(&self) -> bool {
        match self.file.try_lock_shared() {
            Ok(()) => {
                let _ = self.file.unlock();
                false
            }
            Err(_) => true,
        }
    }
}
