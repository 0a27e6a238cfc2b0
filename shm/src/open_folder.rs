//! [`OpenFolder`]: a directory handle. All access to entries below goes through the handle, never through a path, and follows no link.
//! An attacker who swaps a name between the check and the use of an entry therefore cannot redirect the access.

use std::ffi::{CStr, CString};
use std::fs::{self, File};
use std::io::{self, ErrorKind};
use std::os::unix::fs::MetadataExt;
use std::path::{Component, Path};

use rustix::fs::{
    AtFlags, CWD, Dir, FallocateFlags, FileType, Mode, OFlags, Stat, fallocate, fstatvfs, mkdirat, openat,
    renameat, statat, unlinkat,
};
use rustix::io::Errno;
use rustix::path::Arg;
use rustix::process::getuid;

/// Flags for opening a directory: no links, and nothing but a directory.
const DIRECTORY: OFlags = OFlags::DIRECTORY.union(OFlags::NOFOLLOW).union(OFlags::CLOEXEC);

/// Flags for opening a file that another user may have planted: no links, and no waiting for the other end of a pipe.
const PLANTED: OFlags = OFlags::NOFOLLOW.union(OFlags::NONBLOCK).union(OFlags::NOCTTY).union(OFlags::CLOEXEC);

/// An open directory.
#[derive(Debug)]
pub(crate) struct OpenFolder(File);

impl OpenFolder {
    /// Opens `path`, whose last part must be a directory and not a link. Links in the parts before it are allowed, since the caller
    /// chose the path.
    pub(crate) fn open(path: &Path) -> io::Result<Self> {
        match (path.parent(), path.file_name()) {
            (Some(parent), Some(name)) => Self::without_links(&fs::canonicalize(parent)?.join(name)),
            _ => Self::without_links(path),
        }
    }

    /// Opens the absolute `path`, in which no part may be a link or `..`.
    pub(crate) fn without_links(path: &Path) -> io::Result<Self> {
        let mut parts = path.components();
        if parts.next() != Some(Component::RootDir) {
            return Err(ErrorKind::InvalidInput.into());
        }
        let mut at = openat(CWD, "/", DIRECTORY | OFlags::PATH, Mode::empty())?;
        for part in parts {
            let Component::Normal(name) = part else { return Err(ErrorKind::InvalidInput.into()) };
            at = openat(&at, name, DIRECTORY | OFlags::PATH, Mode::empty())?;
        }
        // A path descriptor permits traversal without the right to read; the directory itself needs that right.
        Ok(Self(openat(&at, ".", DIRECTORY, Mode::empty())?.into()))
    }

    /// Opens the directory `name` in this one.
    pub(crate) fn folder(&self, name: impl Arg) -> io::Result<Self> {
        Ok(Self(openat(&self.0, name, DIRECTORY, Mode::empty())?.into()))
    }

    /// Creates the directory `name` of mode 0700 in this one.
    pub(crate) fn make_folder(&self, name: impl Arg) -> io::Result<()> {
        Ok(mkdirat(&self.0, name, Mode::RWXU)?)
    }

    /// Creates the file `name` of mode 0600 and opens it for writing; fails if the name exists.
    pub(crate) fn make_file(&self, name: impl Arg) -> io::Result<File> {
        let flags = PLANTED | OFlags::WRONLY | OFlags::CREATE | OFlags::EXCL;
        Ok(openat(&self.0, name, flags, Mode::RUSR | Mode::WUSR)?.into())
    }

    /// Opens the file `name` for reading, if it is a regular file of this user without another name. The function opens nothing else,
    /// because opening a device may have effects.
    pub(crate) fn own_file(&self, name: impl Arg + Copy) -> io::Result<Option<File>> {
        if !self.status(name).is_some_and(|status| is_own_file(&status)) {
            return Ok(None);
        }
        let file: File = openat(&self.0, name, PLANTED | OFlags::RDONLY, Mode::empty())?.into();
        let is_own = is_own_file(&rustix::fs::fstat(&file)?);
        Ok(is_own.then_some(file))
    }

    /// Status of `name`; for a link, that of the link itself. A file without any name left has just been removed and counts as missing.
    pub(crate) fn status(&self, name: impl Arg) -> Option<Stat> {
        statat(&self.0, name, AtFlags::SYMLINK_NOFOLLOW).ok().filter(|status| status.st_nlink > 0)
    }

