//! `freeplay scenario`: the shipped scenarios are valid, errors have their place, values show their origin, and the schema for editors is that of the types.

use std::path::{Path, PathBuf};

use crate::common::{Ran, freeplay, freeplay_in, fresh_folder};
use serde_json::Value;

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..")
}

/// The scenarios in `scenarios/`: all TOML files there but the arm files.
fn shipped() -> Vec<PathBuf> {
    let files =
        std::fs::read_dir(root().join("scenarios")).expect("a folder").flatten().map(|entry| entry.path());
    files
        .filter(|file| {
            file.to_string_lossy().ends_with(".toml") && !file.to_string_lossy().ends_with(".arm.toml")
        })
        .collect()
}

/// Calls `freeplay scenario` with `arguments` in a folder with the scenario `text` as `s.toml`.
fn with(text: &str, arguments: &[&str]) -> Ran {
    let folder = fresh_folder();
    std::fs::write(folder.path().join("s.toml"), text).expect("written");
    freeplay_in(folder, &[&["scenario"][..], arguments].concat())
}

#[test]
fn the_shipped_scenarios_are_good() {
    let files: Vec<String> = shipped().iter().map(|file| file.display().to_string()).collect();
    println!("{files:#?}");
    assert!(files.len() >= 11);
    let mut arguments = vec!["scenario", "check"];
    arguments.extend(files.iter().map(String::as_str));
    let ran = freeplay(&arguments).expect(0);
    assert_eq!(ran.stdout().matches(": valid: ").count(), files.len());
}

#[test]
fn the_schema_in_docs_is_that_of_the_types_and_knows_every_key_of_the_shipped_scenarios() {
    let made = freeplay(&["scenario", "schema"]).expect(0).stdout();
    let found = std::fs::read_to_string(root().join("docs/scenario.schema.json")).expect("the file is there");
    assert!(found == made, "make it again: freeplay scenario schema > docs/scenario.schema.json");
    let schema: Value = serde_json::from_str(&made).expect("JSON");
    let keys = schema["properties"].as_object().expect("properties");
    assert_eq!(schema["additionalProperties"], false);
    for file in shipped() {
        let text = std::fs::read_to_string(&file).expect("read");
        let table: toml::Table = toml::from_str(&text).expect("TOML");
        let unknown: Vec<&String> = table.keys().filter(|key| !keys.contains_key(*key)).collect();
        assert!(unknown.is_empty(), "{}: {unknown:?}", file.display());
    }
}

#[test]
fn what_is_wrong_is_said_with_line_and_column() {
    let cases = [
        ("seed = 1\nrate = 0\n", "rate = 0 is out of range", "s.toml:2:1"),
        ("seed = 1\n[path]\nlaps = 1\n period = 0\n", "path.period = 0 s", "s.toml:4:2"),
        ("[clearance.joint_5]\nclearance = 0.0006\nfriction = -1\n", "friction = -1", "s.toml:3:1"),
        ("[clearance]\njoint_9 = { clearance = 0.001 }\n", "no joint of that name", "s.toml:2:1"),
        ("[[swap]]\ntick = 5\nto = \"nobody\"\n", "swap to \"nobody\"", "s.toml:1:3"),
        ("[sensors]\ntool.noise = -1\n", "sensors.tool", "s.toml:2:6"),
        ("rate = 1000\npuce = 3\n", "unknown field `puce`", "line 2, column 1"),
        ("rate = \"fast\"\n", "found text \"fast\", expected a number", "line 1, column 8"),
        ("[path\nperiod = 1\n", "TOML parse error", "line 1"),
    ];
    for (text, said, place) in cases {
        let ran = with(text, &["check", "s.toml"]).expect(3);
        println!("{}", ran.stderr());
        assert!(ran.stderr().contains(said) && ran.stderr().contains(place), "{text}{}", ran.dump());
    }
    let ran = with("", &["check", "none.toml"]).expect(3);
    assert!(ran.stderr().contains("cannot read the scenario none.toml"), "{}", ran.dump());
}

#[test]
fn every_value_says_where_it_is_from_and_what_is_shown_is_a_scenario() {
    let text = "hold = 7\n[path]\nperiod = 3.0\n[[swap]]\ntick = 9\nto = \"quasi-static\"\n";
    let ran =
        with(text, &["show", "s.toml", "--set", "seed=5", "--set", "controller.gains.damping_ratio=0.7"])
            .expect(0);
    let shown = ran.stdout();
    let origin = |key: &str| {
        let line = shown
            .lines()
            .find(|line| line.starts_with(&format!("{key} = ")))
            .unwrap_or_else(|| panic!("{key}"));
        line.rsplit("  # ").next().expect("an origin").to_owned()
    };
    assert_eq!([origin("hold"), origin("path.period"), origin("swap")], ["s.toml:1", "s.toml:3", "s.toml:4"]);
    assert_eq!([origin("seed"), origin("controller.gains.damping_ratio")], ["--set", "--set"]);
    assert_eq!([origin("rate"), origin("controller.gains.natural_frequency")], ["default", "default"]);
    let again = with(&shown, &["show", "s.toml"]).expect(0).stdout();
    let values = |text: &str| -> Vec<String> {
        text.lines().filter_map(|line| Some(line.rsplit_once("  # ")?.0.trim().to_owned())).collect()
    };
    assert_eq!(values(&shown), values(&again));
}
