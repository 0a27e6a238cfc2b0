//! Diagnoses of simulated recordings with known missing effects.

use freeplay_arm::{Arm, JointFriction, JointKind};
use freeplay_diagnosis::{
    DiagnoseError, DiagnoseSettings, Diagnosis, Effect, Settings, Verdict, compare, diagnose,
};
use freeplay_laws::{ArmParts, Effects};
use freeplay_model::{ArmFile, EffectTable};
use freeplay_recording::Recording;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use crate::common::{
    Extra, arm, columns, columns_along, even, link, nothing, recording, sines_of_all_but_the_last, without,
};

const FRICTION: JointFriction = JointFriction { viscous: 2.0, coulomb: 1.5 };

fn two_joints() -> Arm {
    arm(vec![link("shoulder", JointKind::Revolute, FRICTION), link("elbow", JointKind::Revolute, FRICTION)])
}

fn nominal_friction(_: usize, v: f64) -> f64 {
    2.0 * v + 1.5 * v.signum()
}

/// 0.8 N·m more dry friction of the elbow than in its file.
fn dry_elbow(joint: usize, v: f64) -> f64 {
    nominal_friction(joint, v) + if joint == 1 { 0.8 * v.signum() } else { 0.0 }
}

fn file(arm: Arm) -> ArmFile {
    ArmFile { arm, effects: Vec::new(), ignored: Vec::new() }
}

/// A recording of `machine` with noise: 0.02 N·m, 1 µrad, 30 µm.
fn measured(machine: &Arm, seconds: f64, extra: Extra, seed: u64) -> Vec<(String, Vec<f64>)> {
    with_noise(columns(machine, &even(seconds, 200.0), extra), seed)
}

fn with_noise(mut made: Vec<(String, Vec<f64>)>, seed: u64) -> Vec<(String, Vec<f64>)> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    for (name, column) in &mut made {
        let deviation = match name.as_str() {
            "t" => continue,
            name if name.starts_with("tau") => 0.02,
            name if name.starts_with('q') => 1e-6,
            _ => 3e-5,
        };
        for x in column {
            *x += deviation * (0..12).map(|_| rng.random_range(-0.5..0.5)).sum::<f64>();
        }
    }
    made
}

fn diagnosed(model: &Arm, recordings: &[Recording]) -> Diagnosis {
    let settings = DiagnoseSettings::default();
    diagnose(&file(model.clone()), recordings, &settings, &mut |_| {}).expect("a diagnosis")
}

/// The value and the 95 % interval of the parameter `name` of `effect`.
fn with_interval(effect: &Effect, name: &str) -> (f64, [f64; 2]) {
    let parameter = &effect.parameters[name];
    (parameter.value.as_float().expect("a number"), parameter.ci95.expect("an interval"))
}

/// A machine within the tolerances of its model.
fn inside(model: &Arm, seed: u64) -> Arm {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut parts = ArmParts::of(model);
    for joint in &mut parts.joints {
        joint.inertia.mass *= 1.0 + 0.02 * rng.random_range(-1.0..1.0);
        joint.inertia.about_com *= 1.0 + 0.02 * rng.random_range(-1.0..1.0);
    }
    parts.into_arm("machine").expect("an arm")
}

#[test]
fn nothing_is_found_in_perfect_recordings() {
    let model = two_joints();
    for seed in 1..=3 {
        let machine = inside(&model, seed);
        let diagnosis = diagnosed(&model, &[recording(measured(&machine, 16.0, nominal_friction, seed))]);
        println!("seed {seed}: {:?}, {}", diagnosis.verdict, diagnosis.statement);
        assert_eq!(diagnosis.verdict, Verdict::NothingMissing, "seed {seed}");
        assert!(diagnosis.effects.is_empty() && diagnosis.model.effects.is_empty());
    }
}

#[test]
fn coulomb_friction_is_named_at_its_joint_with_its_size() {
    let model = two_joints();
    let diagnosis = diagnosed(&model, &[recording(measured(&inside(&model, 7), 20.0, dry_elbow, 7))]);
    println!("{:?}: {}", diagnosis.verdict, diagnosis.statement);
    let [effect] = diagnosis.effects.as_slice() else { panic!("one effect: {:?}", diagnosis.effects) };
    assert_eq!((effect.kind, effect.joint.as_deref()), ("coulomb_friction", Some("elbow")));
    let (value, [low, high]) = with_interval(effect, "coulomb");
    println!("coulomb {value:.4} N*m ({low:.4} to {high:.4}) for 0.8");
    // The nominal 1.5 N·m has a tolerance of 5 %.
    assert!((value - 0.8).abs() < 0.1 && low < 0.8 && 0.8 < high);
    let fit = diagnosis.fit.expect("a fit");
    println!("held out: {:.4} before, {:.4} after", fit.before["tau2"].rmse, fit.after["tau2"].rmse);
    assert!(fit.held_out && fit.after["tau2"].rmse < 0.2 * fit.before["tau2"].rmse);
    assert_eq!(diagnosis.model.effects.len(), 1);
}

