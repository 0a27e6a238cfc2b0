//! The blind proof from end to end: the seal holds, nobody can look inside, and verification detects later changes.

use std::path::Path;

use crate::common::sealed::seal_slide;
use crate::common::{Call, Ran, fresh_folder};
use freeplay_concealed::{Case, Machine, Quota, draw_set};
use serde_json::{Value, json};

/// Cases on the machine with one axis, which are quick: names of the folders and the concealed effects.
const CASES: [(&str, Option<&str>); 4] = [
    ("a1", Some("coulomb_friction")),
    ("b2", None),
    ("c3", Some("periodic_disturbance")),
    ("d4", Some("viscous_friction")),
];

fn read(path: &Path) -> Value {
    let text = std::fs::read_to_string(path).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
    serde_json::from_str(&text).expect("JSON")
}

/// Writes a sealed folder as a third person would, and the truth beside it.
fn seal(folder: &Path) {
    let mut truths = serde_json::Map::new();
    for (seed, (name, kind)) in CASES.into_iter().enumerate() {
        let made = seal_slide(&folder.join("cases").join(name), 40 + seed as u64, kind);
        truths.insert(name.to_owned(), serde_json::to_value(&made.truth).expect("JSON"));
    }
    let truth = json!({ "cases": truths });
    std::fs::write(folder.join("truth.json"), truth.to_string()).expect("the truth");
}

/// Reads the files of a call.
trait Look {
    fn path(&self, file: &str) -> std::path::PathBuf;
    fn check(&self, code: i32);
}

impl Look for Ran {
    fn path(&self, file: &str) -> std::path::PathBuf {
        self.folder.path().join(file)
    }

    fn check(&self, code: i32) {
        assert_eq!(self.code(), code, "{}", self.dump());
    }
}

fn call(folder: tempfile::TempDir, arguments: &[&str]) -> Ran {
    Call::new(folder, arguments).run()
}

/// Replaces the first value of `key` in the receipt by the result of `change`, and verifies.
fn verify_changed(receipt: &Value, change: impl FnOnce(&mut Value)) -> Ran {
    let folder = fresh_folder();
    let mut changed = receipt.clone();
    change(&mut changed);
    std::fs::write(folder.path().join("receipt.json"), changed.to_string()).expect("a receipt");
    call(folder, &["blind", "--verify", "receipt.json"])
}

#[test]
fn a_folder_that_someone_else_sealed_is_answered_scored_and_verified() {
    let folder = fresh_folder();
    seal(folder.path());
    let answered = call(folder, &["blind", "--analyse", "cases", "--quiet"]);
    answered.check(0);
    let before = read(&answered.path("cases/receipt.json"));
    assert!(before["cases"]["a1"]["truth"].is_null() && before["score"].is_null(), "no truth is known yet");
    let isolation = before["parts"][0]["isolation"].as_object().expect("a table");
    println!("{isolation:?}");
    for (words, _) in isolation {
        // If the kernel offers no isolation the receipt says so; otherwise nobody can look inside.
        let walled = words.contains("canary refused") && words.contains("memory of the parent refused");
        assert!(walled || words.starts_with("none"), "{words}");
    }
    let scored = call(answered.folder, &["blind", "--score", "cases", "truth.json", "--quiet"]);
    scored.check(0);
    let receipt = read(&scored.path("cases/receipt.json"));
    for (name, kind) in CASES {
        let case = &receipt["cases"][name];
        println!("{name} {kind:?}: {} {}", case["outcome"], case["answer"]["verdict"]);
    }
    assert_eq!(
        receipt["cases"]["a1"]["outcome"], "right",
        "{}",
        receipt["cases"]["a1"]["answer"]["statement"]
    );
    assert!(scored.path("cases/report.html").is_file());
    let verified = call(scored.folder, &["blind", "--verify", "cases/receipt.json"]);
    verified.check(0);
    tampering_is_caught(&receipt);
    // Verification also detects a changed sealed recording.
    let recording = verified.path("cases/a1/recording.csv");
    let text = std::fs::read_to_string(&recording).expect("a recording");
    std::fs::write(&recording, text + "\n").expect("a recording");
    let spoilt = call(verified.folder, &["blind", "--verify", "cases/receipt.json"]);
    spoilt.check(1);
    assert!(spoilt.stdout().contains("a1 is not as it was sealed"), "{}", spoilt.stdout());
}

