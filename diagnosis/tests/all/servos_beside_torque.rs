//! Commanded and measured positions with torques: the diagnosis names servos where they produce the torques from the commands, and nowhere else; the findings
//! from the torques stay unchanged.
use std::path::Path;

use freeplay_arm::{Arm, JointFriction, JointKind};
use freeplay_diagnosis::{
    DiagnoseSettings, Diagnosis, Effect, Settings, Verdict, compare_all, compare_commands, diagnose,
};
use freeplay_laws::Effects;
use freeplay_model::{ArmFile, parse_toml, to_toml};
use freeplay_recording::Recording;
use freeplay_servo::{Commands, Course, Rollout, ServoArm, State};

use crate::common::{TWO_LINKS, arm, columns, even, link, recording, without};

/// Their servos: stiffness, damping.
const SERVOS: [(&str, f64, f64); 2] = [("shoulder", 30.0, 1.8), ("elbow", 15.0, 0.7)];
const FRICTION: f64 = 0.2;
/// Step of the machine, s, and steps per row: a command holds for a row, and drives measure the mean torque about it.
const STEP: f64 = 0.001;
const ROW: usize = 5;
const ROWS: usize = 4000;

/// The machine with commands delayed by `delay` s.
fn machine(delay: f64) -> ArmFile {
    let mut text = TWO_LINKS.to_owned();
    for (joint, stiffness, damping) in SERVOS {
        text += &format!(
            "[[effect]]\nkind = \"servo\"\njoint = \"{joint}\"\nstiffness = {stiffness}\ndamping = {damping}\n"
        );
        text +=
            &format!("[[effect]]\nkind = \"coulomb_friction\"\njoint = \"{joint}\"\ncoulomb = {FRICTION}\n");
        if delay > 0.0 {
            text += &format!("[[effect]]\nkind = \"command_delay\"\njoint = \"{joint}\"\ndelay = {delay}\n");
        }
    }
    parse_toml(&text, "arm.toml".as_ref()).unwrap()
}

/// A recording at 200 Hz of `machine`, with its encoders delayed by `late` steps.
fn recorded(machine: &ArmFile, name: &str, phase: f64, late: usize) -> Recording {
    let truth = ServoArm::of(machine).unwrap().unwrap();
    let fine: Vec<f64> = (0..ROWS * ROW).map(|step| step as f64 * STEP).collect();
    let wave = |t: f64, joint: f64| {
        0.3 * ((0.9 - 0.1 * joint) * t + phase + joint).sin()
            + 0.2 * ((2.3 + 0.3 * joint) * t + 2.0 * phase).sin()
    };
    let held =
        |joint: usize| (0..fine.len()).map(move |step| wave((step / ROW * ROW) as f64 * STEP, joint as f64));
    let commanded: Vec<Vec<f64>> = (0..2).map(|joint| held(joint).collect()).collect();
    let commands: Vec<Commands> = commanded.iter().map(|column| Commands::new(&fine, column)).collect();
    let start = State { q: commanded.iter().map(|column| column[0]).collect(), v: vec![0.0; 2] };
    let mut out = vec![0.0; 2 * fine.len()];
    let course = Course { commands: &commands, stamps: &fine, loads: &[] };
    Rollout::new(&truth, STEP).run(&truth, course, &start, &mut out);
    let torque = |step: usize, joint: usize| {
        let (before, after) = (step.saturating_sub(1), (step + 1).min(fine.len() - 1));
        let v = (out[2 * after + joint] - out[2 * before + joint]) / ((after - before) as f64 * STEP);
        let servo = &truth.joints[joint];
        let (from, to) = (fine[step] - 0.5 * STEP, fine[step] + 0.5 * STEP);
        let mut cursor = commands[joint].cursor(from - servo.delay);
        servo.torque(commands[joint].mean(&mut cursor, servo, from, to) - out[2 * step + joint], v)
    };
    let steps = || (0..ROWS).map(|row| row * ROW);
    let mut all = vec![("t".to_owned(), steps().map(|step| fine[step]).collect::<Vec<f64>>())];
    for (joint, commanded) in commanded.iter().enumerate() {
        let read = |step: usize| (out[2 * step.saturating_sub(late) + joint] / 1e-4).round() * 1e-4;
        let mean = |step: usize| {
            let about = step.saturating_sub(ROW / 2)..(step + ROW / 2 + 1).min(fine.len());
            let count = about.len() as f64;
            about.map(|step| torque(step, joint)).sum::<f64>() / count
        };
        let number = joint + 1;
        all.push((format!("q{number}"), steps().map(read).collect()));
        // The last digits of a current are noise.
        let noisy =
            |step: usize| mean(step) + 2e-3 * ((step * 7919 + joint * 104_729) % 1000) as f64 / 1000.0;
        all.push((format!("tau{number}"), steps().map(noisy).collect()));
        all.push((format!("q_ref{number}"), steps().map(|step| commanded[step]).collect()));
    }
    Recording::new(Path::new(name), all).unwrap()
}

