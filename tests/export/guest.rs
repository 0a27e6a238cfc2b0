//! FMUs as controllers: FMI 2.0 and 3.0 answer like a native controller; invalid ones end in one error or a safe run.
//!
//! The C compiler that links Rust builds the FMUs; without one these tests print a message and pass.

use std::path::Path;
use std::process::Command;

use serde_json::Value;
use tempfile::TempDir;

use super::tools::{here, python};
use crate::common::{Call, fresh_folder};

/// A description with inputs and outputs named `names`.
fn description(version: &str, names: [&str; 2]) -> String {
    let [reference, command] = names;
    let mut variables = String::new();
    for joint in 1..=6 {
        for (name, causality, at) in [(reference, "input", joint - 1), (command, "output", joint + 9)] {
            let name = name.replace('#', &joint.to_string());
            let start = if causality == "input" { " start=\"0\"" } else { "" };
            variables += &match version {
                "2.0" => format!(
                    "<ScalarVariable name=\"{name}\" valueReference=\"{at}\" causality=\"{causality}\"><Real{start}/></ScalarVariable>\n"
                ),
                _ => format!(
                    "<Float64 name=\"{name}\" valueReference=\"{at}\" causality=\"{causality}\"{start}/>\n"
                ),
            };
        }
    }
    format!(
        "<fmiModelDescription fmiVersion=\"{version}\" modelName=\"follow\" guid=\"follow\" instantiationToken=\"follow\">\n\
         <CoSimulation modelIdentifier=\"follow\"/>\n<ModelVariables>\n{variables}</ModelVariables>\n</fmiModelDescription>\n"
    )
}

fn platform(version: &str) -> String {
    match version {
        "2.0" => "linux64".to_owned(),
        _ => format!("{}-linux", std::env::consts::ARCH),
    }
}

/// The library of `follow.c`, compiled with `flags`; `None` without a compiler.
fn library(folder: &Path, flags: &[&str]) -> Option<Vec<u8>> {
    let out = folder.join("follow.so");
    let mut command = Command::new("cc");
    command.args(["-shared", "-fPIC", "-O1", "-o"]).arg(&out).args(flags).arg(here("follow.c")).arg("-lm");
    match command.output() {
        Ok(output) => {
            assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
            Some(std::fs::read(out).expect("a library"))
        }
        Err(error) => {
            freeplay_skip::skip(freeplay_skip::Need::Compiler, format_args!("no C compiler: {error}"));
            None
        }
    }
}

/// An FMU in `folder` called `name`; false without a compiler.
fn fmu(folder: &Path, name: &str, version: &str, flags: &[&str]) -> bool {
    let two: &[&str] = if version == "2.0" { &["-DTWO"] } else { &[] };
    let Some(library) = library(folder, &[two, flags].concat()) else { return false };
    let text = description(version, ["q_ref.joint_#", "command.joint_#"]);
    pack(folder, name, &text, &format!("binaries/{}/follow.so", platform(version)), &library);
    true
}

fn pack(folder: &Path, name: &str, description: &str, at: &str, library: &[u8]) {
    let entries = [("modelDescription.xml".to_owned(), description.as_bytes()), (at.to_owned(), library)];
    std::fs::write(folder.join(name), freeplay_fmi::archive(&entries).expect("an archive")).expect("written");
}

/// Renames an entry of the archive `file` to a name that no writer would choose.
fn led_out(file: &Path, from: &[u8], to: &[u8]) {
    let mut bytes = std::fs::read(file).expect("an archive");
    let found: Vec<usize> =
        (0..bytes.len() - from.len()).filter(|&at| bytes[at..].starts_with(from)).collect();
    assert!(found.len() >= 2, "in its header and in the list");
    found.into_iter().for_each(|at| bytes[at..at + to.len()].copy_from_slice(to));
    std::fs::write(file, bytes).expect("written");
}

fn run<'a>(controllers: &[&'a str]) -> Vec<&'a str> {
    let mut arguments = vec![
        "run",
        "--quiet",
        "--pace",
        "lockstep",
        "--set",
        "duration=0.3",
        "--set",
        "mode=driven",
        "--force",
        "--out",
        "out",
        "--recording",
        "csv",
    ];
    controllers.iter().for_each(|controller| arguments.extend(["--controller", controller]));
    arguments
}

fn summary(folder: &TempDir) -> Value {
    let text = std::fs::read_to_string(folder.path().join("out/summary.json")).expect("a summary");
    serde_json::from_str(&text).expect("JSON")
}