/// The command of the elbow swings, its drive pushes with up to 2.5 N·m more than the arm takes, and the elbow stands: dry friction of at least that holds it,
/// and the file has a part of it or none. With the finding the comparison has no residual.
#[test]
fn a_joint_that_stands_although_it_was_told_to_move_is_held() {
    for nominal in [0.0, 1.5] {
        let friction = JointFriction { viscous: 0.0, coulomb: nominal };
        let model = arm(vec![
            link("shoulder", JointKind::Revolute, JointFriction::default()),
            link("elbow", JointKind::Revolute, friction),
        ]);
        let t = even(16.0, 200.0);
        let mut made = columns_along(sines_of_all_but_the_last, &model, &t, nothing);
        let pushed: Vec<f64> = t.iter().map(|t| (2.1 * t).sin()).collect();
        let tau = made.iter_mut().find(|(name, _)| name == "tau2").expect("a torque");
        tau.1.iter_mut().zip(&pushed).for_each(|(tau, pushed)| *tau += 2.5 * pushed);
        let told = [made[1].1.clone(), pushed.iter().map(|pushed| 0.4 * pushed).collect()];
        made = with_noise(made, 5);
        made.extend(told.into_iter().enumerate().map(|(joint, told)| (format!("q_ref{}", joint + 1), told)));
        let recording = recording(made);
        let diagnosis = diagnosed(&model, std::slice::from_ref(&recording));
        println!("{:?}: {}", diagnosis.verdict, diagnosis.statement);
        assert_eq!(diagnosis.verdict, Verdict::Named);
        let [effect] = diagnosis.effects.as_slice() else { panic!("one effect: {:?}", diagnosis.effects) };
        assert_eq!((effect.kind, effect.joint.as_deref()), ("coulomb_friction", Some("elbow")));
        let (least, [low, high]) = with_interval(effect, "coulomb");
        println!("{}: at least {least:.4} N*m for {}", effect.statement, 2.5 - nominal);
        assert!(effect.statement.contains("at least") && effect.statement.contains("stands"));
        assert!(least == low && (2.2 - nominal..2.5 - nominal).contains(&low) && high > 1e3);
        let found = Effects::of(&diagnosis.model).expect("effects").placed;
        let (left, _) = compare(&model, &found, &recording, &Settings::default()).expect("a comparison");
        let error = left.channels.iter().find(|channel| channel.name == "tau2").expect("a channel").rmse;
        println!("left of tau2: {error:.4} N*m");
        assert!(error < 0.1);
    }
}

/// A torque that a drive does not report is not a torque of 0 N·m: it has no finding, and the diagnosis finds the missing effect of the other joint. The model
/// has a part of the machine's effect: the diagnosis names one effect with the sum, and with that effect nothing is missing.
#[test]
fn what_the_model_has_a_part_of_is_changed_and_not_written_twice() {
    let model = two_joints();
    let machine = recording(measured(&model, 16.0, dry_elbow, 7));
    let mut known = file(model);
    known.effects.push(EffectTable {
        kind: "coulomb_friction".to_owned(),
        joint: Some("elbow".to_owned()),
        parameters: toml::Table::from_iter([("coulomb".to_owned(), toml::Value::Float(0.3))]),
        line: 0,
    });
    let again = |file: &ArmFile| {
        diagnose(file, std::slice::from_ref(&machine), &DiagnoseSettings::default(), &mut |_| {})
            .expect("a diagnosis")
    };
    let first = again(&known);
    println!("{}", first.effects[0].statement);
    assert!(first.effects[0].statement.contains("already"));
    let [effect] = &first.model.effects[..] else { panic!("one effect: {:?}", first.model.effects) };
    let coulomb = effect.parameters["coulomb"].as_float().expect("a number");
    assert!((coulomb - 0.8).abs() < 0.02, "{coulomb}");
    let second = again(&first.model);
    assert_eq!(second.verdict, Verdict::NothingMissing, "{}", second.statement);
    assert_eq!(second.model.effects.len(), 1);
}

