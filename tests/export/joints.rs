//! Joints that MuJoCo treats differently from other tools: stops, light links with friction, sliding gears.

use std::path::Path;
use std::process::Command;

use freeplay_model::load;
use serde_json::Value;
use tempfile::TempDir;

use super::tools::{Tool, has, python};
use crate::common::{Call, fresh_folder};

/// A joint of a link of 1 kg with its centre in the joint, and effects on it.
fn arm(kind: &str, inertia: f64, effects: &str) -> String {
    format!(
        "name = \"one\"\ngravity = [0.0, 0.0, -9.81]\n[[joint]]\nname = \"axis\"\ntype = \"{kind}\"\naxis = [1.0, 0.0, 0.0]\n\
         limits = {{ lower = -2.0, upper = 2.0, velocity = 5.0, effort = 1e5 }}\nmass = 1.0\ncom = [0.0, 0.0, 0.0]\n\
         inertia = {{ ixx = {inertia:?}, iyy = {inertia:?}, izz = {inertia:?}, ixy = 0.0, ixz = 0.0, iyz = 0.0 }}\n{effects}"
    )
}

/// The folder with `arm.xml` and `arm.urdf`, and the effects that the first does not express.
fn exported(text: &str) -> (TempDir, Vec<String>) {
    let folder = fresh_folder();
    std::fs::write(folder.path().join("arm.toml"), text).expect("written");
    let ran = Call::new(folder, &["export", "arm.toml", "--to", "urdf", "--out", "arm.urdf"]).run().expect(0);
    let asked = ["export", "arm.toml", "--to", "mjcf", "--out", "arm.xml", "--format", "json"];
    let ran = Call::new(ran.folder, &asked).run().expect(0);
    let json: Value = serde_json::from_str(&ran.stdout()).expect("JSON");
    let not_expressed = json["unsaid"].as_array().expect("a list").iter();
    let not_expressed = not_expressed.filter_map(|line| line.as_str().map(str::to_owned)).collect();
    (ran.folder, not_expressed)
}

/// The result of a script on `arm.xml`, which it gets as `model` and `data` of MuJoCo.
fn in_mujoco(folder: &Path, script: &str) -> Value {
    let head = "import json, mujoco, numpy as np\nmodel = mujoco.MjModel.from_xml_path('arm.xml')\ndata = mujoco.MjData(model)\n";
    let mut command = Command::new(python());
    let output = command.args(["-c", &format!("{head}{script}")]).current_dir(folder).output();
    let output = output.expect("it starts");
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    serde_json::from_slice(&output.stdout).expect("JSON")
}

#[test]
fn a_hard_stop_is_the_end_of_the_range_in_both_formats() {
    let stop = "[[effect]]\nkind = \"hard_stop\"\njoint = \"axis\"\nupper = 0.7\n";
    let (folder, not_expressed) = exported(&arm("revolute", 0.01, stop));
    assert!(not_expressed.is_empty(), "{not_expressed:?}");
    for file in ["arm.xml", "arm.urdf"] {
        let limits = load(&folder.path().join(file)).expect(file).arm.joints()[0].limits;
        assert!((limits.lower + 2.0).abs() < 1e-9 && (limits.upper - 0.7).abs() < 1e-9, "{file}: {limits:?}");
    }
}

#[test]
fn what_belongs_to_a_time_is_listed_with_the_reason() {
    let push =
        "[[effect]]\nkind = \"external_torque\"\njoint = \"axis\"\ntorque = 3.0\nstart = 1.0\nend = 2.0\n";
    let (_, not_expressed) = exported(&arm("revolute", 0.01, push));
    assert!(not_expressed.len() == 1 && not_expressed[0].contains("no clock"), "{not_expressed:?}");
}

/// MuJoCo softens friction by the effective inertia of the joint: a link with almost none would have no friction.
#[test]
fn friction_of_a_joint_with_hardly_any_inertia_has_its_level_in_mujoco() {
    if !has("mujoco, numpy") {
        return;
    }
    let friction = "[[effect]]\nkind = \"coulomb_friction\"\njoint = \"axis\"\ncoulomb = 50.0\n";
    let (folder, not_expressed) = exported(&arm("revolute", 1e-9, friction));
    assert!(not_expressed.iter().any(|line| line.contains("friction of 50 needs it")), "{not_expressed:?}");
    let one = load(&folder.path().join("arm.urdf")).expect("an arm").arm;
    let motions = [[vec![0.1], vec![0.01], vec![0.0]], [vec![0.1], vec![-0.01], vec![0.0]]];
    let rows = Tool::Mujoco.inverse(&folder.path().join("arm.xml"), &one, &motions).expect("mujoco");
    for (row, level) in rows.iter().zip([50.0, -50.0]) {
        assert!((row.torque[0] - level).abs() < 1e-6, "{:?} for {level}", row.torque);
    }
}

/// The mass matrix of motor and gear is [[m + a, m], [m, m]], with a the inertia of the motor; MuJoCo assumes it diagonal if the body's frame is that of its
/// principal axes.
#[test]
fn motor_and_gear_of_a_sliding_joint_move_one_link_in_mujoco() {
    if !has("mujoco, numpy") {
        return;
    }
    let gear = "[[effect]]\nkind = \"joint_elasticity\"\njoint = \"axis\"\nstiffness = 1e4\n[[effect]]\nkind = \"rotor_inertia\"\njoint = \"axis\"\ninertia = 0.5\n";
    let (folder, _) = exported(&arm("prismatic", 0.01, gear));
    let script = "mujoco.mj_forward(model, data)\ncolumns = np.zeros((2, 2))\n\
                  for index, unit in enumerate(np.eye(2)):\n    mujoco.mj_mulM(model, data, columns[index], unit)\nprint(json.dumps(columns.tolist()))";
    let mass: Vec<Vec<f64>> = serde_json::from_value(in_mujoco(folder.path(), script)).expect("a matrix");
    let expected = [[1.5, 1.0], [1.0, 1.0]];
    for (row, expected) in mass.iter().flatten().zip(expected.as_flattened()) {
        assert!((row - expected).abs() < 1e-9, "{mass:?}");
    }
}
