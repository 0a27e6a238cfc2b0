//! The plant as an FMU, driven by FMPy: it is valid, and gives the same bits as a native run in lockstep.

use std::fmt::Write as _;
use std::io::Write as _;
use std::path::Path;
use std::process::{Command, Stdio};

use freeplay_model::{paper_arm, to_toml};
use serde_json::{Value, json};

use super::tools::{has, here, python};
use crate::common::{Call, fresh_folder};

/// Steps of a run; the full exam is 100 000.
fn steps() -> usize {
    std::env::var("FREEPLAY_FMU_STEPS").ok().and_then(|steps| steps.parse().ok()).unwrap_or(10_000)
}

/// The posture that the native controller holds while the journal falls and bounces: bent, so that all joints carry weight.
const POSTURE: [f64; 6] = [0.2, 0.3, 0.4, 0.1, 0.9, 0.3];

/// A scenario in which a native controller drives the worn arm.
fn scenario(mode: &str, seconds: f64) -> String {
    format!(
        "model = \"worn.toml\"\ncontrollers = [\"computed-torque\"]\nmode = \"{mode}\"\nduration = {seconds}\n\
         [path]\nkind = \"file\"\nfile = \"rest.csv\"\n"
    )
}

/// The columns `names` of a recording as CSV, row by row.
fn columns(text: &str, names: &[String]) -> Vec<Vec<f64>> {
    let mut lines = text.lines();
    let header: Vec<&str> = lines.next().expect("a header").split(',').collect();
    let places: Vec<usize> =
        names.iter().map(|name| header.iter().position(|column| column == name).expect(name)).collect();
    let row = |line: &str| {
        let cells: Vec<&str> = line.split(',').collect();
        places.iter().map(|&place| cells[place].parse().expect("a number")).collect()
    };
    lines.map(row).collect()
}

/// The numbers in the format of FMPy's side.
fn hex(row: &[f64]) -> String {
    let bytes = row.iter().flat_map(|value| value.to_le_bytes());
    bytes.fold(String::new(), |mut text, byte| {
        let _ = write!(text, "{byte:02x}");
        text
    })
}

fn numbered(prefix: &str) -> Vec<String> {
    (1..=6).map(|number| format!("{prefix}{number}")).collect()
}

fn of_joints(prefix: &str) -> Vec<String> {
    (1..=6).map(|number| format!("{prefix}.joint_{number}")).collect()
}

const PLAY: &str = "\n[[effect]]\nkind = \"joint_clearance\"\njoint = \"joint_5\"\nclearance = 0.0006\n";

#[test]
fn an_fmu_gives_the_bits_of_a_native_run_and_goes_back_to_a_state() {
    same_bits("torque", PLAY, steps());
}

/// Position servos at all joints, with delayed commands.
#[test]
fn an_fmu_of_an_arm_with_servos_gives_the_bits_of_a_native_run() {
    let servo = |joint: u8| {
        let [stiffness, damping] = if joint < 4 { [2e4, 400.0] } else { [40.0, 0.5] };
        format!(
            "\n[[effect]]\nkind = \"servo\"\njoint = \"joint_{joint}\"\nstiffness = {stiffness:?}\ndamping = {damping:?}\n\
             [[effect]]\nkind = \"command_delay\"\njoint = \"joint_{joint}\"\ndelay = 0.0125\n"
        )
    };
    same_bits("position", &(1..=6).map(servo).collect::<String>(), 2_000);
}

