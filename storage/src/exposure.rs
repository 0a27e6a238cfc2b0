//! Detects whether other users can replace the target of a path.

use std::os::unix::fs::MetadataExt;
use std::path::{Path, PathBuf};

use rustix::process::getuid;

/// A folder in which another user can rename and replace files, whatever their modes.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Exposure {
    /// The folder.
    pub folder: PathBuf,
    /// User id of its owner; `None` if every user can.
    pub owner: Option<u32>,
}

impl Exposure {
    /// The outermost such folder on the way to `path`, including `path` itself. Returns `None` if only this user, the superuser and
    /// the caller of `sudo` can replace files. Links are followed.
    #[must_use]
    pub fn of(path: &Path) -> Option<Self> {
        let path = std::fs::canonicalize(path).ok()?;
        let folders: Vec<&Path> = path.ancestors().collect();
        folders.into_iter().rev().find_map(Self::of_folder)
    }

    fn of_folder(folder: &Path) -> Option<Self> {
        let found = std::fs::metadata(folder).ok()?;
        let caller = std::env::var("SUDO_UID").ok().and_then(|id| id.parse().ok());
        let is_trusted = [Some(0), Some(getuid().as_raw()), caller].contains(&Some(found.uid()));
        let exposure = |owner| Some(Self { folder: folder.to_path_buf(), owner });
        // In a sticky folder only the owners of a file and of the folder can rename the file.
        if found.mode() & 0o002 != 0 && found.mode() & 0o1000 == 0 {
            exposure(None)
        } else if !is_trusted {
            exposure(Some(found.uid()))
        } else {
            None
        }
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test ends at the first surprise")]
mod tests {
    use std::fs::{self, Permissions};
    use std::os::unix::fs::{PermissionsExt, chown};

    use super::Exposure;

    #[test]
    fn a_folder_of_others_or_open_to_all_is_found_wherever_it_is_on_the_way() {
        let outer = tempfile::tempdir().unwrap();
        let outer = fs::canonicalize(outer.path()).unwrap().join("outer");
        let inner = outer.join("inner");
        fs::create_dir_all(&inner).unwrap();
        let set = |mode| fs::set_permissions(&outer, Permissions::from_mode(mode)).unwrap();
        let found = || Exposure::of(&inner).map(|found| (found.folder, found.owner));
        for (mode, is_exposed) in [(0o700, false), (0o755, false), (0o1777, false), (0o777, true)] {
            set(mode);
            assert_eq!(found(), is_exposed.then(|| (outer.clone(), None)), "{mode:o}");
        }
        if chown(&outer, Some(65_534), None).is_err() {
            freeplay_skip::skip(freeplay_skip::Need::Root, "a folder of another user takes root");
            return;
        }
        set(0o1755);
        assert_eq!(found(), Some((outer.clone(), Some(65_534))));
        assert_eq!(Exposure::of(&outer.join("missing")), None);
    }
}