fn tampering_is_caught(receipt: &Value) {
    verify_changed(receipt, |_| ()).check(0);
    let caught = |change: fn(&mut Value), what: &str| {
        let ran = verify_changed(receipt, change);
        ran.check(1);
        let line =
            ran.stdout().lines().find(|line| line.contains("FAIL") && line.contains(what)).map(str::to_owned);
        println!("{}", line.unwrap_or_else(|| panic!("{what} is not caught:\n{}", ran.stdout())));
    };
    caught(|r| r["cases"]["a1"]["truth"]["effects"][0]["kind"] = json!("payload"), "stages");
    caught(|r| r["cases"]["a1"]["truth"]["effects"][0]["kind"] = json!("payload"), "score");
    caught(|r| r["cases"]["d4"]["answer"]["statement"] = json!("another"), "answers");
    caught(|r| r["parts"][0]["program"]["sha256"] = json!("00"), "program");
    caught(|r| r["score"]["goals"][0]["reached"] = json!(1.5), "score");
    caught(|r| r["parts"][0]["stages"][1]["at"] = json!("2020-01-01T00:00:00Z"), "stages");
}

/// The first seed whose few cases are friction on the machine with one axis, which is quick.
fn quick_seed(quota: &Quota) -> u64 {
    let kinds = ["coulomb_friction", "viscous_friction", "quadratic_drag", "torque_offset", "friction_drift"];
    let quick =
        |case: &Case| case.machine == Machine::Slide && kinds.contains(&case.effects[0].kind.as_str());
    (1..100_000).find(|seed| draw_set(quota, *seed).expect("cases").iter().all(quick)).expect("a seed")
}

#[test]
fn the_whole_protocol_keeps_its_seal() {
    let seed = quick_seed(&Quota::small(2)).to_string();
    let arguments =
        ["blind", "--cases", "2", "--seed", &seed, "--out", "out", "--quiet", "--history", "sets.jsonl"];
    let ran = call(fresh_folder(), &arguments);
    ran.check(0);
    let receipt = read(&ran.path("out/receipt.json"));
    let part = &receipt["parts"][0];
    let stages: Vec<&str> =
        part["stages"].as_array().expect("stages").iter().filter_map(|s| s["name"].as_str()).collect();
    assert_eq!(stages, ["freeze", "seed", "seal", "answer", "reveal"], "seed {seed}");
    let history = std::fs::read_to_string(ran.path("sets.jsonl")).expect("the history");
    assert!(
        history.lines().count() == 2 && history.contains("sealed") && history.contains("scored"),
        "{history}"
    );
    let mut times = std::collections::BTreeSet::new();
    for case in std::fs::read_dir(ran.path("out/sealed")).expect("cases") {
        let case = case.expect("a case").path();
        for file in std::fs::read_dir(&case).expect("files") {
            times.insert(file.expect("a file").metadata().and_then(|m| m.modified()).expect("a time"));
        }
        assert!(std::fs::read_dir(&case).expect("files").count() == 3, "nothing but model and recordings");
    }
    assert_eq!(times.len(), 1, "all files have the same time");
    let again = call(ran.folder, &arguments);
    again.check(2);
    assert!(again.stderr().contains("holds sealed of an earlier command"), "{}", again.stderr());
    let verified = call(again.folder, &["blind", "--verify", "out/receipt.json"]);
    verified.check(0);
    // After a change of one bit in a commitment, the truth no longer fits it.
    let name = receipt["cases"].as_object().and_then(|cases| cases.keys().next()).expect("a case").clone();
    let changed = verify_changed(&receipt, |r| r["cases"][&name]["salt"] = json!("00"));
    changed.check(1);
    assert!(changed.stdout().contains("is not the one committed to"), "{}", changed.stdout());
    let merged = call(verified.folder, &["blind", "--merge", "out", "--out", "all"]);
    merged.check(0);
    assert_eq!(read(&merged.path("all/receipt.json"))["score"], receipt["score"]);
}

