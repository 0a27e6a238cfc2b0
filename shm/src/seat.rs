//! [`Seat`]: an exclusive role in a run, held by one process at a time.

use std::fs::{self, File, TryLockError};
use std::os::unix::fs::{MetadataExt, OpenOptionsExt};
use std::thread::sleep;
use std::time::Duration;

use rustix::fs::OFlags;

use crate::address::Address;
use crate::error::{LinkError, folder_fault};

/// Number of attempts, a millisecond apart, while another process holds the seat exclusively. A process just started by the holder shares
/// its lock for a moment.
const LOOKS_AT_TAKEN: u32 = 20;
/// Total number of attempts. A process that checks the seat holds a shared lock until it runs again, which takes long on a busy machine.
const LOOKS: u32 = 500;

/// The system's list of all locks.
const LOCKS: &str = "/proc/locks";

/// An exclusive role in a run: the plant, or a controller in its slot. It is the exclusive `flock` on a file in the run's folder,
/// `plant.lock` or `slot-<n>.lock`, so the kernel frees it however the process ends.
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
        let flags = (OFlags::NOFOLLOW | OFlags::NONBLOCK).bits() as i32;
        options.create(true).append(true).mode(0o600).custom_flags(flags);
        let file = options.open(&path).map_err(folder_fault("open", &path))?;
        Ok(Self { file })
    }

    /// Takes the seat until this value is dropped; returns `false` if another process holds it.
    pub(crate) fn take(&self) -> Result<bool, LinkError> {
        let mut taken = 0;
        for _ in 0..LOOKS {
            match self.file.try_lock() {
                Ok(()) => return Ok(true),
                Err(TryLockError::WouldBlock) => taken += u32::from(self.is_taken()),
                Err(TryLockError::Error(source)) => {
                    return Err(LinkError::Folder {
                        doing: "lock a file of",
                        path: "the run".into(),
                        source,
                    });
                }
            }
            if taken >= LOOKS_AT_TAKEN {
                break;
            }
            sleep(Duration::from_millis(1));
        }
        Ok(false)
    }

    /// Returns true if another living process holds the seat. The holder itself must not call it.
    pub(crate) fn is_taken(&self) -> bool {
        match self.file.try_lock_shared() {
            Ok(()) => {
                let _ = self.file.unlock();
                false
            }
            Err(_) => true,
        }
    }

    /// Returns true if the process `pid` holds the seat according to the system's list of locks. If the list does not contain this lock
    /// (another process namespace), the function returns true if any process holds it. It reads a file of the system and is too slow for
    /// the loop.
    pub(crate) fn is_held_by(&self, pid: u32) -> bool {
        let listed = fs::read_to_string(LOCKS).unwrap_or_default();
        let inode = self.file.metadata().map_or(0, |metadata| metadata.ino());
        let holders: Vec<u32> = listed.lines().filter_map(|line| holder(line, inode)).collect();
        self.is_taken() && (holders.is_empty() || holders.contains(&pid))
    }
}

/// The process that holds an exclusive `flock` on the file `inode` according to `line` of the list of locks, as in `3: FLOCK  ADVISORY
/// WRITE 4711 00:1b:346579 0 EOF`. Process 0 belongs to another namespace.
fn holder(line: &str, inode: u64) -> Option<u32> {
    let mut words = line.split_ascii_whitespace().skip(1);
    let is_exclusive = [words.next()?, words.next()?, words.next()?] == ["FLOCK", "ADVISORY", "WRITE"];
    let pid: u32 = words.next()?.parse().ok()?;
    let of: u64 = words.next()?.rsplit(':').next()?.parse().ok()?;
    (is_exclusive && pid > 0 && of == inode).then_some(pid)
}

#[cfg(test)]
mod tests {
    use super::holder;

    #[test]
    fn the_list_of_locks_names_who_holds_a_file() {
        let line = "12: FLOCK  ADVISORY  WRITE 4711 00:1b:346579 0 EOF";
        assert_eq!(holder(line, 346_579), Some(4711));
        for (line, inode) in [
            (line, 346_580),
            ("12: FLOCK  ADVISORY  READ  4711 00:1b:346579 0 EOF", 346_579),
            ("12: POSIX  ADVISORY  WRITE 4711 00:1b:346579 0 EOF", 346_579),
            ("12: -> FLOCK  ADVISORY  WRITE 4711 00:1b:346579 0 EOF", 346_579),
            ("12: FLOCK  ADVISORY  WRITE 0 00:1b:346579 0 EOF", 346_579),
            ("", 0),
        ] {
            assert_eq!(holder(line, inode), None, "{line}");
        }
    }
}
