//! Recordings of machines with concealed effects, replayed in MuJoCo with the exported model.

use std::collections::BTreeMap;
use std::path::Path;
use std::process::Command;

use freeplay_concealed::{Case, Demand, Family, Machine, Noise, Severity, generate, write_sealed};
use freeplay_model::{paper_arm, to_toml};
use serde_json::Value;
use tempfile::TempDir;

use super::tools::{has, python};
use crate::common::{Call, fresh_folder};

/// Root mean square errors by channel.
pub type Errors = BTreeMap<String, f64>;

/// Effects that MJCF can express, the machine that has them, and the joint.
const KINDS: [(&str, Machine, Option<usize>); 19] = [
    ("coulomb_friction", Machine::SixBench, None),
    ("viscous_friction", Machine::SixBench, None),
    ("asymmetric_friction", Machine::SixBench, None),
    ("quadratic_drag", Machine::SixBench, None),
    ("rotor_inertia", Machine::SixBench, None),
    ("payload", Machine::SixBench, None),
    ("link_mass", Machine::SixBench, None),
    ("base_tilt", Machine::SixBench, None),
    ("joint_spring", Machine::SixBench, None),
    ("joint_coupling", Machine::SixBench, None),
    ("actuator_saturation", Machine::SixBench, None),
    ("torque_offset", Machine::SixBench, None),
    ("torque_gain", Machine::SixBench, None),
    ("encoder_offset", Machine::SixBench, None),
    ("link_length", Machine::SixBench, None),
    ("time_delay", Machine::SixBench, None),
    ("joint_elasticity", Machine::SixBench, None),
    ("backlash", Machine::SixBench, None),
    // A bearing with a level axis, on which the journal rests. In a bearing with an upright axis only the arm's own motion presses the journal; see the last
    // test.
    ("joint_clearance", Machine::Paper, Some(4)),
];

/// `model` with the effects in `truth`.
fn with_effects(model: &str, truth: &freeplay_concealed::Truth) -> String {
    let mut text = model.to_owned();
    for effect in &truth.effects {
        text += &format!("\n[[effect]]\nkind = \"{}\"\n", effect.kind);
        if let Some(joint) = &effect.joint {
            text += &format!("joint = \"{joint}\"\n");
        }
        for (name, value) in effect.parameters.as_object().expect("parameters") {
            text += &format!("{name} = {}\n", toml::Value::try_from(value).expect("a value"));
        }
    }
    text
}

/// Keeps the first half of the rows of `recording`.
fn first_half(recording: &Path) {
    let text = std::fs::read_to_string(recording).expect("a recording");
    let rows = text.lines().count().div_ceil(2);
    let half: Vec<&str> = text.lines().take(rows).collect();
    std::fs::write(recording, half.join("\n") + "\n").expect("written");
}

/// The errors of `model` on the recording `held` according to `freeplay compare`.
pub fn compared(folder: TempDir, model: &str, held: &str) -> (Errors, TempDir) {
    let asked = [
        "compare",
        "--model",
        model,
        "--recording",
        held,
        "--lowpass",
        "10",
        "--trim",
        "0.5",
        "--format",
        "json",
    ];
    let ran = Call::new(folder, &asked).run().expect(0);
    let json: Value = serde_json::from_str(&ran.stdout()).expect("JSON");
    let channels = json["channels"].as_array().expect("channels").iter();
    let errors = channels
        .filter_map(|channel| Some((channel["name"].as_str()?.to_owned(), channel["rmse"].as_f64()?)))
        .collect();
    (errors, ran.folder)
}

/// The errors of both models on it according to MuJoCo.
pub fn replayed(folder: &Path, held: &str) -> [Errors; 2] {
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("../python/examples/replay_in_mujoco.py");
    let mut command = Command::new(python());
    command.arg(script).args(["sheet.xml", "full.xml", held]).current_dir(folder);
    let errors: BTreeMap<String, Errors> = serde_json::from_slice(&printed(command)).expect("JSON");
    ["sheet.xml", "full.xml"].map(|model| errors[model].clone())
}

/// The same for `second.csv` in each of `folders`, by one process, which loads the packages once.
fn all_replayed(folders: &[TempDir]) -> Vec<[Errors; 2]> {
    let script = "import json, pathlib, sys
sys.path.insert(0, sys.argv[1])
from replay_in_mujoco import compare, read
def errors(folder):
    folder = pathlib.Path(folder)
    recording = read(folder / 'second.csv')
    return [compare(str(folder / model), recording, 10.0) for model in ('sheet.xml', 'full.xml')]
print(json.dumps([errors(folder) for folder in sys.argv[2:]]))";
    let examples = Path::new(env!("CARGO_MANIFEST_DIR")).join("../python/examples");
    let mut command = Command::new(python());
    command.args(["-c", script]).arg(examples).args(folders.iter().map(TempDir::path));
    serde_json::from_slice(&printed(command)).expect("JSON")
}

