//! `freeplay blind --generator`: recordings of another program with the same seal, and the generator in MuJoCo.
//!
//! `FREEPLAY_PYTHON` names an interpreter that has mujoco; else the tests try `python3`. Without it the test prints a message and passes.

use std::path::Path;
use std::process::Command;

use crate::common::{Call, FREEPLAY, fresh_folder};
use freeplay_concealed::{Case, Demand, Family, Machine, Noise, Severity, generate, write_sealed};
use serde_json::Value;

fn python() -> String {
    std::env::var("FREEPLAY_PYTHON").unwrap_or_else(|_| "python3".to_owned())
}

fn has(packages: &str) -> bool {
    let script = format!("import {packages}");
    let found =
        Command::new(python()).args(["-c", &script]).output().is_ok_and(|output| output.status.success());
    if !found {
        freeplay_skip::skip(
            freeplay_skip::Need::Python,
            format_args!("{} lacks {packages}; FREEPLAY_PYTHON names another interpreter", python()),
        );
    }
    found
}

fn read(path: &Path) -> Value {
    let text = std::fs::read_to_string(path).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
    serde_json::from_str(&text).expect("JSON")
}

/// An executable in `folder` that runs `lines` in a shell.
fn script(folder: &Path, lines: &str) -> String {
    use std::os::unix::fs::PermissionsExt;
    let path = folder.join("generator.sh");
    std::fs::write(&path, format!("#!/bin/sh\n{lines}\n")).expect("written");
    std::fs::set_permissions(&path, std::fs::Permissions::from_mode(0o755)).expect("its own file");
    path.display().to_string()
}

const ASKED: [&str; 8] = ["blind", "--cases", "2", "--seed", "5", "--out", "out", "--quiet"];

/// Copies the folder `case` to the place of the second case in the order, and reports the first as not made.
const COPIES: &str = r#"cat > order.json
folder=$(sed 's/.*"folder":"\([^"]*\)".*/\1/' order.json)
name=$(sed 's/.*"index":1,"name":"\([^"]*\)".*/\1/' order.json)
cp -r case "$folder/$name"
echo '[0, null]'
echo '[0, {"NotMade": {"asked": "a gap", "why": "no tool"}}]'
echo '[1, null]'
echo '[1, {"Made": {"name": "'"$name"'", "truth": {"effects": [{"kind": "coulomb_friction", "joint": "carriage"}]}}}]'"#;

/// Cases that a generator can't make are counted; those that it makes are sealed, answered and scored; the receipt names the generator.
#[test]
fn another_program_gets_an_order_and_its_lines_are_read() {
    let folder = fresh_folder();
    let friction = Demand { kind: "coulomb_friction".to_owned(), joint: None, severity: Severity::Strong };
    let case = Case {
        machine: Machine::Slide,
        effects: vec![friction],
        family: Some(Family::Fourier),
        noise: Noise::Low,
        hollow: false,
        seed: 40,
    };
    write_sealed(&folder.path().join("case"), &generate(&case).expect("a case")).expect("files");
    let generator = script(folder.path(), COPIES);
    let ran = Call::new(folder, &[&ASKED[..], &["--generator", &generator]].concat()).run().expect(0);
    let order = read(&ran.folder.path().join("order.json"));
    assert_eq!((&order["schema"], &order["seed"]), (&"freeplay.generator/1".into(), &5.into()), "{order}");
    assert_eq!(order["quota"]["single"], 2);
    assert_eq!(order["cases"].as_array().map(Vec::len), Some(2));
    assert!(Path::new(order["folder"].as_str().expect("a folder")).is_absolute());
    let receipt = read(&ran.folder.path().join("out/receipt.json"));
    let part = &receipt["parts"][0];
    assert_eq!(part["not_made"][0], "a gap: no tool");
    assert_eq!(part["draw"]["generator"]["name"], generator.as_str());
    let case = receipt["cases"].as_object().and_then(|cases| cases.values().next()).expect("a case");
    assert_eq!(case["outcome"], "right", "{}", case["answer"]["statement"]);
    let verified = Call::new(ran.folder, &["blind", "--verify", "out/receipt.json"]).run().expect(0);
    println!("{}", verified.stdout());
}

