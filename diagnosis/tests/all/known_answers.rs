//! Simulated recordings with known residuals.

use freeplay_arm::{Arm, Inertia, JointFriction, JointKind};
use freeplay_diagnosis::{Comparison, ResidualError, Settings, compare};

use nalgebra::{Matrix3, Vector3};
use proptest::prelude::{ProptestConfig, any, prop, prop_assert, proptest};

use crate::common::{arm, columns, even, jittered, link, nothing, recording, without};

const FRICTION: JointFriction = JointFriction { viscous: 2.0, coulomb: 1.5 };

fn two_joints(friction: JointFriction) -> Arm {
    arm(vec![link("shoulder", JointKind::Revolute, friction), link("elbow", JointKind::Revolute, friction)])
}

fn compared(arm: &Arm, columns: Vec<(String, Vec<f64>)>) -> Comparison {
    compare(arm, &[], &recording(columns), &Settings::default()).expect("a comparison").0
}

/// Largest rmse of the channels whose names start with `prefix`, as a share of the measured size.
fn worst(comparison: &Comparison, prefix: &str) -> f64 {
    let channels = comparison.channels.iter().filter(|channel| channel.name.starts_with(prefix));
    channels.map(|channel| channel.rmse / channel.rms_measured.max(1e-3)).fold(0.0, f64::max)
}

#[test]
fn a_rigid_arm_leaves_nothing() {
    let paper = freeplay_model::paper_arm().arm;
    let slide = arm(vec![link("slide", JointKind::Prismatic, JointFriction::default())]);
    for (name, arm) in [("paper", &paper), ("slide", &slide)] {
        for (stamps, t, most) in [
            ("1 kHz", even(10.0, 1000.0), 2e-6),
            ("250 Hz", even(10.0, 250.0), 2e-5),
            ("125 Hz", even(10.0, 125.0), 1e-4),
            ("500 Hz jittered", jittered(10.0, 500.0), 2e-4),
        ] {
            let comparison = compared(arm, columns(arm, &t, nothing));
            let (torque, tool) = (worst(&comparison, "tau"), worst(&comparison, "x"));
            println!(
                "{name}, {stamps}: torque {torque:.1e}, tool {tool:.1e} of what was measured (margin {most:.0e})"
            );
            assert!(torque < most && tool < most);
            assert!(
                comparison
                    .channels
                    .iter()
                    .all(|channel| channel.rms_measured > 0.0 || channel.name.len() == 1)
            );
        }
    }
}

/// The residual is the friction of the machine, and zero once the model has it.
#[test]
fn friction_is_left_over_until_the_model_names_it() {
    let with_friction = |_: usize, v: f64| 2.0 * v + 1.5 * v.signum();
    let (plain, honest) = (two_joints(JointFriction::default()), two_joints(FRICTION));
    let made = columns(&plain, &even(20.0, 1000.0), with_friction);
    let without = compared(&plain, made.clone());
    let with = compared(&honest, made);
    for (without, with) in without.channels.iter().zip(&with.channels).take(2) {
        println!(
            "{}: rmse {:.4} N*m without friction, {:.4} with, of {:.2} N*m measured",
            with.name, without.rmse, with.rmse, with.rms_measured
        );
        assert!(without.rmse > 1.5, "at least the Coulomb part");
        assert!(without.rmse_without_friction.is_none());
        let same = with.rmse_without_friction.expect("the model names friction");
        assert!((same - without.rmse).abs() < 1e-9, "{same} against {}", without.rmse);
        assert!(with.rmse < 0.005 * without.rmse, "the jump passes the same filter on both sides");
    }
    assert_eq!(
        without.worst().map(|channel| channel.name.as_str()),
        Some("tau2"),
        "the same friction, less torque"
    );
}

/// A joint with an idle drive has only noise in its torque, which no model explains: a note names it, and another channel is the worst, by the ratio of error
/// to noise.
#[test]
fn a_channel_of_noise_is_not_the_worst() {
    let [shoulder, mut elbow] =
        ["shoulder", "elbow"].map(|name| link(name, JointKind::Revolute, JointFriction::default()));
    elbow.inertia = Inertia { mass: 1e-6, com: Vector3::zeros(), about_com: 1e-9 * Matrix3::identity() };
    let arm = arm(vec![shoulder, elbow]);
    // A congruential sequence: uniform between -1 and 1, of the deviation 1/√3.
    let mut state = 1_u64;
    let mut noise = || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 11) as f64 / (1_u64 << 52) as f64 - 1.0
    };
    const NOISE: f64 = 0.05;
    let mut made = columns(&arm, &even(20.0, 1000.0), nothing);
    for (name, column) in &mut made {
        match name.as_str() {
            "tau1" => column.iter_mut().for_each(|tau| *tau = *tau * 1.01 + NOISE * noise()),
            // The elbow carries hardly any load.
            "tau2" => column.iter_mut().for_each(|tau| *tau += NOISE * noise()),
            _ => {}
        }
    }
    let comparison = compared(&arm, made);
    for channel in &comparison.channels {
        println!("{}: off by {:.5}, noise {:.5?}", channel.name, channel.rmse, channel.noise);
    }
    let of_noise: Vec<&str> = comparison.of_noise().map(|channel| channel.name.as_str()).collect();
    assert_eq!(of_noise, ["tau2"]);
    assert_eq!(comparison.worst().map(|channel| channel.name.as_str()), Some("tau1"));
    // White noise of a bandwidth: the share that a forward-backward Butterworth low-pass of order four passes.
    let [tau1, tau2] = [0, 1].map(|index| comparison.channels[index].noise.expect("a noise"));
    let expected = NOISE / 3.0_f64.sqrt() * (2.0 * comparison.lowpass_hz / 1000.0).sqrt();
    for noise in [tau1, tau2] {
        assert!((noise / expected - 1.0).abs() < 0.1, "{noise} against {expected}");
    }
}

