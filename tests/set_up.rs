//! `freeplay diagnose`, `compare` and `record info` on a recording whose conventions differ from its model's: the verdict, the words, and the mapping that
//! corrects it.

use std::fmt::Write as _;
use std::path::Path;

use crate::common::{Call, fresh_folder};
use freeplay_arm::{Workspace, rnea};
use freeplay_model::paper_arm;
use serde_json::Value;

/// The paper's arm on sines, the torque of its second joint in amperes of 12 N·m and its third joint counted backwards, as CSV.
fn faulty() -> String {
    faulty_with(|_, _| ())
}

/// The same, with the torques changed by `what` as a function of the velocities.
fn faulty_with(what: impl Fn(&mut [f64], &[f64])) -> String {
    let arm = paper_arm().arm;
    let n = arm.dof();
    let (mut ws, mut tau) = (Workspace::new(&arm), vec![0.0; n]);
    let mut text = String::from("t");
    for name in ["q", "tau"] {
        (1..=n).for_each(|j| {
            let _ = write!(text, ",{name}{j}");
        });
    }
    text.push('\n');
    for k in 0..1400 {
        let t = 0.01 * f64::from(k);
        let of = |j: usize| {
            let w = std::f64::consts::TAU * (0.17 + 0.05 * j as f64);
            let (sin, cos) = (w * t + 0.7 * j as f64).sin_cos();
            [0.3 + 0.6 * sin, 0.6 * w * cos, -0.6 * w * w * sin]
        };
        let [mut q, v, a] = [0, 1, 2].map(|order| (0..n).map(|j| of(j)[order]).collect::<Vec<f64>>());
        rnea(&arm, &mut ws, &q, &v, &a, &mut tau);
        what(&mut tau, &v);
        q[2] = -q[2];
        tau[2] = -tau[2];
        tau[1] /= 12.0;
        let _ = write!(text, "{t}");
        q.iter().chain(&tau).for_each(|x| {
            let _ = write!(text, ",{x:.7}");
        });
        text.push('\n');
    }
    text
}

/// The same recording with foreign names and units, as a file whose meaning the reader guesses.
fn foreign() -> String {
    let text = faulty();
    let mut rows = text.lines();
    let header = rows.next().expect("a header").split(',').map(|name| {
        let number = name.trim_start_matches(|c: char| c.is_ascii_alphabetic());
        match name.trim_end_matches(number) {
            "q" => format!("position_{number} [deg]"),
            "tau" => format!("effort_{number} [Nm]"),
            _ => "time [ms]".to_owned(),
        }
    });
    let mut foreign = header.collect::<Vec<_>>().join(";") + "\n";
    for row in rows {
        let cells = row.split(',').enumerate().map(|(column, cell)| {
            let value: f64 = cell.parse().expect("a number");
            match column {
                0 => format!("{:.3}", value * 1e3),
                1..=6 => format!("{:.6}", value.to_degrees()),
                _ => cell.to_owned(),
            }
        });
        foreign += &(cells.collect::<Vec<_>>().join(";") + "\n");
    }
    foreign
}

fn json(folder: &Path, arguments: &[&str]) -> Value {
    let call = Call::new(fresh_folder(), arguments);
    std::fs::write(call.folder.path().join("run.csv"), faulty()).expect("a file");
    std::fs::write(call.folder.path().join("foreign.csv"), foreign()).expect("a file");
    let mapping = folder.join("setup.toml");
    if mapping.exists() {
        std::fs::copy(&mapping, call.folder.path().join("setup.toml")).expect("a copy");
    }
    let ran = call.run().expect(0);
    let made = ran.folder.path().join("out/setup.toml");
    if made.exists() {
        std::fs::copy(&made, &mapping).expect("a copy");
    }
    serde_json::from_str(&ran.stdout()).expect("JSON")
}

fn kinds(value: &Value) -> Vec<(String, String)> {
    let text = |value: &Value| value.as_str().unwrap_or_default().to_owned();
    let findings = value["setup"].as_array().expect("a list").iter();
    findings.map(|finding| (text(&finding["kind"]), text(&finding["joint"]))).collect()
}