#[test]
fn fmus_of_both_versions_answer_as_the_native_controller_does() {
    let folder = fresh_folder();
    if !fmu(folder.path(), "three.fmu", "3.0", &[]) || !fmu(folder.path(), "two.fmu", "2.0", &[]) {
        return;
    }
    let ran = Call::new(folder, &run(&["./three.fmu", "./two.fmu", "computed-torque"])).run().expect(0);
    let summary = summary(&ran.folder);
    let runs = summary["runs"].as_array().expect("runs");
    assert_eq!(runs.len(), 3);
    for run in runs {
        println!("{} {} {}", run["controller"], run["state_hash"], run["deviation_mm"]["rms"]);
        assert_eq!(run["state_hash"], runs[2]["state_hash"], "{}", run["controller"]);
        assert_eq!(run["gate"]["rejected"], runs[2]["gate"]["rejected"]);
    }
    assert!(
        !std::env::temp_dir().read_dir().expect("a folder").flatten().any(|entry| {
            let name = entry.file_name().to_string_lossy().into_owned();
            name.strip_prefix("freeplay-fmu-")
                .and_then(|pid| pid.parse::<u32>().ok())
                .is_some_and(|pid| !Path::new(&format!("/proc/{pid}")).exists())
        }),
        "an unpacked FMU is left"
    );
}

#[test]
fn an_fmu_is_swapped_and_examined_as_any_controller() {
    let folder = fresh_folder();
    if !fmu(folder.path(), "three.fmu", "3.0", &[]) {
        return;
    }
    let asked = [
        "swap",
        "--quiet",
        "--swaps",
        "6",
        "--pace",
        "lockstep",
        "--out",
        "swaps",
        "--set",
        "mode=driven",
        "--controller",
        "./three.fmu",
        "--controller",
        "computed-torque",
    ];
    let ran = Call::new(folder, &asked).run().expect(0);
    let asked = [
        "faults",
        "./three.fmu",
        "--quiet",
        "--set",
        "mode=driven",
        "--pace",
        "lockstep",
        "--kind",
        "nan",
        "--kind",
        "crash",
        "--seeds",
        "2",
        "--out",
        "exam",
    ];
    let ran = Call::new(ran.folder, &asked).run().expect(0);
    println!("{}", ran.stdout());
}

#[test]
fn an_fmu_that_fails_on_the_way_leaves_a_safe_run() {
    for flag in ["-DBAD", "-DERRS", "-DCRASH", "-DHANG"] {
        let folder = fresh_folder();
        if !fmu(folder.path(), "bad.fmu", "3.0", &[flag]) {
            return;
        }
        let asked = [run(&["./bad.fmu"]), vec!["--set", "patience=1"]].concat();
        let ran = Call::new(folder, &asked).run();
        println!("{flag}: {:?} {}", ran.output.status.code(), ran.stderr());
        assert!(matches!(ran.output.status.code(), Some(0 | 1 | 5)), "{flag}: {}", ran.dump());
        let run = &summary(&ran.folder)["runs"][0];
        if flag == "-DBAD" {
            assert!(run["gate"]["rejected"]["not_finite"].as_u64().is_some_and(|count| count > 0), "{run:#}");
        }
        let counted = format!("{}{}", run["gate"]["rejected"], run["deadlines"]);
        println!("{counted}");
        assert!(counted.chars().any(|c| ('1'..='9').contains(&c)), "{flag}: the fault is counted");
    }
}

