//! The command line as a person uses it: names with control characters, help, defaults, commands to paste, results in a file.

use std::fmt::Write as _;
use std::path::Path;
use std::process::Command;

use crate::common::{Call, FREEPLAY, Ran, freeplay, freeplay_in, fresh_folder};
use freeplay_skip::{Need, skip};
use serde_json::Value;

/// The arm that comes with the project.
const ARM: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../scenarios/arm.urdf");
/// A name that clears the screen, sets the title, rings, returns, uses a C1 control, reverses the direction of writing and hides a character.
const HOSTILE: &str = "x\u{1b}[2J\u{1b}[31m\u{1b}]0;t\u{7}\r\u{8}\u{9b}1m\u{202e}\u{200b}\u{7f}y";
/// Its display.
const SHOWN: &str = "x\\u001b[2J\\u001b[31m\\u001b]0;t\\u0007\\r\\u0008\\u009b1m\\u202e\\u200b\\u007fy";

/// Checks that `text` has no control characters and no invisible ones.
fn check_visible(what: &str, text: &str) {
    let hidden = |c: &char| *c != '\n' && (c.is_control() || "\u{202e}\u{200b}\u{feff}\u{ad}".contains(*c));
    assert_eq!(text.chars().find(hidden), None, "{what}: {text:?}");
}

fn check_output(ran: &Ran) {
    check_visible("standard output", &ran.stdout());
    check_visible("standard error", &ran.stderr());
}

/// Rows of one joint at rest, with `more` columns.
fn recording(columns: &str, samples: usize) -> String {
    let mut text = format!("t,q1{columns}\n");
    for sample in 0..samples {
        let _ = write!(text, "{}", sample as f64 * 0.01);
        text += &",0.5".repeat(1 + columns.matches(',').count());
        text.push('\n');
    }
    text
}

/// An arm with one joint called `joint`, in the escapes of XML.
fn arm(joint: &str) -> String {
    let name: String = joint.chars().map(|c| format!("&#{};", u32::from(c))).collect();
    format!(
        "<robot name=\"r\"><link name=\"base\"/><link name=\"arm\"><inertial><origin xyz=\"0.3 0 0\"/><mass value=\"2\"/>\
         <inertia ixx=\"0.1\" iyy=\"0.1\" izz=\"0.1\" ixy=\"0\" ixz=\"0\" iyz=\"0\"/></inertial></link>\
         <joint name=\"{name}\" type=\"revolute\"><parent link=\"base\"/><child link=\"arm\"/><axis xyz=\"0 1 0\"/>\
         <limit lower=\"-2\" upper=\"2\" effort=\"50\" velocity=\"3\"/></joint></robot>"
    )
}

#[test]
fn no_name_on_the_command_line_speaks_to_the_terminal() {
    let file = format!("{HOSTILE}.csv");
    let key = format!("path.{HOSTILE}=1");
    let clearance = format!("clearance.{HOSTILE}.clearance=0.001");
    let lines: [&[&str]; 20] = [
        &[HOSTILE],
        &["run", HOSTILE],
        &["run", "--model", HOSTILE],
        &["run", "--controller", HOSTILE],
        &["run", "--standby", HOSTILE],
        &["run", "--set", &key],
        &["run", "--set", &clearance],
        &["run", "--out", "file/x", "--color", HOSTILE],
        &["compare", "--model", "paper", "--recording", &file],
        &["diagnose", "--model", HOSTILE, "--recording", &file],
        &["record", "info", &file],
        &["record", "export", &file, "--format", "csv", "--out", HOSTILE],
        &["record", "import", &file, "--out", "a.csv"],
        &["scenario", "check", HOSTILE],
        &["scenario", "show", HOSTILE],
        &["report", HOSTILE],
        &["replay", HOSTILE, "--against", "computed-torque"],
        &["excite", HOSTILE],
        &["blind", "--verify", HOSTILE],
        &["faults", HOSTILE],
    ];
    for line in lines {
        let ran = freeplay(line);
        check_output(&ran);
        assert_ne!(ran.code(), 0, "{line:?}");
        // Quoted names have Rust's own escapes.
        let shown = ["\\u001b[2J", "\\u{1b}[2J"].iter().any(|escape| ran.stderr().contains(escape));
        assert!(shown, "{line:?}: {}", ran.stderr());
    }
    let coloured = freeplay(&["record", "info", &file, "--color", "always"]);
    check_output(&coloured);
}

#[test]
fn a_file_name_of_two_lines_is_shown_in_one() {
    let folder = fresh_folder();
    let name = format!("one\nVERDICT {HOSTILE}.csv");
    std::fs::write(folder.path().join(&name), recording("", 20)).expect("written");
    let ran = freeplay_in(folder, &["record", "info", &name]).expect(0);
    check_output(&ran);
    assert!(ran.stdout().starts_with(&format!("one\\nVERDICT {SHOWN}.csv: 1 joints")), "{}", ran.stdout());
    let ran = freeplay(&["record", "info", &name]).expect(3);
    assert!(ran.stderr().starts_with("freeplay: one\\nVERDICT"), "{}", ran.stderr());
}

