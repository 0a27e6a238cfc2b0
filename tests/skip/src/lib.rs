//! Support for tests that need something which a machine may lack: an interpreter, a compiler, recordings of real machines.
//!
//! Such a test calls [`skip`] and returns. On a developer's machine this prints one line. A build server sets [`ALLOWED`] to the list of
//! needs that it cannot meet, and every other skip fails there.

use std::fmt::Display;
use std::path::{Path, PathBuf};

/// The environment variable with the permitted needs, separated by commas. If it is not set, every skip is permitted.
pub const ALLOWED: &str = "FREEPLAY_SKIPS";

/// A test's need that a machine may lack.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Need {
    /// A web browser on the path.
    Browser,
    /// A C or C++ compiler.
    Compiler,
    /// Devices: `/dev/full`, or the right to make a device node.
    Device,
    /// An example that only a build of all targets makes.
    Example,
    /// A build of the program with injection of storage faults.
    FaultInjection,
    /// Mounts in a namespace of the test's own.
    Namespace,
    /// A Python with the packages of the test.
    Python,
    /// A Python with a shared library.
    PythonLibrary,
    /// Recordings of real machines in the folder of `FREEPLAY_RECORDINGS`.
    Recordings,
    /// Arm files of other projects in the folder of `FREEPLAY_URDFS`.
    Robots,
    /// The rights of the superuser.
    Root,
    /// A `strace` that may trace.
    Strace,
    /// The program `script`, which runs a command in a terminal.
    Terminal,
}

impl Need {
    /// The word for this need in [`ALLOWED`].
    #[must_use]
    pub fn word(self) -> &'static str {
        match self {
            Self::Browser => "browser",
            Self::Compiler => "compiler",
            Self::Device => "device",
            Self::Example => "example",
            Self::FaultInjection => "fault-injection",
            Self::Namespace => "namespace",
            Self::Python => "python",
            Self::PythonLibrary => "python-library",
            Self::Recordings => "recordings",
            Self::Robots => "robots",
            Self::Root => "root",
            Self::Strace => "strace",
            Self::Terminal => "terminal",
        }
    }
}

/// The folder with recordings of real machines, which are not part of this project: that of `FREEPLAY_RECORDINGS`, or `shared/recordings` beside the project.
/// `None` without such a folder; then the test skips.
///
/// # Panics
/// See [`skip`].
#[must_use]
pub fn recordings() -> Option<PathBuf> {
    let default = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/recordings");
    let folder = std::env::var_os("FREEPLAY_RECORDINGS").map_or(default, PathBuf::from);
    if !folder.is_dir() {
        skip(Need::Recordings, "no recordings here; FREEPLAY_RECORDINGS names their folder");
        return None;
    }
    folder.canonicalize().ok()
}

/// Prints that a test skips for lack of `need`, and the reason.
///
/// # Panics
/// If [`ALLOWED`] is set and does not list `need`.
pub fn skip(need: Need, why: impl Display) {
    println!("skipped: {why}");
    let allowed = std::env::var(ALLOWED).ok();
    assert!(
        is_allowed(need, allowed.as_deref()),
        "this machine should have what the test needs ({}): {why}; {ALLOWED} lists what may be missing",
        need.word()
    );
}

/// True if the list `allowed` contains `need`, or if there is no list.
fn is_allowed(need: Need, allowed: Option<&str>) -> bool {
    allowed.is_none_or(|allowed| allowed.split(',').any(|word| word.trim() == need.word()))
}

#[cfg(test)]
mod tests {
    use super::{Need, is_allowed};

    #[test]
    fn a_list_allows_what_it_names_and_nothing_else() {
        for (allowed, expected) in [(None, true), (Some(""), false), (Some("browser, root"), true)] {
            assert_eq!(is_allowed(Need::Root, allowed), expected, "{allowed:?}");
        }
        assert!(!is_allowed(Need::Python, Some("python-library")));
    }
}
