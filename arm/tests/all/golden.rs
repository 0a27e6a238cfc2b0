//! The paper's arm against numbers of an independent library (`data/ORIGIN.md`).

use crate::common::{close, distance, size};
use crate::runge_kutta::rk4;
use freeplay_arm::{
    Arm, Drive, Inertia, Joint, JointFriction, JointKind, Limits, Workspace, aba, bias, crba,
    forward_kinematics, gravity_torque, hybrid_aba, jacobian, joint_reaction, kinetic_energy,
    potential_energy, rnea,
};
use freeplay_model::paper_arm;
use nalgebra::{DMatrix, Isometry3, Vector3};
use serde_json::Value;

fn golden() -> Value {
    serde_json::from_str(include_str!("data/pinocchio_golden.json")).unwrap()
}

/// All numbers below `value`, in order.
fn numbers(value: &Value) -> Vec<f64> {
    match value {
        Value::Array(items) => items.iter().flat_map(numbers).collect(),
        number => vec![number.as_f64().unwrap()],
    }
}

fn slide(name: &str, axis: nalgebra::Unit<Vector3<f64>>) -> Joint {
    Joint {
        name: name.to_owned(),
        kind: JointKind::Prismatic,
        axis,
        placement: Isometry3::identity(),
        limits: Limits::NONE,
        friction: JointFriction::default(),
        rotor_inertia: 0.0,
        inertia: Inertia::zero(),
    }
}

/// The arm with the two slides of a clearance joint 5.
fn arm8() -> Arm {
    let with_x = paper_arm().arm.with_joint_inserted_before(4, slide("px", Vector3::x_axis())).unwrap();
    with_x.with_joint_inserted_before(5, slide("pz", Vector3::z_axis())).unwrap()
}

/// Rows of a column-major matrix, row by row.
fn by_rows(m: &DMatrix<f64>) -> Vec<f64> {
    m.transpose().as_slice().to_vec()
}

fn compare(arm: &Arm, states: &Value, label: &str) {
    let mut ws = Workspace::new(arm);
    let n = arm.dof();
    let mut worst: Vec<(&str, f64)> = Vec::new();
    let mut note = |what, actual: &[f64], expected: &Value| {
        let expected = numbers(expected);
        let error = distance(actual, &expected) / size(&expected).max(1.0);
        match worst.iter_mut().find(|(known, _)| *known == what) {
            Some((_, e)) => *e = e.max(error),
            None => worst.push((what, error)),
        }
    };
    assert_eq!(states.as_array().unwrap().len(), 20);
    for state in states.as_array().unwrap() {
        let (q, v, a) = (numbers(&state["q"]), numbers(&state["v"]), numbers(&state["a"]));
        let (mut out, mut m, mut j) = (vec![0.0; n], DMatrix::zeros(n, n), DMatrix::zeros(6, n));
        rnea(arm, &mut ws, &q, &v, &a, &mut out);
        note("tau", &out, &state["tau"]);
        let (force, moment) = joint_reaction(&ws, 0);
        note("f1", &[force.as_slice(), moment.as_slice()].concat(), &state["f1"]);
        let tau = out.clone();
        aba(arm, &mut ws, &q, &v, &tau, &mut out);
        note("a", &out, &state["a"]);
        let (force, moment) = joint_reaction(&ws, 0);
        note("f1 after aba", &[force.as_slice(), moment.as_slice()].concat(), &state["f1"]);
        bias(arm, &mut ws, &q, &v, &mut out);
        note("nle", &out, &state["nle"]);
        gravity_torque(arm, &mut ws, &q, &mut out);
        note("g", &out, &state["g"]);
        crba(arm, &mut ws, &q, &mut m);
        note("M", &by_rows(&m), &state["M"]);
        jacobian(arm, &mut ws, &q, &mut j);
        note("J", &by_rows(&j), &state["J"]);
        let tool = forward_kinematics(arm, &mut ws, &q);
        note("p_ee", tool.translation.vector.as_slice(), &state["p_ee"]);
        let rotation = tool.rotation.to_rotation_matrix();
        note("R_ee", rotation.matrix().transpose().as_slice(), &state["R_ee"]);
        note("T", &[kinetic_energy(arm, &mut ws, &q, &v)], &state["T"]);
        note("U", &[potential_energy(arm, &mut ws, &q)], &state["U"]);
    }
    for (what, error) in worst {
        close(&format!("{label}: {what}"), error, if what == "a" { 1e-10 } else { 1e-12 });
    }
}