#[test]
fn a_torque_that_is_stuck_is_no_measurement() {
    let model = two_joints();
    let with_stuck = |stuck: &[&str]| {
        let made = measured(&inside(&model, 7), 20.0, dry_elbow, 7);
        let mut made = ["x", "y", "z"].into_iter().fold(made, without);
        for (_, column) in made.iter_mut().filter(|(name, _)| stuck.contains(&name.as_str())) {
            column
                .iter_mut()
                .enumerate()
                .for_each(|(k, x)| *x = if k % 9 == 0 { 0.1 * x.round() } else { 0.0 });
        }
        diagnosed(&model, &[recording(made)])
    };
    let diagnosis = with_stuck(&["tau1"]);
    println!("{:?}: {} {:?}", diagnosis.verdict, diagnosis.statement, diagnosis.quality);
    let found: Vec<_> =
        diagnosis.effects.iter().map(|effect| (effect.kind, effect.joint.as_deref())).collect();
    assert_eq!(found, [("coulomb_friction", Some("elbow"))]);
    assert!(diagnosis.quality.iter().any(|note| note.contains("not measured: tau1 stays at 0 N*m in 8")));
    assert!(diagnosis.untestable.iter().any(|one| one.because == "tau1 is no measurement"));
    assert_eq!(diagnosis.fit.expect("a fit").before.keys().collect::<Vec<_>>(), ["tau2"]);
    let nothing = with_stuck(&["tau1", "tau2"]);
    println!("{:?}: {}", nothing.verdict, nothing.statement);
    assert_eq!(nothing.verdict, Verdict::InsufficientData);
}

/// While the elbow rests its friction does not show: the recording in which it moves takes part in the fit at any position in the list.
#[test]
fn what_the_last_recording_alone_shows_is_named() {
    let (model, machine) = (two_joints(), inside(&two_joints(), 9));
    let resting =
        with_noise(columns_along(sines_of_all_but_the_last, &machine, &even(16.0, 200.0), dry_elbow), 1);
    let moving = measured(&machine, 16.0, dry_elbow, 2);
    for recordings in [[moving.clone(), resting.clone()], [resting, moving]] {
        let diagnosis = diagnosed(&model, &recordings.map(recording));
        println!("{:?}: {} {:?}", diagnosis.verdict, diagnosis.statement, diagnosis.quality);
        assert_eq!(diagnosis.verdict, Verdict::Named);
        let named: Vec<_> = diagnosis.effects.iter().map(|e| (e.kind, e.joint.as_deref())).collect();
        assert_eq!(named, [("coulomb_friction", Some("elbow"))]);
    }
}

/// For a twentieth of the time a disturbance shakes the elbow, always to the same side: the estimate of the constant offset keeps its size. Least squares would
/// give 0.45 N·m.
#[test]
fn what_shakes_at_times_does_not_bend_the_numbers() {
    const OFFSET: f64 = 0.5;
    const SHAKES: [f64; 8] = [1.1, 3.9, 5.2, 8.6, 10.1, 13.7, 14.8, 18.3];
    let model = two_joints();
    let mut made = measured(&inside(&model, 5), 20.0, nominal_friction, 5);
    let shakes = |t: f64| if SHAKES.iter().any(|s| (0.0..0.125).contains(&(t - s))) { -1.0 } else { 0.0 };
    let t = made[0].1.clone();
    for (name, column) in &mut made {
        if name == "tau2" {
            column.iter_mut().zip(&t).for_each(|(tau, t)| *tau += OFFSET + shakes(*t));
        }
    }
    let diagnosis = diagnosed(&model, &[recording(made)]);
    println!("{:?}: {}", diagnosis.verdict, diagnosis.statement);
    let is_offset = |effect: &&Effect| effect.kind == "torque_offset";
    let effect = diagnosis.effects.iter().find(is_offset).expect("the offset");
    let (value, [low, high]) = with_interval(effect, "offset");
    println!("offset {value:.4} N*m ({low:.4} to {high:.4}) for {OFFSET}");
    assert!((value - OFFSET).abs() < 0.02 * OFFSET && low < OFFSET && OFFSET < high);
}

