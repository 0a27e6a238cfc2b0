//! The shared memory objects of a run. iceoryx2 keeps the objects of all programs in one folder; a prefix distinguishes them.
//!
//! Every user may put files of any name and type into `/dev/shm`. The program reads, changes or removes only regular files of this user; it
//! ignores all others, whatever their name.

use std::collections::BTreeSet;
use std::ffi::{CStr, CString};
use std::fs;
use std::io::{self, ErrorKind, Read, Write};
use std::path::Path;
use std::thread::sleep;
use std::time::Duration;

use rustix::process::getuid;

use crate::address::Address;
use crate::error::{LinkError, folder_fault};
use crate::limits::MAX_ROOT;
use crate::open_folder::{OpenFolder, is_own_file};

/// Folder of the POSIX shared memory objects on Linux.
pub(crate) const SEGMENTS: &str = "/dev/shm";

/// Prefix of the names of all segments.
const PREFIX: &str = "freeplay-";

/// Second part of the name of the mark file, which contains the path of a run's folder. With it, a sweep finds the segments of a dead run even
/// if the folder is gone.
const MARK: &str = "_root";

/// Time for which a segment may stay empty, ms; a living process sets its size within microseconds of creating it.
const BIRTH_MS: u32 = 200;

/// Most bytes read from a segment that other users may write to; that of iceoryx2 has 16.
const MOST_SHARED: u64 = 4096;

/// Free shared memory required before a process joins a run, bytes. The segments of a run with all slots use a part of it; a test measures how
/// much.
pub const ROOM: u64 = 8 << 20;

fn no_room(free: u64) -> LinkError {
    LinkError::NoRoom { path: SEGMENTS.into(), free, needed: ROOM }
}

/// The folder of all segments.
pub(crate) struct Segments(OpenFolder);

impl Segments {
    /// Opens the folder of this machine.
    pub(crate) fn open() -> Result<Self, LinkError> {
        // Only the superuser could have replaced this path by a link.
        let path = fs::canonicalize(SEGMENTS).unwrap_or_else(|_| SEGMENTS.into());
        OpenFolder::open(&path).map(Self).map_err(folder_fault("open", Path::new(SEGMENTS)))
    }

    /// Writes a mark file with the path of the run's folder next to the run's segments.
    pub(crate) fn mark(&self, address: &Address) -> io::Result<()> {
        let mut file = self.0.make_file(mark_of(address.id()).as_str())?;
        write!(file, "{address}")
    }

    /// The runs of this user that have left a mark, dead or alive.
    pub(crate) fn marked(&self) -> Vec<Address> {
        let marks = self.0.names(is_mark);
        marks.into_iter().filter_map(|mark| self.read_mark(&mark)).collect()
    }

    /// The address in the file `mark`, if this user wrote it and it names its own run.
    fn read_mark(&self, mark: &CStr) -> Option<Address> {
        let file = self.0.own_file(mark).ok()??;
        let mut text = String::new();
        file.take(MAX_ROOT as u64 + 1).read_to_string(&mut text).ok()?;
        let address: Address = text.parse().ok()?;
        (mark.to_bytes() == mark_of(address.id()).as_bytes()).then_some(address)
    }

    /// Gives the owner exclusive access. iceoryx2 creates one segment, a counter of nodes, that every user may write to. Another user may have
    /// opened it meanwhile and could truncate it, which would end the processes that map it. A copy therefore replaces the segment, and no
    /// other user has ever had the copy open. No process may have the segment mapped.
    ///
    /// # Errors
    /// [`LinkError::Planted`] as in [`Segments::check_owner`], or if another user has already truncated or enlarged a segment;
    /// [`LinkError::Folder`] if the system refuses.
    pub(crate) fn make_private(&self, address: &Address) -> Result<(), LinkError> {
        self.check_owner(address)?;
        for name in self.of(address) {
            if self.0.status(&*name).is_some_and(|status| status.st_mode & 0o077 != 0) {
                self.replace(&name)?;
            }
        }
        Ok(())
    }