#[test]
fn six_joint_arm_agrees_with_pinocchio() {
    compare(&paper_arm().arm, &golden()["arm6"], "arm6");
}

#[test]
fn arm_with_slides_agrees_with_pinocchio() {
    compare(&arm8(), &golden()["arm8"], "arm8");
}

#[test]
fn weight_and_reach_at_zero_are_those_of_the_fact_sheet() {
    let arm = paper_arm().arm;
    let mut ws = Workspace::new(&arm);
    let q = [0.0; 6];
    let tool = forward_kinematics(&arm, &mut ws, &q);
    close("tool at zero", (tool.translation.vector - Vector3::new(1.045, 0.0, 1.355)).norm(), 1e-15);
    let mut tau = [0.0; 6];
    gravity_torque(&arm, &mut ws, &q, &mut tau);
    close(
        "gravity torque at zero",
        distance(&tau, &[0.0, -143.018813, -143.018813, 0.0, -1.252247, 0.0]),
        1e-6,
    );
    let (force, _) = joint_reaction(&ws, 0);
    close("weight", (force - Vector3::new(0.0, 0.0, 127.68 * 9.81)).norm(), 1e-9);
}

/// The effective mass at the clearance: with prescribed motors, only link 4; with free motors, less.
#[test]
fn effective_mass_at_the_clearance_is_that_of_the_fact_sheet() {
    let arm = arm8().with_gravity(Vector3::zeros());
    let mut ws = Workspace::new(&arm);
    let (q, mut a, mut tau) = ([0.0; 8], [0.0; 8], [0.0; 8]);
    for (slide, free) in [(4, 2.158), (5, 0.810)] {
        let push = |i: usize| if i == slide { 1.0 } else { 0.0 };
        let held: Vec<Drive> = (0..8)
            .map(|i| if i == 4 || i == 5 { Drive::Torque(push(i)) } else { Drive::Acceleration(0.0) })
            .collect();
        hybrid_aba(&arm, &mut ws, &q, &q, &held, &mut a, &mut tau);
        close("prescribed joints: 2.22 kg", (1.0 / a[slide] - 2.22).abs(), 1e-12);
        let drive: Vec<Drive> = (0..8).map(|i| Drive::Torque(push(i))).collect();
        hybrid_aba(&arm, &mut ws, &q, &q, &drive, &mut a, &mut tau);
        close("torque-driven joints", (1.0 / a[slide] - free).abs(), 5e-4);
    }
}

#[test]
fn free_fall_follows_the_reference_and_keeps_its_energy() {
    let arm = paper_arm().arm;
    let mut ws = Workspace::new(&arm);
    let reference = golden()["free_fall_arm6"].clone();
    let (mut q, mut v) = (vec![0.1, 0.3, -0.2, 0.4, 0.5, -0.3], vec![0.0; 6]);
    let energy = |ws: &mut Workspace, q: &[f64], v: &[f64]| {
        kinetic_energy(&arm, ws, q, v) + potential_energy(&arm, ws, q)
    };
    let start = energy(&mut ws, &q, &v);
    close("energy at the start", (start - reference[0]["E"].as_f64().unwrap()).abs(), 1e-11);
    for sample in 1..=5 {
        for _ in 0..1000 {
            rk4(&mut q, &mut v, 1e-4, |q, v, a| aba(&arm, &mut ws, q, v, &[0.0; 6], a));
        }
        let (expected_q, expected_v) = (numbers(&reference[sample]["q"]), numbers(&reference[sample]["v"]));
        assert!(size(&expected_v) > 0.1, "it falls");
        close(&format!("q at 0.{sample} s"), distance(&q, &expected_q), 1e-9);
        close(&format!("v at 0.{sample} s"), distance(&v, &expected_v), 1e-8);
    }
    close("energy after 0.5 s", (energy(&mut ws, &q, &v) - start).abs(), 1e-9);
}
