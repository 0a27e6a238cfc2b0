//! Fills the sealed folder in the order of the names, so that no property of a file reveals when its case was made.
//!
//! Inodes, times of birth and of the last change follow the order of writing, and no system call sets them. The generator writes its cases in the order of the
//! draw, each when it is done. Copies in the order of the names, which follow from a secret key, reveal neither.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use freeplay_storage::{StorageError, list, make_folder, read_bytes, remove_folder, write};

use super::generator::without_times;

/// Moves the cases of the folder `from` to the folder `to`, and gives every file the same time.
///
/// # Errors
/// Errors of the file system.
pub fn arrange(from: &Path, to: &Path) -> Result<(), StorageError> {
    for (case, folder) in entries(from)? {
        make_folder(&to.join(&case))?;
        for (file, path) in entries(&folder)? {
            write(&to.join(&case).join(&file), read_bytes(&path, u64::MAX)?)?;
        }
    }
    remove_folder(from)?;
    without_times(to)
}

/// The entries of `folder` by name, sorted.
fn entries(folder: &Path) -> Result<BTreeMap<PathBuf, PathBuf>, StorageError> {
    let named = |path: PathBuf| (path.file_name().map(PathBuf::from).unwrap_or_default(), path);
    Ok(list(folder)?.into_iter().map(|entry| named(entry.path)).collect())
}

#[cfg(test)]
mod tests {
    use std::fs;
    use std::os::unix::fs::MetadataExt;

    /// Files are written in the order of the names, whatever the order of their making; contents stay.
    #[test]
    fn looks_follow_the_names_alone() {
        let folder = tempfile::tempdir().expect("a folder");
        let (from, to) = (folder.path().join("from"), folder.path().join("to"));
        fs::create_dir(&to).expect("a folder");
        for name in ["c", "a", "d", "b"] {
            fs::create_dir_all(from.join(name)).expect("a folder");
            fs::write(from.join(name).join("model.toml"), name).expect("a file");
        }
        super::arrange(&from, &to).expect("arranged");
        assert!(!from.exists());
        let about = |name: &str| fs::metadata(to.join(name).join("model.toml")).expect("a file");
        let born: Vec<_> = ["a", "b", "c", "d"].map(|name| about(name).created().ok()).into();
        assert!(born.is_sorted(), "{born:?}");
        assert!(["a", "b", "c", "d"].windows(2).all(|w| about(w[0]).mtime() == about(w[1]).mtime()));
        assert_eq!(fs::read_to_string(to.join("d/model.toml")).expect("a file"), "d");
    }
}
