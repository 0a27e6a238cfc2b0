//! Draws the golden results of the command anew and shows where they differ from those on file.
//!
//! ```sh
//! cargo build --release && cargo run --release -p freeplay --example goldens            # draws, compares, exit code 1 where they differ
//! cargo run --release -p freeplay --example goldens -- --write                          # draws and keeps
//! cargo run --release -p freeplay --example goldens -- --only lockstep --only compare   # a part of them
//! cargo run --release -p freeplay --example goldens -- --executable /path/to/freeplay   # of another build
//! ```
//!
//! A golden file holds one `key = value` a line. A change that moves code leaves every line as it is; a change that means to alter results
//! keeps the new lines and says why in its commit. The results of real machines, `compare` and `diagnose`, need their recordings, which
//! `FREEPLAY_RECORDINGS` names; without it they are passed over, and what is on file of them stays.

use std::collections::BTreeMap;
use std::ffi::OsStr;
use std::path::{Path, PathBuf};
use std::process::{Command, ExitCode};

use serde_json::Value;

/// A golden file: values by key.
type Golden = BTreeMap<String, String>;
type Fault = Box<dyn std::error::Error>;

/// Inputs with which the executable draws a golden file, in an empty folder.
enum Draw {
    /// By itself.
    Alone(fn(&Tool) -> Result<Golden, Fault>),
    /// From the recordings of real machines.
    From(fn(&Tool, &[Machine]) -> Result<Golden, Fault>),
}

/// The golden files, and how each is drawn.
const GOLDENS: [(&str, Draw); 5] = [
    ("lockstep", Draw::Alone(lockstep)),
    ("compare", Draw::From(compare)),
    ("diagnose", Draw::From(diagnose)),
    ("blind", Draw::Alone(blind)),
    ("exam", Draw::Alone(exam)),
];

/// Seed of the sealed set: any, as long as it stays.
const BLIND_SEED: &str = "4242";

/// The executable under test and a folder to work in.
struct Tool {
    executable: PathBuf,
    folder: tempfile::TempDir,
}

impl Tool {
    /// Runs the executable in the folder; its standard output. Exit code 1 is a verdict, not a fault.
    fn run(&self, arguments: &[&str]) -> Result<String, Fault> {
        eprintln!("freeplay {}", arguments.join(" "));
        let output = Command::new(&self.executable).args(arguments).current_dir(&self.folder).output()?;
        match output.status.code() {
            Some(0 | 1) => Ok(String::from_utf8(output.stdout)?),
            code => {
                Err(format!("{arguments:?}: {code:?}: {}", String::from_utf8_lossy(&output.stderr)).into())
            }
        }
    }

    fn json(&self, arguments: &[&str]) -> Result<Value, Fault> {
        Ok(serde_json::from_str(&self.run(arguments)?)?)
    }

    fn read(&self, file: &str) -> Result<Value, Fault> {
        Ok(serde_json::from_str(&std::fs::read_to_string(self.folder.path().join(file))?)?)
    }
}

/// Hashes of every state and command, by path and controller.
fn lockstep(tool: &Tool) -> Result<Golden, Fault> {
    let mut golden = Golden::new();
    for path in ["lissajous", "square", "square_sharp"] {
        let kind = format!("path.kind={path}");
        tool.run(&["run", "--set", &kind, "--set", "duration=2", "--out", path, "-q"])?;
        let summary = tool.read(&format!("{path}/summary.json"))?;
        for run in summary["runs"].as_array().into_iter().flatten() {
            let name = format!("{path}.{}", run["controller"].as_str().unwrap_or_default());
            flatten(&format!("{name}.state_hash"), &run["state_hash"], &mut golden);
            flatten(&format!("{name}.deviation_mm"), &run["deviation_mm"], &mut golden);
        }
    }
    Ok(golden)
}

/// A real machine: its model and its recordings.
struct Machine {
    name: String,
    model: String,
    recordings: Vec<String>,
}

