//! [`RunFolder`]: the folder of one run in shared memory, and what keeps it alive.
//!
//! All runs of a user live in one folder of mode 0700, `freeplay-<uid>` in `/dev/shm` or in `$FREEPLAY_SHM`. Each run
//! has a folder in it, named by its id. Who takes part in a run (the [`RunFolder`] itself and every open link) holds a
//! shared `flock` on the run's folder; the kernel lets go of it however the process ends. So a run lives as long as its
//! folder cannot be locked exclusively. Who leaves last removes the run; what belongs to a run whose last process was killed
//! can be removed by anybody.
//!
//! Making, sweeping and removing runs happens under an exclusive `flock` on the folder of all runs.
//!
//! Other users can write to `/dev/shm`, too. A run is removed only if its folder is a directory of this user, closed to all
//! others, and lies directly in a folder of runs that is the same; `open_folder.rs` says how it is reached.

use std::collections::BTreeSet;
use std::ffi::CStr;
use std::fs::{self, DirBuilder};
use std::io::{self, ErrorKind};
use std::os::unix::fs::{DirBuilderExt, MetadataExt};
use std::path::{Path, PathBuf};

use rustix::process::getuid;
use rustix::rand::{GetRandomFlags, getrandom};

use crate::address::Address;
use crate::error::{LinkError, folder_fault};
use crate::open_folder::OpenFolder;
use crate::segments::{SEGMENTS, Segments};
use crate::services;

/// Environment variable naming another folder for the runs than `/dev/shm`.
pub const SHM_ENV: &str = "FREEPLAY_SHM";

/// The folder of one run in shared memory, of mode 0700. The process that starts a run holds this value until all processes of
/// the run have ended. Dropping the value removes everything that belongs to the run.
#[derive(Debug)]
pub struct RunFolder {
    address: Address,
    share: Share,
}

impl RunFolder {
    /// Removes what dead runs left behind, then makes the folder of a new run.
    ///
    /// # Errors
    /// [`LinkError::Folder`] if the system refuses, [`LinkError::NotPrivate`] or [`LinkError::NoFolder`] if others can write to
    /// the folder of all runs or have put something in its place, [`LinkError::Open`] if they could, [`LinkError::Planted`] if
    /// they made a segment of this run, [`LinkError::BadAddress`] if its path is too long, [`LinkError::Transport`] if iceoryx2
    /// refuses.
    pub fn create() -> Result<Self, LinkError> {
        let all = all_runs();
        let held = hold_all_runs(&all, true)?;
        let segments = Segments::open()?;
        sweep(&all, Some(&held), &segments);
        let id = new_id()?;
        let root = all.join(&id);
        let address = Address::parse(&root.display().to_string())?;
        held.make_folder(&*id).map_err(folder_fault("create", &root))?;
        let share = Share::take(&address)?;
        drop(held);
        let run = Self { address, share };
        // The first node makes what all nodes of the run share. Made here, nobody who starts later can be killed amidst it. Until
        // then nobody else knows the id, under which another user could have made it instead.
        drop(services::node(run.address())?);
        segments.make_private(run.address())?;
        segments.mark(run.address()).map_err(folder_fault("write to", Path::new(SEGMENTS)))?;
        Ok(run)
    }

    /// What other processes need to find the run.
    #[must_use]
    pub fn address(&self) -> &Address {
        &self.address
    }

    /// Tells the plant that the process which was started for `slot` has ended; see [`PlantLink::has_ended`](crate::PlantLink::has_ended).
    /// What can't be told, the plant finds out when its patience ends.
    pub fn report_process_exit(&self, slot: usize) {
        let _ = self.share.folder.make_file(&*ended_mark(slot));
    }

    /// Removes what runs that no longer live left behind, and returns their ids. What cannot be removed stays.
    pub fn sweep_dead() -> Vec<String> {
        let all = all_runs();
        let held = hold_all_runs(&all, false).ok();
        let Ok(segments) = Segments::open() else { return Vec::new() };
        let swept = sweep(&all, held.as_ref(), &segments);
        if held.is_some() {
            remove_if_empty(&all);
        }
        swept
    }
}

impl Drop for RunFolder {
    fn drop(&mut self) {
        end(&self.address);
    }
}

/// Taking part in a run: the shared lock on its folder.
#[derive(Debug)]
pub(crate) struct Share {
    folder: OpenFolder,
    address: Address,
}

