//! Every effect that MJCF can express: MuJoCo's inverse dynamics against the law.

use freeplay_laws::{Effects, Prediction, Trajectory, predict};
use freeplay_model::{paper_arm, parse_toml, to_toml};
use std::path::Path;

use super::tools::{Motion, Tool, has};
use crate::common::{Call, fresh_folder};

/// Accuracy of an effect in MuJoCo.
#[derive(Clone, Copy, Debug)]
enum Shows {
    /// All torques and the tool to rounding.
    Exactly,
    /// The tool to this share of the effect, and the torques to 0.5 % of all torque: springs and journals swing, but rest in MuJoCo's inverse dynamics.
    AtRest(f64),
}

/// A table of an effect, and its accuracy in MuJoCo.
const EFFECTS: [(&str, Shows); 22] = [
    ("kind = \"coulomb_friction\"\njoint = \"joint_3\"\ncoulomb = 40.0", Shows::Exactly),
    ("kind = \"viscous_friction\"\njoint = \"joint_2\"\nviscous = 80.0", Shows::Exactly),
    ("kind = \"asymmetric_friction\"\njoint = \"joint_3\"\npositive = 30.0\nnegative = 55.0", Shows::Exactly),
    ("kind = \"quadratic_drag\"\njoint = \"joint_2\"\ncoefficient = 25.0", Shows::Exactly),
    ("kind = \"rotor_inertia\"\njoint = \"joint_3\"\ninertia = 4.0", Shows::Exactly),
    (
        "kind = \"payload\"\nmass = 6.0\ncom = [0.05, 0.02, -0.03]\nmoments = [0.02, 0.03, 0.025]",
        Shows::Exactly,
    ),
    ("kind = \"link_mass\"\njoint = \"joint_3\"\nscale = 1.3\ncom_shift = [0.02, 0.0, 0.01]", Shows::Exactly),
    ("kind = \"base_tilt\"\nroll = 0.1\npitch = -0.06", Shows::Exactly),
    ("kind = \"base_tilt\"\nroll = 0.1\ntracker = \"level\"", Shows::Exactly),
    ("kind = \"link_length\"\njoint = \"joint_2\"\noffset = 0.02", Shows::Exactly),
    ("kind = \"joint_spring\"\njoint = \"joint_2\"\nstiffness = 300.0\nrest = 0.2", Shows::Exactly),
    (
        "kind = \"joint_coupling\"\njoint = \"joint_6\"\nwith = \"joint_5\"\nsign = -1.0\ninertia = 0.4\nviscous = 3.0\ncoulomb = 5.0",
        Shows::Exactly,
    ),
    (
        "kind = \"joint_coupling\"\njoint = \"joint_6\"\nwith = \"joint_5\"\nsign = 1.0\nform = \"cross\"\ninertia = 0.4\nviscous = 3.0\ncoulomb = 5.0",
        Shows::Exactly,
    ),
    ("kind = \"torque_offset\"\njoint = \"joint_3\"\noffset = -25.0", Shows::Exactly),
    ("kind = \"torque_gain\"\njoint = \"joint_2\"\ngain = 0.85", Shows::Exactly),
    ("kind = \"actuator_saturation\"\njoint = \"joint_2\"\nlimit = 300.0", Shows::Exactly),
    ("kind = \"encoder_offset\"\njoint = \"joint_2\"\noffset = 0.03", Shows::Exactly),
    ("kind = \"joint_elasticity\"\njoint = \"joint_2\"\nstiffness = 2e5", Shows::AtRest(0.02)),
    (
        "kind = \"backlash\"\njoint = \"joint_4\"\ngap = 0.004\nstiffness = 5e4\ncourse = \"rest\"",
        Shows::AtRest(0.02),
    ),
    ("kind = \"backlash\"\njoint = \"joint_4\"\ngap = 0.004\ncourse = \"rest\"", Shows::AtRest(0.02)),
    (
        "kind = \"joint_clearance\"\njoint = \"joint_5\"\nclearance = 0.0008\nfriction = 0.0",
        Shows::AtRest(0.05),
    ),
    (
        "kind = \"presliding_friction\"\njoint = \"joint_3\"\nstiffness = 1e9\ncoulomb = 30.0\nstart = 1.0",
        Shows::AtRest(1e-3),
    ),
];