    /// Free bytes of the file system.
    pub(crate) fn free(&self) -> io::Result<u64> {
        let status = fstatvfs(&self.0)?;
        Ok(status.f_bavail.saturating_mul(status.f_frsize))
    }

    /// Allocates the disk space of the file `name`, if it is a regular file of this user, so that no later write finds the file system
    /// full.
    pub(crate) fn reserve(&self, name: impl Arg + Copy) -> io::Result<()> {
        let Some(status) = self.status(name).filter(is_own_file) else { return Ok(()) };
        let length = u64::try_from(status.st_size).unwrap_or(0);
        if length == 0 {
            return Ok(());
        }
        let file: File = openat(&self.0, name, PLANTED | OFlags::RDWR, Mode::empty())?.into();
        Ok(fallocate(&file, FallocateFlags::KEEP_SIZE, 0, length)?)
    }

    /// The entries selected by `wanted`, in no order; empty if the directory is unreadable.
    pub(crate) fn names(&self, wanted: impl Fn(&CStr) -> bool) -> Vec<CString> {
        let entries = Dir::read_from(&self.0).into_iter().flatten().flatten();
        let is_in = |name: &CStr| !matches!(name.to_bytes(), b"." | b"..");
        entries
            .filter(|entry| is_in(entry.file_name()) && wanted(entry.file_name()))
            .map(|entry| entry.file_name().to_owned())
            .collect()
    }

    /// Removes the file `name` of any type except a directory.
    pub(crate) fn remove_file(&self, name: impl Arg) -> io::Result<()> {
        Ok(unlinkat(&self.0, name, AtFlags::empty())?)
    }

    /// Renames the file `from` to `to`, replacing an existing `to`.
    pub(crate) fn rename(&self, from: impl Arg, to: impl Arg) -> io::Result<()> {
        Ok(renameat(&self.0, from, &self.0, to)?)
    }

    /// Removes the directory `name` if it is empty.
    pub(crate) fn remove_empty(&self, name: impl Arg) -> io::Result<()> {
        Ok(unlinkat(&self.0, name, AtFlags::REMOVEDIR)?)
    }

    /// Removes the directory `name` and its contents. The function removes links but not their targets, and leaves other mounted file
    /// systems alone.
    pub(crate) fn remove_tree(&self, name: impl Arg + Copy) -> io::Result<()> {
        let folder = self.folder(name)?;
        if folder.0.metadata()?.dev() != self.0.metadata()?.dev() {
            return Err(ErrorKind::CrossesDevices.into());
        }
        for name in folder.names(|_| true) {
            // For a directory, Linux returns the first error and POSIX the second. An entry that stays also keeps the directory.
            if let Err(Errno::ISDIR | Errno::PERM) = unlinkat(&folder.0, &name, AtFlags::empty()) {
                let _ = folder.remove_tree(&*name);
            }
        }
        self.remove_empty(name)
    }

    /// Returns true if the folder belongs to this user and is closed to all others.
    pub(crate) fn is_private(&self) -> bool {
        self.owner_and_mode().is_ok_and(|(owner, mode)| owner == getuid().as_raw() && mode & 0o077 == 0)
    }

    /// User id of the owner, and permission bits.
    pub(crate) fn owner_and_mode(&self) -> io::Result<(u32, u32)> {
        let metadata = self.0.metadata()?;
        Ok((metadata.uid(), metadata.mode() & 0o7777))
    }

    /// Returns true if the folder has been removed.
    pub(crate) fn is_gone(&self) -> bool {
        self.0.metadata().is_ok_and(|metadata| metadata.nlink() == 0)
    }

    /// The open directory itself, for locks.
    pub(crate) fn file(&self) -> &File {
        &self.0
    }
}