impl Share {
    /// Takes part in the run at `address`.
    pub(crate) fn take(address: &Address) -> Result<Self, LinkError> {
        let no_run = || LinkError::NoRun { path: address.root().to_owned() };
        let folder = OpenFolder::open(address.root()).map_err(|_| no_run())?;
        see_private(&folder, address.root())?;
        folder.file().lock_shared().map_err(folder_fault("lock", address.root()))?;
        if folder.is_gone() { Err(no_run()) } else { Ok(Self { folder, address: address.clone() }) }
    }

    /// Whether the process that was started for `slot` has ended: [`RunFolder::report_process_exit`] leaves a mark for it.
    pub(crate) fn has_ended(&self, slot: usize) -> bool {
        self.folder.status(&*ended_mark(slot)).is_some()
    }
}

/// Name of the file in the run's folder that says that the process for `slot` has ended.
fn ended_mark(slot: usize) -> String {
    format!("slot-{slot}.ended")
}

impl Drop for Share {
    fn drop(&mut self) {
        // Nobody else takes part, so whoever started the run was killed; or the run has ended while we still did.
        if self.folder.is_gone() || self.folder.file().try_lock().is_ok() {
            end(&self.address);
        }
    }
}

/// Removes everything of the run.
fn end(address: &Address) {
    let all = address.root().parent().unwrap_or(address.root());
    let held = hold_all_runs(all, false);
    if let Ok(segments) = Segments::open() {
        remove(&segments, &[(held.as_ref().ok(), address.id())]);
    }
    if held.is_ok() {
        remove_if_empty(all);
    }
}

/// The folder of all runs of this user.
pub(crate) fn all_runs() -> PathBuf {
    let parent = std::env::var_os(SHM_ENV).map_or_else(|| PathBuf::from(SEGMENTS), PathBuf::from);
    // Without links, so that a later run can tell this path from one that was exchanged.
    let parent = fs::canonicalize(&parent).or_else(|_| std::path::absolute(&parent)).unwrap_or(parent);
    parent.join(name_of_all_runs())
}

fn name_of_all_runs() -> String {
    format!("freeplay-{}", getuid().as_raw())
}

/// Locks the folder of all runs, made first if `make`, and sees that it is this user's alone.
fn hold_all_runs(all: &Path, make: bool) -> Result<OpenFolder, LinkError> {
    loop {
        if make {
            see_safe_place(all)?;
            match DirBuilder::new().mode(0o700).create(all) {
                Err(error) if error.kind() != ErrorKind::AlreadyExists => {
                    return Err(folder_fault("create", all)(error));
                }
                _ => (),
            }
        }
        let folder = match OpenFolder::open(all) {
            Err(error) if make && error.kind() == ErrorKind::NotFound => continue,
            opened => opened.map_err(|error| unusable(all, error))?,
        };
        // Before it is locked: the lock of a folder of somebody else could be held for ever.
        see_private(&folder, all)?;
        folder.file().lock().map_err(folder_fault("lock", all))?;
        // Whoever left last may have removed the folder between our opening and our locking it.
        if !folder.is_gone() {
            return Ok(folder);
        }
    }
}

/// Why `all` can't be opened: where it is a link or a file, somebody has put it there.
fn unusable(all: &Path, error: io::Error) -> LinkError {
    match fs::symlink_metadata(all) {
        Ok(there) if !there.is_dir() => LinkError::NoFolder { path: all.to_owned(), owner: there.uid() },
        _ => folder_fault("open", all)(error),
    }
}

/// Sees that nobody else can exchange what is in the parent of `all`.
fn see_safe_place(all: &Path) -> Result<(), LinkError> {
    let Some(parent) = all.parent() else { return Ok(()) };
    let found = fs::metadata(parent).map_err(folder_fault("look at", parent))?;
    let (owner, mode) = (found.uid(), found.mode() & 0o7777);
    // In a sticky folder, such as /dev/shm, only the owner of a file and that of the folder rename the file.
    let is_open_to_others = mode & 0o022 != 0 && mode & 0o1000 == 0;
    if is_open_to_others || ![0, getuid().as_raw()].contains(&owner) {
        return Err(LinkError::Open { path: parent.to_owned(), owner, mode });
    }
    Ok(())
}

fn see_private(folder: &OpenFolder, path: &Path) -> Result<(), LinkError> {
    if folder.is_private() {
        return Ok(());
    }
    let (owner, mode) = folder.owner_and_mode().map_err(folder_fault("look at", path))?;
    Err(LinkError::NotPrivate { path: path.to_owned(), owner, mode })
}

