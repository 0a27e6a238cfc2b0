//! Notes that accompany the numbers, and cases without a note.

use std::f64::consts::TAU;

use freeplay_arm::{Arm, JointFriction, JointKind};
use freeplay_diagnosis::{DiagnoseSettings, Diagnosis, Settings, Verdict, beyond_limits, compare, diagnose};
use freeplay_model::ArmFile;

use crate::common::{arm, columns, even, link, recording};

type Columns = Vec<(String, Vec<f64>)>;
/// A position as a function of the row.
type Course<'a> = &'a dyn Fn(usize) -> f64;

fn two_joints() -> Arm {
    let friction = JointFriction { viscous: 2.0, coulomb: 1.5 };
    arm(["shoulder", "elbow"].map(|name| link(name, JointKind::Revolute, friction)).into())
}

/// The sines of two joints, with a friction that differs from the model's.
fn made(seconds: f64) -> Columns {
    columns(&two_joints(), &even(seconds, 500.0), |_, v| 3.0 * v + 2.0 * v.signum())
}

/// Applies `change` to each value of the column `name`; `change` also receives the row.
fn with(mut columns: Columns, name: &str, change: impl Fn(usize, f64) -> f64) -> Columns {
    let of_name = columns.iter_mut().filter(|(known, _)| known == name);
    of_name.for_each(|(_, column)| column.iter_mut().enumerate().for_each(|(k, x)| *x = change(k, *x)));
    columns
}

/// `columns` with the torques of both joints multiplied by `times`.
fn scaled(columns: Columns, times: [f64; 2]) -> Columns {
    let [first, second] = times;
    with(with(columns, "tau1", |_, tau| first * tau), "tau2", |_, tau| second * tau)
}

fn notes(columns: Columns) -> Vec<String> {
    let compared = compare(&two_joints(), &[], &recording(columns), &Settings::default());
    compared.expect("a comparison").0.notes
}

/// Noise between -1 and 1, nearly white.
fn noise(k: usize) -> f64 {
    2.0 * ((k as f64 * 12.9898).sin() * 43_758.545_3).fract().abs() - 1.0
}

#[test]
fn a_joint_that_stands_still_is_not_too_fast_for_the_filter() {
    let is_fast = |note: &String| note.contains("of the movement of q2");
    let step = TAU / 4096.0;
    let cases: [(&str, bool, Course); 5] = [
        ("noise", false, &|k| 1e-5 * noise(k)),
        ("steps of the encoder", false, &|k| (0.5 + noise(k)).round() * step),
        ("a glitch now and then", false, &|k| if k % 700 == 0 { step } else { 0.0 }),
        ("shaken at 35 Hz", true, &|k| 1e-3 * (TAU * 35.0 * k as f64 / 500.0).sin() + 1e-5 * noise(k)),
        ("shaken by steps", true, &|k| (20.0 * (TAU * 35.0 * k as f64 / 500.0).sin()).round() * step),
    ];
    for (name, expected, q) in cases {
        let notes = notes(with(made(10.0), "q2", |k, _| 0.3 + q(k)));
        println!("{name}: {notes:?}");
        assert_eq!(notes.iter().any(is_fast), expected, "{name}");
    }
}

#[test]
fn torques_of_another_sign_unit_or_side_are_found() {
    let found = |columns: Columns| {
        let compared = compare(&two_joints(), &[], &recording(columns), &Settings::default());
        compared.expect("a comparison").0.setup
    };
    let cases: [([f64; 2], &[&str], &str); 5] = [
        ([1000.0, 1000.0], &["torque_unit"], "N·mm"),
        ([-1.0, -1.0], &["torque_sign"], "the opposite sign"),
        ([-1000.0, -1000.0], &["torque_sign", "torque_unit"], "N·mm"),
        ([0.01, 0.01], &["torque_unit"], "motor's side"),
        ([0.1, 0.1], &["torque_unit"], "amperes"),
    ];
    for (times, kinds, said) in cases {
        let setup = found(scaled(made(12.0), times));
        println!("{times:?}: {setup:?}");
        assert_eq!(setup.iter().map(|finding| finding.kind).collect::<Vec<_>>(), kinds, "{times:?}");
        assert!(setup.iter().any(|finding| finding.statement.contains(said)), "{times:?}");
    }
    assert_eq!(found(made(12.0)), []);
    let unlike = with(with(made(12.0), "tau1", |k, _| 900.0 * noise(k)), "tau2", |k, _| -noise(3 * k));
    let unit = found(unlike).into_iter().find(|finding| finding.kind == "torque_unit");
    assert_eq!(unit, None, "what does not go with the model has no scale");
}

#[test]
fn a_diagnosis_says_so_too_and_how_long_to_record() {
    let settings = DiagnoseSettings::default();
    let diagnosed = |columns: Columns| {
        let file = ArmFile { arm: two_joints(), effects: Vec::new(), ignored: Vec::new() };
        diagnose(&file, &[recording(columns)], &settings, &mut |_| ()).expect("a diagnosis")
    };
    let odd = diagnosed(scaled(made(16.0), [1000.0, 1000.0]));
    println!("{}\n{:?}", odd.statement, odd.mapping);
    assert_eq!(odd.verdict, Verdict::Setup);
    assert!(
        odd.statement.contains("N·mm")
            && odd.mapping.is_some_and(|mapping| mapping.contains("scale = [0.001"))
    );
    let plain = diagnosed(made(16.0));
    let kinds =
        |diagnosis: &Diagnosis| diagnosis.effects.iter().map(|effect| effect.kind).collect::<Vec<_>>();
    assert_eq!(
        kinds(&plain),
        odd.effects.iter().map(|effect| effect.kind).collect::<Vec<_>>(),
        "the physics beside it"
    );
    let short = diagnosed(made(1.0));
    println!("{} Next: {:?}", short.statement, short.next);
    assert_eq!(short.verdict, Verdict::InsufficientData);
    assert!(["made.csv", "lasts 1.0 s"].iter().all(|words| short.statement.contains(words)));
    assert!(short.next[0].contains("at least 10 s") && !short.next[0].contains("--trim"));
}

#[test]
fn joints_beyond_their_limits_are_named() {
    let arm = two_joints();
    assert_eq!(beyond_limits(&arm, &recording(made(5.0))), Vec::<String>::new());
    let degrees = recording(with(made(5.0), "q2", |_, q| q.to_degrees()));
    let said = beyond_limits(&arm, &degrees);
    println!("{said:?}");
    assert!(said.len() == 1 && said[0].starts_with("q2 ranges from") && said[0].contains("degrees"));
}
