//! Pendulums against published and closed-form motion.

use crate::common::{close, distance};
use crate::runge_kutta::rk4;
use freeplay_arm::{
    Arm, Inertia, Joint, JointFriction, JointKind, Limits, Workspace, aba, kinetic_energy, potential_energy,
};
use nalgebra::{Isometry3, Matrix3, Vector3};
use serde_json::Value;

/// Point masses of 1 kg on massless rods of 1 m, turning about y, hanging down at q = 0.
fn pendulum(joints: usize) -> Arm {
    let joint = |number: usize| Joint {
        name: format!("joint_{number}"),
        kind: JointKind::Revolute,
        axis: -Vector3::y_axis(),
        placement: if number == 1 { Isometry3::identity() } else { Isometry3::translation(0.0, 0.0, -1.0) },
        limits: Limits::NONE,
        friction: JointFriction::default(),
        rotor_inertia: 0.0,
        inertia: Inertia { mass: 1.0, com: Vector3::new(0.0, 0.0, -1.0), about_com: Matrix3::zeros() },
    };
    Arm::new(
        "pendulum",
        (1..=joints).map(joint).collect(),
        Isometry3::identity(),
        Vector3::new(0.0, 0.0, -9.81),
    )
    .unwrap()
}

/// The reference gives absolute angles; joint angles are relative.
#[test]
fn double_pendulum_follows_the_reference() {
    let reference: Value = serde_json::from_str(include_str!("data/double_pendulum.json")).unwrap();
    let arm = pendulum(2);
    let mut ws = Workspace::new(&arm);
    let number = |value: &Value| value.as_f64().unwrap();
    for (start, case) in reference.as_object().unwrap().iter().filter(|(_, case)| case.get("y0").is_some()) {
        let y0: Vec<f64> = case["y0"].as_array().unwrap().iter().map(number).collect();
        let (mut q, mut v) = (vec![y0[0], y0[1] - y0[0]], vec![y0[2], y0[3] - y0[2]]);
        let dt = 2.5e-4;
        for steps in 1..=4000_u32 {
            rk4(&mut q, &mut v, dt, |q, v, a| aba(&arm, &mut ws, q, v, &[0.0; 2], a));
            for (t, y) in case["t"].as_array().unwrap().iter().zip(case["y"].as_array().unwrap()) {
                if (f64::from(steps) * dt - number(t)).abs() < dt / 2.0 {
                    let expected: Vec<f64> = y.as_array().unwrap().iter().map(number).collect();
                    let actual = [q[0], q[0] + q[1], v[0], v[0] + v[1]];
                    assert!(distance(&expected, &y0) > 0.01, "it moves");
                    close(&format!("start {start}, t = {t}"), distance(&actual, &expected), 2e-10);
                }
            }
        }
    }
}

/// IFToMM benchmark A01: released horizontally; period and speed at the bottom in closed form, and no energy loss in 10 s.
#[test]
fn simple_pendulum_keeps_period_speed_and_energy() {
    let arm = pendulum(1);
    let mut ws = Workspace::new(&arm);
    let (mut q, mut v) = (vec![std::f64::consts::FRAC_PI_2], vec![0.0]);
    let energy = |ws: &mut Workspace, q: &[f64], v: &[f64]| {
        kinetic_energy(&arm, ws, q, v) + potential_energy(&arm, ws, q)
    };
    let start = energy(&mut ws, &q, &v);
    let (mut fastest, mut drift, mut crossings) = (0.0_f64, 0.0_f64, Vec::new());
    let dt = 1e-3;
    for step in 0..10_000 {
        let before = q[0];
        rk4(&mut q, &mut v, dt, |q, v, a| aba(&arm, &mut ws, q, v, &[0.0], a));
        if before > 0.0 && q[0] <= 0.0 {
            // At the bottom the speed is stationary, so that the position is linear in time to third order.
            crossings.push((f64::from(step) + before / (before - q[0])) * dt);
        }
        fastest = fastest.max(v[0].abs());
        drift = drift.max((energy(&mut ws, &q, &v) - start).abs());
    }
    let period = (crossings[crossings.len() - 1] - crossings[0]) / (crossings.len() - 1) as f64;
    close("period", (period - 2.367_841_947_6).abs(), 1e-8);
    close("bottom speed", (fastest - 4.429_446_9).abs(), 2e-5);
    close("energy", drift, 1e-8);
}