/// Removes the runs that no longer live, those in the folder `all`, where that is there and `held` open, and those that have left a
/// mark, and returns their ids.
fn sweep(all: &Path, held: Option<&OpenFolder>, segments: &Segments) -> Vec<String> {
    let is_run = |name: &CStr| name.to_str().is_ok_and(is_run_id);
    let names = held.into_iter().flat_map(|held| held.names(is_run));
    let names = names.filter_map(|name| name.into_string().ok());
    let here: Vec<String> = names.filter(|id| is_dead_in(held, id) == Some(true)).collect();
    let mut dead: Vec<(Option<&OpenFolder>, &str)> = here.iter().map(|id| (held, &**id)).collect();
    let marked: Vec<Address> =
        segments.marked().into_iter().filter(|address| is_run_id(address.id())).collect();
    let is_here = |address: &&Address| held.is_some() && address.root().parent() == Some(all);
    // A run in this folder that has its own folder still is dead already, or lives.
    let gone = marked.iter().filter(is_here).filter(|address| is_dead_in(held, address.id()).is_none());
    dead.extend(gone.map(|address| (None, address.id())));
    let elsewhere = marked.iter().filter(|address| !is_here(address));
    let elsewhere: Vec<(Option<OpenFolder>, &str)> =
        elsewhere.filter_map(|address| Some((dead_elsewhere(address)?, address.id()))).collect();
    dead.extend(elsewhere.iter().map(|(folder, id)| (folder.as_ref(), *id)));
    remove(segments, &dead);
    dead.into_iter().map(|(_, id)| id.to_owned()).collect()
}

fn is_dead_in(folder: Option<&OpenFolder>, id: &str) -> Option<bool> {
    is_dead(folder?, id)
}

/// Whether the run `id` in `folder` no longer lives; `None` if there is nothing of that name. What is no folder of this user
/// alone is no run, and counts as living.
fn is_dead(folder: &OpenFolder, id: &str) -> Option<bool> {
    let root = match folder.folder(id) {
        Err(error) if error.kind() == ErrorKind::NotFound => return None,
        Err(_) => return Some(false),
        Ok(root) => root,
    };
    Some(root.is_private() && root.file().try_lock().is_ok())
}

/// If the run at `address`, in another folder of runs than this process uses, no longer lives: that folder, or `None` if the
/// run's has gone.
fn dead_elsewhere(address: &Address) -> Option<Option<OpenFolder>> {
    let all = address.root().parent()?;
    if all.file_name()? != name_of_all_runs().as_str() {
        return None;
    }
    let folder = match OpenFolder::without_links(all) {
        Err(error) if error.kind() == ErrorKind::NotFound => return Some(None),
        opened => opened.ok()?,
    };
    if !folder.is_private() {
        return None;
    }
    match is_dead(&folder, address.id()) {
        None => Some(None),
        Some(true) => Some(Some(folder)),
        Some(false) => None,
    }
}

/// Removes the runs `dead`, each an id with the folder that its own folder lies in, if that is there. Segments first, marks last:
/// whoever is killed meanwhile leaves what tells the next where the rest is.
fn remove(segments: &Segments, dead: &[(Option<&OpenFolder>, &str)]) {
    if dead.is_empty() {
        return;
    }
    let ids: BTreeSet<String> = dead.iter().map(|(_, id)| (*id).to_owned()).collect();
    segments.remove_all(&ids);
    for (folder, id) in dead {
        // What can't be removed stays for the next.
        let _ = folder.map(|folder| folder.remove_tree(*id));
    }
    segments.remove_marks(&ids);
}

/// Removes the folder of all runs if it is empty. Without holding it, somebody may just be making a run in it.
fn remove_if_empty(all: &Path) {
    let (Some(parent), Some(name)) = (all.parent(), all.file_name()) else { return };
    let _ = OpenFolder::open(parent).and_then(|parent| parent.remove_empty(name));
}

/// A run id that was never used: the process id, so that people can tell runs apart, and a random number.
fn new_id() -> Result<String, LinkError> {
    let mut random = [0; 4];
    getrandom(&mut random, GetRandomFlags::empty())
        .map_err(|errno| folder_fault("draw a random number from", Path::new("/dev/random"))(errno.into()))?;
    Ok(format!("{}-{:08x}", std::process::id(), u32::from_ne_bytes(random)))
}

/// Whether `name` is one that [`new_id`] gives.
fn is_run_id(name: &str) -> bool {
    let is_hex = |text: &str| text.len() == 8 && text.bytes().all(|byte| byte.is_ascii_hexdigit());
    let is_number = |text: &str| !text.is_empty() && text.bytes().all(|byte| byte.is_ascii_digit());
    name.split_once('-').is_some_and(|(process, random)| is_number(process) && is_hex(random))
}