#[test]
fn a_generator_that_is_missing_or_garbled_is_said_in_one_error() {
    let folder = fresh_folder();
    let garbled = script(folder.path(), "cat > /dev/null\necho hello");
    let ran = Call::new(folder, &[&ASKED[..], &["--generator", &garbled]].concat()).run().expect(3);
    assert!(ran.stderr().contains("breaks the contract of a generator"), "{}", ran.stderr());

    let call = Call::new(fresh_folder(), &[&ASKED[..], &["--generator", "mujoco"]].concat());
    let ran = call.env("FREEPLAY_PYTHON", "/nowhere/python").run().expect(5);
    assert!(ran.stderr().contains("FREEPLAY_PYTHON"), "{}", ran.stderr());
    for left in ["sealed", "making", "generator", "receipt.json"] {
        assert!(!ran.folder.path().join("out").join(left).exists(), "{left} is left");
    }
}

/// A Python without the package ends with the exit code of a missing peer, and the message names the package.
#[test]
fn a_python_without_mujoco_is_said_in_one_error() {
    if !has("json") {
        return;
    }
    let folder = fresh_folder();
    let hidden = folder.path().join("hidden");
    std::fs::create_dir(&hidden).expect("a folder");
    std::fs::write(hidden.join("mujoco.py"), "raise ImportError('hidden', name='mujoco')").expect("written");
    let call = Call::new(folder, &[&ASKED[..], &["--generator", "mujoco"]].concat());
    let ran = call.env("FREEPLAY_PYTHON", python()).env("PYTHONPATH", &hidden).run().expect(5);
    assert!(ran.stderr().contains("pip install mujoco"), "{}", ran.stderr());
}

/// Three cases from MuJoCo under the whole protocol: sealed, answered, scored, verified.
#[test]
fn cases_from_mujoco_are_sealed_and_scored_as_our_own() {
    if !has("mujoco") {
        return;
    }
    let folder = fresh_folder();
    // One analyst at a time: another test uses the other core.
    let asked = [
        "blind",
        "--generator",
        "mujoco",
        "--cases",
        "3",
        "--seed",
        "11",
        "--patience",
        "3000",
        "--jobs",
        "1",
    ];
    let run = |arguments: &[&str]| {
        let mut command = Command::new(FREEPLAY);
        command.args(arguments).current_dir(folder.path()).env("FREEPLAY_PYTHON", python());
        let output = command.output().expect("it runs");
        let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
        assert!(output.status.success(), "{}\n{}", text(&output.stdout), text(&output.stderr));
        text(&output.stdout)
    };
    println!("{}", run(&[&asked[..], &["--out", "out", "--quiet"]].concat()));
    let receipt = read(&folder.path().join("out/receipt.json"));
    let (part, cases) = (&receipt["parts"][0], receipt["cases"].as_object().expect("cases"));
    assert_eq!(part["draw"]["generator"]["name"], "mujoco");
    let not_made = part["not_made"].as_array().map_or(0, Vec::len);
    assert_eq!(cases.len() + not_made, 3, "{:#}", part["not_made"]);
    assert!(cases.len() >= 2, "{:#}", part["not_made"]);
    for (name, case) in cases {
        println!("{name} {} {}: {}", case["truth"]["machine"], case["outcome"], case["answer"]["verdict"]);
        assert_ne!(case["outcome"], "failed", "{:#}", case["answer"]["statement"]);
        for file in std::fs::read_dir(folder.path().join("out/sealed").join(name)).expect("files") {
            let file = file.expect("a file").file_name().into_string().expect("a name");
            assert!(["model.toml", "recording.csv", "second.csv"].contains(&file.as_str()), "{file}");
        }
    }
    let goals = receipt["score"]["goals"].as_array().expect("goals");
    assert!(goals.iter().any(|goal| goal["quantity"].as_str().is_some_and(|q| q.contains("intervals"))));
    assert!(run(&["blind", "--verify", "out/receipt.json"]).contains("sealed"), "each hash is named");
}
