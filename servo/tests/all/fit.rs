//! Fits of simulated recordings: they recover the true values within their intervals, with any number of threads, and contact does not bias
//! them.
use freeplay_servo::{
    Commands, Course, Fitted, JointServo, Load, ModelParameter, Problem, Rollout, ServoArm, Sight, State,
    Track, Unknown, lag, servos, sights, unknowns,
};

use crate::common::{stamps, two_links};

/// Step of the encoders, rad.
const TICK: f64 = 5e-4;

/// The true servos, unknown to the fit.
fn truth() -> ServoArm {
    let servo = |stiffness: f64, lag: f64, friction: f64| JointServo {
        damping: stiffness * lag,
        coulomb: stiffness * friction,
        stiction: 0.3 * stiffness * friction,
        delay: 0.023,
        stribeck_velocity: 0.03,
        rotor_inertia: 0.01,
        ..JointServo::stiff(stiffness)
    };
    ServoArm::new(two_links(9.81), vec![servo(30.0, 0.06, 0.02), servo(15.0, 0.05, 0.03)])
}

/// A recording of `truth` of `seconds` at 50 Hz with rounded encoders; a contact pushes the first joint aside by `pressed` rad for two
/// seconds.
fn recorded(truth: &ServoArm, seconds: usize, pressed: f64) -> Track {
    let times = stamps(50 * seconds, 0.02);
    let wave = |t: f64, phase: f64| {
        0.4 * (0.7 * t + phase).sin() + 0.25 * (2.3 * t + 2.0 * phase).sin() + 0.1 * (4.9 * t).sin()
    };
    let columns = [0.0, 1.3].map(|phase| times.iter().map(|t| wave(*t, phase)).collect::<Vec<f64>>());
    let commands: Vec<Commands> = columns.iter().map(|column| Commands::new(&times, column)).collect();
    let start = State { q: columns.iter().map(|column| column[0]).collect(), v: vec![0.0; 2] };
    let mut out = vec![0.0; 2 * times.len()];
    let course = Course { commands: &commands, stamps: &times, loads: &[] };
    Rollout::new(truth, 0.001).run(truth, course, &start, &mut out);
    let column = |joint: usize| {
        let rows = out.iter().skip(joint).step_by(2).zip(&times);
        rows.map(|(q, t)| {
            let aside = if joint == 0 && (12.0..14.0).contains(t) { pressed } else { 0.0 };
            ((q + aside) / TICK).round() * TICK
        })
        .collect::<Vec<f64>>()
    };
    Track { measured: vec![column(0), column(1)], commands, stamps: times, loads: Vec::new() }
}

fn problem(track: &Track, threads: usize) -> Problem<'_> {
    Problem {
        tracks: std::slice::from_ref(track),
        windows: track.windows(0.1, 10.0).into_iter().map(|rows| (0, rows)).collect(),
        counted: Vec::new(),
        rounding: vec![TICK / 12.0_f64.sqrt(); 2],
        longest_step: 0.005,
        threads,
    }
}

/// Initial servos for a fit to `track`, half of the lag as delay.
fn first(track: &Track) -> (ServoArm, Vec<Sight>) {
    let arm = two_links(9.81);
    let seen = sights(&arm, std::slice::from_ref(track));
    let servos = servos(&arm, &seen, &[0.5; 2]);
    (ServoArm::new(arm, servos), seen)
}

fn fitted(track: &Track, threads: usize) -> (Vec<Unknown>, Fitted) {
    let problem = problem(track, threads);
    let (model, seen) = first(track);
    let unknowns = unknowns(&seen, &model, 1e-4);
    let fitted = problem.fit(&model, &unknowns, &mut |_, _| ());
    (unknowns, fitted)
}

#[test]
fn servos_come_back_from_a_recording() {
    let truth = truth();
    let track = recorded(&truth, 40, 0.0);
    let (unknowns, fitted) = fitted(&track, 2);
    println!("{} steps, noise {:?}", fitted.steps, fitted.noise.size);
    for (unknown, (value, deviation)) in unknowns.iter().zip(&fitted.values) {
        let true_value = unknown.of(&truth);
        println!(
            "{} {:?}: {value:.5} ± {deviation:.5}, in truth {true_value:.5}",
            unknown.joint, unknown.parameter
        );
        let slack = match unknown.parameter {
            ModelParameter::Stiffness => 0.03,
            ModelParameter::Lag | ModelParameter::Delay => 0.003,
            ModelParameter::Coulomb | ModelParameter::Offset => 0.002,
            // The simulated truth breaks away in steps of 1 ms, the fit in steps of 5 ms.
            ModelParameter::Stiction => 0.003,
            ModelParameter::Rotor => 3e-4,
            _ => 0.0,
        };
        assert!((value - true_value).abs() < slack, "{unknown:?}");
    }
    assert!(fitted.noise.size.iter().all(|size| *size < 3.0 * TICK));
}