#[test]
fn names_within_files_are_shown_escaped_on_the_screen_and_in_the_report() {
    let joint = "j\u{9b}2J\u{202e}\u{200b}k";
    let folder = fresh_folder();
    let at = |name: &str| folder.path().join(name);
    std::fs::write(at("arm.urdf"), arm(joint)).expect("written");
    std::fs::write(at("r.csv"), recording(",tau1,odd\u{202e}\u{200b}name", 400)).expect("written");
    std::fs::write(at("keys.toml"), "\"a\\u001b[2J\\u202e\" = 1\n").expect("written");
    let lines: [(&[&str], i32); 5] = [
        (&["record", "info", "r.csv"], 0),
        (&["compare", "--model", "arm.urdf", "--recording", "r.csv", "--out", "report.html"], 0),
        (&["run", "--model", "arm.urdf", "--set", "clearance.none.clearance=0.001"], 3),
        (&["run", "keys.toml"], 3),
        (&["scenario", "check", "keys.toml"], 3),
    ];
    for (line, code) in lines {
        let mut words = std::process::Command::new(env!("CARGO_BIN_EXE_freeplay"));
        let ran = words.args(line).current_dir(folder.path()).output().expect("it runs");
        let [out, error] = [ran.stdout, ran.stderr].map(|bytes| String::from_utf8_lossy(&bytes).into_owned());
        assert_eq!(ran.status.code(), Some(code), "{line:?}: {out}{error}");
        check_visible("standard output", &out);
        check_visible("standard error", &error);
        assert!((out + &error).contains("\\u202e"), "{line:?}");
    }
    let page = std::fs::read_to_string(at("report.html")).expect("a report");
    check_visible("the report", &page.replace('\t', " "));
    // Data keep their names.
    let json = std::process::Command::new(env!("CARGO_BIN_EXE_freeplay"))
        .args(["record", "info", "r.csv", "--format", "json"])
        .current_dir(folder.path())
        .output()
        .expect("it runs");
    let json: Value = serde_json::from_slice(&json.stdout).expect("JSON");
    assert_eq!(json["columns"][3]["name"], "odd\u{202e}\u{200b}name");
}

#[test]
fn a_joint_whose_name_has_two_lines_is_refused() {
    let folder = fresh_folder();
    std::fs::write(folder.path().join("arm.urdf"), arm("one\ntwo")).expect("written");
    let ran = freeplay_in(folder, &["run", "--model", "arm.urdf"]).expect(3);
    assert!(ran.stderr().contains("\"one\\ntwo\""), "{}", ran.stderr());
}

#[test]
fn a_recording_of_one_sample_or_two_says_so() {
    let of = |samples: usize, format: &str| {
        let folder = fresh_folder();
        std::fs::write(folder.path().join("r.csv"), recording("", samples)).expect("written");
        freeplay_in(folder, &["record", "info", "r.csv", "--format", format])
    };
    let one = of(1, "text").expect(0).stdout();
    assert!(one.contains("1 sample, too few samples for a duration and a rate"), "{one}");
    assert!(!one.contains("inf") && !one.to_lowercase().contains("nan"), "{one}");
    let two = of(2, "text").expect(0).stdout();
    assert!(two.contains("2 samples, 0.010 s at 100.0 Hz (steps 10.000 to 10.000 ms)"), "{two}");
    assert!(of(0, "text").expect(3).stderr().contains("no samples"));
    let json: Value = serde_json::from_str(&of(1, "json").expect(0).stdout()).expect("JSON");
    for figure in [&json["rate_hz"], &json["duration_s"], &json["step_s"]["min"], &json["step_s"]["median"]] {
        assert!(figure.is_null(), "{json:#}");
    }
}

#[test]
fn the_help_has_the_main_commands_first_and_fits_its_width() {
    let help = freeplay(&["--help"]).expect(0).stdout();
    let at = |words: &str| help.find(words).unwrap_or_else(|| panic!("{words} is not in\n{help}"));
    let order = [
        "Main commands:",
        "  run ",
        "  diagnose ",
        "Run:",
        "Diagnose:",
        "Prove:",
        "Exam:",
        "Files:",
        "Paper:",
        "Common options:",
    ];
    assert!(order.map(at).is_sorted(), "{help}");
}

/// In a terminal of 80 columns the progress line is rewritten in place, and the text is wrapped.
#[test]
fn a_narrow_terminal_gets_narrow_lines() {
    let shell = format!(
        "stty cols 80 rows 40; exec {FREEPLAY} run --pace lockstep --controller computed-torque --set duration=0.2 --out out"
    );
    let mut command = Command::new("script");
    command.args(["-qec", &shell, "typescript"]).env("TERM", "xterm");
    if !Command::new("script").arg("--version").output().is_ok_and(|output| output.status.success()) {
        return skip(Need::Terminal, "no program script here");
    }
    let ran = Call::of(fresh_folder(), command).run().expect(0);
    let text = ran.stdout();
    assert!(text.contains("motion, lockstep"), "no progress in {text:?}");
    assert!(!text.contains("\u{1b}[1A"), "the progress line takes more than one line: {text:?}");
    let (_, result) = text.split_once("Freeplay 0").expect("the result");
    for line in result.lines().skip(1).filter(|line| !line.contains("freeplay ")) {
        let plain = line.trim_end();
        assert!(plain.chars().count() <= 80, "{plain:?} in {result}");
    }
}

