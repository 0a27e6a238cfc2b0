//! `freeplay record` and `freeplay replay` on recordings of the real binary.

mod common;

use std::path::PathBuf;

use common::{Ran, freeplay_in, fresh_folder, lockstep};
use serde_json::Value;
use tempfile::TempDir;

/// A run of 0.1 s and its recording.
fn recorded() -> (Ran, PathBuf) {
    let ran = lockstep(0.1, &["--controller", "computed-torque"]).expect(0);
    let path = ran.out().join("computed-torque.mcap");
    (ran, path)
}

/// `freeplay record` with `arguments` in `folder`.
fn record(folder: TempDir, arguments: &[&str]) -> Ran {
    freeplay_in(folder, &[&["record"][..], arguments].concat())
}

fn with(name: &str, text: &str) -> TempDir {
    let folder = fresh_folder();
    std::fs::write(folder.path().join(name), text).expect("written");
    folder
}

#[test]
fn a_recording_is_described_and_exported_bit_for_bit() {
    let (_ran, mcap) = recorded();
    let mcap = mcap.display().to_string();
    let info = record(fresh_folder(), &["info", &mcap, "--format", "json"]).expect(0);
    let info: Value = serde_json::from_str(&info.stdout()).expect("JSON");
    assert_eq!((&info["joints"], &info["samples"]), (&Value::from(6), &Value::from(100)));
    assert_eq!(info["columns"][1]["unit"], "rad");
    assert!(info["metadata"]["scenario"].as_str().is_some_and(|text| text.contains("duration")), "{info:#}");
    let words = record(fresh_folder(), &["info", &mcap]).expect(0).stdout();
    assert!(words.contains("6 joints, 100 samples, 0.099 s at 1000.0 Hz"), "{words}");

    let ran = record(fresh_folder(), &["export", &mcap, "--format", "csv", "--out", "r.csv"]).expect(0);
    let ours = freeplay_recording::read(std::path::Path::new(&mcap), None).expect("read");
    let csv = freeplay_recording::read(&ran.folder.path().join("r.csv"), None).expect("read");
    let bits = |row: Vec<f64>| row.into_iter().map(f64::to_bits).collect::<Vec<_>>();
    assert_eq!((csv.columns(), csv.len()), (ours.columns(), 100));
    for sample in 0..csv.len() {
        assert_eq!(bits(csv.row(sample)), bits(ours.row(sample)), "sample {sample}");
    }
    let ran = record(ran.folder, &["export", "r.csv", "--format", "csv"]).expect(2);
    assert!(ran.stderr().contains("the input cannot be the output as well"), "{}", ran.dump());
    let ran = record(ran.folder, &["export", &mcap, "--format", "csv", "--out", "r.csv"]).expect(2);
    assert!(ran.stderr().contains("--force"), "{}", ran.dump());
    let ran = record(ran.folder, &["export", &mcap, "--format", "parquet", "--out", "r.csv"]).expect(2);
    assert!(ran.stderr().contains("ends in .parquet"), "{}", ran.dump());
    record(ran.folder, &["export", &mcap, "--format", "parquet", "--out", "r.parquet"]).expect(0);
}

#[test]
fn a_csv_in_degrees_is_imported_and_what_does_not_fit_is_said() {
    const MAP: &str = "[t]\ncolumns = \"ms\"\nunit = \"ms\"\n[q]\ncolumns = \"j{}\"\nunit = \"deg\"\n";
    let folder = with("log.csv", "ms,j1,j2\n0,0,90\n4,180,45\n");
    std::fs::write(folder.path().join("map.toml"), MAP).expect("written");
    let import = ["import", "log.csv", "--mapping", "map.toml", "--out", "r.mcap"];
    let ran = record(folder, &import).expect(0);
    let recording = freeplay_recording::read(&ran.folder.path().join("r.mcap"), Some(2)).expect("read");
    assert_eq!((recording.t[1], recording.q[0][1]), (0.004, std::f64::consts::PI));

    let ran = record(ran.folder, &["import", "log.csv", "--out", "guessed.mcap"]).expect(0);
    let guessed = std::fs::read_to_string(ran.folder.path().join("guessed.mapping.toml")).expect("a mapping");
    for words in ["columns = \"ms\"", "unit = \"ms\"", "columns = [\"j1\", \"j2\"]"] {
        assert!(guessed.contains(words) && ran.stdout().contains(words), "{guessed}");
    }
    std::fs::write(ran.folder.path().join("log.csv"), "ms,j1,j2\n0,0,90\n4,x,45\n").expect("written");
    let again = ["import", "log.csv", "--mapping", "map.toml", "--out", "s.mcap"];
    let ran = record(ran.folder, &again).expect(3);
    assert!(ran.stderr().contains("log.csv:3: column q1: \"x\" is not a number"), "{}", ran.dump());
    assert!(!ran.folder.path().join("s.mcap").exists(), "nothing is written");
    let ran = record(ran.folder, &["import", "none.csv", "--out", "s.mcap"]).expect(3);
    assert!(ran.stderr().contains("none.csv"), "{}", ran.dump());
}

