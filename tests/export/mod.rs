//! `freeplay export`: the exported files in other tools, against the model's own dynamics.
//!
//! `FREEPLAY_PYTHON` names an interpreter that has mujoco, numpy and scipy, and pin for Pinocchio; else the tests try `python3`. A test without its package
//! prints a message and passes.

mod effects;
mod fmu;
mod guest;
mod joints;
mod real;
mod replay;
mod tools;

use crate::common::{Call, fresh_folder};
use freeplay_arm::{Arm, JointKind, Workspace, rnea};
use freeplay_model::{ArmFile, load, paper_arm, to_toml};
use tools::{Motion, Tool, random};

/// The inverse dynamics of `arm` along `motions`.
fn torques(arm: &Arm, motions: &[Motion]) -> Vec<Vec<f64>> {
    let mut ws = Workspace::new(arm);
    let torque = |[q, v, a]: &Motion| {
        let mut tau = vec![0.0; arm.dof()];
        rnea(arm, &mut ws, q, v, a, &mut tau);
        tau
    };
    motions.iter().map(torque).collect()
}

/// Largest difference over the largest torque.
fn difference(found: &[Vec<f64>], expected: &[Vec<f64>]) -> f64 {
    let largest = expected.iter().flatten().fold(0.0_f64, |most, tau| most.max(tau.abs()));
    assert!(largest > 1.0, "it tests something: {largest}");
    let differences = found.iter().flatten().zip(expected.iter().flatten()).map(|(a, b)| (a - b).abs());
    differences.fold(0.0, f64::max) / largest
}

/// Arms of all sorts: the paper's, one on a slope, one with a slide, one without limits and with oblique joints.
fn arms() -> Vec<(&'static str, ArmFile)> {
    let change = |change: &dyn Fn(&mut String)| {
        let mut text = to_toml(&paper_arm());
        change(&mut text);
        freeplay_model::parse_toml(&text, std::path::Path::new("arm.toml")).expect("an arm")
    };
    let slope =
        change(&|text| *text = text.replace("gravity = [0.0, 0.0, -9.81]", "gravity = [5.886, 0.0, -7.848]"));
    let slides = change(&|text| *text = text.replacen("type = \"revolute\"", "type = \"prismatic\"", 1));
    let askew = change(&|text| {
        let lines = text.lines().filter(|line| !line.starts_with("limits"));
        *text = lines.map(|line| format!("{line}\n")).collect();
        for (number, from) in ["[1.0, 0.0, 0.0]", "[0.0, 1.0, 0.0]"].into_iter().enumerate() {
            let to = ["[0.6, 0.0, 0.8]", "[0.36, 0.48, -0.8]"][number];
            *text = text.replace(&format!("axis = {from}"), &format!("axis = {to}"));
        }
    });
    vec![("paper", paper_arm()), ("slope", slope), ("slides", slides), ("askew", askew)]
}

#[test]
fn a_urdf_gives_freeplay_mujoco_and_pinocchio_the_same_inverse_dynamics() {
    for (name, file) in arms() {
        let mut folder = fresh_folder();
        std::fs::write(folder.path().join("arm.toml"), to_toml(&file)).expect("written");
        for target in ["urdf", "mjcf"] {
            let asked = ["export", "arm.toml", "--to", target, "--out", &format!("arm.{target}")];
            folder = Call::new(folder, &asked).run().expect(0).folder;
        }
        let motions = random(file.arm.dof(), 50);
        let expected = torques(&file.arm, &motions);
        for target in ["urdf", "mjcf"] {
            let back = load(&folder.path().join(format!("arm.{target}"))).expect("it reads back").arm;
            let own = difference(&torques(&back, &motions), &expected);
            println!("{name}.{target}, freeplay: {own:.1e}");
            assert!(own < 1e-12);
        }
        for (tool, target) in [(Tool::Mujoco, "mjcf"), (Tool::Mujoco, "urdf"), (Tool::Pinocchio, "urdf")] {
            let path = folder.path().join(format!("arm.{target}"));
            let Some(rows) = tool.inverse(&path, &file.arm, &motions) else { continue };
            let found: Vec<Vec<f64>> = rows.into_iter().map(|row| row.torque).collect();
            let off = difference(&found, &expected);
            println!("{name}.{target}, {tool:?}: {off:.1e}");
            assert!(off < 1e-10);
        }
    }
}