#[test]
fn an_fmu_that_can_not_be_used_is_said_in_one_error() {
    let folder = fresh_folder();
    let Some(library) = library(folder.path(), &[]) else { return };
    let good = description("3.0", ["q_ref.joint_#", "command.joint_#"]);
    let at = format!("binaries/{}/follow.so", platform("3.0"));
    let path = folder.path();
    pack(path, "platform.fmu", &good, "binaries/aarch64-windows/follow.dll", &library);
    pack(path, "slip.fmu", &good, "xx/xx/slip.so", &library);
    led_out(&path.join("slip.fmu"), b"xx/xx/slip.so", b"../../slip.so");
    pack(
        path,
        "other.fmu",
        &good.replace("modelIdentifier=\"follow\"", "modelIdentifier=\"../follow\""),
        &at,
        &library,
    );
    pack(path, "exchange.fmu", &good.replace("CoSimulation", "ModelExchange"), &at, &library);
    pack(path, "names.fmu", &description("3.0", ["wanted#", "command.joint_#"]), &at, &library);
    pack(path, "silent.fmu", &description("3.0", ["q_ref.joint_#", "out#"]), &at, &library);
    pack(path, "token.fmu", &good.replace("\"follow\">", "\"else\">"), &at, &library);
    pack(path, "rubbish.fmu", &good, &at, b"no library");
    std::fs::write(path.join("text.fmu"), "no archive").expect("written");
    let mut folder = folder;
    for (name, words) in [
        ("platform.fmu", "has no library binaries"),
        ("slip.fmu", "leads out of it"),
        ("other.fmu", "no name of a library"),
        ("exchange.fmu", "no FMU for Co-Simulation"),
        ("names.fmu", "the input `wanted1` of the FMU"),
        ("silent.fmu", "is the command of joint_1"),
        ("token.fmu", "not what the description says"),
        ("rubbish.fmu", "library of the FMU can't be used"),
        ("text.fmu", "no FMU, which is a ZIP archive"),
    ] {
        let controller = format!("./{name}");
        let ran = Call::new(folder, &run(&[&controller])).run();
        let code = ran.output.status.code();
        println!("{name}: {code:?} {}", ran.stderr());
        assert!(matches!(code, Some(3 | 5)), "{name}: {}", ran.dump());
        assert!(ran.stderr().contains(words), "{name}: {}", ran.stderr());
        folder = ran.folder;
    }
}

#[test]
fn a_mapping_file_says_what_names_do_not() {
    let folder = fresh_folder();
    let Some(library) = library(folder.path(), &[]) else { return };
    let at = format!("binaries/{}/follow.so", platform("3.0"));
    pack(folder.path(), "odd.fmu", &description("3.0", ["wanted#", "out#"]), &at, &library);
    let table = |prefix: &str, of: &str| {
        (1..=6).map(|n| format!("{prefix}{n} = \"{of}.joint_{n}\"\n")).collect::<String>()
    };
    let text = format!("[inputs]\n{}[outputs]\n{}", table("wanted", "q_ref"), table("out", "command"));
    std::fs::write(folder.path().join("odd.fmu.toml"), text).expect("written");
    let ran = Call::new(folder, &run(&["./odd.fmu", "computed-torque"])).run().expect(0);
    let runs = summary(&ran.folder)["runs"].clone();
    assert_eq!(runs[0]["state_hash"], runs[1]["state_hash"]);
}

/// The shared library of the Python that `FREEPLAY_PYTHON` names, if it has one and the package `package`.
fn python_library(package: &str) -> Option<String> {
    let script = format!(
        "import {package}, os, sysconfig; get = sysconfig.get_config_var; path = os.path.join(get('LIBDIR'), get('INSTSONAME')); assert get('Py_ENABLE_SHARED') and os.path.exists(path); print(path)"
    );
    let output = Command::new(python()).args(["-c", &script]).output().ok()?;
    if !output.status.success() {
        freeplay_skip::skip(
            freeplay_skip::Need::PythonLibrary,
            format_args!(
                "{} lacks {package} or a shared library; FREEPLAY_PYTHON names another interpreter",
                python()
            ),
        );
        return None;
    }
    Some(String::from_utf8_lossy(&output.stdout).trim().to_owned())
}

/// A class of `pythonfmu3`, and of `pythonfmu`, that commands the reference.
const IN_PYTHON: [(&str, [&str; 2], &str); 2] = [
    (
        "pythonfmu3",
        ["Follow3", "Fmi3Slave"],
        "from pythonfmu3 import Fmi3Slave, Float64 as Real, Fmi3Causality as Causality, Fmi3Variability\nMORE = dict(variability=Fmi3Variability.continuous)\n",
    ),
    (
        "pythonfmu",
        ["Follow2", "Fmi2Slave"],
        "from pythonfmu import Fmi2Slave, Real, Fmi2Causality as Causality\nMORE = {}\n",
    ),
];

const BODY: &str = r#"
class NAME(BASE):
    def __init__(self, **kwargs):
        super().__init__(**kwargs)
        for joint in range(1, 7):
            setattr(self, f"q_ref_{joint}", 0.0)
            setattr(self, f"command_{joint}", 0.0)
            self.register_variable(Real(f"q_ref_{joint}", causality=Causality.input, start=0, **MORE))
            self.register_variable(Real(f"command_{joint}", causality=Causality.output, **MORE))

    def do_step(self, time, step):
        for joint in range(1, 7):
            setattr(self, f"command_{joint}", getattr(self, f"q_ref_{joint}"))
        return True
