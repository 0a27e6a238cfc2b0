//! [`PlantSeat`]: who is the plant of a run.

use std::fs::{File, TryLockError};
use std::os::unix::fs::OpenOptionsExt;
use std::thread::sleep;
use std::time::Duration;

use crate::address::Address;
use crate::error::{LinkError, folder_fault};

/// Who is the plant of a run: the process that holds the lock on a file in the run's folder.
#[derive(Debug)]
pub(crate) struct PlantSeat {
    file: File,
}

impl PlantSeat {
    /// Takes the seat.
    pub(crate) fn take(address: &Address) -> Result<Self, LinkError> {
        let seat = Self::watch(address)?;
        // A controller that looks whether the plant lives holds the lock for a moment.
        for _ in 0..20 {
            match seat.file.try_lock() {
                Ok(()) => return Ok(seat),
                Err(TryLockError::WouldBlock) => sleep(Duration::from_millis(1)),
                Err(TryLockError::Error(error)) => return Err(folder_fault("lock", address.root())(error)),
            }
        }
        Err(LinkError::PlantExists { path: address.root().to_owned() })
    }

    /// Watches the seat without taking it.
    pub(crate) fn watch(address: &Address) -> Result<Self, LinkError> {
        let path = address.root().join("plant.lock");
        let mut options = File::options();
        options.create(true).append(true).mode(0o600);
        let file = options.open(&path).map_err(folder_fault("open", &path))?;
        Ok(Self { file })
    }

    /// Whether a living process has taken the seat.
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
