//! Controllers in Python, with the SDK in `python/freeplay/controller.py`: they run, swap with controllers in Rust, and fail with clear messages.
//!
//! `FREEPLAY_PYTHON` names an interpreter that has iceoryx2 0.10.0, and for the package's own tests the packages of its extra `test`; else the tests try
//! `python3`. Without it these tests print a message and pass.

use std::path::{Path, PathBuf};
use std::process::Command;

use crate::common::{Call, FREEPLAY, fresh_folder};
use freeplay_arm::{Workspace, rnea};
use serde_json::{Value, json};

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..")
}

fn python() -> String {
    std::env::var("FREEPLAY_PYTHON").unwrap_or_else(|_| "python3".to_owned())
}

/// True if there is a suitable Python; reports the missing package if not.
fn available() -> bool {
    let script =
        "import tomllib; from importlib.metadata import version; assert version('iceoryx2') == '0.10.0'";
    let found =
        Command::new(python()).args(["-c", script]).output().is_ok_and(|output| output.status.success());
    if !found {
        freeplay_skip::skip(
            freeplay_skip::Need::Python,
            format_args!(
                "{} lacks Python 3.11 or iceoryx2 0.10.0; FREEPLAY_PYTHON names another interpreter",
                python()
            ),
        );
    }
    found
}

/// A program in `folder` that runs `script` with the SDK on its path.
fn program(folder: &Path, name: &str, script: &Path) -> String {
    use std::os::unix::fs::PermissionsExt;
    let path = folder.join(name);
    let text =
        format!("#!/bin/sh\nPYTHONPATH={:?} exec {} {:?} \"$@\"\n", root().join("python"), python(), script);
    std::fs::write(&path, text).expect("written");
    std::fs::set_permissions(&path, std::fs::Permissions::from_mode(0o755)).expect("its own file");
    path.display().to_string()
}

fn computed_torque(folder: &Path) -> String {
    program(folder, "py-computed-torque", &root().join("python/examples/computed_torque.py"))
}

/// A controller whose `answer` has this body.
fn with_answer(folder: &Path, body: &str) -> String {
    let script = folder.join("mine.py");
    let text = format!(
        "import freeplay\n\nclass Mine(freeplay.Controller):\n    name = \"mine\"\n\n    def answer(self, state):\n        {body}\n\nfreeplay.serve(Mine())\n"
    );
    std::fs::write(&script, text).expect("written");
    program(folder, "mine", &script)
}

#[test]
fn the_inverse_dynamics_of_the_example_are_those_of_the_arm_crate() {
    if !available() {
        return;
    }
    let file = freeplay_model::paper_arm();
    let (folder, n) = (fresh_folder(), file.arm.dof());
    let path = folder.path().join("arm.toml");
    std::fs::write(&path, freeplay_model::to_toml(&file)).expect("written");
    let (q, v): (Vec<f64>, Vec<f64>) =
        (0..n).map(|j| ((j as f64 + 0.3).sin(), (2.0 * j as f64).cos())).unzip();
    let a: Vec<f64> = (0..n).map(|j| 3.0 - j as f64).collect();
    let script = format!("from rigid_arm import Arm\nprint(*Arm({path:?}).torques({q:?}, {v:?}, {a:?}))");
    let examples = root().join("python/examples");
    let output = Command::new(python()).args(["-c", &script]).env("PYTHONPATH", examples).output();
    let output = output.expect("it starts");
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let text = String::from_utf8(output.stdout).expect("text");
    let found: Vec<f64> = text.split_whitespace().map(|number| number.parse().expect("a number")).collect();
    let mut expected = vec![0.0; n];
    rnea(&file.arm, &mut Workspace::new(&file.arm), &q, &v, &a, &mut expected);
    let size = expected.iter().fold(0.0_f64, |most, value| most.max(value.abs()));
    let worst = found.iter().zip(&expected).fold(0.0_f64, |most, (f, e)| most.max((f - e).abs()));
    println!("{found:?}\ndiffer by {worst:e} of {size}");
    assert!(found.len() == n && expected.iter().all(|value| value.abs() > 1e-6), "it tests something");
    assert!(worst < 1e-11 * size);
}

#[test]
fn a_controller_in_python_holds_the_arm_as_the_one_in_rust_does_and_repeats_itself() {
    if !available() {
        return;
    }
    let play = || {
        let folder = fresh_folder();
        let python = computed_torque(folder.path());
        let arguments = [
            "run",
            "--quiet",
            "--out",
            "out",
            "--set",
            "duration=0.6",
            "--controller",
            &python,
            "--controller",
            "computed-torque",
        ];
        Call::new(folder, &arguments).run().expect(0).summary()
    };
    let (first, second) = (play(), play());
    let rms = |run: usize| first["runs"][run]["deviation_mm"]["rms_after_start"].as_f64().expect("a number");
    println!("RMS in Python {} mm, in Rust {} mm", rms(0), rms(1));
    assert!((rms(0) - rms(1)).abs() < 0.01, "{} {}", rms(0), rms(1));
    assert_eq!(
        first["runs"][0]["state_hash"], second["runs"][0]["state_hash"],
        "two runs are the same to the byte"
    );
    assert_ne!(first["runs"][0]["state_hash"], first["runs"][1]["state_hash"]);
    assert_eq!(first["runs"][0]["gate"]["rejected"]["missing"], 0);
}