/// Verification detects another executable than the frozen one, also one with an additional byte.
#[test]
fn a_changed_program_is_caught() {
    let folder = fresh_folder();
    seal(folder.path());
    for (name, _) in &CASES[1..] {
        std::fs::remove_dir_all(folder.path().join("cases").join(name)).expect("one case is enough");
    }
    let answered = call(folder, &["blind", "--analyse", "cases", "--quiet"]);
    let scored = call(answered.folder, &["blind", "--score", "cases", "truth.json"]);
    scored.check(0);
    let other = scored.path("other");
    let mut bytes = std::fs::read(crate::common::FREEPLAY).expect("the program");
    bytes.push(0);
    std::fs::write(&other, bytes).expect("another program");
    let executable = std::os::unix::fs::PermissionsExt::from_mode(0o700);
    std::fs::set_permissions(&other, executable).expect("executable");
    let mut command = std::process::Command::new(&other);
    command.args(["blind", "--verify", "cases/receipt.json"]);
    let verified = Call::of(scored.folder, command).run();
    verified.check(1);
    assert!(verified.stdout().contains("frozen was the program"), "{}", verified.stdout());
}

#[test]
fn an_analyst_that_fails_has_answered_wrongly() {
    let folder = fresh_folder();
    let case = folder.path().join("cases/broken");
    std::fs::create_dir_all(&case).expect("a folder");
    std::fs::write(case.join("model.toml"), "no arm").expect("a file");
    std::fs::write(
        folder.path().join("truth.json"),
        json!({ "cases": { "broken": { "effects": [] } } }).to_string(),
    )
    .expect("the truth");
    let answered = call(folder, &["blind", "--analyse", "cases", "--quiet"]);
    answered.check(0);
    let scored = call(answered.folder, &["blind", "--score", "cases", "truth.json"]);
    scored.check(0);
    let receipt = read(&scored.path("cases/receipt.json"));
    assert_eq!(receipt["cases"]["broken"]["outcome"], "failed");
    assert_eq!(receipt["score"]["goals"][0]["reached"], 100.0, "a false alarm");
}

/// A sweep of one kind on the machine with one axis: one case at each severity, on that machine and at that joint, and a control.
#[test]
fn a_matrix_covers_its_places() {
    let arguments = [
        "blind",
        "--matrix",
        "--kind",
        "coulomb_friction",
        "--machine",
        "linear_axis",
        "--negative",
        "1",
        "--seed",
        "6",
        "--out",
        "out",
        "--quiet",
    ];
    let ran = call(fresh_folder(), &arguments);
    ran.check(0);
    let receipt = read(&ran.path("out/receipt.json"));
    let cases = receipt["cases"].as_object().expect("cases");
    let effects = cases.values().filter_map(|case| case["truth"]["effects"].get(0));
    let severities: std::collections::BTreeSet<_> = effects
        .map(|effect| {
            assert_eq!(
                (effect["kind"].as_str(), effect["joint"].as_str()),
                (Some("coulomb_friction"), Some("carriage"))
            );
            effect["severity"].as_str().expect("a severity")
        })
        .collect();
    println!("{}", ran.stdout());
    assert_eq!((cases.len(), severities.len()), (4, 3), "{}", receipt["parts"][0]["not_made"]);
    assert!(cases.values().all(|case| case["truth"]["machine"] == "linear_axis"));
    assert_eq!(receipt["score"]["confusion"]["coulomb_friction"]["coulomb_friction"], 3);
    assert!(std::fs::read_to_string(ran.path("out/report.html")).expect("a report").contains("linear_axis"));
    let verified = call(ran.folder, &["blind", "--verify", "out/receipt.json"]);
    verified.check(0);
    let nowhere = call(
        verified.folder,
        &["blind", "--matrix", "--kind", "joint_coupling", "--machine", "linear_axis", "--out", "other"],
    );
    nowhere.check(2);
    assert!(nowhere.stderr().contains("has no place"), "{}", nowhere.stderr());
}
