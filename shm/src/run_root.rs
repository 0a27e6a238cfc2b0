//! [`RunRoot`]: the folder of one run in shared memory, and what keeps it alive.
//!
//! All runs of a user live in one folder of mode 0700, `freeplay-<uid>` in `/dev/shm` or in `$FREEPLAY_SHM`. Each run
//! has a folder in it, named by its id. Who takes part in a run (the [`RunRoot`] itself and every open link) holds a
//! shared `flock` on the run's folder; the kernel lets go of it however the process ends. So a run lives as long as its
//! folder cannot be locked exclusively. Who leaves last removes the run; what belongs to a run whose last process was killed
//! can be removed by anybody.
//!
//! Making, sweeping and removing runs happens under an exclusive `flock` on the folder of all runs.

use std::fs::{self, DirBuilder, File, TryLockError};
use std::io::{self, ErrorKind};
use std::os::unix::fs::{DirBuilderExt, MetadataExt, OpenOptionsExt, PermissionsExt};
use std::path::{Path, PathBuf};
use std::thread;
use std::time::Duration;

use rustix::process::getuid;
use rustix::rand::{GetRandomFlags, getrandom};

use crate::address::Address;
use crate::error::LinkError;

/// Environment variable naming another folder for the runs than `/dev/shm`.
pub const SHM_ENV: &str = "FREEPLAY_SHM";

/// Where Linux keeps POSIX shared memory objects, which is where iceoryx2 puts its segments.
const SEGMENTS: &str = "/dev/shm";

/// The folder of one run in shared memory, of mode 0700. Whoever starts a run holds it; dropping it removes everything
/// of the run. Hold it until all processes of the run have ended.
#[derive(Debug)]
pub struct RunRoot {
    address: Address,
    _share: Share,
}

impl RunRoot {
    /// Removes what dead runs left behind, then makes the folder of a new run.
    ///
    /// # Errors
    /// [`LinkError::Folder`] if the system refuses, [`LinkError::NotPrivate`] if others can write to the folder of all
    /// runs, [`LinkError::BadAddress`] if its path is too long.
    pub fn create() -> Result<Self, LinkError> {
        let all = all_runs();
        let _held = hold_all_runs(&all, true)?;
        sweep(&all);
        let root = all.join(new_id()?);
        let address = Address::parse(&root.display().to_string())?;
        DirBuilder::new().mode(0o700).create(&root).map_err(folder_fault("create", &root))?;
        let share = Share::take(&address)?;
        Ok(Self { address, _share: share })
    }

    /// What other processes need to find the run.
    #[must_use]
    pub fn address(&self) -> &Address {
        &self.address
    }

    /// Removes what runs that no longer live left behind, and returns their ids. What cannot be removed stays.
    pub fn sweep_dead() -> Vec<String> {
        let all = all_runs();
        let Ok(_held) = hold_all_runs(&all, false) else { return Vec::new() };
        let swept = sweep(&all);
        remove_if_empty(&all);
        swept
    }
}

impl Drop for RunRoot {
    fn drop(&mut self) {
        end(&self.address);
    }
}

/// Taking part in a run: the shared lock on its folder.
#[derive(Debug)]
pub(crate) struct Share {
    folder: File,
    address: Address,
}

impl Share {
    /// Takes part in the run at `address`.
    pub(crate) fn take(address: &Address) -> Result<Self, LinkError> {
        let no_run = || LinkError::NoRun { path: address.root().to_owned() };
        let folder = File::open(address.root()).map_err(|_| no_run())?;
        folder.lock_shared().map_err(folder_fault("lock", address.root()))?;
        if is_gone(&folder) { Err(no_run()) } else { Ok(Self { folder, address: address.clone() }) }
    }
}

impl Drop for Share {
    fn drop(&mut self) {
        // Nobody else takes part: whoever started the run was killed.
        if !is_gone(&self.folder) && self.folder.try_lock().is_ok() {
            end(&self.address);
        }
    }
}

/// Removes everything of the run.
fn end(address: &Address) {
    let all = address.root().parent().unwrap_or(address.root());
    let _held = hold_all_runs(all, false);
    remove(address);
    remove_if_empty(all);
}

/// Gives the owner alone access to the run's shared memory: iceoryx2 makes one small segment (a counter of nodes) that
/// everybody may write to.
pub(crate) fn make_segments_private(address: &Address) -> Result<(), LinkError> {
    for path in segments(address) {
        let Ok(metadata) = fs::metadata(&path) else { continue };
        if metadata.permissions().mode() & 0o077 != 0 {
            let owner_only = fs::Permissions::from_mode(0o600);
            fs::set_permissions(&path, owner_only).map_err(folder_fault("close to others", &path))?;
        }
    }
    Ok(())
}