#[test]
fn python_and_rust_swap_without_a_gap() {
    if !available() {
        return;
    }
    for mode in ["mode=torque", "mode=driven"] {
        let folder = fresh_folder();
        let python = computed_torque(folder.path());
        let arguments =
            ["run", "--quiet", "--out", "out", "--controller", "computed-torque", "--standby", &python];
        let scenario =
            ["--set", mode, "--set", "duration=0.8", "--set", "random_swaps=40", "--set", "swap_blend=0.01"];
        let run = Call::new(folder, &[&arguments[..], &scenario[..]].concat()).run().expect(0).run();
        let swaps = run["line_up"]["swaps"].as_array().expect("swaps");
        assert_eq!(swaps.len(), 40);
        for swap in swaps {
            assert_eq!((&swap["gap_ticks"], &swap["held_ticks"]), (&json!(0), &json!(0)), "{swap}");
        }
        let shares = run["line_up"]["controllers"].as_array().expect("two controllers");
        assert!(shares.iter().all(|share| share["ticks_in_charge"].as_u64() > Some(10)), "{shares:?}");
    }
}

#[test]
fn what_goes_wrong_in_python_is_said_and_the_standby_takes_over() {
    if !available() {
        return;
    }
    // Body of the answer, the expected message, the gate's count.
    let cases = [
        (
            "return [0.0] * (6 if state.tick < 3 else 5)",
            "the answer has 5 numbers, the arm has 6 joints",
            "missing",
        ),
        ("return [0.0] * 6 if state.tick < 3 else [float('nan')] * 6", "", "not_finite"),
        ("return [0.0] * 6 if state.tick < 3 else None", "", "no_answer"),
        ("return [0.0] * 6 if state.tick < 3 else 1 / 0", "ZeroDivisionError", "missing"),
    ];
    for (body, said, reason) in cases {
        let folder = fresh_folder();
        let mine = with_answer(folder.path(), body);
        let arguments =
            ["run", "--quiet", "--out", "out", "--controller", &mine, "--standby", "computed-torque"];
        let ran = Call::new(folder, &[&arguments[..], &["--set", "duration=0.3"]].concat()).run().expect(0);
        assert!(ran.stderr().contains(said), "{}", ran.dump());
        let swaps: Value = ran.run()["line_up"]["swaps"].clone();
        println!("{body}: {swaps}");
        assert_eq!(swaps[0]["cause"]["failed"], json!(reason), "{swaps:#}");
    }
}

#[test]
fn a_controller_that_cannot_join_says_why() {
    if !available() {
        return;
    }
    let folder = fresh_folder();
    let mine = with_answer(folder.path(), "return [0.0] * 6");
    for (arguments, code, said) in [
        (&[][..], 2, "no run to join"),
        (&["--run", "/dev/shm/freeplay-0/1-none"], 5, "no run lives at"),
        (&["--run", "relative"], 2, "no address of a run"),
        (&["--run", "/dev/shm/x", "--slot", "one"], 2, "is not a number"),
    ] {
        let mut command = Command::new(&mine);
        command.args(arguments);
        let ran = Call::of(fresh_folder(), command).run();
        assert_eq!(ran.code(), code, "{}", ran.dump());
        assert!(ran.stderr().starts_with("mine: ") && ran.stderr().contains(said), "{}", ran.dump());
    }
}

/// The Python package passes its own tests with this build of the command: types, API, campaigns, notebooks.
#[test]
fn the_package_passes_its_tests() {
    let needed = "import cloudpickle, matplotlib, nbclient, pandas, pyarrow, pytest, iceoryx2";
    let found = Command::new(python()).args(["-c", needed]).output();
    if !found.is_ok_and(|output| output.status.success()) {
        freeplay_skip::skip(
            freeplay_skip::Need::Python,
            format_args!(
                "{} lacks one of the packages that python/tests need: {needed}; FREEPLAY_PYTHON names another interpreter",
                python()
            ),
        );
        return;
    }
    let folder = root().join("python");
    let output = Command::new(python())
        .args(["-m", "pytest", "-p", "no:cacheprovider", "--durations=10", "-rs"])
        .current_dir(&folder)
        .env("PYTHONPATH", std::path::absolute(&folder).expect("a path"))
        .env("PYTHONDONTWRITEBYTECODE", "1")
        .env("MYPY_CACHE_DIR", fresh_folder().path().join("mypy"))
        .env("FREEPLAY_EXECUTABLE", FREEPLAY)
        .output()
        .expect("it starts");
    let text = String::from_utf8_lossy(&output.stdout);
    println!("{text}");
    assert!(output.status.success(), "{text}\n{}", String::from_utf8_lossy(&output.stderr));
    if let Some(count) = text.lines().rfind(|line| line.contains(" passed") && line.contains(" skipped")) {
        freeplay_skip::skip(freeplay_skip::Need::Python, count);
    }
}
