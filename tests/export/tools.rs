//! Other tools, in Python processes.

use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use freeplay_arm::Arm;
use serde_json::json;

/// Positions, velocities and accelerations of all joints.
pub type Motion = [Vec<f64>; 3];

/// A tool with inverse dynamics of its own.
#[derive(Clone, Copy, Debug)]
pub enum Tool {
    Mujoco,
    Pinocchio,
}

/// Results of a tool for one motion.
pub struct Row {
    pub torque: Vec<f64>,
    pub tool: Vec<f64>,
}

pub fn python() -> String {
    std::env::var("FREEPLAY_PYTHON").unwrap_or_else(|_| "python3".to_owned())
}

pub fn here(file: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../tests/export").join(file)
}

/// True if Python has the packages; reports the missing ones if not.
pub fn has(packages: &str) -> bool {
    let script = format!("import {packages}");
    let found =
        Command::new(python()).args(["-c", &script]).output().is_ok_and(|output| output.status.success());
    if !found {
        freeplay_skip::skip(
            freeplay_skip::Need::Python,
            format_args!("{} lacks {packages}; FREEPLAY_PYTHON names another interpreter", python()),
        );
    }
    found
}

impl Tool {
    /// Torques along `motions` for the model in `file`; `None` without the tool.
    pub fn inverse(self, file: &Path, arm: &Arm, motions: &[Motion]) -> Option<Vec<Row>> {
        let (packages, script) = match self {
            Tool::Mujoco => ("mujoco, numpy", "mujoco_inverse.py"),
            Tool::Pinocchio => ("pinocchio", "pinocchio_inverse.py"),
        };
        if !has(packages) {
            return None;
        }
        let names: Vec<&str> = arm.joints().iter().map(|joint| joint.name.as_str()).collect();
        let mut command = Command::new(python());
        command.arg(here(script)).arg(file).stdin(Stdio::piped()).stdout(Stdio::piped());
        let mut child = command.spawn().expect("it starts");
        let mut input = child.stdin.take().expect("a pipe");
        input.write_all(json!([names, motions]).to_string().as_bytes()).expect("it reads");
        drop(input);
        let output = child.wait_with_output().expect("it ends");
        assert!(output.status.success(), "{self:?} of {}", file.display());
        let rows: Vec<[Vec<f64>; 2]> = serde_json::from_slice(&output.stdout).expect("JSON");
        Some(rows.into_iter().map(|[torque, tool]| Row { torque, tool }).collect())
    }
}

/// Random motions, the same in every run, with no joint near standstill.
pub fn random(dof: usize, count: usize) -> Vec<Motion> {
    let mut seed = 0x2545_F491_4F6C_DD1D_u64;
    let mut next = || {
        seed ^= seed << 13;
        seed ^= seed >> 7;
        seed ^= seed << 17;
        (seed >> 11) as f64 / (1_u64 << 52) as f64 - 1.0
    };
    let moving = |x: f64| x + 0.2 * x.signum();
    (0..count)
        .map(|_| {
            [1.0, 1.5, 4.0].map(|scale| {
                (0..dof).map(|_| if scale == 1.5 { scale * moving(next()) } else { scale * next() }).collect()
            })
        })
        .collect()
}

/// Arms as users write them for MuJoCo.
pub const MODELS: [(&str, &str); 2] = [
    (
        "classes.xml",
        r#"<mujoco model="classes"><compiler eulerseq="zyx"/><option gravity="0 0 -9.81"><flag contact="disable"/></option>
        <default><default class="arm"><joint axis="0 1 0" damping="2" armature="0.1" frictionloss="0.5"
          solreffriction="0.002 1" solimpfriction="0.9999 0.9999 0.001 0.5 2"/>
          <geom type="capsule" size="0.04" density="700"/><default class="wrist"><joint armature="0.02" damping="0.3"/></default></default></default>
        <worldbody><body name="a" pos="0 0 0.3" euler="30 0 0" childclass="arm"><joint name="j1" axis="0 0 1"/><geom fromto="0 0 0 0.1 0 0.2"/>
        <body name="b" pos="0.1 0 0.2" quat="0.9 0.1 -0.3 0.2"><joint name="j2" pos="0.05 0 0" ref="20"/><geom type="box" size="0.05 0.04 0.2" pos="0 0 0.2" mass="5"/>
        <body name="c" pos="0 0 0.4" xyaxes="0 1 0 -1 0 0.2"><joint name="j3" type="slide" axis="0 0 1"/><geom fromto="0 0 0 0 0.2 0.2" size="0.03"/>
        <frame pos="0 0.1 0.2" euler="0 45 10"><body name="d" childclass="wrist"><joint name="j4"/><inertial pos="0.02 0 0.1" mass="1.5" diaginertia="0.01 0.012 0.004" euler="10 20 30"/>
        <body name="e" pos="0 0 0.2"><geom type="ellipsoid" size="0.05 0.03 0.08"/><geom type="cylinder" size="0.02 0.06" pos="0 0 0.1"/><site name="tool0" pos="0 0 0.2"/></body>
        </body></frame></body></body></body></worldbody></mujoco>"#,
    ),
    (
        "two_joints.xml",
        r#"<mujoco model="two joints a body"><compiler angle="radian"/><option><flag contact="disable"/></option><worldbody><body name="shoulder" pos="0 0 1">
        <joint name="yaw" axis="0 0 1" pos="0 0.1 0"/><joint name="pitch" axis="0 1 0" pos="0 0 0.1" damping="1"/><inertial pos="0 0 -0.2" mass="3" diaginertia="0.05 0.05 0.01"/>
        <body name="fore" pos="0 0 -0.4"><joint name="elbow" axis="1 1 0" armature="0.3"/><inertial pos="0 0 -0.2" mass="2" fullinertia="0.04 0.03 0.02 0.002 0.001 -0.003"/>
        <geom size="0.1" mass="0.7"/></body></body></worldbody></mujoco>"#,
    ),
];
