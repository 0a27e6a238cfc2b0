//! A moving arm, effects on it, and comparisons that print their margin.

use std::f64::consts::PI;

use freeplay_arm::{Arm, Inertia, Joint, JointFriction, JointKind, Limits};
use freeplay_laws::{Change, Placed, Prediction, Trajectory, predict};
use freeplay_model::{ArmFile, EffectTable, paper_arm};
use nalgebra::{Isometry3, Matrix3, Vector3};
use toml::Table;

/// Prints the error of `actual` against `expected` and the `tolerance`, and fails beyond it.
pub fn close(what: &str, actual: f64, expected: f64, tolerance: f64) {
    let off = (actual - expected).abs();
    println!("{what}: {actual:.9e}, expected {expected:.9e}: off by {off:.1e} of {tolerance:.1e}");
    assert!(off <= tolerance, "{what}: {actual:e} is not {expected:e} to {tolerance:e}");
}

/// The paper's arm with friction in every joint.
pub fn arm() -> Arm {
    let arm = paper_arm().arm;
    let mut joints = arm.joints().to_vec();
    joints.iter_mut().for_each(|joint| joint.friction = JointFriction { viscous: 1.5, coulomb: 2.0 });
    Arm::new("test", joints, *arm.tool(), *arm.gravity()).unwrap()
}

/// One link of `mass`, kg, with its centre 0.5 m along x, turning about y (gravity pulls it down) or sliding along x.
pub fn one_link(kind: JointKind, mass: f64) -> Arm {
    let inertia = Inertia { mass, com: Vector3::new(0.5, 0.0, 0.0), about_com: Matrix3::identity() * 0.1 };
    let axis = match kind {
        JointKind::Revolute => Vector3::y_axis(),
        JointKind::Prismatic => Vector3::x_axis(),
    };
    let joint = Joint {
        name: "only".into(),
        kind,
        axis,
        placement: Isometry3::identity(),
        limits: Limits::NONE,
        friction: JointFriction { viscous: 0.0, coulomb: 0.0 },
        rotor_inertia: 0.0,
        inertia,
    };
    Arm::new("one", vec![joint], Isometry3::translation(1.0, 0.0, 0.0), Vector3::new(0.0, 0.0, -9.81))
        .unwrap()
}

/// Two sines per joint, of different frequencies, sampled at `rate` Hz for `duration` s.
pub fn motion(dof: usize, rate: f64, duration: f64) -> Trajectory {
    let points = (rate * duration) as usize;
    let t: Vec<f64> = (0..points).map(|i| i as f64 / rate).collect();
    let wave = |joint: usize, order: i32| {
        let j = joint as f64;
        let waves = [(0.6, 0.31 + 0.07 * j, 0.4 * j), (0.12, 1.1 - 0.05 * j, 1.0)];
        let value = |t: f64| {
            let part = |(size, hz, phase): (f64, f64, f64)| {
                let w = 2.0 * PI * hz;
                let turn = f64::from(order) * PI / 2.0;
                size * w.powi(order) * (w * t + phase + turn).sin()
            };
            waves.into_iter().map(part).sum::<f64>()
        };
        t.iter().map(|t| value(*t)).collect::<Vec<_>>()
    };
    let columns = |order| (0..dof).map(|joint| wave(joint, order)).collect();
    Trajectory {
        q: columns(0),
        v: columns(1),
        a: columns(2),
        stretches: std::iter::once(0..points).collect(),
        t,
    }
}

/// A motion of one joint with these positions and velocities at 1 Hz, without acceleration.
pub fn samples(q: &[f64], v: &[f64]) -> Trajectory {
    let t = (0..q.len()).map(|i| i as f64).collect();
    let (q, v, a) = (vec![q.to_vec()], vec![v.to_vec()], vec![vec![0.0; q.len()]]);
    Trajectory { t, stretches: std::iter::once(0..q[0].len()).collect(), q, v, a }
}

/// No filter.
pub fn raw(column: &[f64]) -> Vec<f64> {
    column.to_vec()
}

/// The effect of `kind` at `joint` with the parameters of the TOML table `text`.
pub fn effect(arm: &Arm, kind: &str, joint: Option<usize>, text: &str) -> Placed {
    placed(arm, kind, joint, toml::from_str(text).unwrap())
}

/// The effect with these parameters.
pub fn placed(arm: &Arm, kind: &str, joint: Option<usize>, parameters: Table) -> Placed {
    let joint = joint.map(|joint| arm.joints()[joint].name.clone());
    Placed::new(&EffectTable { kind: kind.into(), joint, parameters, line: 1 }, arm).unwrap()
}

/// `change` with every column at full length.
pub fn whole(arm: &Arm, motion: &Trajectory, change: &Change) -> Prediction {
    let mut whole = Prediction::blank(arm.dof(), motion.len());
    whole.add(change);
    whole
}

/// The difference that `effects` make in the prediction of `arm`.
pub fn added(arm: &Arm, effects: &[Placed], motion: &Trajectory) -> Prediction {
    let mut with = predict(arm, effects, motion, &raw).unwrap();
    with.subtract(&predict(arm, &[], motion, &raw).unwrap());
    with
}

/// The arm file of `arm` with one effect.
pub fn file(arm: &Arm, table: EffectTable) -> ArmFile {
    ArmFile { arm: arm.clone(), effects: vec![table], ignored: Vec::new() }
}

/// Greatest magnitude in a column.
pub fn greatest<'a>(values: impl IntoIterator<Item = &'a f64>) -> f64 {
    values.into_iter().fold(0.0, |most, value| most.max(value.abs()))
}