fn diagnosed(file: &ArmFile, recordings: &[Recording]) -> Diagnosis {
    let diagnosis = diagnose(file, recordings, &DiagnoseSettings::default(), &mut |_| ()).unwrap();
    println!("{:?}: {}", diagnosis.verdict, diagnosis.statement);
    diagnosis.effects.iter().for_each(|effect| println!("- {}", effect.statement));
    diagnosis
}

fn all_of<'a>(diagnosis: &'a Diagnosis, kind: &str) -> Vec<&'a Effect> {
    diagnosis.effects.iter().filter(|effect| effect.kind == kind).collect()
}

fn number(effect: &Effect, name: &str) -> f64 {
    effect.parameters[name].value.as_float().unwrap()
}

/// `recording` without its commands.
fn without_commands(recording: &Recording) -> Recording {
    Recording { q_ref: None, ..recording.clone() }
}

/// Delayed commands: the diagnosis names both servos and the delay, the model simulates the recording, and the findings from the torques are those without
/// commands.
#[test]
fn servos_and_late_commands_are_named() {
    let bare = parse_toml(TWO_LINKS, "arm.toml".as_ref()).unwrap();
    let recordings =
        [("a.csv", 0.0), ("b.csv", 1.7)].map(|(name, phase)| recorded(&machine(0.02), name, phase, 0));
    let diagnosis = diagnosed(&bare, &recordings);
    assert_eq!(all_of(&diagnosis, "servo").len(), 2);
    for ((_, stiffness, damping), servo) in SERVOS.into_iter().zip(SERVOS.map(|(joint, ..)| {
        diagnosis.effects.iter().find(|e| e.kind == "servo" && e.joint.as_deref() == Some(joint)).unwrap()
    })) {
        assert!((number(servo, "stiffness") / stiffness - 1.0).abs() < 0.01);
        assert!((number(servo, "damping") / damping - 1.0).abs() < 0.02);
    }
    let delays = all_of(&diagnosis, "command_delay");
    assert_eq!(delays.len(), 2);
    assert!(delays.iter().all(|delay| (number(delay, "delay") - 0.02).abs() < 1e-3));
    assert!(all_of(&diagnosis, "time_delay").is_empty());
    let alone = diagnosed(&bare, &recordings.each_ref().map(without_commands));
    let count = alone.effects.len();
    assert_eq!(
        serde_json::to_value(&diagnosis.effects[..count]).unwrap(),
        serde_json::to_value(&alone.effects).unwrap()
    );
    let (with, of_torque) = (diagnosis.fit.as_ref().unwrap(), alone.fit.as_ref().unwrap());
    assert!(of_torque.after.iter().all(|(channel, error)| with.after[channel] == *error));
    assert!(with.after["q1"].rmse < 0.1 * with.retuned["q1"].rmse, "{:?}", with.after);
    assert!(
        diagnosis.passages.iter().all(|passage| passage.traces.iter().any(|trace| trace.channel == "q2"))
    );
    let again = parse_toml(&to_toml(&diagnosis.model), "found.toml".as_ref()).unwrap();
    let (simulated, _) = compare_commands(&again, &recordings[0]).unwrap();
    assert!(simulated.channels.iter().all(|channel| channel.rmse < 3e-3), "{:?}", simulated.channels);
    // If the model has servos, a comparison of torques includes these positions; a model without servos does not predict them.
    let compared = |file| {
        let effects = Effects::of(file).unwrap().placed;
        let (all, residuals) = compare_all(file, &effects, &recordings[0], &Settings::default()).unwrap();
        let names: Vec<String> = residuals.iter().flat_map(|r| &r.channels).map(|c| c.name.clone()).collect();
        assert!(names.iter().eq(all.channels.iter().map(|channel| &channel.name)));
        all.channels
    };
    let (all, torques) = (compared(&again), compared(&bare));
    assert_eq!(all[all.len() - 2..], simulated.channels);
    assert_eq!(all.len(), torques.len() + 2);
}

