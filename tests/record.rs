//! `freeplay record` and `freeplay replay` on recordings of the real binary.

use std::path::PathBuf;

use crate::common::{Ran, freeplay_in, fresh_folder, lockstep};
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

/// Positions of the joints of the recording `name` in `folder`, with their names.
fn joints_of(folder: &TempDir, name: &str) -> (Vec<String>, Vec<Vec<f64>>) {
    let recording = freeplay_recording::read(&folder.path().join(name), None).expect("read");
    (recording.joint_names, recording.q)
}

/// With any kind of file, with or without joint names: `--joints` imports the requested joints, or names those that it cannot identify.
#[test]
fn the_joints_that_are_asked_for_are_the_joints_that_are_imported() {
    let header: Vec<String> = (1..=6).map(|joint| format!("q{joint}")).collect();
    let row =
        |k: u32| (1..=6).map(|joint| f64::from(10 * joint + k).to_string()).collect::<Vec<_>>().join(",");
    let rows: String = (0..20).map(|k| format!("{},{}\n", f64::from(k) * 0.01, row(k))).collect();
    let plain = format!("t,{}\n{rows}", header.join(","));
    let arm = ["base", "shoulder", "elbow", "wrist_1", "wrist_2", "wrist_3"];
    let named = format!("time,{}\n{rows}", arm.map(|joint| format!("{joint}_pos")).join(","));
    let mut folder = with("plain.csv", &plain);
    std::fs::write(folder.path().join("named.csv"), named).expect("written");
    for (kind, ending) in [("mcap", "mcap"), ("parquet", "parquet"), ("csv", "csv")] {
        let import = ["import", "named.csv", "--out", &format!("named-{kind}.{ending}"), "--force"];
        folder = record(folder, &import).expect(0).folder;
    }
    let asked = |folder: TempDir, file: &str, joints: &str, code: i32| {
        record(folder, &["import", file, "--joints", joints, "--out", "out.mcap", "--force"]).expect(code)
    };
    for file in ["named.csv", "named-mcap.mcap", "named-parquet.parquet", "named-csv.csv"] {
        let ran = asked(folder, file, "wrist_3,shoulder", 0);
        let (names, q) = joints_of(&ran.folder, "out.mcap");
        assert_eq!(
            (names.join(","), q.len(), q[0][0], q[1][0]),
            ("wrist_3,shoulder".to_owned(), 2, 60.0, 20.0),
            "{file}"
        );
        let ran = asked(ran.folder, file, "wrist_3,nose", 3);
        let said = ran.stderr();
        for words in [file, "nose", "the recording has base, shoulder, elbow", "give each joint by its name"]
        {
            assert!(said.contains(words), "{words}: {}", ran.dump());
        }
        let ran = asked(ran.folder, file, "wrist_3,wrist_3", 3);
        assert!(ran.stderr().contains("give each joint once"), "{}", ran.dump());
        folder = ran.folder;
    }
    let ran = asked(folder, "plain.csv", "a,b", 3);
    for words in ["plain.csv", "a, b", "q1, q2", "give a name for each"] {
        assert!(ran.stderr().contains(words), "{words}: {}", ran.dump());
    }
    let ran = asked(ran.folder, "plain.csv", "q5,q2", 0);
    let (_, q) = joints_of(&ran.folder, "out.mcap");
    assert_eq!((q.len(), q[0][0], q[1][0]), (2, 50.0, 20.0));
    let ran = asked(ran.folder, "plain.csv", "a,b,c,d,e,f", 0);
    let (names, q) = joints_of(&ran.folder, "out.mcap");
    assert_eq!((names.join(""), q.len(), q[5][0]), ("abcdef".to_owned(), 6, 60.0));
}