/// Compares `steps` steps of the arm with `effects`, whose inputs are of the sort `inputs`, with a native run.
fn same_bits(inputs: &str, effects: &str, steps: usize) {
    if !has("fmpy, numpy") {
        return;
    }
    let folder = fresh_folder();
    let at = |name: &str| folder.path().join(name);
    let mode = if inputs == "position" { "servo" } else { "torque" };
    std::fs::write(at("worn.toml"), to_toml(&paper_arm()) + effects).expect("written");
    std::fs::write(at("run.toml"), scenario(mode, steps as f64 * 1e-3)).expect("written");
    let row = POSTURE.map(|q| q.to_string()).join(",");
    let times = [0.0, 0.3, 0.6, 1.0].map(|share| share * (steps as f64 * 1e-3 + 1.0));
    let rows: String = times.iter().map(|t| format!("{t},{row}\n")).collect();
    std::fs::write(at("rest.csv"), format!("t,q1,q2,q3,q4,q5,q6\n{rows}")).expect("written");
    let asked = ["run", "run.toml", "--pace", "lockstep", "--recording", "csv", "--out", "native", "--quiet"];
    let ran = Call::new(folder, &asked).run().expect(0);
    let ran =
        Call::new(ran.folder, &["export", "worn.toml", "--to", "fmu", "--out", "worn.fmu"]).run().expect(0);
    let text =
        std::fs::read_to_string(ran.folder.path().join("native/computed-torque.csv")).expect("a recording");
    let tool = ["x", "y", "z", "qx", "qy", "qz", "qw"].map(str::to_owned).to_vec();
    let natives = [numbered("q"), numbered("qd"), numbered("tau"), tool.clone()].concat();
    let tools: Vec<String> = tool.iter().map(|name| format!("tool.{name}")).collect();
    let names = [of_joints("q"), of_joints("qd"), of_joints("tau"), tools].concat();
    let (native, applied) = (columns(&text, &natives), columns(&text, &numbered("applied_")));
    let count = native.len() - 1;
    let parameters: serde_json::Map<String, Value> =
        of_joints("start.q").into_iter().zip(POSTURE).map(|(name, q)| (name, q.into())).collect();
    let order = json!({
        "fmu": ran.folder.path().join("worn.fmu"), "parameters": parameters, "names": names, "inputs": of_joints(inputs),
        // The first tick has no command yet: the native plant holds its joints on the path.
        "brakes": (0..count).map(|step| step == 0).collect::<Vec<_>>(),
        "given": applied[..count].iter().enumerate().map(|(step, row)| (step > 0).then_some(row)).collect::<Vec<_>>(), "rewind": count / 2,
    });
    let mut child = Command::new(python())
        .arg(here("fmu.py"))
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .spawn()
        .expect("it starts");
    child.stdin.take().expect("a pipe").write_all(order.to_string().as_bytes()).expect("it reads");
    let output = child.wait_with_output().expect("it ends");
    assert!(output.status.success());
    let text = String::from_utf8(output.stdout).expect("text");
    let found: Vec<String> = serde_json::from_str(text.lines().last().expect("a line")).expect("JSON");
    assert_eq!(found.len(), count);
    assert!(native[1] != native[count], "it moves");
    for (step, found) in found.iter().enumerate() {
        assert_eq!(*found, hex(&native[step + 1]), "step {step}");
    }
    println!("{count} steps, {} numbers each, all bits the same", names.len());
}

#[test]
fn an_fmu_needs_a_name() {
    let ran = Call::new(fresh_folder(), &["export", "paper", "--to", "fmu"]).run().expect(2);
    assert!(ran.stderr().contains("--out FILE.fmu"), "{}", ran.stderr());
}

/// The installed program: in `bin`, alone or with the library in `lib/freeplay`.
#[test]
fn an_installed_program_finds_the_library_of_its_installation_or_says_how_to_build_it() {
    let folder = fresh_folder();
    let program = Path::new(env!("CARGO_BIN_EXE_freeplay"));
    let beside = program.parent().expect("a folder");
    let name = "libfreeplay_fmi.so";
    let built = [beside.join("deps").join(name), beside.join(name)].into_iter().find(|path| path.is_file());
    let (bin, lib) = (folder.path().join("bin"), folder.path().join("lib/freeplay"));
    for folder in [&bin, &lib] {
        std::fs::create_dir_all(folder).expect("made");
    }
    std::fs::copy(program, bin.join("freeplay")).expect("copied");
    let export = || {
        let mut command = Command::new(bin.join("freeplay"));
        command.args(["export", "paper", "--to", "fmu", "--out", "paper.fmu"]).current_dir(folder.path());
        command.env_remove("FREEPLAY_FMI_LIBRARY").output().expect("it runs")
    };
    let refused = export();
    let said = String::from_utf8_lossy(&refused.stderr).into_owned();
    assert_eq!(refused.status.code(), Some(3), "{said}");
    assert!(
        said.contains("cargo build --release -p freeplay-fmi") && said.contains("lib/freeplay"),
        "{said}"
    );
    assert!(!folder.path().join("paper.fmu").exists());
    std::fs::copy(built.expect("the library is built with the program"), lib.join(name)).expect("copied");
    let done = export();
    assert_eq!(done.status.code(), Some(0), "{}", String::from_utf8_lossy(&done.stderr));
    assert!(folder.path().join("paper.fmu").exists());
}