"#;

/// An FMU in `folder` of the class number `index` in [`IN_PYTHON`]: its name, and the library that it needs; `None` if Python lacks either.
fn python_fmu(folder: &Path, index: usize) -> Option<(String, String)> {
    let (package, [name, base], head) = IN_PYTHON[index];
    let library = python_library(package)?;
    let script = format!("{head}{}", BODY.replace("NAME", name).replace("BASE", base));
    std::fs::write(folder.join("follow.py"), script).expect("written");
    let mut build = Command::new(python());
    build.args(["-m", package, "build", "-f", "follow.py"]).current_dir(folder);
    let built = build.output().expect("it starts");
    assert!(built.status.success(), "{}", String::from_utf8_lossy(&built.stderr));
    Some((format!("./{name}.fmu"), library))
}

#[test]
fn fmus_in_python_answer_as_the_native_controller_does() {
    for index in 0..IN_PYTHON.len() {
        let folder = fresh_folder();
        let Some((fmu, library)) = python_fmu(folder.path(), index) else { continue };
        let call = Call::new(folder, &run(&[&fmu, "computed-torque"])).env("FREEPLAY_FMU_PRELOAD", library);
        let ran = call.run().expect(0);
        let runs = summary(&ran.folder)["runs"].clone();
        println!("{fmu}: {}", runs[0]["state_hash"]);
        assert_eq!(runs[0]["state_hash"], runs[1]["state_hash"]);
    }
}

/// The verdict on each kind of fault of the exam.
fn verdicts(exam: &Value) -> Vec<(String, bool)> {
    let lists = ["verdicts", "surroundings"].map(|list| exam[list].as_array().expect("a list").iter());
    let word = |verdict: &Value| verdict["kind"].as_str().or(verdict["fault"].as_str()).map(str::to_owned);
    let verdict = |verdict: &Value| (word(verdict).expect("a name"), verdict["holds"] == true);
    lists.into_iter().flatten().map(verdict).collect()
}

/// 200 swaps with the native controller of the same law, and the whole exam, compared with that of the native controller.
fn swapped_and_examined(folder: TempDir, fmu: &str, library: Option<&str>) {
    let set = ["--quiet", "--set", "mode=driven", "--pace", "lockstep"];
    let swap =
        ["swap", "--swaps", "200", "--controller", fmu, "--controller", "computed-torque", "--out", "swaps"];
    let given = |call: Call| match library {
        Some(library) => call.env("FREEPLAY_FMU_PRELOAD", library),
        None => call,
    };
    let mut folder = given(Call::new(folder, &[swap.as_slice(), &set].concat())).run().expect(0).folder;
    println!("{fmu}: 200 swaps hold");
    let exams = [fmu, "computed-torque"].map(|controller| {
        let faults = [
            "faults",
            controller,
            "--format",
            "json",
            "--out",
            if controller == fmu { "exam" } else { "native" },
        ];
        let kept = std::mem::replace(&mut folder, fresh_folder());
        let ran = given(Call::new(kept, &[faults.as_slice(), &set].concat())).run().expect(0);
        let exam: Value = serde_json::from_str(&ran.stdout()).expect("JSON");
        folder = ran.folder;
        verdicts(&exam)
    });
    println!(
        "{fmu}: {} of {} verdicts hold",
        exams[0].iter().filter(|(_, holds)| *holds).count(),
        exams[0].len()
    );
    assert_eq!(exams[0], exams[1]);
}

#[test]
#[ignore = "minutes: cargo test --release -p freeplay --test command export:: -- --ignored --nocapture"]
fn an_fmu_in_c_passes_the_whole_exam_and_200_swaps() {
    let folder = fresh_folder();
    if fmu(folder.path(), "three.fmu", "3.0", &[]) {
        swapped_and_examined(folder, "./three.fmu", None);
    }
}

#[test]
#[ignore = "minutes: cargo test --release -p freeplay --test command export:: -- --ignored --nocapture"]
fn fmus_in_python_pass_the_whole_exam_and_200_swaps() {
    for index in 0..IN_PYTHON.len() {
        let folder = fresh_folder();
        let Some((fmu, library)) = python_fmu(folder.path(), index) else { continue };
        swapped_and_examined(folder, &fmu, Some(&library));
    }
}
