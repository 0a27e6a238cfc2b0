//! Checks of paths.

use std::io;
use std::path::{Component, Path, PathBuf};

use crate::error::{PATH_LIMIT, Refusal};

/// Checks that `path` is UTF-8 and not longer than [`PATH_LIMIT`].
///
/// # Errors
/// [`Refusal::PathNotUtf8`], [`Refusal::PathTooLong`].
pub fn check_path(path: &Path) -> io::Result<()> {
    let Some(text) = path.to_str() else { return Err(Refusal::PathNotUtf8.into()) };
    if text.len() > PATH_LIMIT {
        return Err(Refusal::PathTooLong { length: text.len() }.into());
    }
    Ok(())
}

/// The parent folder of `path`.
pub(crate) fn parent(path: &Path) -> PathBuf {
    let parent = path.parent().filter(|parent| !parent.as_os_str().is_empty());
    parent.unwrap_or(Path::new(".")).to_path_buf()
}

/// The name of the file `path` in its folder.
pub(crate) fn file_name(path: &Path) -> io::Result<&str> {
    match path.components().next_back() {
        Some(Component::Normal(name)) => name.to_str().ok_or_else(|| Refusal::PathNotUtf8.into()),
        _ => Err(io::ErrorKind::IsADirectory.into()),
    }
}

#[cfg(test)]
mod tests {
    use std::ffi::OsStr;
    use std::os::unix::ffi::OsStrExt;
    use std::path::Path;

    use super::{PATH_LIMIT, check_path};

    #[test]
    fn paths_are_text_of_bounded_length() {
        assert!(check_path(Path::new(&"a".repeat(PATH_LIMIT))).is_ok());
        let long = check_path(Path::new(&"a".repeat(PATH_LIMIT + 1))).expect_err("too long");
        assert!(long.to_string().contains("1025 bytes"), "{long}");
        let bytes = check_path(Path::new(OsStr::from_bytes(b"a\xff"))).expect_err("no text");
        assert!(bytes.to_string().contains("not UTF-8"), "{bytes}");
    }
}