    /// Replaces the segment `name` by a copy of mode 0600.
    fn replace(&self, name: &CStr) -> Result<(), LinkError> {
        let fault = || folder_fault("close to others what is in", Path::new(SEGMENTS));
        let Some(file) = self.0.own_file(name).map_err(fault())? else { return Ok(()) };
        let mut bytes = Vec::new();
        file.take(MOST_SHARED + 1).read_to_end(&mut bytes).map_err(fault())?;
        if bytes.is_empty() || bytes.len() as u64 > MOST_SHARED {
            let path = Path::new(SEGMENTS).join(&*name.to_string_lossy());
            return Err(LinkError::Planted { path, owner: getuid().as_raw() });
        }
        let copy = [name.to_bytes(), b".copy"].concat();
        let mut file = self.0.make_file(copy.as_slice()).map_err(fault())?;
        file.write_all(&bytes).map_err(fault())?;
        self.0.rename(copy.as_slice(), name).map_err(fault())
    }

    /// Checks that all segments of the run belong to this user, because iceoryx2 opens any file with the expected name.
    ///
    /// # Errors
    /// [`LinkError::Planted`] if one belongs to another user or is not a regular file.
    pub(crate) fn check_owner(&self, address: &Address) -> Result<(), LinkError> {
        for name in self.of(address) {
            // A missing segment has just been removed by its owner.
            if let Some(status) = self.0.status(&*name).filter(|status| !is_own_file(status)) {
                let path = Path::new(SEGMENTS).join(&*name.to_string_lossy());
                return Err(LinkError::Planted { path, owner: status.st_uid });
            }
        }
        Ok(())
    }

    /// Checks that shared memory has [`ROOM`] free: SIGBUS ends a process that writes to a segment without memory.
    pub(crate) fn see_room(&self) -> Result<(), LinkError> {
        let free = self.0.free().map_err(folder_fault("look at", Path::new(SEGMENTS)))?;
        if free < ROOM { Err(no_room(free)) } else { Ok(()) }
    }

    /// Allocates the memory of all segments of the run. iceoryx2 only sets the size of a segment; the system would allocate each page at its
    /// first write, and other programs could fill shared memory before.
    ///
    /// # Errors
    /// [`LinkError::NoRoom`].
    pub(crate) fn reserve(&self, address: &Address) -> Result<(), LinkError> {
        for name in self.of(address) {
            match self.0.reserve(&*name) {
                Err(error) if error.kind() == ErrorKind::StorageFull => {
                    return Err(no_room(self.0.free().unwrap_or(0)));
                }
                // The segment is gone, or the file system cannot reserve memory.
                _ => {}
            }
        }
        Ok(())
    }

    /// Removes the remains of processes that were killed between creating a segment and setting its size. iceoryx2 0.10 would wait for such a
    /// segment for ever (`posix_shared_memory::Builder::open_impl` retries on an empty segment, whatever its timeout), also when it cleans up
    /// after dead processes.
    pub(crate) fn remove_unborn(&self, address: &Address) {
        let mut unborn: Vec<CString> = self.of(address);
        unborn.retain(|name| self.is_empty(name));
        for _ in 0..BIRTH_MS {
            if unborn.is_empty() {
                return;
            }
            sleep(Duration::from_millis(1));
            unborn.retain(|name| self.is_empty(name));
        }
        for name in unborn {
            let _ = self.0.remove_file(&*name);
        }
    }

    /// Removes all segments of the runs `ids` except their marks.
    pub(crate) fn remove_all(&self, ids: &BTreeSet<String>) {
        let is_theirs = |name: &CStr| run_of(name).is_some_and(|id| ids.contains(id)) && !is_mark(name);
        self.0.names(is_theirs).iter().for_each(|name| self.remove_own(name));
    }

    /// Removes the marks of the runs `ids`. It must be the last step, because without a mark no sweep finds the remains.
    pub(crate) fn remove_marks(&self, ids: &BTreeSet<String>) {
        for id in ids {
            if let Ok(mark) = CString::new(mark_of(id)) {
                self.remove_own(&mark);
            }
        }
    }

    fn remove_own(&self, name: &CStr) {
        if self.0.status(name).is_some_and(|status| is_own_file(&status)) {
            let _ = self.0.remove_file(name);
        }
    }