/// Returns true if `status` is that of a regular file of this user without another name.
pub(crate) fn is_own_file(status: &Stat) -> bool {
    let kind = FileType::from_raw_mode(status.st_mode);
    kind == FileType::RegularFile && status.st_uid == getuid().as_raw() && status.st_nlink == 1
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test ends at the first surprise")]
mod tests {
    use std::os::unix::fs::symlink;
    use std::sync::atomic::{AtomicBool, Ordering};

    use super::*;

    #[test]
    fn no_part_of_a_path_without_links_is_a_link() {
        let outer = tempfile::tempdir().unwrap();
        let outer = fs::canonicalize(outer.path()).unwrap().join("outer");
        fs::create_dir_all(outer.join("inner")).unwrap();
        symlink(&outer, outer.with_file_name("link")).unwrap();
        let link = outer.with_file_name("link");
        assert!(OpenFolder::without_links(&outer.join("inner")).is_ok());
        assert!(
            OpenFolder::open(&link.join("inner")).is_ok(),
            "the links of the caller's own path are its own"
        );
        for path in [link.join("inner"), link.clone(), outer.join("../outer"), "outer".into()] {
            assert!(OpenFolder::without_links(&path).is_err(), "{}", path.display());
        }
        assert!(OpenFolder::open(&link).is_err());
    }

    #[test]
    fn a_tree_is_removed_with_its_links_but_without_what_they_point_to() {
        let all = tempfile::tempdir().unwrap();
        let (kept, tree) = (all.path().join("kept"), all.path().join("tree"));
        fs::create_dir_all(tree.join("a/b")).unwrap();
        fs::create_dir(&kept).unwrap();
        fs::write(kept.join("file"), "kept").unwrap();
        symlink(&kept, tree.join("a/b/link")).unwrap();
        symlink(kept.join("file"), tree.join("a/link")).unwrap();
        symlink("nowhere", tree.join("dangling")).unwrap();
        OpenFolder::open(all.path()).unwrap().remove_tree("tree").unwrap();
        assert!(!tree.exists());
        assert_eq!(fs::read_to_string(kept.join("file")).unwrap(), "kept");
    }

    #[test]
    fn exchanging_folders_for_links_while_a_tree_is_removed_redirects_nothing() {
        let all = tempfile::tempdir().unwrap();
        let kept = all.path().join("kept");
        fs::create_dir(&kept).unwrap();
        for index in 0..50 {
            fs::write(kept.join(index.to_string()), "kept").unwrap();
        }
        let folder = OpenFolder::open(all.path()).unwrap();
        let done = AtomicBool::new(false);
        let (tree, aside, link) =
            (all.path().join("tree"), all.path().join("aside"), all.path().join("link"));
        symlink(&kept, &link).unwrap();
        let exchanges = std::thread::scope(|scope| {
            let exchanger = scope.spawn(|| {
                let mut count = 0_u64;
                let inner = |path: &Path| [path.to_owned(), path.join("inner")];
                while !done.load(Ordering::Relaxed) {
                    for victim in inner(&tree) {
                        // Either of the two may just have been removed.
                        let moved = fs::rename(&victim, &aside).is_ok();
                        count += u64::from(moved && symlink(&kept, &victim).is_ok());
                        let _ = fs::remove_file(&victim);
                        let _ = fs::rename(&aside, &victim);
                    }
                }
                count
            });
            for _ in 0..2000 {
                let _ = fs::create_dir_all(tree.join("inner"));
                for name in ["inner/file", "file"] {
                    let _ = fs::write(tree.join(name), "");
                }
                let _ = folder.remove_tree("tree");
            }
            done.store(true, Ordering::Relaxed);
            exchanger.join().unwrap()
        });
        println!("{exchanges} exchanges");
        assert!(exchanges > 0, "nothing was exchanged: this tests nothing");
        // The test itself writes through the links, so more files may exist; none may be missing.
        assert!((0..50).all(|index| kept.join(index.to_string()).exists()));
    }

    #[test]
    fn only_regular_files_of_this_user_under_one_name_are_read() {
        let all = tempfile::tempdir().unwrap();
        let at = |name: &str| all.path().join(name);
        fs::write(at("file"), "text").unwrap();
        fs::write(at("twice"), "text").unwrap();
        fs::hard_link(at("twice"), at("again")).unwrap();
        fs::create_dir(at("folder")).unwrap();
        symlink("file", at("link")).unwrap();
        symlink("nowhere", at("dangling")).unwrap();
        let _socket = std::os::unix::net::UnixListener::bind(at("socket")).unwrap();
        let fifo = rustix::fs::mknodat(CWD, at("fifo"), FileType::Fifo, Mode::RUSR | Mode::WUSR, 0);
        fifo.unwrap();
        let folder = OpenFolder::open(all.path()).unwrap();
        for name in ["twice", "again", "folder", "link", "dangling", "socket", "fifo", "missing"] {
            assert!(!matches!(folder.own_file(name), Ok(Some(_))), "{name}");
        }
        assert!(matches!(folder.own_file("file"), Ok(Some(_))));
    }
}