#[test]
fn units_follow_the_joints_and_names_the_model() {
    let arm = arm(vec![
        link("lift", JointKind::Prismatic, JointFriction::default()),
        link("turn", JointKind::Revolute, JointFriction::default()),
    ]);
    let mut made = columns(&arm, &even(5.0, 250.0), nothing);
    let encoder = made[2].1.iter().map(|q| q + 1e-3).collect();
    made.push(("q_link2".into(), encoder));
    let comparison = compared(&arm, made);
    let seen: Vec<_> =
        comparison.channels.iter().map(|c| (c.name.as_str(), c.unit, c.joint.as_deref())).collect();
    assert_eq!(
        seen,
        [
            ("tau1", "N", Some("lift")),
            ("tau2", "N*m", Some("turn")),
            ("x", "m", None),
            ("y", "m", None),
            ("z", "m", None),
            ("q_link2", "rad", Some("turn")),
        ]
    );
    let link = &comparison.channels[5];
    println!("link encoder: offset {:.3e} rad, the rest {:.1e} rad", link.mean_error, link.std_error);
    assert!((link.mean_error - 1e-3).abs() < 1e-12 && link.std_error < 1e-12);
    assert_eq!(comparison.channels[3].nrmse_std, None, "the tool never leaves the plane y = 0");
    assert!(comparison.tool_distance().is_some_and(|distance| distance < 1e-6));
}

#[test]
fn the_json_is_what_the_design_says() {
    let arm = two_joints(FRICTION);
    let json = serde_json::to_value(compared(&arm, columns(&arm, &even(5.0, 250.0), nothing))).expect("JSON");
    assert_eq!(json["schema"], "freeplay.compare/1");
    assert!(json["samples"].as_u64().is_some_and(|n| n > 100));
    let channel = &json["channels"][0];
    assert_eq!((&channel["name"], &channel["unit"]), (&"tau1".into(), &"N*m".into()));
    for field in ["rmse", "rms_measured", "nrmse"] {
        assert!(channel[field].as_f64().is_some_and(|x| x > 0.0), "{field}");
    }
    assert!(json["channels"][3]["nrmse"].is_null(), "y is zero throughout");
}

#[test]
fn two_seconds_are_enough_and_a_tenth_is_refused() {
    let arm = two_joints(JointFriction::default());
    let short = compared(&arm, columns(&arm, &even(2.0, 100.0), nothing));
    println!("2 s at 100 Hz: {} points, torque off by {:.1e}", short.samples, worst(&short, "tau"));
    assert!(short.samples > 50 && worst(&short, "tau") < 1e-3);
    let error =
        compare(&arm, &[], &recording(columns(&arm, &even(0.1, 250.0), nothing)), &Settings::default());
    let Err(error @ ResidualError::TooShort { .. }) = error else { panic!("{error:?}") };
    println!("{error}");
}

#[test]
fn gaps_are_not_bridged() {
    let arm = two_joints(JointFriction::default());
    let t: Vec<f64> = even(10.0, 250.0).into_iter().map(|t| if t < 4.0 { t } else { t + 300.0 }).collect();
    let made = recording(columns(&arm, &t, nothing));
    let (comparison, residuals) = compare(&arm, &[], &made, &Settings::default()).expect("a comparison");
    println!(
        "{} points in {:?}, torque off by {:.1e}",
        comparison.samples,
        residuals.stretches,
        worst(&comparison, "tau")
    );
    assert_eq!(residuals.stretches.len(), 2);
    assert_eq!(residuals.stretches[1].end, comparison.samples);
    assert!(worst(&comparison, "tau") < 1e-5);
    assert!(comparison.notes.iter().any(|note| note.contains("1 gap")), "{:?}", comparison.notes);
}

