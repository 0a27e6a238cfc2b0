//! Missing samples have an effect only where they are missing; the dry friction of a joint at rest takes any value within its limits.

use crate::common::{arm, columns, columns_along, even, link, recording, sines_of_all_but_the_last};
use freeplay_arm::{Arm, JointFriction, JointKind};
use freeplay_diagnosis::{Comparison, DiagnoseSettings, Diagnosis, Settings, Verdict, compare, diagnose};
use freeplay_model::ArmFile;
use freeplay_recording::Recording;

const RATE_HZ: f64 = 200.0;
const SECONDS: f64 = 24.0;

fn arm_with(coulomb: f64) -> Arm {
    let friction = JointFriction { viscous: 0.0, coulomb };
    arm(["shoulder", "elbow", "wrist"].map(|name| link(name, JointKind::Revolute, friction)).into())
}

/// Noise between −1 and 1, nearly white, different for each `column`.
fn noise(k: usize, column: &str) -> f64 {
    let own: u32 = column.bytes().map(u32::from).sum();
    2.0 * (((k as f64 + 0.37 * f64::from(own)) * 12.9898).sin() * 43_758.545_3).fract().abs() - 1.0
}

/// The simulated motion with noise and 4 N·m of dry friction at the elbow; `lacks` returns true where a column is missing at a time.
fn made(lacks: impl Fn(&str, f64) -> bool) -> Recording {
    let t = even(SECONDS, RATE_HZ);
    let mut made = columns(&arm_with(0.0), &t, |joint, v| if joint == 1 { 4.0 * v.signum() } else { 0.0 });
    for (name, column) in &mut made[1..] {
        let size = if name.starts_with("tau") { 0.1 } else { 1e-5 };
        for (k, (x, t)) in column.iter_mut().zip(&t).enumerate() {
            *x = if lacks(name, *t) { f64::NAN } else { *x + size * noise(k, name) };
        }
    }
    recording(made)
}

fn compared(recording: &Recording) -> Comparison {
    compare(&arm_with(0.0), &[], recording, &Settings::default()).expect("a comparison").0
}

fn diagnosed(recording: Recording) -> Diagnosis {
    diagnosed_with(arm_with(0.0), recording)
}

fn diagnosed_with(arm: Arm, recording: Recording) -> Diagnosis {
    let file = ArmFile { arm, effects: Vec::new(), ignored: Vec::new() };
    let settings = DiagnoseSettings::default();
    diagnose(&file, &[recording], &settings, &mut |_| {}).expect("a diagnosis")
}

#[test]
fn a_torque_that_is_missing_for_a_while_leaves_its_own_rows_out_and_nothing_else() {
    let (whole, part) = (
        compared(&made(|_, _| false)),
        compared(&made(|name, t| name == "tau2" && (8.0..10.0).contains(&t))),
    );
    assert_eq!((whole.samples, whole.channels.len()), (part.samples, part.channels.len()));
    for (whole, part) in whole.channels.iter().zip(&part.channels) {
        println!("{}: {:.5} and {:.5} {}", whole.name, whole.rmse, part.rmse, whole.unit);
        if whole.name == "tau2" {
            assert!((part.rmse / whole.rmse - 1.0).abs() < 0.05 && part.rmse != whole.rmse);
        } else {
            assert_eq!(whole, part);
        }
    }
    assert!(part.notes.iter().any(|note| note.contains("tau2 in 400 of 4801 samples")), "{:?}", part.notes);
}

#[test]
fn a_tracker_that_loses_the_tool_is_compared_where_it_sees_it() {
    let (whole, part) = (
        compared(&made(|_, _| false)),
        compared(&made(|name, t| ["x", "y", "z"].contains(&name) && t < 6.0)),
    );
    let distance = |comparison: &Comparison| comparison.tool_distance().expect("a tracker");
    println!("{:.2e} and {:.2e} m", distance(&whole), distance(&part));
    assert!((distance(&part) / distance(&whole) - 1.0).abs() < 0.2);
    assert_eq!(whole.channels[..3], part.channels[..3]);
}

/// True if a column is missing at a time, s.
type Lacks = fn(&str, f64) -> bool;

#[test]
fn a_diagnosis_finds_the_same_beside_what_is_missing() {
    let whole = diagnosed(made(|_, _| false));
    let cases: [(&str, Lacks); 3] = [
        ("tau1 for 2 s", |name, t| name == "tau1" && (8.0..10.0).contains(&t)),
        ("tau2 for 2 s", |name, t| name == "tau2" && (8.0..10.0).contains(&t)),
        ("tau3 throughout, x for a while", |name, t| name == "tau3" || (name == "x" && t > 15.0)),
    ];
    for (name, lacks) in cases {
        let part = diagnosed(made(lacks));
        let said = |diagnosis: &Diagnosis| {
            diagnosis.effects.iter().map(|effect| (effect.kind, effect.joint.clone())).collect::<Vec<_>>()
        };
        println!("{name}: {:?} {:?}, complete {:?}", part.verdict, said(&part), said(&whole));
        assert_eq!((part.verdict, said(&part)), (Verdict::Named, said(&whole)), "{name}");
    }
    assert_eq!(whole.effects.len(), 1, "{:?}", whole.effects);
}

fn dry(_: usize, v: f64) -> f64 {
    18.0 * if v == 0.0 { 0.0 } else { v.signum() }
}

/// A joint at rest whose torque is 6 N·m less than its load, since friction carries the rest, measured by a noisy encoder.
#[test]
fn friction_at_rest_is_what_it_takes_and_no_more_than_it_can() {
    let t = even(SECONDS, RATE_HZ);
    let resting = |carried: f64| {
        let mut made = columns_along(sines_of_all_but_the_last, &arm_with(0.0), &t, dry);
        for (name, column) in &mut made[1..] {
            let size = if name.starts_with('q') { 1e-5 } else { 0.0 };
            column.iter_mut().enumerate().for_each(|(k, x)| *x += size * noise(k, name));
            if name == "tau3" {
                column.iter_mut().for_each(|x| *x -= carried);
            }
        }
        recording(made)
    };
    let error = |carried: f64| {
        let (comparison, _) =
            compare(&arm_with(18.0), &[], &resting(carried), &Settings::default()).expect("a comparison");
        let [.., wrist] =
            comparison.channels.iter().filter(|c| c.name.starts_with("tau")).collect::<Vec<_>>()[..]
        else {
            panic!("three torques")
        };
        wrist.rmse
    };
    let (within, beyond) = (error(6.0), error(21.0));
    println!("off by {within:.3} N·m where friction can carry it, by {beyond:.3} N·m where it lacks 3 N·m");
    assert!(within < 0.3 && (beyond - 3.0).abs() < 0.3);
    let diagnosis = diagnosed_with(arm_with(18.0), resting(6.0));
    let before =
        diagnosis.fit.as_ref().and_then(|fit| fit.before.get("tau3")).map_or(0.0, |error| error.rmse);
    println!("{:?}, off by {before:.3} N·m before", diagnosis.verdict);
    assert!(before < 0.5);
}
