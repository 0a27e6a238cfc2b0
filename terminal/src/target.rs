//! The meaning of `--out`: a folder of results or, by the ending of its name, a single result file.

use std::path::Path;

use freeplay_storage::OutputFolder;

use crate::exit::Failure;
use crate::files::{check_target, claim};

/// The ending of the name `out` among `endings` (in small letters); `None` for a folder or another ending.
pub fn asked_file<'a>(out: &Path, endings: &[&'a str]) -> Option<&'a str> {
    let ending = out.extension().and_then(|ending| ending.to_str()).filter(|_| !out.is_dir())?;
    endings.iter().copied().find(|known| ending.eq_ignore_ascii_case(known))
}

/// Claims the target of `--out`: checks a file with one of `endings`, or locks a folder for `results`.
///
/// # Errors
/// As [`check_target`] and [`claim`].
pub fn claim_out(
    out: &Path,
    endings: &[&str],
    results: &[&str],
    force: bool,
) -> Result<Option<OutputFolder>, Failure> {
    match asked_file(out, endings) {
        Some(_) => check_target(out).map(|()| None),
        None => claim(Some(out), results, force).map(Some),
    }
}

/// The folder that contains the file `path`.
pub fn folder_of(path: &Path) -> &Path {
    path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."))
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::{asked_file, folder_of};

    #[test]
    fn an_ending_asks_for_a_file_unless_there_is_a_folder() {
        let folder = tempfile::tempdir().expect("a folder");
        let there = folder.path().join("runs.toml");
        assert_eq!(asked_file(&there, &["json", "toml"]), Some("toml"));
        assert_eq!(asked_file(Path::new("a.TOML"), &["toml"]), Some("toml"));
        assert_eq!(asked_file(Path::new("out/2025.11"), &["toml"]), None);
        std::fs::create_dir(&there).expect("made");
        assert_eq!(asked_file(&there, &["toml"]), None);
        assert_eq!(folder_of(Path::new("a.toml")), Path::new("."));
    }
}
