//! [`Seat`]: a part in a run that one process has at a time.

use std::fs::{self, File, TryLockError};
use std::os::unix::fs::{MetadataExt, OpenOptionsExt};
use std::thread::sleep;
use std::time::Duration;

use rustix::fs::OFlags;

use crate::address::Address;
use crate::error::{LinkError, folder_fault};

/// How often to look for a seat, a millisecond apart, while somebody else sits there: a process that has just been started by one that sits
/// holds it for a moment, too.
const LOOKS_AT_TAKEN: u32 = 20;
/// And in all: who merely looks at it holds it until it gets the processor again, which on a busy machine lasts.
const LOOKS: u32 = 500;

/// The system's list of all locks.
const LOCKS: &str = "/proc/locks";

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
        let flags = (OFlags::NOFOLLOW | OFlags::NONBLOCK).bits() as i32;
        options.create(true).append(true).mode(0o600).custom_flags(flags);
        let file = options.open(&path).map_err(folder_fault("open", &path))?;
        Ok(Self { file })
    }

    /// Takes the seat until this is dropped, or returns `false` if another process has it.
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

    /// Whether the process `pid` has taken the seat, by the system's list of locks. Where that does not show this lock (another
    /// namespace of processes), whether anybody has. Reads a file of the system: not for the loop.
    pub(crate) fn is_held_by(&self, pid: u32) -> bool {
        let listed = fs::read_to_string(LOCKS).unwrap_or_default();
        let inode = self.file.metadata().map_or(0, |metadata| metadata.ino());
        let holders: Vec<u32> = listed.lines().filter_map(|line| holder(line, inode)).collect();
        self.is_taken() && (holders.is_empty() || holders.contains(&pid))
    }
}

/// The process that holds an exclusive `flock` on the file `inode`, if `line` of the list of locks says so, as in
/// `3: FLOCK  ADVISORY  WRITE 4711 00:1b:346579 0 EOF`. Process 0 is one of another namespace.
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
