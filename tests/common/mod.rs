//! Runs of the real binary in fresh folders.
#![allow(dead_code, reason = "each test binary uses its own part")]

use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use serde_json::Value;
use tempfile::TempDir;

/// The binary under test.
pub const FREEPLAY: &str = env!("CARGO_BIN_EXE_freeplay");

/// What one call of the binary left.
pub struct Ran {
    /// Its folder; removed when this is dropped.
    pub folder: TempDir,
    /// What it printed and how it ended.
    pub output: Output,
}

impl Ran {
    /// The exit code.
    pub fn code(&self) -> i32 {
        self.output.status.code().expect("not killed")
    }

    /// Standard error as text.
    pub fn stderr(&self) -> String {
        String::from_utf8_lossy(&self.output.stderr).into_owned()
    }

    /// Standard output as text.
    pub fn stdout(&self) -> String {
        String::from_utf8_lossy(&self.output.stdout).into_owned()
    }

    /// `summary.json`.
    pub fn summary(&self) -> Value {
        let path = self.out().join("summary.json");
        let text = std::fs::read_to_string(&path).unwrap_or_else(|error| panic!("{error}: {}", self.dump()));
        serde_json::from_str(&text).expect("summary.json is JSON")
    }

    /// The folder of results.
    pub fn out(&self) -> PathBuf {
        self.folder.path().join("out")
    }

    /// All there is to say after a failure.
    pub fn dump(&self) -> String {
        format!("exit {:?}\nstdout:\n{}\nstderr:\n{}", self.output.status, self.stdout(), self.stderr())
    }

    /// Fails with all there is to say unless the exit code is `code`.
    pub fn expect(self, code: i32) -> Self {
        assert_eq!(self.output.status.code(), Some(code), "{}", self.dump());
        self
    }
}

/// Calls `freeplay` with `arguments` in a fresh folder.
pub fn freeplay(arguments: &[&str]) -> Ran {
    freeplay_in(tempfile::tempdir().expect("a folder"), arguments)
}

/// Calls `freeplay` with `arguments` in `folder`.
pub fn freeplay_in(folder: TempDir, arguments: &[&str]) -> Ran {
    let output = Command::new(FREEPLAY).args(arguments).current_dir(folder.path()).output().expect("freeplay starts");
    Ran { folder, output }
}

/// A lockstep run of the default scenario cut to `duration` seconds, with more `arguments`.
pub fn lockstep(duration: f64, arguments: &[&str]) -> Ran {
    let duration = format!("duration={duration}");
    let mut all = vec!["run", "--pace", "lockstep", "--quiet", "--out", "out", "--set", &duration];
    all.extend(arguments);
    freeplay(&all)
}

/// What runs of this user have in shared memory.
pub fn left_in_shared_memory() -> Vec<PathBuf> {
    let entries = |folder: &Path| -> Vec<PathBuf> {
        std::fs::read_dir(folder).map(|found| found.flatten().map(|entry| entry.path()).collect()).unwrap_or_default()
    };
    let ours = |path: &PathBuf| path.file_name().is_some_and(|name| name.to_string_lossy().starts_with("freeplay"));
    entries(Path::new("/dev/shm")).into_iter().filter(ours).flat_map(|path| {
        if path.is_dir() { entries(&path) } else { vec![path] }
    }).collect()
}