#[test]
fn a_faulty_set_up_is_said_first_and_its_mapping_mends_it() {
    let folder = fresh_folder();
    let joints: Vec<String> = paper_arm().arm.joints().iter().map(|joint| joint.name.clone()).collect();
    let expected =
        [("joint_direction".to_owned(), joints[2].clone()), ("torque_unit".to_owned(), joints[1].clone())];
    let given = ["--model", "paper", "--recording", "run.csv", "--format", "json"];
    let diagnosis = json(folder.path(), &[&["diagnose", "--out", "out"], given.as_slice()].concat());
    println!("{}", diagnosis["statement"]);
    assert_eq!(diagnosis["verdict"], "setup");
    assert_eq!(kinds(&diagnosis), expected);
    assert_eq!(
        diagnosis["effects"].as_array().map(Vec::len),
        Some(0),
        "nothing is missing from the mended reading"
    );

    let compared = json(folder.path(), &[&["compare"], given.as_slice()].concat());
    assert_eq!(kinds(&compared), expected);
    let mended = [&["compare", "--mapping", "setup.toml"], given.as_slice()].concat();
    let compared = json(folder.path(), &mended);
    assert_eq!(kinds(&compared), []);
    let worst = compared["channels"].as_array().expect("channels").iter().filter_map(|c| c["nrmse"].as_f64());
    assert!(worst.fold(0.0, f64::max) < 0.05, "{:#}", compared["channels"]);

    let looked = json(folder.path(), &["record", "info", "--model", "paper", "--format", "json", "run.csv"]);
    assert_eq!(kinds(&looked), expected);
}

/// The mapping that corrects a guessed file names that file's own columns.
#[test]
fn the_mapping_of_a_guessed_file_reads_that_file() {
    let folder = fresh_folder();
    let given = ["--model", "paper", "--recording", "foreign.csv", "--format", "json"];
    let diagnosis = json(folder.path(), &[&["diagnose", "--out", "out"], given.as_slice()].concat());
    assert_eq!(diagnosis["verdict"], "setup");
    let mapping = std::fs::read_to_string(folder.path().join("setup.toml")).expect("a mapping");
    assert!(mapping.contains("position_3 [deg]") && mapping.contains("effort_2 [Nm]"), "{mapping}");
    let compared = json(folder.path(), &[&["compare", "--mapping", "setup.toml"], given.as_slice()].concat());
    assert_eq!(kinds(&compared), [], "{mapping}");
    let worst = compared["channels"].as_array().expect("channels").iter().filter_map(|c| c["nrmse"].as_f64());
    assert!(worst.fold(0.0, f64::max) < 0.05, "{:#}", compared["channels"]);
}

/// A position stands still while its velocity moves: there was no comparison, so that no message suggests running or comparing the model as given.
#[test]
fn a_frozen_position_ends_the_diagnosis_and_offers_no_model() {
    let text = faulty();
    let mut rows = text.lines();
    let mut frozen = format!("{},{}\n", rows.next().expect("a header"), "qd1,qd2,qd3,qd4,qd5,qd6");
    for (k, row) in rows.enumerate() {
        let speed = (0.01 * k as f64).cos();
        let cells = row.split(',').enumerate().map(|(column, cell)| if column == 3 { "0.25" } else { cell });
        let _ =
            writeln!(frozen, "{}{}", cells.collect::<Vec<_>>().join(","), format!(",{speed:.6}").repeat(6));
    }
    for out in [false, true] {
        let arguments = ["diagnose", "--model", "paper", "--recording", "run.csv", "--out", "out"];
        let call = Call::new(fresh_folder(), if out { &arguments } else { &arguments[..5] });
        std::fs::write(call.folder.path().join("run.csv"), &frozen).expect("a file");
        let ran = call.run().expect(0);
        let screen = ran.stdout();
        assert!(screen.contains("frozen") && screen.contains("REPORT"), "{screen}");
        assert!(!screen.contains("freeplay run") && !screen.contains("with these effects"), "{screen}");
        if out {
            let report =
                std::fs::read_to_string(ran.folder.path().join("out/report.html")).expect("a report");
            assert!(
                report.contains("frozen") && !report.contains("freeplay run"),
                "the report offers the model"
            );
        }
    }
}

