//! Robots with more than an arm, and incomplete arms, with the real binary.

use std::fmt::Write as _;

use crate::common::{Call, Ran, fresh_folder};

/// An arm of two joints with a gripper of two fingers; `upper`, `lower` are inserted in its links, `extra` in its joints.
fn robot(upper: &str, lower: &str, extra: &str) -> String {
    let joint = |name: &str, parent: &str, child: &str, x: f64| {
        format!(
            "<joint name=\"{name}\" type=\"revolute\"><origin xyz=\"{x} 0 0\"/><parent link=\"{parent}\"/><child link=\"{child}\"/>\
             <axis xyz=\"0 1 0\"/>{extra}</joint>\n"
        )
    };
    let finger = |name: &str, sign: i8, more: &str| {
        format!(
            "<link name=\"{name}_link\"/><joint name=\"{name}\" type=\"prismatic\"><parent link=\"hand\"/><child link=\"{name}_link\"/>\
             <axis xyz=\"0 {sign} 0\"/><limit lower=\"0\" upper=\"0.04\" effort=\"20\" velocity=\"0.2\"/>{more}</joint>\n"
        )
    };
    format!(
        "<robot name=\"made\"><link name=\"base\"/><link name=\"upper\">{upper}</link><link name=\"lower\">{lower}</link><link name=\"hand\"/>\n\
         {}{}<joint name=\"mount\" type=\"fixed\"><origin xyz=\"0.3 0 0\"/><parent link=\"lower\"/><child link=\"hand\"/></joint>\n{}{}</robot>",
        joint("shoulder", "base", "upper", 0.0),
        joint("elbow", "upper", "lower", 0.4),
        finger("left", 1, ""),
        finger("right", -1, "<mimic joint=\"left\"/>")
    )
}

const LIMITS: &str = "<limit lower=\"-3\" upper=\"3\" effort=\"90\" velocity=\"3\"/>";

fn inertial(mass: f64, x: f64) -> String {
    format!(
        "<inertial><origin xyz=\"{x} 0 0\"/><mass value=\"{mass}\"/><inertia ixx=\"0.01\" iyy=\"0.03\" izz=\"0.03\"/></inertial>"
    )
}

/// Four seconds of both joints, with the position of the hand as the tool and, on request, arbitrary torques.
fn recording(torques: bool) -> String {
    let mut csv = String::from(if torques { "t,q1,q2,x,y,z,tau1,tau2\n" } else { "t,q1,q2,x,y,z\n" });
    for sample in 0..400 {
        let t = 0.01 * f64::from(sample);
        let (a, b) = ((2.0 * t).sin() * 0.8, (3.0 * t).cos() * 0.6);
        let (x, z) = (0.4 * a.cos() + 0.3 * (a + b).cos(), -0.4 * a.sin() - 0.3 * (a + b).sin());
        let _ = write!(csv, "{t:.2},{a},{b},{x},0,{z}");
        csv += if torques { ",1,2\n" } else { "\n" };
    }
    csv
}

fn call(files: &[(&str, &str)], arguments: &[&str], code: i32) -> Ran {
    let folder = fresh_folder();
    for (file, text) in files {
        std::fs::write(folder.path().join(file), text).expect("written");
    }
    let ran = Call::new(folder, arguments).run().expect(code);
    println!("{}", ran.dump());
    ran
}

const RUN: [&str; 13] = [
    "run",
    "--pace",
    "lockstep",
    "--out",
    "out",
    "--controller=computed-torque",
    "--set",
    "duration=0.05",
    "--set",
    "path.kind=joint_sine",
    "--set",
    "path.period=4",
    "--model",
];

#[test]
fn a_gripper_is_no_part_of_the_arm_in_compare_and_run() {
    let text = robot(&inertial(3.0, 0.2), &inertial(2.0, 0.15), LIMITS);
    let files = [("arm.urdf", text.as_str()), ("r.csv", &recording(true))];
    let compared =
        call(&files, &["compare", "--model", "arm.urdf", "--recording", "r.csv", "--format", "json"], 0);
    let found: serde_json::Value = serde_json::from_str(&compared.stdout()).expect("JSON");
    let channels = found["channels"].as_array().expect("channels");
    assert_eq!(channels.len(), 5, "two torques and the tool");
    let x = channels.iter().find(|channel| channel["name"] == "x").expect("x");
    assert!(x["rmse"].as_f64().is_some_and(|rmse| rmse < 1e-9), "the tool is the hand: {x}");
    let line = "arm: base → hand, 2 joints; the gripper's 2 joints held still (`left`, `right`)";
    assert_eq!(found["model"]["ignored"][0], line);
    let ran = call(&files, &[RUN.as_slice(), &["arm.urdf"]].concat(), 0);
    assert!(ran.stdout().contains(line), "{}", ran.dump());
    let finger =
        call(&files, &["compare", "--model", "arm.urdf", "--recording", "r.csv", "--tip", "left_link"], 3);
    assert!(
        finger.stderr().contains("expected 3 joint") && finger.stderr().contains("--tip LINK"),
        "{}",
        finger.dump()
    );
    let tip = ["--tip", "lower"];
    let diagnosis = ["diagnose", "--quiet", "--model", "arm.urdf", "--recording", "r.csv", "--out", "found"];
    let ran = call(&files, &[&diagnosis[..], &tip].concat(), 0);
    let report = std::fs::read_to_string(ran.folder.path().join("found/report.html")).expect("a report");
    assert!(report.contains("freeplay diagnose --model arm.urdf --tip lower --recording r.csv"));
    let ran = call(&files, &[RUN.as_slice(), &["arm.urdf"], &tip].concat(), 0);
    assert!(ran.stdout().contains("arm: base → lower, 2 joints"), "{}", ran.dump());
    let ran = call(&files, &[RUN.as_slice(), &["arm.urdf", "--tip", "palm"]].concat(), 3);
    assert!(ran.stderr().contains("tip `palm`: there is no link of this name"), "{}", ran.dump());
}