#[test]
fn the_file_or_the_list_goes_to_standard_output() {
    let folder = fresh_folder();
    let text = "urdf = \"arm.urdf\"\n[[effect]]\nkind = \"stribeck_friction\"\njoint = \"joint_2\"\nextra = 3.0\nvelocity = 0.1\n";
    std::fs::write(folder.path().join("worn.toml"), text).expect("written");
    let urdf = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../scenarios/arm.urdf");
    std::fs::copy(urdf, folder.path().join("arm.urdf")).expect("copied");
    let ran = Call::new(folder, &["export", "worn.toml", "--to", "urdf"]).run().expect(0);
    assert!(ran.stdout().starts_with("<?xml"), "{}", ran.stdout());
    assert!(ran.stderr().contains("not expressed: stribeck_friction at joint_2"), "{}", ran.stderr());
    let asked = ["export", "worn.toml", "--to", "mjcf", "--out", "worn.xml", "--format", "json"];
    let ran = Call::new(ran.folder, &asked).run().expect(0);
    let json: serde_json::Value = serde_json::from_str(&ran.stdout()).expect("JSON");
    assert_eq!((&json["schema"], &json["to"]), (&"freeplay.export/1".into(), &"mjcf".into()));
    assert!(json["unsaid"][0].as_str().is_some_and(|line| line.starts_with("stribeck_friction at joint_2")));
    let ran =
        Call::new(ran.folder, &["export", "worn.toml", "--to", "urdf", "--out", "worn.urdf"]).run().expect(0);
    assert!(
        ran.stdout().contains("the file cannot express:\n- stribeck_friction at joint_2"),
        "{}",
        ran.stdout()
    );
    let ran =
        Call::new(ran.folder, &["export", "paper", "--to", "urdf", "--out", "paper.urdf"]).run().expect(0);
    assert!(ran.stdout().contains("the file expresses the whole model"), "{}", ran.stdout());
}

#[test]
fn what_can_not_be_exported_ends_in_one_error_and_no_file() {
    let folder = fresh_folder();
    std::fs::write(folder.path().join("bad.toml"), "urdf = \"none.urdf\"\n").expect("written");
    std::fs::write(
        folder.path().join("kind.toml"),
        to_toml(&paper_arm()) + "\n[[effect]]\nkind = \"magic\"\n",
    )
    .expect("written");
    let mut folder = folder;
    for (arguments, code, words) in [
        (["export", "bad.toml", "--to", "urdf", "--out", "out.urdf"], 3, "none.urdf"),
        (["export", "kind.toml", "--to", "mjcf", "--out", "out.xml"], 3, "unknown effect kind \"magic\""),
        (["export", "paper", "--to", "mjcf", "--out", "no/out.xml"], 3, "there is no folder"),
        (["export", "paper", "--to", "sdf", "--out", "out.sdf"], 2, "possible values"),
    ] {
        let ran = Call::new(folder, &arguments).run().expect(code);
        assert!(ran.stderr().contains(words), "{}", ran.stderr());
        folder = ran.folder;
        for name in ["out.urdf", "out.xml", "out.sdf"] {
            assert!(!folder.path().join(name).exists(), "{name} is left");
        }
    }
}

#[test]
fn models_of_mujoco_have_the_inverse_dynamics_that_mujoco_gives_them() {
    let folder = fresh_folder();
    for (name, text) in tools::MODELS {
        let path = folder.path().join(name);
        std::fs::write(&path, text).expect("written");
        let arm = load(&path).expect(name).arm;
        assert!(arm.dof() >= 3 && arm.joints().iter().any(|joint| joint.kind == JointKind::Revolute));
        let motions = random(arm.dof(), 30);
        let Some(rows) = Tool::Mujoco.inverse(&path, &arm, &motions) else { return };
        let friction = |[_, v, _]: &Motion| -> Vec<f64> {
            let joints = arm.joints().iter().zip(v);
            joints
                .map(|(joint, v)| joint.friction.viscous * v + joint.friction.coulomb * v.signum())
                .collect()
        };
        let mut expected = torques(&arm, &motions);
        for (torque, motion) in expected.iter_mut().zip(&motions) {
            torque.iter_mut().zip(friction(motion)).for_each(|(torque, friction)| *torque += friction);
        }
        let found: Vec<Vec<f64>> = rows.into_iter().map(|row| row.torque).collect();
        let off = difference(&found, &expected);
        println!("{name}: {off:.1e}");
        assert!(off < 1e-10);
    }
}
