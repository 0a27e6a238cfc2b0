//! Recordings of real machines: read completely, with the numbers in their descriptions.
//!
//! They are not part of this project: `FREEPLAY_RECORDINGS` names their folder.

use std::fs;
use std::path::Path;

use freeplay_recording::{export, read};

/// Checks one file against its entry; returns its rows.
fn check(path: &Path, entry: &toml::Table, joints: usize) -> i64 {
    let number = |key: &str| entry[key].as_float().expect("a number");
    let recording = read(path, Some(joints)).unwrap_or_else(|error| panic!("{error}"));
    assert_eq!(recording.len() as i64, entry["rows"].as_integer().expect("a number"), "{}", path.display());
    let mut expected: Vec<&str> =
        entry["columns"].as_array().expect("a list").iter().filter_map(|c| c.as_str()).collect();
    let columns = recording.columns();
    let mut columns: Vec<&str> = columns.iter().map(String::as_str).collect();
    expected.sort_unstable();
    columns.sort_unstable();
    assert_eq!(columns, expected, "{}", path.display());
    let off = (recording.duration() - number("duration_s")).abs();
    let step = recording.median_step() / number("dt_median_s") - 1.0;
    println!("{}: duration off by {off:.1e} s, step by {step:+.1e}", path.display());
    assert!(off <= 0.5e-4 + 1e-9, "the description states four decimals");
    // For an even count the description does not define the median step between the two middle ones.
    assert!(step.abs() < 1e-5, "step {}", recording.median_step());
    assert!(recording.notes.is_empty(), "{:?}", recording.notes);
    recording.len() as i64
}

#[test]
fn every_real_recording_is_read_as_described() {
    let Some(folder) = freeplay_skip::recordings() else { return };
    let (mut files, mut rows) = (0, 0);
    for machine in fs::read_dir(&folder).expect("a folder") {
        let machine = machine.expect("an entry").path();
        let Ok(meta) = fs::read_to_string(machine.join("meta.toml")) else { continue };
        let meta: toml::Table = meta.parse().expect("TOML");
        let joints = meta["dof"].as_integer().expect("a number") as usize;
        // A folder may contain other files than recordings.
        for entry in meta.get("recording").and_then(toml::Value::as_array).into_iter().flatten() {
            let entry = entry.as_table().expect("a table");
            rows += check(&machine.join(entry["file"].as_str().expect("a name")), entry, joints);
            files += 1;
        }
    }
    println!("{files} files, {rows} rows");
    assert!(files > 0, "{} holds no recordings", folder.display());
}

#[test]
fn a_real_recording_survives_both_formats() {
    let Some(recordings) = freeplay_skip::recordings() else { return };
    let path = recordings.join("kuka_kr300/test_B.csv");
    let original = read(&path, Some(6)).expect("read");
    let folder = tempfile::tempdir().expect("a folder");
    for name in ["copy.csv", "copy.mcap"] {
        let copy = folder.path().join(name);
        let summary = export(&original, &copy).expect("written");
        let mut again = read(&copy, Some(6)).expect("read");
        println!("{name}: {} bytes", summary.bytes);
        again.origin.clone_from(&original.origin);
        assert_eq!(again, original, "{name}");
    }
}
