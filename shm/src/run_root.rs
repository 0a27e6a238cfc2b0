//! [`RunRoot`]: the folder of one run in shared memory, and what keeps it alive.
//!
//! All runs of a user live in one folder of mode 0700, `freeplay-<uid>` in `/dev/shm` or in `$FREEPLAY_SHM`. Each run
//! has a folder in it, named by its id. Who takes part in a run (the [`RunRoot`] itself and every open link) holds a
//! shared `flock` on the run's folder; the kernel lets go of it however the process ends. So a run lives as long as its
//! folder cannot be locked exclusively. Who leaves last removes the run; what belongs to a run whose last process was killed
//! can be removed by anybody.
//!
//! Making, sweeping and removing runs happens under an exclusive `flock` on the folder of all runs.

use std::fs::{self, DirBuilder, File};
use std::io::ErrorKind;
use std::os::unix::fs::{DirBuilderExt, MetadataExt};
use std::path::{Path, PathBuf};

use rustix::process::getuid;
use rustix::rand::{GetRandomFlags, getrandom};

use crate::address::Address;
use crate::error::{LinkError, folder_fault};
use crate::segments::{self, SEGMENTS};
use crate::services;

/// Environment variable naming another folder for the runs than `/dev/shm`.
pub const SHM_ENV: &str = "FREEPLAY_SHM";

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
    /// runs, [`LinkError::BadAddress`] if its path is too long, [`LinkError::Transport`] if iceoryx2 refuses.
    pub fn create() -> Result<Self, LinkError> {
        let all = all_runs();
        let held = hold_all_runs(&all, true)?;
        sweep(&all);
        let root = all.join(new_id()?);
        let address = Address::parse(&root.display().to_string())?;
        DirBuilder::new().mode(0o700).create(&root).map_err(folder_fault("create", &root))?;
        let share = Share::take(&address)?;
        drop(held);
        let run = Self { address, _share: share };
        let at_segments = |doing| folder_fault(doing, Path::new(SEGMENTS));
        segments::mark(run.address()).map_err(at_segments("write to"))?;
        // The first node makes what all nodes of the run share. Made here, nobody who starts later can be killed amidst it.
        drop(services::node(run.address())?);
        segments::make_private(run.address()).map_err(at_segments("close to others what is in"))?;
        Ok(run)
    }

    /// What other processes need to find the run.
    #[must_use]
    pub fn address(&self) -> &Address {
        &self.address
    }

    /// Removes what runs that no longer live left behind, and returns their ids. What cannot be removed stays.
    pub fn sweep_dead() -> Vec<String> {
        let all = all_runs();
        let held = hold_all_runs(&all, false);
        let swept = sweep(&all);
        remove_if_empty(&all, held);
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
        // Nobody else takes part, so whoever started the run was killed; or the run has ended while we still did.
        if is_gone(&self.folder) || self.folder.try_lock().is_ok() {
            end(&self.address);
        }
    }
}

/// Removes everything of the run.
fn end(address: &Address) {
    let all = address.root().parent().unwrap_or(address.root());
    let held = hold_all_runs(all, false);
    remove(address);
    remove_if_empty(all, held);
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

/// Removes the runs that no longer live, those in `all` and those that have left a mark, and returns their ids.
fn sweep(all: &Path) -> Vec<String> {
    let entries = fs::read_dir(all).into_iter().flatten().flatten();
    let in_folder = entries.filter_map(|entry| Address::parse(entry.path().to_str()?).ok());
    let dead = in_folder.chain(segments::marked()).filter(is_dead);
    dead.inspect(remove).map(|address| address.id().to_owned()).collect()
}

fn is_dead(address: &Address) -> bool {
    match File::open(address.root()) {
        Ok(folder) => folder.try_lock().is_ok(),
        Err(error) => error.kind() == ErrorKind::NotFound,
    }
}

fn remove(address: &Address) {
    segments::remove_all(address);
    let _ = fs::remove_dir_all(address.root());
}

/// Removes the folder of all runs if it is held and empty. Without holding it, somebody may just be making a run in it.
fn remove_if_empty(all: &Path, held: Result<File, LinkError>) {
    if held.is_ok() {
        let _ = fs::remove_dir(all);
    }
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