/// The diagnosis of a too short recording offers nothing: no model, no command with one, and no remedy but a longer recording. It removes the results of an
/// earlier diagnosis in the same place, which would pass for its own.
#[test]
fn a_recording_that_cannot_tell_offers_no_model() {
    let rows: Vec<String> = faulty().lines().map(str::to_owned).collect();
    for (count, out) in [(30, "out"), (100, "out"), (250, "out"), (100, "model.toml")] {
        let arguments = ["diagnose", "--model", "paper", "--recording", "run.csv", "--force", "--out", out];
        let call = Call::new(fresh_folder(), &arguments);
        let at = |name: &str| call.folder.path().join(name);
        std::fs::write(at("run.csv"), rows[..=count].join("\n")).expect("a file");
        std::fs::create_dir_all(at("out")).expect("a folder");
        for earlier in ["out/model.toml", "out/setup.toml", "model.toml"] {
            std::fs::write(at(earlier), "").expect("a file");
        }
        let ran = call.run().expect(0);
        let screen = ran.stdout();
        println!("{count} rows: {screen}");
        assert!(screen.contains("insufficient data"), "{screen}");
        assert!(screen.contains("NEXT     record at least 10 s of motion"), "{screen}");
        assert!(!screen.contains("MODEL") && !screen.contains("freeplay "), "{screen}");
        let at = |name: &str| ran.folder.path().join(name);
        if out == "model.toml" {
            assert!(!at("model.toml").exists() && screen.contains("there is no model"), "{screen}");
            continue;
        }
        assert!(!at("out/model.toml").exists() && !at("out/setup.toml").exists());
        let json = std::fs::read_to_string(at("out/diagnosis.json")).expect("a diagnosis");
        assert_eq!(serde_json::from_str::<Value>(&json).expect("JSON")["model"], Value::Null);
        let report = std::fs::read_to_string(at("out/report.html")).expect("a report");
        assert!(!report.contains("freeplay compare") && !report.contains("freeplay run"));
    }
}

/// A person pastes the printed commands: each succeeds and reads the corrected recording.
#[test]
fn commands_behind_a_set_up_finding_read_the_mended_recording() {
    let commands = |screen: &str| -> Vec<String> {
        let lines = screen.lines().map(str::trim).filter(|line| line.starts_with("freeplay "));
        lines.map(str::to_owned).collect()
    };
    let mut folder = fresh_folder();
    std::fs::write(folder.path().join("run.csv"), faulty()).expect("a file");
    let given = ["--model", "paper", "--recording", "run.csv"];
    let looked = ["record", "info", "--model", "paper", "run.csv"];
    // Each writes the mapping, in a folder that only the first one creates.
    for first in [&["diagnose"][..], &["compare"], &looked] {
        let arguments = if first.len() > 1 { first.to_vec() } else { [first, &given].concat() };
        let ran = Call::new(folder, &arguments).run().expect(0);
        assert_eq!(
            commands(&ran.stdout()),
            ["freeplay diagnose --model paper --recording run.csv --out found"],
            "{first:?}"
        );
        folder = ran.folder;
    }
    let ran = Call::new(folder, &[&["diagnose"], &given[..], &["--out", "found"]].concat()).run().expect(0);
    let printed = commands(&ran.stdout());
    assert_eq!(printed, ["freeplay diagnose --model paper --recording run.csv --mapping found/setup.toml"]);
    let words: Vec<&str> = printed[0].split(' ').skip(1).collect();
    let again = Call::new(ran.folder, &words).run().expect(0);
    assert!(!again.stdout().contains("CHECK"), "{}", again.stdout());
    // With a model to give, each command that uses it has the mapping, too.
    let rubbing = faulty_with(|tau, v| tau[2] += 12.0 * v[2].signum());
    std::fs::write(again.folder.path().join("run.csv"), rubbing).expect("a file");
    let arguments = [&["diagnose"], &given[..], &["--force", "--out", "found"]].concat();
    let ran = Call::new(again.folder, &arguments).run().expect(0);
    let printed = commands(&ran.stdout());
    println!("{printed:#?}");
    let compare = printed.iter().find(|line| line.starts_with("freeplay compare")).expect("a command");
    assert!(compare.ends_with("--mapping found/setup.toml"), "{compare}");
    let words: Vec<&str> = compare.split(' ').skip(1).collect();
    let compared = Call::new(ran.folder, &words).run().expect(0);
    assert!(!compared.stdout().contains("CHECK"), "{}", compared.stdout());
    let report = std::fs::read_to_string(compared.folder.path().join("found/report.html")).expect("a report");
    assert!(report.contains("--mapping found/setup.toml"));
}