#[test]
fn any_arm_moves_without_a_path_and_a_run_beyond_its_path_says_so() {
    let folder = fresh_folder();
    std::fs::write(folder.path().join("arm.urdf"), arm("j")).expect("written");
    let line = ["run", "--model", "arm.urdf", "--controller", "computed-torque", "--recording", "none"];
    let ran = freeplay_in(folder, &[&line[..], &["--set", "duration=6.5"]].concat()).expect(0);
    assert!(ran.stdout().contains("path joint_sine"), "{}", ran.stdout());
    assert!(ran.stderr().contains("the path ends after 6 s"), "{}", ran.stderr());
    let shown = |arguments: &[&str]| freeplay(&[&["run", "--show"], arguments].concat()).expect(0).stdout();
    assert!(shown(&[]).contains("kind = \"lissajous\""), "the paper's arm keeps its path");
    assert!(shown(&["--model", ARM]).contains("kind = \"joint_sine\""));
    assert!(shown(&["--model", ARM, "--set", "path.kind=circle"]).contains("kind = \"circle\""));
    assert!(shown(&["--model", ARM, "--set", "path.centre=[0.9,0,0.9]"]).contains("kind = \"lissajous\""));
}

#[test]
fn results_in_one_file_and_results_that_move() {
    let folder = fresh_folder();
    let at = |name: &str| folder.path().join(name);
    std::fs::create_dir(at("my data")).expect("made");
    std::fs::write(at("my data/arm.urdf"), arm("j")).expect("written");
    let rows = swinging();
    std::fs::write(at("my data/r.csv"), rows).expect("written");
    let run = |cwd: &Path, line: &[&str]| {
        let ran = std::process::Command::new(env!("CARGO_BIN_EXE_freeplay"))
            .args(line)
            .current_dir(cwd)
            .output()
            .expect("it runs");
        let [out, error] = [ran.stdout, ran.stderr].map(|bytes| String::from_utf8_lossy(&bytes).into_owned());
        assert_eq!(ran.status.code(), Some(0), "{line:?}: {out}{error}");
        out
    };
    let inputs = ["--model", "my data/arm.urdf", "--recording", "my data/r.csv", "--seed", "4", "--out"];
    let diagnose = |out: &str| run(folder.path(), &[&["diagnose"], &inputs[..], &[out]].concat());
    let said = diagnose("the model.toml");
    assert!(at("the model.toml").is_file(), "{said}");
    assert!(said.contains("'the model.toml'"), "quoted for the shell: {said}");
    let said = diagnose("found");
    let command =
        said.lines().find(|line| line.trim().starts_with("freeplay compare")).expect("a command").trim();
    let shell = command.replacen("freeplay", env!("CARGO_BIN_EXE_freeplay"), 1);
    let pasted = std::process::Command::new("sh")
        .args(["-c", &shell])
        .current_dir(folder.path())
        .output()
        .expect("sh");
    assert!(pasted.status.success(), "{command}: {}", String::from_utf8_lossy(&pasted.stderr));
    // All files are moved, and used from another folder.
    let json = std::fs::read_to_string(at("found/diagnosis.json")).expect("a diagnosis");
    let json: Value = serde_json::from_str(&json).expect("JSON");
    assert_eq!(json["model"], "model.toml");
    assert_eq!(json["inputs"]["model"], "../my data/arm.urdf");
    let excite = [
        "excite",
        "found/diagnosis.json",
        "--kinds",
        "backlash,joint_elasticity",
        "--joint",
        "j",
        "--candidates",
        "1",
    ];
    run(folder.path(), &[&excite[..], &["--duration", "4", "--out", "next"]].concat());
    let elsewhere = fresh_folder();
    let scenario = at("next/excite.toml").display().to_string();
    run(elsewhere.path(), &["scenario", "check", &scenario]);
}

/// A swinging joint, with friction that its model lacks.
fn swinging() -> String {
    let mut text = String::from("t,q1,qd1,tau1\n");
    for sample in 0..2000 {
        let t = f64::from(sample) * 0.005;
        let (omega, one) = (2.0, 0.6);
        let (q, v, a) = (
            one * (omega * t).sin(),
            one * omega * (omega * t).cos(),
            -one * omega * omega * (omega * t).sin(),
        );
        let torque = 0.28 * a - 2.0 * 0.3 * 9.81 * q.cos() + 1.5 * v.signum();
        let _ = writeln!(text, "{t:.4},{q:.9},{v:.9},{torque:.9}");
    }
    text
}
