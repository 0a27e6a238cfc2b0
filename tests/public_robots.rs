//! Loads every URDF below a folder and runs it with `joint_sine`; prints a table of the results.
//!
//! `FREEPLAY_URDFS` names the folder; else the test takes the robots of the Python package `example-robot-data`, if the interpreter of `FREEPLAY_PYTHON` has
//! it. Without either the test reports that it skips.

use std::path::{Path, PathBuf};
use std::process::Command;

use crate::common::{Call, fresh_folder};

/// The folder of URDFs.
fn folder() -> Option<PathBuf> {
    if let Some(folder) = std::env::var_os("FREEPLAY_URDFS") {
        return Some(PathBuf::from(folder));
    }
    let python = std::env::var("FREEPLAY_PYTHON").unwrap_or_else(|_| "python3".to_owned());
    let find = "import sys, pathlib; print(*[f for p in sys.path if p for f in pathlib.Path(p).glob('cmeel.prefix/share/example-robot-data')])";
    let output = Command::new(python).args(["-c", find]).output().ok()?;
    let text = String::from_utf8_lossy(&output.stdout).trim().to_owned();
    (!text.is_empty()).then(|| PathBuf::from(text))
}

fn collect(folder: &Path, files: &mut Vec<PathBuf>) {
    for path in std::fs::read_dir(folder).into_iter().flatten().flatten().map(|entry| entry.path()) {
        if path.is_dir() {
            collect(&path, files);
        } else if path.extension().is_some_and(|extension| extension == "urdf") {
            files.push(path);
        }
    }
}

/// True if a refusal names the place in the file: its path with a line, or its path if the file is empty.
fn tells(said: &str, path: &Path) -> bool {
    said.contains(&path.display().to_string()) || ["joint", "link"].iter().any(|word| said.contains(word))
}

#[test]
fn robots_of_others_load_and_run_or_say_what_prevents_it() {
    let Some(folder) = folder().filter(|folder| folder.is_dir()) else {
        freeplay_skip::skip(
            freeplay_skip::Need::Robots,
            "FREEPLAY_URDFS names a folder of URDFs, or FREEPLAY_PYTHON an interpreter with example-robot-data",
        );
        return;
    };
    let mut files = Vec::new();
    collect(&folder, &mut files);
    files.sort();
    let (mut ran, mut silent) = (0, Vec::new());
    for path in &files {
        let name = path.display().to_string();
        let arguments = [
            "run",
            "--pace",
            "lockstep",
            "--out",
            "out",
            "--recording",
            "none",
            "--controller=computed-torque",
            "--set",
            "duration=0.5",
            "--set",
            "path.kind=joint_sine",
            "--model",
            &name,
        ];
        let call = Call::new(fresh_folder(), &arguments).run();
        let said = call.stderr();
        let first = said.lines().next().unwrap_or_default().to_owned();
        assert!(!said.contains("panicked"), "{}", call.dump());
        if call.code() == 0 {
            ran += 1;
            println!("ran      {name}");
        } else {
            println!("exit {}   {name}: {first}", call.code());
            // A run whose brakes closed names the joint that can't hold the arm, with its limit.
            let stdout = call.stdout();
            let weak = stdout.lines().find(|line| line.contains("(line ") && line.contains("effort limit"));
            println!("         {}", weak.unwrap_or_default());
            let told =
                if call.code() == 1 { weak.is_some() } else { call.code() == 3 && tells(&first, path) };
            if !told {
                silent.push(name);
            }
        }
    }
    println!("{} robots, {ran} ran", files.len());
    assert!(!files.is_empty() && silent.is_empty(), "no word of what prevents it: {silent:#?}");
}