fn printed(mut command: Command) -> Vec<u8> {
    let output = command.output().expect("it starts");
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    output.stdout
}

/// A machine with a concealed effect of `kind`: both models in MJCF, beside its recording, and the errors of both according to `freeplay compare`.
fn exported(kind: &str, machine: Machine, joint: Option<usize>) -> ([Errors; 2], TempDir) {
    let demand = Demand { kind: kind.to_owned(), joint, severity: Severity::Strong };
    let case = Case {
        machine,
        effects: vec![demand],
        family: Some(Family::Fourier),
        noise: Noise::Low,
        hollow: false,
        seed: 41,
    };
    let made = generate(&case).unwrap_or_else(|error| panic!("{kind}: {error}"));
    let mut folder = fresh_folder();
    write_sealed(folder.path(), &made).expect("files");
    first_half(&folder.path().join("second.csv"));
    std::fs::write(folder.path().join("full.toml"), with_effects(&made.model, &made.truth)).expect("written");
    for (model, file) in [("model.toml", "sheet.xml"), ("full.toml", "full.xml")] {
        folder = Call::new(folder, &["export", model, "--to", "mjcf", "--out", file]).run().expect(0).folder;
    }
    let (before, folder) = compared(folder, "model.toml", "second.csv");
    let (after, folder) = compared(folder, "full.toml", "second.csv");
    ([before, after], folder)
}

#[test]
fn mujoco_takes_away_what_the_model_itself_takes_away() {
    if !has("mujoco, numpy, scipy") {
        return;
    }
    let mut own = Vec::new();
    let mut folders = Vec::new();
    for (kind, machine, joint) in KINDS {
        let (errors, folder) = exported(kind, machine, joint);
        own.push(errors);
        folders.push(folder);
    }
    let mut short = Vec::new();
    for (((kind, ..), [before, after]), [there_before, there_after]) in
        KINDS.into_iter().zip(own).zip(all_replayed(&folders))
    {
        // The channel in which the model itself reduces the error most, as a share of it.
        let share = |name: &String| (before[name] - after[name]) / before[name];
        let channel = before
            .keys()
            .filter(|name| there_before.contains_key(*name))
            .max_by(|a, b| share(a).total_cmp(&share(b)))
            .expect("a channel");
        let own = before[channel] - after[channel];
        let theirs = there_before[channel] - there_after[channel];
        println!(
            "{kind} {channel}: {:.4} -> {:.4} here, {:.4} -> {:.4} in MuJoCo: {:.3}",
            before[channel],
            after[channel],
            there_before[channel],
            there_after[channel],
            theirs / own
        );
        assert!(share(channel) > 0.2, "{kind}: it tests something");
        if theirs < 0.9 * own {
            short.push(kind);
        }
    }
    assert!(short.is_empty(), "{short:?}");
}

/// Radial play about an upright axis: the arm's motion presses the journal aside, and it stays in its bearing in MuJoCo, too. Where a motion reverses fast the
/// journal flies, and the flights in two tools differ by their starting points.
#[test]
fn mujoco_keeps_a_journal_about_an_upright_axis_where_the_plant_has_it() {
    if !has("mujoco, numpy, scipy") {
        return;
    }
    let play = "\n[[effect]]\nkind = \"joint_clearance\"\njoint = \"joint_1\"\nclearance = 0.0006\n";
    let mut folder = fresh_folder();
    std::fs::write(folder.path().join("model.toml"), to_toml(&paper_arm())).expect("written");
    std::fs::write(folder.path().join("full.toml"), to_toml(&paper_arm()) + play).expect("written");
    let run = ["run", "--controller", "computed-torque", "--recording", "csv", "--out", "native", "--quiet"];
    let set = ["--set", "model=full.toml", "--set", "duration=3", "--pace", "lockstep"];
    folder = Call::new(folder, &[run.as_slice(), &set].concat()).run().expect(0).folder;
    for (model, file) in [("model.toml", "sheet.xml"), ("full.toml", "full.xml")] {
        folder = Call::new(folder, &["export", model, "--to", "mjcf", "--out", file]).run().expect(0).folder;
    }
    let held = "native/computed-torque.csv";
    let (before, folder) = compared(folder, "model.toml", held);
    let (after, folder) = compared(folder, "full.toml", held);
    let [there_before, there_after] = replayed(folder.path(), held);
    for axis in ["x", "y"] {
        let (own, theirs) = (before[axis] - after[axis], there_before[axis] - there_after[axis]);
        println!("{axis}: {:.3e} m here, {:.3e} m in MuJoCo taken away", own, theirs);
        assert!(own > 0.5 * before[axis] && theirs > 0.9 * own, "{axis}");
    }
}
