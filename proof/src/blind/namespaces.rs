//! Separate namespaces for an analyst: user, file system, network, System V memory, host name.
//!
//! A user namespace needs no privilege if the system permits it (`user.max_user_namespaces`, AppArmor). Inside it this process can make the folder of its case
//! the root of its file system. It gives up every privilege over the outside, root's too: it can trace no process of the user that started it (capabilities(7):
//! the tracer's namespace has to hold the capabilities of the traced).

use std::os::unix::fs::MetadataExt;
use std::path::Path;

use rustix::fs::{StatVfsMountFlags, statvfs};
use rustix::mount::{
    MountFlags, MountPropagationFlags, UnmountFlags, mount_bind, mount_change, mount_remount, unmount,
};
use rustix::process::{chdir, geteuid, pivot_root};
use rustix::thread::UnshareFlags;

/// Result of the separation.
#[derive(Debug, Default, PartialEq, Eq)]
pub struct Parted {
    /// Credentials, network, System V memory and message queues.
    pub spaces: bool,
    /// The file system: its root is the folder of the case.
    pub root: bool,
    /// The folder is mounted for reading only.
    pub read_only: bool,
    /// The refused part, and the reason.
    pub refused: Option<String>,
}

impl Parted {
    /// In a few words.
    pub fn words(&self) -> String {
        let have = match (self.spaces, self.root) {
            (true, true) if self.read_only => "own namespaces and root, read-only",
            (true, true) => "own namespaces and root",
            (true, false) => "own namespaces",
            (false, _) => "no namespaces",
        };
        self.refused.as_ref().map_or_else(|| have.to_owned(), |why| format!("{have} ({why})"))
    }
}

/// Separates this process, which must have one thread only, from all others as far as the system permits.
pub fn enter() -> Parted {
    let mut parted = Parted::default();
    parted.refused = enter_each(&mut parted).err();
    parted
}

fn enter_each(parted: &mut Parted) -> Result<(), String> {
    let here = std::env::current_dir().map_err(|error| format!("working folder: {error}"))?;
    // With its privileges, root loses the right to read files of others.
    if let Some(name) = foreign(&here).map_err(|error| format!("working folder: {error}"))? {
        return Err(format!("{name} belongs to another user"));
    }
    unshare().map_err(|error| format!("unshare: {error}"))?;
    parted.spaces = true;
    own_root(&here).map_err(|error| format!("root: {error}"))?;
    parted.root = true;
    read_only().map_err(|error| format!("read-only: {error}"))?;
    parted.read_only = true;
    Ok(())
}

/// The first entry of `folder`, or the folder itself, that this user can read by privilege alone.
fn foreign(folder: &Path) -> std::io::Result<Option<String>> {
    let user = geteuid().as_raw();
    let mut entries = vec![folder.to_path_buf()];
    for entry in std::fs::read_dir(folder)? {
        entries.push(entry?.path());
    }
    for path in entries {
        let about = std::fs::metadata(&path)?;
        let needed = if about.is_dir() { 0o005 } else { 0o004 };
        if about.uid() != user && about.mode() & needed != needed {
            return Ok(Some(path.file_name().unwrap_or_default().to_string_lossy().into_owned()));
        }
    }
    Ok(None)
}

#[expect(
    deprecated,
    reason = "it is deprecated for CLONE_FILES, which parts the descriptors of threads and is not among these"
)]
fn unshare() -> rustix::io::Result<()> {
    rustix::thread::unshare(
        UnshareFlags::NEWUSER
            | UnshareFlags::NEWNS
            | UnshareFlags::NEWNET
            | UnshareFlags::NEWIPC
            | UnshareFlags::NEWUTS,
    )
}

/// Makes `folder` the root and the working folder.
fn own_root(folder: &Path) -> rustix::io::Result<()> {
    mount_change("/", MountPropagationFlags::DOWNSTREAM | MountPropagationFlags::REC)?;
    mount_bind(folder, folder)?;
    chdir(folder)?;
    // The old root is mounted over the new one (pivot_root(2)); this unmounts it.
    pivot_root(".", ".")?;
    unmount(".", UnmountFlags::DETACH)?;
    chdir("/")
}

/// Remounts the root read-only: Landlock leaves an owner the right to change permissions and times.
fn read_only() -> rustix::io::Result<()> {
    // A mount flag set outside a user namespace cannot be removed inside it.
    let given = statvfs("/")?.f_flag;
    let times = [
        (StatVfsMountFlags::NOATIME, MountFlags::NOATIME),
        (StatVfsMountFlags::NODIRATIME, MountFlags::NODIRATIME),
        (StatVfsMountFlags::RELATIME, MountFlags::RELATIME),
    ];
    let kept = times.into_iter().filter(|(given_here, _)| given.contains(*given_here));
    let flags =
        MountFlags::BIND | MountFlags::RDONLY | MountFlags::NOSUID | MountFlags::NODEV | MountFlags::NOEXEC;
    mount_remount("/", kept.fold(flags, |flags, (_, flag)| flags | flag), c"")
}