/// A slow motion of all joints in which each keeps its direction, away from standstill.
fn motion(dof: usize) -> (Trajectory, Vec<Motion>) {
    let points = 60;
    let t: Vec<f64> = (0..points).map(|k| 0.01 * f64::from(k)).collect();
    let column = |value: &dyn Fn(f64, f64) -> f64| -> Vec<Vec<f64>> {
        (0..dof).map(|joint| t.iter().map(|t| value(*t, joint as f64)).collect()).collect()
    };
    // The speed has a constant part and one that swings, so that accelerations differ.
    let q = column(&|t, j| {
        0.3 + 0.2 * j
            + (0.7 - 0.1 * j) * t * if j % 2.0 == 0.0 { 1.0 } else { -1.0 }
            + 0.01 * (9.0 * t + j).sin()
    });
    let v = column(&|t, j| {
        (0.7 - 0.1 * j) * if j % 2.0 == 0.0 { 1.0 } else { -1.0 } + 0.09 * (9.0 * t + j).cos()
    });
    let a = column(&|t, j| -0.81 * (9.0 * t + j).sin());
    let row = |k: usize| [&q, &v, &a].map(|columns| columns.iter().map(|column| column[k]).collect());
    let motions = (0..t.len()).map(row).collect();
    let stretches = std::iter::once(0..t.len()).collect();
    (Trajectory { t, q, v, a, stretches }, motions)
}

/// The model's torques and tool with the effect of `table`.
fn predicted(text: &str, motion: &Trajectory) -> Prediction {
    let file = parse_toml(text, Path::new("arm.toml")).expect("an arm file");
    let effects = Effects::of(&file).expect("effects");
    predict(&file.arm, &effects.placed, motion, &|column: &[f64]| column.to_vec()).expect("a prediction")
}

#[test]
fn every_effect_that_mjcf_says_has_the_torques_and_the_tool_of_its_law() {
    if !has("mujoco, numpy") {
        return;
    }
    let arm = paper_arm().arm;
    let (trajectory, motions) = motion(arm.dof());
    // A wrist with rotors and damping of its own, as the form `cross` of a coupling assumes.
    let rigid = to_toml(&paper_arm()).replace("limits = ", "damping = 4.0\nrotor_inertia = 0.5\nlimits = ");
    let without = predicted(&rigid, &trajectory);
    for (table, shows) in EFFECTS {
        let text = format!("{rigid}\n[[effect]]\n{table}\n");
        let folder = fresh_folder();
        std::fs::write(folder.path().join("arm.toml"), &text).expect("written");
        let ran =
            Call::new(folder, &["export", "arm.toml", "--to", "mjcf", "--out", "arm.xml"]).run().expect(0);
        let with = predicted(&text, &trajectory);
        let rows = Tool::Mujoco.inverse(&ran.folder.path().join("arm.xml"), &arm, &motions).expect("mujoco");
        let (mut effect, mut off) = ([0.0_f64; 2], [0.0_f64; 2]);
        for (k, row) in rows.iter().enumerate() {
            for joint in 0..arm.dof() {
                effect[0] = effect[0].max((with.torque[joint][k] - without.torque[joint][k]).abs());
                off[0] = off[0].max((with.torque[joint][k] - row.torque[joint]).abs());
            }
            for axis in 0..3 {
                effect[1] = effect[1].max((with.tool[axis][k] - without.tool[axis][k]).abs());
                off[1] = off[1].max((with.tool[axis][k] - row.tool[axis]).abs());
            }
        }
        println!(
            "{}: torque {:.3e} of {:.3e} N·m, tool {:.3e} of {:.3e} m",
            table.replace('\n', " "),
            off[0],
            effect[0],
            off[1],
            effect[1]
        );
        assert!(effect[0] > 1.0 || effect[1] > 1e-4, "it tests something");
        match shows {
            Shows::Exactly => assert!(off[0] < 1e-8 && off[1] < 1e-11, "{table}: {off:?}"),
            Shows::AtRest(share) => {
                let largest =
                    with.torque.iter().flatten().fold(0.0_f64, |most, torque| most.max(torque.abs()));
                let fits = off[0] < 5e-3 * largest && off[1] < (share * effect[1]).max(1e-7);
                assert!(fits, "{table}: {off:?} of {effect:?}, torques to {largest}");
            }
        }
    }
}
