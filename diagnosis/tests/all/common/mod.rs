//! Simulated recordings: an arm on known sines, with the torques of this motion.
#![allow(dead_code, reason = "every test file uses another part of this one")]

use std::f64::consts::PI;
use std::path::Path;

use freeplay_arm::{
    Arm, Inertia, Joint, JointFriction, JointKind, Limits, Workspace, forward_kinematics, rnea,
};
use freeplay_concealed::Samples;
use freeplay_recording::Recording;
use nalgebra::{Isometry3, Matrix3, Vector3};

/// Position, velocity and acceleration of every joint at time `t`, s: two sines a joint, of different frequencies.
pub fn sines(arm: &Arm, t: f64) -> [Vec<f64>; 3] {
    let mut motion = [const { Vec::new() }; 3];
    for (j, joint) in arm.joints().iter().enumerate() {
        let size = if joint.kind == JointKind::Prismatic { 0.1 } else { 0.6 };
        let waves =
            [(size, 0.31 + 0.07 * j as f64, 0.4 * j as f64), (0.2 * size, 1.1 - 0.05 * j as f64, 1.0)];
        let mut sum = [0.0; 3];
        for (amplitude, hz, phase) in waves {
            let w = 2.0 * PI * hz;
            let (sin, cos) = (w * t + phase).sin_cos();
            sum = [sum[0] + amplitude * sin, sum[1] + amplitude * w * cos, sum[2] - amplitude * w * w * sin];
        }
        for (motion, sum) in motion.iter_mut().zip(sum) {
            motion.push(sum);
        }
    }
    motion
}

/// Torque beyond that of the rigid arm: of `joint` moving with `velocity`.
pub type Extra = fn(joint: usize, velocity: f64) -> f64;

/// No extra torque.
pub fn nothing(_: usize, _: f64) -> f64 {
    0.0
}

/// The sines with the last joint at rest.
pub fn sines_of_all_but_the_last(arm: &Arm, t: f64) -> [Vec<f64>; 3] {
    let mut motion = sines(arm, t);
    for (of_all, at_rest) in motion.iter_mut().zip([0.4, 0.0, 0.0]) {
        of_all.iter_mut().skip(arm.dof() - 1).for_each(|x| *x = at_rest);
    }
    motion
}

/// Position, velocity and acceleration of every joint of an arm at a time, s.
pub type Motion = fn(&Arm, f64) -> [Vec<f64>; 3];

/// The columns t, q, tau, x, y, z of `arm` on [`sines`] at the times `t`.
pub fn columns(arm: &Arm, t: &[f64], extra: Extra) -> Vec<(String, Vec<f64>)> {
    columns_along(sines, arm, t, extra)
}

/// The columns t, q, tau, x, y, z of `arm` on `motion` at the times `t`.
pub fn columns_along(motion: Motion, arm: &Arm, t: &[f64], extra: Extra) -> Vec<(String, Vec<f64>)> {
    let dof = arm.dof();
    let mut ws = Workspace::new(arm);
    let mut tau = vec![0.0; dof];
    let mut columns: Vec<(String, Vec<f64>)> = vec![("t".into(), t.to_vec())];
    columns.extend((1..=dof).map(|j| (format!("q{j}"), Vec::new())));
    columns.extend((1..=dof).map(|j| (format!("tau{j}"), Vec::new())));
    columns.extend(["x", "y", "z"].map(|axis| (axis.to_string(), Vec::new())));
    for &time in t {
        let [q, v, a] = motion(arm, time);
        rnea(arm, &mut ws, &q, &v, &a, &mut tau);
        let tool = forward_kinematics(arm, &mut ws, &q).translation.vector;
        let torques = tau.iter().enumerate().map(|(j, tau)| tau + extra(j, v[j]));
        let row: Vec<f64> = q.iter().copied().chain(torques).chain(tool.iter().copied()).collect();
        for ((_, column), value) in columns[1..].iter_mut().zip(row) {
            column.push(value);
        }
    }
    columns
}

/// The recording of a machine from the generator.
pub fn of_samples(samples: &Samples) -> Recording {
    let columns = samples.names.iter().cloned().zip(samples.columns.iter().cloned());
    let columns = std::iter::once(("t".to_owned(), samples.t.clone())).chain(columns).collect();
    Recording::new(Path::new("made.csv"), columns).expect("a recording")
}

/// A recording of these columns.
pub fn recording(columns: Vec<(String, Vec<f64>)>) -> Recording {
    Recording::new(Path::new("made.csv"), columns).expect("a recording")
}

/// `columns` without those whose names start with `prefix`.
pub fn without(columns: Vec<(String, Vec<f64>)>, prefix: &str) -> Vec<(String, Vec<f64>)> {
    columns.into_iter().filter(|(name, _)| !name.starts_with(prefix)).collect()
}

/// Even times: `seconds` at `rate` Hz.
pub fn even(seconds: f64, rate: f64) -> Vec<f64> {
    (0..=(seconds * rate) as usize).map(|k| k as f64 / rate).collect()
}

/// Times with deviations of up to 30 % of a step.
pub fn jittered(seconds: f64, rate: f64) -> Vec<f64> {
    even(seconds, rate).iter().enumerate().map(|(k, t)| t + 0.3 / rate * (2.4 * k as f64).sin()).collect()
}

/// One link of 3 kg, 0.4 m long, on a joint about y or along x.
pub fn link(name: &str, kind: JointKind, friction: JointFriction) -> Joint {
    let axis = if kind == JointKind::Revolute { Vector3::y_axis() } else { Vector3::x_axis() };
    Joint {
        name: name.into(),
        kind,
        axis,
        placement: Isometry3::translation(0.4, 0.0, 0.0),
        limits: Limits { lower: -2.0, upper: 2.0, ..Limits::NONE },
        friction,
        rotor_inertia: 0.0,
        inertia: Inertia {
            mass: 3.0,
            com: Vector3::new(0.2, 0.0, 0.0),
            about_com: Matrix3::from_diagonal(&Vector3::new(0.01, 0.04, 0.04)),
        },
    }
}

/// An arm of these joints.
pub fn arm(joints: Vec<Joint>) -> Arm {
    Arm::new("made", joints, Isometry3::translation(0.4, 0.0, 0.0), Vector3::new(0.0, 0.0, -9.81))
        .expect("an arm")
}

/// Two links in series in the plane of gravity.
pub const TWO_LINKS: &str = r#"
name = "two links"

[[joint]]
name = "shoulder"
type = "revolute"
axis = [0.0, -1.0, 0.0]
mass = 0.5
com = [0.1, 0.0, 0.0]
inertia = { ixx = 0.015, iyy = 0.015, izz = 0.015, ixy = 0.0, ixz = 0.0, iyz = 0.0 }

[[joint]]
name = "elbow"
type = "revolute"
axis = [0.0, -1.0, 0.0]
origin = { xyz = [0.25, 0.0, 0.0], rpy = [0.0, 0.0, 0.0] }
mass = 0.4
com = [0.1, 0.0, 0.0]
inertia = { ixx = 0.01, iyy = 0.01, izz = 0.01, ixy = 0.0, ixz = 0.0, iyz = 0.0 }
"#;