#[test]
fn constant_and_missing_channels_are_told() {
    let arm = two_joints(JointFriction::default());
    let made = columns(&arm, &even(5.0, 250.0), nothing);
    let mut still = made.clone();
    for (name, column) in &mut still[1..] {
        column.fill(if name == "tau2" { 0.0 } else { 0.3 });
    }
    let comparison = compared(&arm, still);
    let tau2 = &comparison.channels[1];
    assert_eq!((tau2.nrmse, tau2.nrmse_std), (None, None));
    assert!(comparison.channels[0].nrmse.is_some() && comparison.channels[0].nrmse_std.is_none());
    assert!(
        comparison
            .notes
            .iter()
            .any(|note| note.contains("constant in this recording") && note.contains("tau2"))
    );
    let tool_only = compared(&arm, without(made.clone(), "tau"));
    assert_eq!(tool_only.channels.len(), 3);
    assert!(tool_only.notes.iter().any(|note| note.contains("no torque")), "{:?}", tool_only.notes);
    let nothing_left = ["tau", "x", "y", "z"].into_iter().fold(made, without);
    let error =
        compare(&arm, &[], &recording(nothing_left), &Settings::default()).expect_err("nothing to compare");
    println!("{error}");
    assert!(matches!(error, ResidualError::NothingToCompare { joints: 2, .. }));
}

#[test]
fn a_recording_of_another_arm_is_refused_and_degrees_are_suspected() {
    let arm = two_joints(JointFriction::default());
    let three = columns(&freeplay_model::paper_arm().arm, &even(2.0, 250.0), nothing);
    let error = compare(&arm, &[], &recording(three), &Settings::default()).expect_err("six joints");
    println!("{error}");
    assert!(matches!(error, ResidualError::JointCount { expected: 2, found: 6, .. }));
    let mut degrees = columns(&arm, &even(5.0, 250.0), nothing);
    degrees[1].1.iter_mut().for_each(|q| *q = q.to_degrees());
    let notes = compared(&arm, degrees).notes;
    assert!(notes.iter().any(|note| note.contains("degrees")), "{notes:?}");
}

#[test]
fn numbers_beyond_reason_are_errors() {
    let arm = two_joints(JointFriction::default());
    let made = columns(&arm, &even(5.0, 250.0), nothing);
    let compare_with = |settings| compare(&arm, &[], &recording(made.clone()), &settings).map(|_| ());
    for lowpass_hz in [0.0, -3.0, 126.0, f64::NAN, f64::INFINITY] {
        let error = compare_with(Settings { lowpass_hz: Some(lowpass_hz), trim_s: None });
        assert!(matches!(error, Err(ResidualError::Cutoff { .. })), "{lowpass_hz}: {error:?}");
    }
    for (trim_s, ok) in
        [(0.0, true), (2.0, true), (2.5, false), (-1.0, false), (f64::NAN, false), (1e300, false)]
    {
        let result = compare_with(Settings { lowpass_hz: None, trim_s: Some(trim_s) });
        assert_eq!(result.is_ok(), ok, "{trim_s}: {result:?}");
    }
    let mut huge = made.clone();
    huge[1].1.iter_mut().for_each(|q| *q *= 1e200);
    let error = compare(&arm, &[], &recording(huge), &Settings::default()).expect_err("no such torque");
    println!("{error}");
    assert!(matches!(error, ResidualError::NotFinite { .. }));
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 300, failure_persistence: None, ..ProptestConfig::default() })]

    /// For any stamps, values and settings, the result is an error or finite numbers, and never more points than samples. More than a quarter of the cases give
    /// a comparison, the others an error.
    #[test]
    fn any_recording_gives_finite_numbers_or_an_error(
        steps in prop::collection::vec((-9.0..3.0_f64, any::<bool>()), 1..400),
        size in -300.0..300.0_f64,
        lowpass_hz in prop::option::of(-1.0..1e3_f64),
        trim_s in prop::option::of(-0.1..2.0_f64),
    ) {
        let arm = two_joints(FRICTION);
        let mut t = vec![0.0];
        for (exponent, regular) in &steps {
            t.push(t[t.len() - 1] + if *regular { 0.01 } else { 10_f64.powf(*exponent) });
        }
        let value = |k: usize| (k as f64 * 1.7).sin() * 10_f64.powf(size);
        let columns = ["q1", "q2", "tau1", "tau2", "q_link2"].map(|name| (name.into(), (0..t.len()).map(value).collect()));
        let recording = recording(std::iter::once(("t".into(), t.clone())).chain(columns).collect());
        if let Ok((comparison, _)) = compare(&arm, &[], &recording, &Settings { lowpass_hz, trim_s }) {
            prop_assert!(comparison.samples > 0 && comparison.samples <= t.len() + 1, "{}", comparison.samples);
            prop_assert!(comparison.channels.iter().all(|channel| channel.rmse.is_finite()));
        }
    }
}