#[test]
fn a_recorded_run_is_replayed_to_the_same_controller_and_to_another() {
    let (_ran, mcap) = recorded();
    let mcap = mcap.display().to_string();
    let replay = |against: &str| {
        let arguments = ["replay", &mcap, "--against", against, "--format", "json"];
        let ran = freeplay_in(fresh_folder(), &arguments).expect(0);
        serde_json::from_str::<Value>(&ran.stdout()).expect("JSON")
    };
    let (same, other) = (replay("computed-torque"), replay("quasi-static"));
    assert_eq!((&same["ticks"], &same["identical_ticks"]), (&Value::from(100), &Value::from(100)));
    assert!(other["identical_ticks"].as_u64() < Some(100), "{other:#}");
}

#[test]
fn a_controller_that_ends_does_not_keep_a_replay_waiting() {
    let (_ran, mcap) = recorded();
    let folder = fresh_folder();
    let program = folder.path().join("ends");
    std::fs::write(&program, "#!/bin/sh\necho no model >&2\nexit 3\n").expect("written");
    std::fs::set_permissions(&program, std::os::unix::fs::PermissionsExt::from_mode(0o755))
        .expect("executable");
    let ran = freeplay_in(folder, &["replay", &mcap.display().to_string(), "--against", "./ends"]).expect(5);
    assert!(ran.stderr().contains("no model") && ran.stderr().contains("exit status: 3"), "{}", ran.dump());
}

#[test]
fn a_run_with_a_model_of_the_controllers_own_is_replayed_from_anywhere() {
    let folder = fresh_folder();
    let model = freeplay_arm::to_toml(&freeplay_arm::paper_arm());
    std::fs::write(folder.path().join("believed.toml"), model).expect("written");
    let arguments =
        ["run", "--quiet", "--out", "out", "--set", "duration=0.1", "--controller", "computed-torque"];
    let arguments = [&arguments[..], &["--set", "controller.model=believed.toml"]].concat();
    let ran = freeplay_in(folder, &arguments).expect(0);
    let mcap = ran.out().join("computed-torque.mcap").display().to_string();
    let replayed = freeplay_in(fresh_folder(), &["replay", &mcap, "--against", "computed-torque"]).expect(0);
    assert!(replayed.stdout().starts_with("100 of 100 commands"), "{}", replayed.dump());
}

#[test]
fn the_command_line_says_what_it_is() {
    let version = freeplay_in(fresh_folder(), &["--version"]).expect(0).stdout();
    assert!(version.starts_with(concat!("freeplay ", env!("CARGO_PKG_VERSION"))), "{version}");
    for arguments in [&["help", "exit-codes"][..], &["exit-codes"], &["--help"]] {
        let text = freeplay_in(fresh_folder(), arguments).expect(0).stdout();
        assert!(
            text.contains("  3  bad input or configuration") && text.contains("130  interrupted"),
            "{text}"
        );
        assert!(!text.contains('\u{1b}'), "no colour where there is no terminal");
    }
    for (shell, sign) in
        [("bash", "complete -F"), ("zsh", "#compdef freeplay"), ("fish", "complete -c freeplay")]
    {
        let text = freeplay_in(fresh_folder(), &["completions", shell]).expect(0).stdout();
        assert!(text.contains(sign) && text.contains("diagnose"), "{shell}");
    }
    let ran = freeplay_in(fresh_folder(), &["man", "--out", "man"]).expect(0);
    for page in ["freeplay.1", "freeplay-run.1", "freeplay-record-import.1"] {
        let text = std::fs::read_to_string(ran.folder.path().join("man").join(page)).expect("a page");
        assert!(text.contains(".TH freeplay"), "{page}");
    }
    assert!(!ran.folder.path().join("man/freeplay-plant.1").exists(), "what is not for people has no page");
}