/// Delayed encoders differ from delayed commands: the torques don't fit the motion either.
#[test]
fn late_encoders_are_no_late_commands() {
    let bare = parse_toml(TWO_LINKS, "arm.toml".as_ref()).unwrap();
    let recordings =
        [("a.csv", 0.0), ("b.csv", 1.7)].map(|(name, phase)| recorded(&machine(0.0), name, phase, 10));
    let diagnosis = diagnosed(&bare, &recordings);
    assert_eq!(all_of(&diagnosis, "time_delay").len(), 1);
    assert_eq!(all_of(&diagnosis, "servo").len(), 2);
    assert!(all_of(&diagnosis, "command_delay").is_empty());
    // The resulting model includes the delay of the encoders.
    let (simulated, _) = compare_commands(&diagnosis.model, &recordings[0]).unwrap();
    assert!(simulated.channels.iter().all(|channel| channel.rmse < 3e-3), "{:?}", simulated.channels);
}

/// A model with the right servos gets no others.
#[test]
fn known_servos_are_not_named_again() {
    let machine = machine(0.02);
    let recordings = [recorded(&machine, "a.csv", 0.0, 0)];
    let diagnosis = diagnosed(&machine, &recordings);
    assert!(all_of(&diagnosis, "servo").is_empty() && all_of(&diagnosis, "command_delay").is_empty());
    assert_eq!(diagnosis.verdict, Verdict::NothingMissing);
    let of_file: Vec<_> = machine.effects.iter().filter(|table| table.kind == "servo").collect();
    let of_model: Vec<_> = diagnosis.model.effects.iter().filter(|table| table.kind == "servo").collect();
    assert_eq!(of_model, of_file);
}

/// The path of a controller that knows the arm: unknown friction displaces the joints, and no servo produces such torques. The diagnosis draws no conclusion
/// from the commands.
#[test]
fn a_path_under_computed_torques_is_no_command() {
    const FRICTION: f64 = 2.0;
    const FEEDBACK: f64 = 800.0;
    let made: Arm = arm(vec![
        link("one", JointKind::Revolute, JointFriction::default()),
        link("two", JointKind::Revolute, JointFriction::default()),
    ]);
    let file = ArmFile { arm: made.clone(), effects: Vec::new(), ignored: Vec::new() };
    let mut all = without(
        without(without(columns(&made, &even(20.0, 200.0), |_, v| FRICTION * v.signum()), "x"), "y"),
        "z",
    );
    for joint in 1..=2 {
        let column = |name: String| all.iter().find(|(other, _)| *other == name).unwrap().1.clone();
        let q = column(format!("q{joint}"));
        let error = |row: usize| {
            FRICTION / FEEDBACK * (q[(row + 1).min(q.len() - 1)] - q[row.saturating_sub(1)]).signum()
        };
        all.push((format!("q_ref{joint}"), (0..q.len()).map(|row| q[row] + error(row)).collect()));
    }
    let with = recording(all);
    let alone = diagnosed(&file, &[without_commands(&with)]);
    assert!(!alone.effects.is_empty());
    let diagnosis = diagnosed(&file, &[with]);
    assert_eq!(serde_json::to_value(&diagnosis).unwrap(), serde_json::to_value(&alone).unwrap());
}