    fn of(&self, address: &Address) -> Vec<CString> {
        let prefix = address.prefix();
        self.0.names(|name| name.to_bytes().starts_with(prefix.as_bytes()))
    }

    fn is_empty(&self, name: &CStr) -> bool {
        self.0.status(name).is_some_and(|status| is_own_file(&status) && status.st_size == 0)
    }
}

/// Name of the mark of the run `id`.
fn mark_of(id: &str) -> String {
    format!("{PREFIX}{id}_{MARK}")
}

/// Returns true if `name` is that of a mark.
fn is_mark(name: &CStr) -> bool {
    let run = name.to_bytes().strip_suffix(MARK.as_bytes()).and_then(|rest| rest.strip_suffix(b"_"));
    run.is_some_and(|run| run.starts_with(PREFIX.as_bytes()) && !run.contains(&b'_'))
}

/// The id of the run whose segment has this `name`.
fn run_of(name: &CStr) -> Option<&str> {
    let rest = name.to_str().ok()?.strip_prefix(PREFIX)?;
    Some(rest.split_once('_')?.0)
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test ends at the first surprise")]
mod tests {
    use std::os::unix::fs::{PermissionsExt, symlink};
    use std::path::PathBuf;
    use std::sync::atomic::{AtomicBool, Ordering};

    use rustix::fs::{CWD, FileType, Mode, mknodat};
    use tempfile::TempDir;

    use super::*;

    /// Creates a separate folder of segments for the test.
    fn fresh() -> (TempDir, Segments) {
        let folder = tempfile::tempdir().unwrap();
        let segments = Segments(OpenFolder::open(folder.path()).unwrap());
        (folder, segments)
    }

    fn run(id: &str) -> Address {
        Address::parse(&format!("/dev/shm/freeplay-test/{id}")).unwrap()
    }

    #[test]
    fn only_empty_segments_of_this_run_are_removed_and_only_if_they_stay_empty() {
        let (folder, segments) = fresh();
        let id = "1-0000000a";
        let path = |name: &str| folder.path().join(format!("freeplay-{id}{name}"));
        let [dead, born, full, other] = [path("_dead"), path("_born"), path("_full"), path("0_other")];
        for empty in [&dead, &born, &other] {
            fs::write(empty, "").unwrap();
        }
        fs::write(&full, "full").unwrap();
        let grown = born.clone();
        let birth = std::thread::spawn(move || {
            sleep(Duration::from_millis(u64::from(BIRTH_MS) / 4));
            fs::write(grown, "born").unwrap();
        });
        segments.remove_unborn(&run(id));
        birth.join().unwrap();
        assert_eq!([&dead, &born, &full, &other].map(|path| path.exists()), [false, true, true, true]);
        segments.remove_all(&[id.to_owned()].into());
        assert_eq!([&born, &full, &other].map(|path| path.exists()), [false, false, true]);
    }

    #[test]
    fn who_opened_a_segment_before_it_was_closed_has_no_hold_on_it() {
        let (folder, segments) = fresh();
        let address = run("1-0000000a");
        let path = folder.path().join("freeplay-1-0000000a_node.global_mgmt");
        let publish = |bytes: &[u8]| {
            fs::write(&path, bytes).unwrap();
            fs::set_permissions(&path, fs::Permissions::from_mode(0o666)).unwrap();
        };
        publish(b"counter");
        let mut held = fs::OpenOptions::new().write(true).open(&path).unwrap();
        segments.make_private(&address).unwrap();
        held.write_all(b"spoiled").unwrap();
        held.set_len(0).unwrap();
        assert_eq!(fs::read(&path).unwrap(), b"counter");
        assert_eq!(fs::metadata(&path).unwrap().permissions().mode() & 0o777, 0o600);
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1);
        // The function reports a segment that another user truncated or enlarged meanwhile.
        for length in [0, MOST_SHARED + 1] {
            publish(&vec![0; length as usize]);
            assert!(matches!(segments.make_private(&address), Err(LinkError::Planted { .. })), "{length}");
        }
    }

    #[test]
    fn a_mark_is_found_and_goes_last() {
        let (folder, segments) = fresh();
        let address = run("1-0000000a");
        let mark = folder.path().join("freeplay-1-0000000a__root");
        segments.mark(&address).unwrap();
        assert_eq!(segments.marked(), [address]);
        let ids = ["1-0000000a".to_owned()].into();
        segments.remove_all(&ids);
        assert!(mark.exists());
        segments.remove_marks(&ids);
        assert!(!mark.exists());
    }

    #[test]
    fn what_is_no_mark_of_this_user_is_no_mark() {
        let (folder, segments) = fresh();
        let at = |id: &str| folder.path().join(format!("freeplay-{id}__root"));
        let text = |id: &str| format!("/dev/shm/freeplay-test/{id}");
        let elsewhere = folder.path().join("elsewhere");
        fs::write(&elsewhere, text("1-00000001")).unwrap();
        symlink(&elsewhere, at("1-00000001")).unwrap();
        symlink("nowhere", at("1-00000002")).unwrap();
        mknodat(CWD, at("1-00000003"), FileType::Fifo, Mode::RUSR | Mode::WUSR, 0).unwrap();
        let _socket = std::os::unix::net::UnixListener::bind(at("1-00000004")).unwrap();
        fs::create_dir(at("1-00000005")).unwrap();
        fs::write(at("1-00000006"), [text("1-00000006").as_bytes(), &[0xff; 10]].concat()).unwrap();
        fs::File::create(at("1-00000007")).unwrap().set_len(1 << 40).unwrap();
        fs::write(at("1-00000008"), text("1-00000009")).unwrap();
        fs::write(at("1-0000000a"), "1-0000000a").unwrap();
        fs::write(at("1-0000000b"), "").unwrap();
        fs::write(folder.path().join("freeplay-x_root"), "/home/x").unwrap();
        fs::write(&elsewhere, text("1-0000000c")).unwrap();
        fs::hard_link(&elsewhere, at("1-0000000c")).unwrap();
        assert_eq!(segments.marked(), []);
        let before = fs::read_dir(folder.path()).unwrap().count();
        // Irregular files and files with other names are not segments, and must not be removed either.
        let ids: BTreeSet<String> = (1..=0xc).map(|id| format!("1-{id:08x}")).collect();
        segments.remove_all(&ids);
        segments.remove_marks(&ids);
        let left: BTreeSet<PathBuf> =
            fs::read_dir(folder.path()).unwrap().map(|entry| entry.unwrap().path()).collect();
        assert_eq!(before - left.len(), 5, "{left:?}");
        for id in ["1-00000001", "1-00000002", "1-00000003", "1-00000004", "1-00000005", "1-0000000c"] {
            assert!(left.contains(&at(id)), "{id}");
        }
        assert!(left.contains(&folder.path().join("freeplay-x_root")));
    }

    #[test]
    fn a_segment_that_is_removed_at_this_moment_is_nobody_elses() {
        let (folder, segments) = fresh();
        let address = run("1-0000000a");
        let path = folder.path().join("freeplay-1-0000000a_leaving");
        let is_done = AtomicBool::new(false);
        std::thread::scope(|scope| {
            scope.spawn(|| {
                while !is_done.load(Ordering::Relaxed) {
                    fs::write(&path, "").unwrap();
                    fs::remove_file(&path).unwrap();
                }
            });
            let seen = (0..20_000).try_for_each(|_| segments.check_owner(&address));
            is_done.store(true, Ordering::Relaxed);
            seen.unwrap();
        });
    }

    #[test]
    fn a_segment_that_is_none_ends_the_start_of_a_run() {
        let (folder, segments) = fresh();
        let address = run("1-0000000a");
        fs::write(folder.path().join("freeplay-1-0000000a_good"), "").unwrap();
        segments.check_owner(&address).unwrap();
        fs::write(folder.path().join("freeplay-1-0000000b_other"), "").unwrap();
        symlink("nowhere", folder.path().join("freeplay-1-0000000a_link")).unwrap();
        let error = segments.make_private(&address).unwrap_err();
        assert!(
            matches!(&error, LinkError::Planted { path, .. } if path.ends_with("freeplay-1-0000000a_link"))
        );
    }
}
