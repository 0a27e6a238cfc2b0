//! Counts the pushes in recordings that a diagnosis finds. The example adds pulses on joints and on the tool to the torques of recordings without a
//! fault, at full bandwidth.
//!
//! `cargo run --release -p freeplay-proof --example pushes -- FOLDER COUNT [SEED]`, with a FOLDER of cases of which some have no effect, in the
//! format of the crate `concealed` (`NNNN/model.toml`, `recording.csv`, `truth/NNNN.json`).
#![allow(clippy::unwrap_used, reason = "an example ends at the first surprise")]

use std::path::{Path, PathBuf};

use freeplay_arm::{Arm, Workspace, jacobian};
use freeplay_diagnosis::{DiagnoseSettings, Diagnosis, Effect, diagnose};
use freeplay_model::ArmFile;
use freeplay_recording::Recording;
use nalgebra::{DMatrix, Vector3};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// A push: on a joint, or on the tool with a force in the base frame.
#[derive(Debug)]
struct Push {
    joint: Option<usize>,
    start: f64,
    end: f64,
    /// N·m on a joint; N on the tool.
    size: Vector3<f64>,
}

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let folder = PathBuf::from(&arguments[0]);
    let count: usize = arguments[1].parse().unwrap();
    let mut rng = ChaCha8Rng::seed_from_u64(arguments.get(2).map_or(1, |seed| seed.parse().unwrap()));
    let cases = faultless(&folder);
    let (mut all, mut found, mut alarms, mut alone) = (0, 0, 0, 0);
    for number in arguments.get(3).map_or(0, |n| n.parse().unwrap())..count {
        let case = &cases[number % cases.len()];
        let file = freeplay_model::load(&case.join("model.toml")).unwrap();
        let recording = freeplay_recording::read(&case.join("recording.csv"), Some(file.arm.dof())).unwrap();
        let plain = run(&file, &recording);
        if number < cases.len() {
            alone += usize::from(!plain.effects.is_empty());
        }
        let floors: Vec<f64> = (1..=file.arm.dof())
            .map(|j| {
                plain.fit.as_ref().unwrap().after.get(&format!("tau{j}")).map_or(1.0, |error| error.rmse)
            })
            .collect();
        let pushes = drawn(&mut rng, &file.arm, &recording, &floors);
        let diagnosis = run(&file, &pushed(&file.arm, &recording, &pushes));
        let same = |effect: &Effect, push: &Push| is_same(effect, push, &file.arm, &recording, &floors);
        let is_found = |push: &&Push| diagnosis.effects.iter().any(|effect| same(effect, push));
        let (missed, right): (Vec<&Push>, Vec<&Push>) = pushes.iter().partition(|push| !is_found(push));
        let is_alarm = |effect: &&Effect| !pushes.iter().any(|push| same(effect, push));
        let wrong: Vec<&Effect> = diagnosis.effects.iter().filter(is_alarm).collect();
        (all, found, alarms) = (all + pushes.len(), found + right.len(), alarms + wrong.len());
        println!("{} {number}: {} of {}", case.display(), right.len(), pushes.len());
        missed.iter().for_each(|push| println!("    missed {push:.3?}"));
        wrong.iter().for_each(|effect| println!("    {}", effect.statement));
    }
    println!(
        "{found} of {all} pushes, {alarms} other findings; {alone} findings in {} recordings without",
        cases.len()
    );
}

/// The cases in `folder` without a missing effect.
fn faultless(folder: &Path) -> Vec<PathBuf> {
    let is_sound = |name: &str| {
        let truth = std::fs::read_to_string(folder.join("truth").join(format!("{name}.json"))).unwrap();
        let truth: serde_json::Value = serde_json::from_str(&truth).unwrap();
        truth["effects"].as_array().is_some_and(Vec::is_empty)
    };
    let names = std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().file_name());
    let mut names: Vec<String> = names.map(|name| name.to_string_lossy().into_owned()).collect();
    names.retain(|name| name.parse::<u32>().is_ok() && is_sound(name));
    names.sort();
    names.iter().map(|name| folder.join(name)).collect()
}

fn run(file: &ArmFile, recording: &Recording) -> Diagnosis {
    diagnose(file, std::slice::from_ref(recording), &DiagnoseSettings::default(), &mut |_| {}).unwrap()
}

