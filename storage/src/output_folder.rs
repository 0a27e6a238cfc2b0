//! The folder of results of one command.

use std::fs::File;
use std::io::{self, ErrorKind};
use std::path::{Path, PathBuf};

use crate::call::Call;
use crate::error::{Operation, Refusal, StorageError};
use crate::folder::{ReservedFolder, make_missing, open_folder};
use crate::handle::{is_at, lock};
use crate::path::check_path;
use crate::perform::perform;

/// Requirements of a command on its folder.
#[derive(Clone, Copy, Debug)]
pub struct Claim<'a> {
    /// Names of the command's results in the folder. An existing one is a result of an earlier command.
    pub results: &'a [&'a str],
    /// If true, the command may replace results of an earlier one.
    pub force: bool,
}

/// A folder for the exclusive use of one command. The lock is on the folder itself, so that it needs no lock file, and it ends with
/// the process.
#[derive(Debug)]
pub struct OutputFolder {
    path: PathBuf,
    // Fields drop in this order: the folder is removed if it is empty, then unlocked.
    _reserved: ReservedFolder,
    lock: Option<File>,
}

impl OutputFolder {
    /// Creates the folder `path` and its parents, locks it, and checks for earlier results.
    ///
    /// # Errors
    /// A refused path; [`Refusal::Busy`]; [`Refusal::Occupied`]; an error of the operating system.
    pub fn claim(path: &Path, claim: Claim) -> Result<Self, StorageError> {
        let failed = |source| StorageError::new(Operation::Folder, path, source);
        let mut absolute = check_path(path).and_then(|()| std::path::absolute(path)).map_err(failed)?;
        if absolute.is_symlink() {
            // The folder that a person names may be a link; folders created in it may not.
            absolute = std::fs::canonicalize(&absolute).map_err(failed)?;
        }
        // The absolute path may be too long or not UTF-8, although the relative one is valid.
        check_path(&absolute).map_err(failed)?;
        let mut reserved = ReservedFolder::before(&absolute);
        make_missing(&absolute).map_err(failed)?;
        let locked = match lock_folder(&absolute) {
            // Another command has removed it between its creation and its locking.
            Err(error) if error.kind() == ErrorKind::NotFound => Err(Refusal::Busy.into()),
            // The process that removed it has ended since, and so has its claim; the name is free for the next one.
            Ok(Some(lock)) if !is_at(&lock, &absolute) => Err(Refusal::Busy.into()),
            done => done,
        };
        let lock = locked.map_err(failed).inspect_err(|error| {
            // The folder that has the name now belongs to another command, even if it is still empty.
            if error.refusal() == Some(&Refusal::Busy) {
                reserved.leave();
            }
        })?;
        let folder = Self { path: absolute, _reserved: reserved, lock };
        if !claim.force {
            folder.refuse_results(claim.results).map_err(failed)?;
        }
        Ok(folder)
    }

    /// Claims the folder `path`, or `path-2`, `path-3` … if another command has the name already.
    ///
    /// # Errors
    /// See [`OutputFolder::claim`].
    pub fn claim_new(path: &Path) -> Result<Self, StorageError> {
        let mut number = 1_u32;
        loop {
            let name = if number == 1 { path.to_path_buf() } else { numbered(path, number) };
            if std::fs::symlink_metadata(&name).is_err() {
                match Self::claim(&name, Claim { results: &[], force: false }) {
                    Err(error) if error.refusal() == Some(&Refusal::Busy) => {}
                    done => return done,
                }
            }
            number += 1;
        }
    }

    /// The folder, as an absolute path.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Returns true if the file system could lock the folder. Some network file systems cannot.
    #[must_use]
    pub fn holds_lock(&self) -> bool {
        self.lock.is_some()
    }

    fn refuse_results(&self, names: &[&str]) -> io::Result<()> {
        let is_there = |name: &&&str| std::fs::symlink_metadata(self.path.join(name)).is_ok();
        match names.iter().find(is_there) {
            Some(name) => Err(Refusal::Occupied((*name).to_owned()).into()),
            None => Ok(()),
        }
    }
}

fn numbered(path: &Path, number: u32) -> PathBuf {
    let mut name = path.as_os_str().to_owned();
    name.push(format!("-{number}"));
    name.into()
}

/// Locks a folder; returns `None` if its file system does not support the lock.
fn lock_folder(path: &Path) -> io::Result<Option<File>> {
    let locked = perform(&Call::Lock(path), || {
        let folder = open_folder(path)?;
        lock(&folder).map(|()| folder)
    });
    match locked {
        Ok(folder) => Ok(Some(folder)),
        Err(error) if has_no_lock(&error) => Ok(None),
        Err(error) => Err(error),
    }
}

fn has_no_lock(error: &io::Error) -> bool {
    use rustix::io::Errno;
    matches!(Errno::from_io_error(error), Some(Errno::BADF | Errno::NOLCK | Errno::OPNOTSUPP))
        || error.kind() == ErrorKind::Unsupported
}