/// A mapping names and scales the columns of a recording in the same way, whatever its kind.
#[test]
fn a_mapping_reads_every_kind_of_file() {
    const MAP: &str =
        "joints = [\"a\", \"b\"]\n[t]\ncolumns = \"t\"\n[q]\ncolumns = [\"q2\", \"q6\"]\nscale = [1, -2]\n";
    let (_ran, mcap) = recorded();
    let folder = with("map.toml", MAP);
    std::fs::copy(&mcap, folder.path().join("r.mcap")).expect("copied");
    let mut folder = folder;
    for kind in ["csv", "parquet"] {
        folder = record(folder, &["export", "r.mcap", "--format", kind]).expect(0).folder;
    }
    let (_, all) = joints_of(&folder, "r.mcap");
    for file in ["r.csv", "r.parquet", "r.mcap"] {
        let ran = record(folder, &["import", file, "--mapping", "map.toml", "--out", "m.mcap", "--force"])
            .expect(0);
        let (names, q) = joints_of(&ran.folder, "m.mcap");
        assert_eq!((names.join(""), q.len()), ("ab".to_owned(), 2), "{file}");
        let doubled = all[5].iter().map(|q| -2.0 * q).collect::<Vec<_>>();
        assert!(q[0] == all[1] && q[1] == doubled, "{file}");
        let ran = record(ran.folder, &["info", file, "--mapping", "map.toml", "--format", "json"]).expect(0);
        assert!(ran.stdout().contains("\"joints\": 2"), "{file}: {}", ran.dump());
        folder = ran.folder;
    }
    std::fs::write(folder.path().join("map.toml"), MAP.replace("q6", "q7")).expect("written");
    for file in ["r.csv", "r.parquet", "r.mcap"] {
        let ran = record(folder, &["info", file, "--mapping", "map.toml"]).expect(3);
        for words in ["map.toml:5:18: q.columns", file, "no column \"q7\"", "correct the name"] {
            assert!(ran.stderr().contains(words), "{words}: {}", ran.dump());
        }
        folder = ran.folder;
    }
}

/// A clock that jumps back ends every command that reads the file, with one message; late rows are sorted with a note.
#[test]
fn a_clock_that_jumps_back_is_said() {
    let file = |jump: f64| {
        let time = |k: i32| 0.01 * f64::from(k) - if k < 200 { 0.0 } else { jump };
        let row =
            |k: i32| format!("{},{},{}\n", time(k), (0.01 * f64::from(k)).sin(), (0.01 * f64::from(k)).cos());
        (0..400).fold("t,q1,tau1\n".to_owned(), |text, k| text + &row(k))
    };
    for jump in [0.015, 0.5, 2.0, 4.0] {
        let folder = with("r.csv", &file(jump));
        let ran = record(folder, &["info", "r.csv"]);
        if jump > 3.0 {
            // There is no mixing: the rows behind the jump were recorded before.
            let ran = ran.expect(0);
            assert!(ran.stdout().contains("200 late, sorted by time"), "{}", ran.dump());
            continue;
        }
        let ran = ran.expect(3);
        for words in ["r.csv:202: column t", "the clock", "jumps back", "cut the file"] {
            assert!(ran.stderr().contains(words), "{jump}: {words}: {}", ran.dump());
        }
    }
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
    let model = freeplay_model::to_toml(&freeplay_model::paper_arm());
    std::fs::write(folder.path().join("believed.toml"), model).expect("written");
    let arguments =
        ["run", "--quiet", "--out", "out", "--set", "duration=0.1", "--controller", "computed-torque"];
    let arguments = [&arguments[..], &["--set", "controller.model=believed.toml"]].concat();
    let ran = freeplay_in(folder, &arguments).expect(0);
    let mcap = ran.out().join("computed-torque.mcap").display().to_string();
    let replayed = freeplay_in(fresh_folder(), &["replay", &mcap, "--against", "computed-torque"]).expect(0);
    assert!(
        replayed.stdout().starts_with("in 100 of 100 ticks the commands of computed-torque"),
        "{}",
        replayed.dump()
    );
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