/// One to six pushes of 0.05 to 0.5 s, at least half a second apart. In the torque with the largest ratio, each has 2 to 10 times the error of the
/// model.
fn drawn(rng: &mut ChaCha8Rng, arm: &Arm, recording: &Recording, floors: &[f64]) -> Vec<Push> {
    let (first, last) = (recording.t[0], recording.t[recording.len() - 1]);
    let mut pushes: Vec<Push> = Vec::new();
    let count = rng.random_range(1..=6);
    while pushes.len() < count {
        let lasts = rng.random_range(0.05..0.5);
        let start = rng.random_range(first + 0.2..last - 0.2 - lasts);
        if pushes.iter().any(|push| start < push.end + 0.5 && push.start < start + lasts + 0.5) {
            continue;
        }
        let size = rng.random_range(2.0..10.0) * if rng.random_bool(0.5) { 1.0 } else { -1.0 };
        let joint = rng.random_bool(0.5).then(|| rng.random_range(0..arm.dof()));
        let size = match joint {
            Some(joint) => Vector3::x() * size * floors[joint],
            None => {
                let along = Vector3::from_fn(|_, _| rng.random_range(-1.0..1.0)).normalize();
                let row = recording.t.partition_point(|t| *t < start);
                let torques = joint_torques(arm, recording, row, &along);
                let most = torques.iter().zip(floors).map(|(x, floor)| (x / floor).abs());
                along * size / most.fold(0.0, f64::max)
            }
        };
        pushes.push(Push { joint, start, end: start + lasts, size });
    }
    pushes
}

/// Jᵀ f at `row`: the joint torques of a force on the tool.
fn joint_torques(arm: &Arm, recording: &Recording, row: usize, force: &Vector3<f64>) -> Vec<f64> {
    let q: Vec<f64> = recording.q.iter().map(|column| column[row]).collect();
    let mut columns = DMatrix::zeros(6, arm.dof());
    jacobian(arm, &mut Workspace::new(arm), &q, &mut columns);
    (0..arm.dof()).map(|joint| (0..3).map(|axis| columns[(axis, joint)] * force[axis]).sum()).collect()
}

fn pushed(arm: &Arm, recording: &Recording, pushes: &[Push]) -> Recording {
    let mut recording = recording.clone();
    for push in pushes {
        for row in 0..recording.len() {
            if recording.t[row] < push.start || recording.t[row] >= push.end {
                continue;
            }
            let torques = match push.joint {
                Some(joint) => (0..arm.dof()).map(|j| if j == joint { push.size.x } else { 0.0 }).collect(),
                None => joint_torques(arm, &recording, row, &push.size),
            };
            let tau = recording.tau.as_mut().unwrap();
            tau.iter_mut().zip(torques).for_each(|(column, torque)| column[row] -= torque);
        }
    }
    recording
}

/// Returns true if `effect` is `push`: the same place, its times to 0.05 s, its impulse to a quarter in terms of joint torques, because only these
/// act on the arm. For an arm of one joint, a force on the tool equals a torque.
fn is_same(effect: &Effect, push: &Push, arm: &Arm, recording: &Recording, floors: &[f64]) -> bool {
    let number = |name: &str| effect.parameters.get(name).and_then(|p| p.value.as_float());
    let joint = effect.joint.as_ref().and_then(|name| arm.joint_index(name));
    let size = match effect.kind {
        "external_torque" => number("torque").map(|torque| Vector3::x() * torque),
        "external_force" => {
            let force = effect.parameters.get("force").and_then(|p| p.value.as_array());
            let axis = |k: usize| force.and_then(|f| f[k].as_float()).unwrap_or_default();
            Some(Vector3::from_fn(|k, _| axis(k)))
        }
        _ => None,
    };
    let (Some(start), Some(end), Some(size)) = (number("start"), number("end"), size) else { return false };
    let row = recording.t.partition_point(|t| *t < 0.5 * (push.start + push.end));
    let impulses = |joint: Option<usize>, size: &Vector3<f64>, lasts: f64| -> Vec<f64> {
        let torques = match joint {
            Some(joint) => (0..arm.dof()).map(|j| if j == joint { size.x } else { 0.0 }).collect(),
            None => joint_torques(arm, recording, row, size),
        };
        torques.iter().zip(floors).map(|(torque, floor)| lasts * torque / floor).collect()
    };
    let (found, put) =
        (impulses(joint, &size, end - start), impulses(push.joint, &push.size, push.end - push.start));
    let norm = |of: &[f64]| of.iter().map(|x| x * x).sum::<f64>().sqrt();
    let off: Vec<f64> = found.iter().zip(&put).map(|(found, put)| found - put).collect();
    (joint == push.joint || arm.dof() == 1)
        && (start - push.start).abs() < 0.05
        && (end - push.end).abs() < 0.05
        && norm(&off) < 0.25 * norm(&put)
}