/// The machines in `folder`, by name.
fn machines(folder: &OsStr) -> Result<Vec<Machine>, Fault> {
    let mut machines = Vec::new();
    for entry in std::fs::read_dir(std::path::absolute(folder)?)?
        .filter(|e| e.as_ref().is_ok_and(|e| e.path().is_dir()))
    {
        let path = entry?.path();
        let mut files: Vec<String> =
            std::fs::read_dir(&path)?.flatten().map(|file| file.path().display().to_string()).collect();
        files.sort();
        let model =
            files.iter().find(|file| file.ends_with(".urdf")).ok_or("a folder without a URDF")?.clone();
        let recordings = files.into_iter().filter(|file| file.ends_with(".csv")).collect();
        machines.push(Machine { name: file_name(&path.display().to_string()), model, recordings });
    }
    machines.sort_by(|a, b| a.name.cmp(&b.name));
    Ok(machines)
}

fn file_name(path: &str) -> String {
    Path::new(path).file_name().unwrap_or_default().to_string_lossy().into_owned()
}

/// Residuals of each model in each recording of its machine.
fn compare(tool: &Tool, machines: &[Machine]) -> Result<Golden, Fault> {
    let mut golden = Golden::new();
    for machine in machines {
        for recording in &machine.recordings {
            let arguments =
                ["compare", "--model", &machine.model, "--recording", recording, "--format", "json"];
            let key = format!("{}.{}", machine.name, file_name(recording));
            match tool.json(&arguments) {
                Ok(found) => flatten(&key, &found["channels"], &mut golden),
                Err(refused) => drop(golden.insert(key, first_line(&refused.to_string()))),
            }
        }
    }
    Ok(golden)
}

/// Verdict, effects, parameters and errors of the diagnosis of each machine's training recordings.
fn diagnose(tool: &Tool, machines: &[Machine]) -> Result<Golden, Fault> {
    let mut golden = Golden::new();
    for machine in machines {
        let mut arguments = vec!["diagnose", "--model", &machine.model, "--format", "json"];
        for recording in machine.recordings.iter().filter(|file| file_name(file).starts_with("train")) {
            arguments.extend(["--recording", recording.as_str()]);
        }
        match tool.json(&arguments) {
            Ok(found) => answer(&machine.name, &found, &mut golden),
            Err(refused) => drop(golden.insert(machine.name.clone(), first_line(&refused.to_string()))),
        }
    }
    Ok(golden)
}

/// Adds the results of a diagnosis: verdict, set-up, effects with their parameters, errors.
fn answer(key: &str, found: &Value, golden: &mut Golden) {
    flatten(&format!("{key}.verdict"), &found["verdict"], golden);
    flatten(&format!("{key}.setup"), &found["setup"], golden);
    for (number, effect) in found["effects"].as_array().into_iter().flatten().enumerate() {
        for part in ["kind", "joint", "parameters"] {
            flatten(&format!("{key}.effects.{number}.{part}"), &effect[part], golden);
        }
    }
    flatten(&format!("{key}.fit.after"), &found["fit"]["after"], golden);
}

/// The answers to forty sealed cases of a fixed seed, and their score.
fn blind(tool: &Tool) -> Result<Golden, Fault> {
    tool.run(&["blind", "--cases", "40", "--seed", BLIND_SEED, "--out", "blind", "-q"])?;
    let receipt = tool.read("blind/receipt.json")?;
    let mut golden = Golden::new();
    flatten("outcomes", &receipt["score"]["outcomes"], &mut golden);
    // Names of cases are drawn anew for each set; the truth tells which case it is.
    let named: Vec<&Value> = match &receipt["cases"] {
        Value::Object(cases) => cases.values().collect(),
        cases => cases.as_array().into_iter().flatten().collect(),
    };
    let mut cases: Vec<(String, &Value)> =
        named.into_iter().map(|case| (case["truth"].to_string(), &case["answer"])).collect();
    cases.sort_by(|a, b| a.0.cmp(&b.0));
    for (number, (truth, answered)) in cases.iter().enumerate() {
        golden.insert(format!("{number:02}.truth"), truth.clone());
        answer(&format!("{number:02}"), answered, &mut golden);
    }
    Ok(golden)
}