#[test]
fn a_contact_does_not_bend_the_fit_and_threads_do_not_change_it() {
    let truth = truth();
    let track = recorded(&truth, 30, 0.2);
    let [(unknowns, one), (_, two)] = [1, 2].map(|threads| fitted(&track, threads));
    assert_eq!(one.values, two.values, "the number of threads shows");
    for (unknown, (value, _)) in unknowns.iter().zip(&one.values) {
        if unknown.parameter == ModelParameter::Stiffness {
            let off = value - unknown.of(&truth);
            println!("logarithm of the stiffness of {} off by {off:.4}", unknown.joint);
            assert!(off.abs() < 0.05);
        }
    }
}

#[test]
fn a_lag_and_a_stiffness_show_before_any_rollout() {
    let truth = truth();
    let track = recorded(&truth, 30, 0.0);
    let seen = sights(&truth.arm, std::slice::from_ref(&track));
    println!("{seen:?}");
    for (sight, joint) in seen.iter().zip(&truth.joints) {
        let expected = joint.delay + joint.damping / joint.stiffness;
        assert!((0.8..1.8).contains(&(sight.lag / expected)), "{sight:?}");
        assert!((sight.tick - TICK).abs() < 1e-9);
        let stiffness = sight.stiffness.unwrap();
        assert!((0.5..2.0).contains(&(stiffness / joint.stiffness)), "{sight:?}");
    }
    let shifted = Track {
        measured: vec![
            (0..track.stamps.len()).map(|row| track.commands[0].between(track.stamps[row] - 0.05)).collect(),
        ],
        commands: vec![track.commands[0].clone()],
        stamps: track.stamps.clone(),
        loads: Vec::new(),
    };
    assert!((lag(&[shifted], 0) - 0.05).abs() < 1e-3);
}

/// A joint alone, under the recorded load from the measured motion of the other, moves as in the whole arm: to a tenth of the load's
/// effect.
#[test]
fn a_joint_alone_moves_as_in_the_arm() {
    let truth = truth();
    let track = recorded(&truth, 30, 0.0);
    let rows = 0..track.stamps.len();
    let size =
        |residual: &[f64]| (residual.iter().map(|r| r * r).sum::<f64>() / residual.len() as f64).sqrt();
    for (joint, alone) in track.by_joint(&truth.arm).into_iter().enumerate() {
        let model = ServoArm::new(truth.arm.clone(), vec![truth.joints[joint]]);
        let off = |track: &Track| size(&track.residual(&model, &mut Rollout::new(&model, 0.005), &rows));
        let unloaded =
            Track { loads: vec![Load { inertia: 1e-6, torque: 0.0 }; rows.len()], ..alone.clone() };
        let (off, without) = (off(&alone), off(&unloaded));
        println!("joint {joint}: {:.3} mrad off alone, {:.3} without its load", 1e3 * off, 1e3 * without);
        assert!(off < 0.1 * without, "{off} {without}");
    }
}

/// The dependence of the droop on the pose distinguishes an unknown payload from softer servos, even with unknown servos.
#[test]
fn a_payload_is_told_by_the_course_of_the_droop() {
    let mut loaded = truth();
    let payload = Unknown {
        joint: 0,
        parameter: ModelParameter::Payload,
        expected: 0.0,
        deviation: 2.0,
        step: 0.06,
        is_torque: false,
        least: f64::NEG_INFINITY,
    };
    payload.set(&mut loaded, 0.4);
    let track = recorded(&loaded, 60, 0.0);
    let tracks = std::slice::from_ref(&track);
    let problem = Problem {
        tracks,
        windows: track.windows(0.1, 10.0).into_iter().map(|rows| (0, rows)).collect(),
        counted: Vec::new(),
        rounding: vec![TICK / 12.0_f64.sqrt(); 2],
        longest_step: 0.005,
        threads: 2,
    };
    let (first, seen) = first(&track);
    let mut believed = unknowns(&seen, &first, 1e-4);
    believed.push(payload);
    let found = problem.fit(&first, &believed, &mut |_, _| {});
    let (mass, deviation) = *found.values.last().unwrap();
    println!("{mass:.3} ± {deviation:.3} kg of 0.4 kg");
    assert!((mass - 0.4).abs() < 4.0 * deviation.max(0.01));
    assert!(mass > 6.0 * deviation, "told from none");
}

/// A diverging simulation explains nothing: the loss of its rows is unbounded, whereas rows without a measurement have no loss.
#[test]
fn a_simulation_without_numbers_explains_nothing() {
    let track = recorded(&truth(), 10, 0.0);
    let mut lost = truth();
    lost.joints[0].damping = f64::NAN;
    let rows = 0..track.stamps.len();
    let residual = track.residual(&lost, &mut Rollout::new(&lost, 0.005), &rows);
    assert!(residual.iter().any(|r| r.is_infinite()));
    let noise = freeplay_servo::Noise::of(
        &[track.residual(&truth(), &mut Rollout::new(&lost, 0.005), &rows)],
        &[TICK; 2],
    );
    assert!(residual.iter().enumerate().map(|(at, r)| noise.loss(at % 2, *r)).sum::<f64>().is_infinite());
}
