//! [`RunFolder`]: the folder of one run in shared memory, and its lifetime.
//!
//! All runs of a user are in one folder of mode 0700, `freeplay-<uid>` in `/dev/shm` or in `$FREEPLAY_SHM`. Each run has a folder
//! in it, named by its id. Every participant of a run (the [`RunFolder`] itself and every open link) holds a shared `flock` on
//! the run's folder; the kernel releases it however the process ends. A run therefore lives as long as its folder cannot be
//! locked exclusively. The last participant to leave removes the run; any process of the user can remove a run whose last process
//! was killed.
//!
//! Processes create, sweep and remove runs under an exclusive `flock` on the folder of all runs.
//!
//! Other users can write to `/dev/shm`, too. A process removes a run only if its folder is a directory of this user, closed to
//! all others, and lies directly in a folder of runs with the same properties; `open_folder.rs` describes the access.

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

/// Environment variable with a folder for the runs other than `/dev/shm`.
pub const SHM_ENV: &str = "FREEPLAY_SHM";

/// The folder of one run in shared memory, of mode 0700. The process that starts a run holds this value until all processes of
/// the run have ended. Dropping the value removes everything that belongs to the run.
#[derive(Debug)]
pub struct RunFolder {
    address: Address,
    share: Share,
}

impl RunFolder {
    /// Removes the remains of dead runs, then creates the folder of a new run.
    ///
    /// # Errors
    /// [`LinkError::Folder`] if the system refuses, [`LinkError::NotPrivate`] or [`LinkError::NoFolder`] if other users can write
    /// to the folder of all runs or have put something else at its path, [`LinkError::Open`] if they could do so,
    /// [`LinkError::Planted`] if they made a segment of this run, [`LinkError::BadAddress`] if its path is too long,
    /// [`LinkError::Transport`] if iceoryx2 refuses.
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
        // The first node creates the objects that all nodes of the run share. Creating them here means that no process that
        // starts later can be killed during their creation. Until then no other user knows the id under which to plant an object.
        drop(services::node(run.address())?);
        segments.make_private(run.address())?;
        segments.mark(run.address()).map_err(folder_fault("write to", Path::new(SEGMENTS)))?;
        Ok(run)
    }

    /// The address with which other processes find the run.
    #[must_use]
    pub fn address(&self) -> &Address {
        &self.address
    }

    /// Reports to the plant that the process started for `slot` has ended; see
    /// [`PlantLink::has_ended`](crate::PlantLink::has_ended). If the report fails, the plant notices the end when its patience
    /// ends.
    pub fn report_process_exit(&self, slot: usize) {
        let _ = self.share.folder.make_file(&*ended_mark(slot));
    }

    /// Removes the remains of dead runs and returns their ids. Anything that cannot be removed stays.
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

/// Participation in a run: the shared lock on its folder.
#[derive(Debug)]
pub(crate) struct Share {
    folder: OpenFolder,
    address: Address,
}

impl Share {
    /// Joins the run at `address`.
    pub(crate) fn take(address: &Address) -> Result<Self, LinkError> {
        let no_run = || LinkError::NoRun { path: address.root().to_owned() };
        let folder = OpenFolder::open(address.root()).map_err(|_| no_run())?;
        see_private(&folder, address.root())?;
        folder.file().lock_shared().map_err(folder_fault("lock", address.root()))?;
        if folder.is_gone() { Err(no_run()) } else { Ok(Self { folder, address: address.clone() }) }
    }

    /// Returns true if the process started for `slot` has ended: [`RunFolder::report_process_exit`] leaves a mark file.
    pub(crate) fn has_ended(&self, slot: usize) -> bool {
        self.folder.status(&*ended_mark(slot)).is_some()
    }
}

/// Name of the mark file in the run's folder for the ended process of `slot`.
fn ended_mark(slot: usize) -> String {
    format!("slot-{slot}.ended")
}

impl Drop for Share {
    fn drop(&mut self) {
        // There is no other participant: the process that started the run was killed, or the run ended before this link.
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

/// Path of the folder of all runs of this user.
pub(crate) fn all_runs() -> PathBuf {
    let parent = std::env::var_os(SHM_ENV).map_or_else(|| PathBuf::from(SEGMENTS), PathBuf::from);
    // The path is free of links, so that a later run can distinguish it from a replaced one.
    let parent = fs::canonicalize(&parent).or_else(|_| std::path::absolute(&parent)).unwrap_or(parent);
    parent.join(name_of_all_runs())
}

fn name_of_all_runs() -> String {
    format!("freeplay-{}", getuid().as_raw())
}

/// Locks the folder of all runs and checks that it is private to this user; `make` first creates it.
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
        // Check before locking: another user could hold the lock of their own folder for ever.
        see_private(&folder, all)?;
        folder.file().lock().map_err(folder_fault("lock", all))?;
        // The last participant may have removed the folder between opening and locking.
        if !folder.is_gone() {
            return Ok(folder);
        }
    }
}