#[test]
fn an_arm_without_masses_compares_its_tool_and_nothing_else() {
    let text = robot("", "", LIMITS);
    for torques in [false, true] {
        let files = [("arm.urdf", text.as_str()), ("r.csv", &recording(torques))];
        let ran =
            call(&files, &["compare", "--model", "arm.urdf", "--recording", "r.csv", "--format", "json"], 0);
        let found: serde_json::Value = serde_json::from_str(&ran.stdout()).expect("JSON");
        let names: Vec<&str> = found["channels"]
            .as_array()
            .expect("channels")
            .iter()
            .filter_map(|c| c["name"].as_str())
            .collect();
        assert_eq!(names, ["x", "y", "z"]);
        assert_eq!(ran.stdout().matches("has a mass").count(), 1, "{}", ran.dump());
    }
    let whole = recording(true);
    let bare = whole.lines().map(|row| {
        let cells: Vec<&str> = row.split(',').collect();
        [&cells[..3], &cells[6..]].concat().join(",") + "\n"
    });
    let files = [("arm.urdf", text.as_str()), ("r.csv", &bare.collect::<String>())];
    for command in ["compare", "diagnose"] {
        let ran = call(&files, &[command, "--model", "arm.urdf", "--recording", "r.csv"], 3);
        assert!(
            ran.stderr().contains("arm.urdf:1:1: no moving link of this file has a mass"),
            "{}",
            ran.dump()
        );
    }
    let ran = call(&files, &[RUN.as_slice(), &["arm.urdf"]].concat(), 3);
    assert!(ran.stderr().contains("arm.urdf:1:1: no moving link of this file has a mass"), "{}", ran.dump());
}

#[test]
fn a_rotor_lets_a_joint_run_that_moves_no_inertia() {
    let point = "<inertial><mass value=\"2\"/></inertial>";
    let text = robot(&inertial(3.0, 0.2), point, LIMITS);
    let files = [("arm.urdf", text.as_str())];
    let ran = call(&files, &[RUN.as_slice(), &["arm.urdf"]].concat(), 3);
    for words in ["arm.urdf:3:1", "link `lower`", "joint `elbow` moves no inertia", "rotor_inertia"] {
        assert!(ran.stderr().contains(words), "{words}: {}", ran.dump());
    }
    let joint = "urdf = \"arm.urdf\"\n[[joint]]\nname = \"elbow\"\nrotor_inertia = 0.05\n";
    let effect =
        "urdf = \"arm.urdf\"\n[[effect]]\nkind = \"rotor_inertia\"\njoint = \"elbow\"\ninertia = 0.05\n";
    for arm in [joint, effect] {
        call(&[files[0], ("arm.toml", arm)], &[RUN.as_slice(), &["arm.toml"]].concat(), 0);
    }
}

#[test]
fn a_damping_too_much_for_the_inertia_is_named() {
    let light = "<inertial><origin xyz=\"0.01 0 0\"/><mass value=\"0.06\"/><inertia ixx=\"4e-6\" iyy=\"4e-6\" izz=\"4e-6\"/></inertial>";
    let extra = format!("{LIMITS}<dynamics damping=\"3\"/>");
    let text = robot(&inertial(3.0, 0.2), light, &extra);
    let ran = call(&[("arm.urdf", &text)], &[RUN.as_slice(), &["arm.urdf"]].concat(), 3);
    let line = text.lines().position(|line| line.contains("<joint name=\"elbow\"")).expect("the joint") + 1;
    let place = format!("arm.urdf:{line}: joint `elbow`: a damping of 3 N·m·s/rad");
    for words in [place.as_str(), "kg·m²", "sub-steps a tick"] {
        assert!(ran.stderr().contains(words), "{words}: {}", ran.dump());
    }
}

#[test]
fn limits_and_friction_below_zero_run() {
    let extra =
        "<limit lower=\"-3\" upper=\"3\" effort=\"90\" velocity=\"-1\"/><dynamics friction=\"-0.39\"/>";
    let text = robot(&inertial(3.0, 0.2), &inertial(2.0, 0.15), extra);
    let ran = call(&[("arm.urdf", &text)], &[RUN.as_slice(), &["arm.urdf"]].concat(), 0);
    assert!(ran.stdout().contains("velocity limit -1 is read as none"), "{}", ran.dump());
}