/// The verdicts of the fault exam on each built-in controller.
fn exam(tool: &Tool) -> Result<Golden, Fault> {
    let mut golden = Golden::new();
    for controller in ["computed-torque", "quasi-static", "narx-qp"] {
        let found =
            tool.json(&["faults", controller, "--seeds", "1", "--set", "duration=1", "--format", "json"])?;
        for verdict in found["verdicts"].as_array().into_iter().flatten() {
            let key = format!("{controller}.{}", verdict["kind"].as_str().unwrap_or_default());
            for part in ["holds", "detected", "not_as_expected", "bad_applied", "reasons"] {
                flatten(&format!("{key}.{part}"), &verdict[part], &mut golden);
            }
        }
    }
    Ok(golden)
}

fn first_line(text: &str) -> String {
    text.lines().next().unwrap_or_default().to_owned()
}

/// Adds every number, text and truth value in `value` under its path.
fn flatten(key: &str, value: &Value, golden: &mut Golden) {
    match value {
        Value::Object(fields) => {
            fields.iter().for_each(|(name, value)| flatten(&format!("{key}.{name}"), value, golden));
        }
        Value::Array(items) => items
            .iter()
            .enumerate()
            .for_each(|(number, value)| flatten(&format!("{key}.{number}"), value, golden)),
        leaf => drop(golden.insert(key.to_owned(), leaf.to_string())),
    }
}

fn text_of(golden: &Golden) -> String {
    golden.iter().map(|(key, value)| format!("{key} = {value}\n")).collect()
}

fn parse(text: &str) -> Golden {
    let pairs = text.lines().filter_map(|line| line.split_once(" = "));
    pairs.map(|(key, value)| (key.to_owned(), value.to_owned())).collect()
}

/// Prints each key whose value differs; how many there are.
fn differences(name: &str, old: &Golden, new: &Golden) -> usize {
    let keys: std::collections::BTreeSet<&String> = old.keys().chain(new.keys()).collect();
    let none = "(absent)".to_owned();
    let mut count = 0;
    for key in keys {
        let (before, after) = (old.get(key).unwrap_or(&none), new.get(key).unwrap_or(&none));
        if before != after {
            println!("{name}: {key}\n  - {before}\n  + {after}");
            count += 1;
        }
    }
    count
}

fn draw() -> Result<bool, Fault> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let write = arguments.iter().any(|argument| argument == "--write");
    let given = |option: &'static str| {
        arguments.windows(2).filter(move |pair| pair[0] == option).map(|pair| &pair[1])
    };
    let only: Vec<&String> = given("--only").collect();
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../tests/goldens");
    let beside = std::env::current_exe()?.with_file_name("").join("../freeplay");
    let executable = given("--executable").next().map_or(beside, PathBuf::from);
    let machines = std::env::var_os("FREEPLAY_RECORDINGS").map(|folder| machines(&folder)).transpose()?;
    let mut same = true;
    for (name, draw) in GOLDENS.iter().filter(|(name, _)| only.is_empty() || only.iter().any(|o| o == name)) {
        let tool = Tool { executable: executable.clone(), folder: tempfile::tempdir()? };
        let new = match (draw, &machines) {
            (Draw::Alone(draw), _) => draw(&tool)?,
            (Draw::From(draw), Some(machines)) => draw(&tool, machines)?,
            (Draw::From(_), None) => {
                println!(
                    "{name}: passed over: FREEPLAY_RECORDINGS names no folder of recordings of real machines"
                );
                continue;
            }
        };
        let file = folder.join(format!("{name}.txt"));
        if write {
            std::fs::write(&file, text_of(&new))?;
            println!("{name}: kept {} values", new.len());
            continue;
        }
        let differing = differences(name, &parse(&std::fs::read_to_string(&file).unwrap_or_default()), &new);
        println!("{name}: {differing} of {} values differ", new.len());
        same &= differing == 0;
    }
    Ok(same)
}

fn main() -> ExitCode {
    match draw() {
        Ok(same) => ExitCode::from(u8::from(!same)),
        Err(fault) => {
            eprintln!("goldens: {fault}");
            ExitCode::from(70)
        }
    }
}