/// The links are 2 % heavier than in their data sheet, and bend the spring of the elbow accordingly: the estimated stiffness is that of the machine, not 2 %
/// less. Closed form: with the link at θ and the torque τ(θ) behind a spring without inertia, the encoder reads θ + τ/k.
#[test]
fn a_spring_is_as_stiff_as_it_is_under_links_that_are_heavier_than_they_should_be() {
    const STIFFNESS: f64 = 2000.0;
    let joint = |name| link(name, JointKind::Revolute, JointFriction::default());
    let model = arm(vec![joint("shoulder"), joint("elbow")]);
    let mut parts = ArmParts::of(&model);
    parts.joints.iter_mut().for_each(|joint| joint.inertia.mass *= 1.02);
    let machine = parts.into_arm("machine").expect("an arm");
    let mut made = columns(&machine, &even(20.0, 200.0), nothing);
    let of = |made: &[(String, Vec<f64>)], wanted: &str| {
        made.iter().position(|(name, _)| name == wanted).expect("a column")
    };
    let torque = made[of(&made, "tau2")].1.clone();
    let elbow = of(&made, "q2");
    made[elbow].1.iter_mut().zip(torque).for_each(|(q, torque)| *q += torque / STIFFNESS);
    let diagnosis = diagnosed(&model, &[recording(with_noise(made, 4))]);
    println!("{:?}: {}", diagnosis.verdict, diagnosis.statement);
    let [effect] = diagnosis.effects.as_slice() else { panic!("one effect: {:?}", diagnosis.effects) };
    assert_eq!((effect.kind, effect.joint.as_deref()), ("joint_elasticity", Some("elbow")));
    let (value, [low, high]) = with_interval(effect, "stiffness");
    println!("stiffness {value:.1} N*m/rad ({low:.1} to {high:.1}) for {STIFFNESS}");
    assert!((value / STIFFNESS - 1.0).abs() < 0.005 && low < STIFFNESS && STIFFNESS < high);
}

/// Mass errors of up to 2 % leave more than the noise; the model of the diagnosis has the fitted masses.
#[test]
fn the_model_of_a_diagnosis_is_tuned_inside_its_tolerances() {
    let (model, machine) = (two_joints(), inside(&two_joints(), 11));
    let diagnosis = diagnosed(&model, &[recording(measured(&machine, 20.0, dry_elbow, 11))]);
    let later = recording(measured(&machine, 12.0, dry_elbow, 12));
    let error = |file: &ArmFile| {
        let effects = Effects::of(file).expect("effects").placed;
        let (compared, _) = compare(&file.arm, &effects, &later, &Settings::default()).expect("a comparison");
        let of = |name: &str| compared.channels.iter().find(|c| c.name == name).expect("a torque").rmse;
        ["tau1", "tau2"].map(of)
    };
    let untuned = ArmFile { arm: model.clone(), ..diagnosis.model.clone() };
    let (tuned, untuned) = (error(&diagnosis.model), error(&untuned));
    println!("another recording, N*m: {tuned:.4?} tuned, {untuned:.4?} with the effect alone");
    assert!(tuned[0] < 0.7 * untuned[0] && tuned[1] < untuned[1]);
    for (tuned, given) in diagnosis.model.arm.joints().iter().zip(model.joints()) {
        let share = tuned.inertia.mass / given.inertia.mass - 1.0;
        assert!(share.abs() < 0.03, "{}: {:.1} % off", tuned.name, 100.0 * share);
    }
}

#[test]
fn the_same_seed_says_the_same() {
    let model = two_joints();
    let made = [recording(measured(&model, 8.0, nothing, 3))];
    let text = || serde_json::to_string(&diagnosed(&model, &made)).expect("JSON");
    assert_eq!(text(), text());
}

#[test]
fn recordings_that_cannot_tell_say_so() {
    let model = two_joints();
    let short = diagnosed(&model, &[recording(measured(&model, 2.0, nominal_friction, 1))]);
    println!("2 s: {}", short.statement);
    assert_eq!(short.verdict, Verdict::InsufficientData);
    let mut still = measured(&model, 16.0, nominal_friction, 1);
    for (name, column) in &mut still {
        if name.starts_with('q') {
            column.fill(0.3);
        }
    }
    let still = diagnosed(&model, &[recording(still)]);
    println!("still: {}", still.statement);
    assert_eq!(still.verdict, Verdict::Setup);
    assert!(still.setup.iter().any(|finding| finding.kind == "frozen_channel"));
    assert!(still.effects.is_empty());
}

#[test]
fn recordings_that_do_not_fit_are_refused_with_a_reason() {
    let model = two_joints();
    let made = measured(&model, 8.0, nominal_friction, 1);
    let one = arm(vec![link("only", JointKind::Revolute, FRICTION)]);
    let ask = |model: &Arm, recordings: &[Recording]| {
        diagnose(&file(model.clone()), recordings, &DiagnoseSettings::default(), &mut |_| {})
            .map(|diagnosis| diagnosis.verdict)
    };
    let count = ask(&one, &[recording(made.clone())]).expect_err("another number of joints");
    println!("{count}");
    assert!(matches!(count, DiagnoseError::Residual(_)));
    let other =
        ask(&model, &[recording(made.clone()), recording(without(made, "tau"))]).expect_err("other columns");
    println!("{other}");
    assert!(matches!(other, DiagnoseError::DifferentColumns { .. } | DiagnoseError::Residual(_)));
    assert!(matches!(ask(&model, &[]), Err(DiagnoseError::NoRecording)));
}