/// Error for an unusable `all`; a link or a file at this path means that somebody planted it.
fn unusable(all: &Path, error: io::Error) -> LinkError {
    match fs::symlink_metadata(all) {
        Ok(there) if !there.is_dir() => LinkError::NoFolder { path: all.to_owned(), owner: there.uid() },
        _ => folder_fault("open", all)(error),
    }
}

/// Checks that no other user can replace the contents of the parent of `all`.
fn see_safe_place(all: &Path) -> Result<(), LinkError> {
    let Some(parent) = all.parent() else { return Ok(()) };
    let found = fs::metadata(parent).map_err(folder_fault("look at", parent))?;
    let (owner, mode) = (found.uid(), found.mode() & 0o7777);
    // In a sticky folder, such as /dev/shm, only the owners of a file and of the folder can rename the file.
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

/// Removes dead runs and returns their ids: those in the folder `all`, if it exists and `held` is its handle, and those that have
/// left a mark.
fn sweep(all: &Path, held: Option<&OpenFolder>, segments: &Segments) -> Vec<String> {
    let is_run = |name: &CStr| name.to_str().is_ok_and(is_run_id);
    let names = held.into_iter().flat_map(|held| held.names(is_run));
    let names = names.filter_map(|name| name.into_string().ok());
    let here: Vec<String> = names.filter(|id| is_dead_in(held, id) == Some(true)).collect();
    let mut dead: Vec<(Option<&OpenFolder>, &str)> = here.iter().map(|id| (held, &**id)).collect();
    let marked: Vec<Address> =
        segments.marked().into_iter().filter(|address| is_run_id(address.id())).collect();
    let is_here = |address: &&Address| held.is_some() && address.root().parent() == Some(all);
    // A marked run in this folder that still has its own folder is either among the dead already, or it lives.
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

/// Returns true if the run `id` in `folder` is dead, and `None` if the name does not exist. An entry that is not a private folder
/// of this user is not a run and counts as living.
fn is_dead(folder: &OpenFolder, id: &str) -> Option<bool> {
    let root = match folder.folder(id) {
        Err(error) if error.kind() == ErrorKind::NotFound => return None,
        Err(_) => return Some(false),
        Ok(root) => root,
    };
    Some(root.is_private() && root.file().try_lock().is_ok())
}

/// For a dead run at `address` in a folder of runs that this process does not use: that folder, or `None` if the run's own folder
/// is gone.
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

/// Removes the runs `dead`, each an id with the parent of its folder, if that exists. The function removes segments first and
/// marks last, so that after a kill the remaining marks lead the next sweep to the rest.
fn remove(segments: &Segments, dead: &[(Option<&OpenFolder>, &str)]) {
    if dead.is_empty() {
        return;
    }
    let ids: BTreeSet<String> = dead.iter().map(|(_, id)| (*id).to_owned()).collect();
    segments.remove_all(&ids);
    for (folder, id) in dead {
        // Anything that cannot be removed stays for the next sweep.
        let _ = folder.map(|folder| folder.remove_tree(*id));
    }
    segments.remove_marks(&ids);
}

/// Removes the folder of all runs if it is empty. Call it only while holding the folder; otherwise another process may be
/// creating a run in it.
fn remove_if_empty(all: &Path) {
    let (Some(parent), Some(name)) = (all.parent(), all.file_name()) else { return };
    let _ = OpenFolder::open(parent).and_then(|parent| parent.remove_empty(name));
}

/// A new run id: the process id, so that people can distinguish runs, and a random number.
fn new_id() -> Result<String, LinkError> {
    let mut random = [0; 4];
    getrandom(&mut random, GetRandomFlags::empty())
        .map_err(|errno| folder_fault("draw a random number from", Path::new("/dev/random"))(errno.into()))?;
    Ok(format!("{}-{:08x}", std::process::id(), u32::from_ne_bytes(random)))
}

/// Returns true if `name` has the form of the ids of [`new_id`].
fn is_run_id(name: &str) -> bool {
    let is_hex = |text: &str| text.len() == 8 && text.bytes().all(|byte| byte.is_ascii_hexdigit());
    let is_number = |text: &str| !text.is_empty() && text.bytes().all(|byte| byte.is_ascii_digit());
    name.split_once('-').is_some_and(|(process, random)| is_number(process) && is_hex(random))
}
