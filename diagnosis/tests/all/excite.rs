//! The next motion: it separates two causes that a recording leaves possible.

use freeplay_arm::{Arm, JointFriction, JointKind};
use freeplay_diagnosis::{
    DiagnoseSettings, Diagnosis, Excitation, ExciteError, ExciteSettings, Rival, Tolerances, Verdict,
    diagnose, excite,
};
use freeplay_laws::{Trajectory, kind, rigid_torques};
use freeplay_model::ArmFile;
use freeplay_recording::Recording;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use crate::common::{arm, link, recording};

const FRICTION: JointFriction = JointFriction { viscous: 2.0, coulomb: 1.5 };
const RATE: f64 = 200.0;
/// Dry friction of the elbow that the model lacks, N·m.
const HIDDEN: f64 = 0.8;

fn model() -> ArmFile {
    let arm = arm(vec![
        link("shoulder", JointKind::Revolute, FRICTION),
        link("elbow", JointKind::Revolute, FRICTION),
    ]);
    ArmFile { arm, effects: Vec::new(), ignored: Vec::new() }
}

/// The shoulder swings; the elbow turns in one direction only, at varying speed.
fn one_way() -> Trajectory {
    let t: Vec<f64> = (0..=(12.0 * RATE) as usize).map(|k| k as f64 / RATE).collect();
    let shoulder = |t: f64| [0.6 * (1.3 * t).sin(), 0.78 * (1.3 * t).cos(), -1.014 * (1.3 * t).sin()];
    let elbow = |t: f64| {
        [-1.5 + 0.25 * t - 0.1 * (2.0 * t).sin(), 0.25 - 0.2 * (2.0 * t).cos(), 0.4 * (2.0 * t).sin()]
    };
    let column = |of: &dyn Fn(f64) -> [f64; 3], order: usize| t.iter().map(|&t| of(t)[order]).collect();
    let both = |order: usize| vec![column(&shoulder, order), column(&elbow, order)];
    Trajectory { q: both(0), v: both(1), a: both(2), stretches: std::iter::once(0..t.len()).collect(), t }
}

/// A recording of the machine with the hidden friction, with noise of 0.02 N·m.
fn measured(arm: &Arm, motion: &Trajectory, seed: u64) -> Recording {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let torques = rigid_torques(arm, motion, None);
    let mut columns = vec![("t".to_owned(), motion.t.clone())];
    columns.extend((0..2).map(|j| (format!("q{}", j + 1), motion.q[j].clone())));
    for (j, torque) in torques.iter().enumerate() {
        let hidden = if j == 1 { HIDDEN } else { 0.0 };
        let with_friction = torque.iter().zip(&motion.v[j]).map(|(torque, v)| {
            let noise: f64 = (0..12).map(|_| rng.random_range(-0.5..0.5)).sum();
            torque + FRICTION.viscous * v + (FRICTION.coulomb + hidden) * v.signum() + 0.02 * noise
        });
        columns.push((format!("tau{}", j + 1), with_friction.collect()));
    }
    recording(columns)
}

fn diagnosed(file: &ArmFile, recording: &Recording) -> Diagnosis {
    let settings = DiagnoseSettings::default();
    diagnose(file, std::slice::from_ref(recording), &settings, &mut |_| {}).expect("a diagnosis")
}

fn rivals() -> Vec<Rival> {
    ["coulomb_friction", "torque_offset"]
        .map(|name| Rival { kind: kind(name).expect("a kind"), joint: Some(1), parameters: None })
        .into()
}

fn settings(diagnosis: &Diagnosis) -> ExciteSettings {
    ExciteSettings {
        duration: 10.0,
        candidates: 8,
        seed: 1,
        posture: None,
        reach: 1.0,
        tolerances: Tolerances::default(),
        noise: diagnosis.noise.clone(),
    }
}

#[test]
fn what_one_way_of_turning_leaves_open_the_next_motion_settles() {
    let file = model();
    let seen = measured(&file.arm, &one_way(), 3);
    let before = diagnosed(&file, &seen);
    println!("{:?}: {}", before.verdict, before.statement);
    let knew = before.verdict == Verdict::Named && before.effects[0].kind == "coulomb_friction";
    assert!(!knew, "a joint that turns one way can't tell friction from an offset");

    let mut rivals = rivals();
    rivals[0].parameters = Some(toml::toml! { coulomb = 0.8 });
    let found: Excitation =
        excite(&file, &rivals, Some(&seen), &settings(&before), &mut |_, _, _| {}).expect("a motion");
    let old = found.log_odds_before.as_ref().expect("the recorded motion was weighed")[0];
    println!("log odds {old:.2} as recorded, {:.1} expected; {:?}", found.log_odds[0], found.used);
    assert!(old < 5.0 && found.log_odds[0] > 20.0);
    assert!(found.used.most() <= 1.0 && found.used.most() > 0.1);

    let after = diagnosed(&file, &measured(&file.arm, &found.motion.trajectory(RATE), 4));
    println!("{:?}: {}", after.verdict, after.statement);
    assert_eq!(after.verdict, Verdict::Named);
    let effect = &after.effects[0];
    assert_eq!(effect.joint.as_deref(), Some("elbow"));
    // Friction of equal size in both directions, under either name.
    let names =
        if effect.kind == "coulomb_friction" { vec!["coulomb"] } else { vec!["positive", "negative"] };
    for name in names {
        let size = effect.parameters[name].value.as_float().expect("a number");
        println!("{name} {size:.4} for {HIDDEN}");
        assert!((size / HIDDEN - 1.0).abs() < 0.05);
    }
}

#[test]
fn a_single_cause_or_a_wrong_posture_is_refused() {
    let file = model();
    let plain = settings(&diagnosed(&file, &measured(&file.arm, &one_way(), 5)));
    let single = excite(&file, &rivals()[..1], None, &plain, &mut |_, _, _| {});
    assert!(matches!(single, Err(ExciteError::TooFew)));
    let three = ExciteSettings { posture: Some(vec![0.0; 3]), ..plain };
    let refused = excite(&file, &rivals(), None, &three, &mut |_, _, _| {});
    assert!(matches!(refused, Err(ExciteError::Posture { found: 3, expected: 2 })));
}