/// The folder of all runs of this user.
pub(crate) fn all_runs() -> PathBuf {
    let parent = std::env::var_os(SHM_ENV).map_or_else(|| PathBuf::from(SEGMENTS), PathBuf::from);
    let name = format!("freeplay-{}", getuid().as_raw());
    std::path::absolute(&parent).unwrap_or(parent).join(name)
}

/// Locks the folder of all runs, made first if `make`, and sees that it is this user's alone.
fn hold_all_runs(all: &Path, make: bool) -> Result<File, LinkError> {
    loop {
        if make {
            match DirBuilder::new().mode(0o700).create(all) {
                Err(error) if error.kind() != ErrorKind::AlreadyExists => {
                    return Err(folder_fault("create", all)(error));
                }
                _ => (),
            }
        }
        let folder = match File::open(all) {
            Err(error) if make && error.kind() == ErrorKind::NotFound => continue,
            opened => opened.map_err(folder_fault("open", all))?,
        };
        folder.lock().map_err(folder_fault("lock", all))?;
        // Whoever left last may have removed the folder between our opening and our locking it.
        if !is_gone(&folder) {
            see_private(&folder, all)?;
            return Ok(folder);
        }
    }
}

fn see_private(folder: &File, path: &Path) -> Result<(), LinkError> {
    let metadata = folder.metadata().map_err(folder_fault("look at", path))?;
    let (owner, mode) = (metadata.uid(), metadata.mode() & 0o7777);
    if owner == getuid().as_raw() && mode & 0o077 == 0 {
        return Ok(());
    }
    Err(LinkError::NotPrivate { path: path.to_owned(), owner, mode })
}

/// Removes the runs in `all` that no longer live and returns their ids.
fn sweep(all: &Path) -> Vec<String> {
    let Ok(entries) = fs::read_dir(all) else { return Vec::new() };
    let addresses = entries.flatten().filter_map(|entry| Address::parse(entry.path().to_str()?).ok());
    let is_dead =
        |address: &Address| File::open(address.root()).is_ok_and(|folder| folder.try_lock().is_ok());
    addresses.filter(is_dead).inspect(remove).map(|address| address.id().to_owned()).collect()
}

fn remove(address: &Address) {
    for segment in segments(address) {
        let _ = fs::remove_file(segment);
    }
    let _ = fs::remove_dir_all(address.root());
}

fn remove_if_empty(all: &Path) {
    let _ = fs::remove_dir(all);
}

/// The run's shared memory objects.
fn segments(address: &Address) -> impl Iterator<Item = PathBuf> {
    let prefix = address.prefix();
    let entries = fs::read_dir(SEGMENTS).into_iter().flatten().flatten();
    entries
        .filter(move |entry| entry.file_name().as_encoded_bytes().starts_with(prefix.as_bytes()))
        .map(|entry| entry.path())
}

/// Whether the open folder has been removed.
fn is_gone(folder: &File) -> bool {
    folder.metadata().is_ok_and(|metadata| metadata.nlink() == 0)
}

/// A run id that was never used: the process id, so that people can tell runs apart, and a random number.
fn new_id() -> Result<String, LinkError> {
    let mut random = [0; 4];
    getrandom(&mut random, GetRandomFlags::empty())
        .map_err(|errno| folder_fault("draw a random number from", Path::new("/dev/random"))(errno.into()))?;
    Ok(format!("{}-{:08x}", std::process::id(), u32::from_ne_bytes(random)))
}

fn folder_fault(doing: &'static str, path: &Path) -> impl FnOnce(io::Error) -> LinkError + use<> {
    let path = path.to_owned();
    move |source| LinkError::Folder { doing, path, source }
}

/// Who is the plant of a run: the process that holds the lock on a file in the run's folder.
#[derive(Debug)]
pub(crate) struct PlantSeat {
    file: File,
}

impl PlantSeat {
    /// Takes the seat.
    pub(crate) fn take(address: &Address) -> Result<Self, LinkError> {
        let seat = Self::open(address)?;
        // A controller that looks whether the plant lives holds the lock for a moment.
        for _ in 0..20 {
            match seat.file.try_lock() {
                Ok(()) => return Ok(seat),
                Err(TryLockError::WouldBlock) => thread::sleep(Duration::from_millis(1)),
                Err(TryLockError::Error(error)) => return Err(folder_fault("lock", address.root())(error)),
            }
        }
        Err(LinkError::PlantExists { path: address.root().to_owned() })
    }

    /// Watches the seat without taking it.
    pub(crate) fn watch(address: &Address) -> Result<Self, LinkError> {
        Self::open(address)
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

    fn open(address: &Address) -> Result<Self, LinkError> {
        let path = address.root().join("plant.lock");
        let mut options = File::options();
        options.create(true).append(true).mode(0o600);
        let file = options.open(&path).map_err(folder_fault("open", &path))?;
        Ok(Self { file })
    }
}
