//! Trained networks in the real binary: refused for another arm, model or layout, ignored in other modes, and without effect on faults and swaps.

use std::path::Path;

use crate::common::{Call, Ran, fresh_folder};
use freeplay_controller::identity::{identity, model_identity};
use serde_json::{Value, json};

/// Name of the file with the paper's arm without play, in the folder of a test.
const NOMINAL: &str = "nominal.toml";
/// Path at which runs with this model find weights.
const WEIGHTS: &str = "nominal.weights.json";

/// A weight file for the model of `folder`: a network that predicts the deviation by 0.6 mm of play in joint 5 on the paper's paths, where the journal rests
/// 0.6 mm down.
fn weights(folder: &Path) -> Value {
    let file = freeplay_model::load(&folder.join(NOMINAL)).expect("an arm");
    let axis = |lowest: f64| json!({ "lowest": lowest, "highest": 0.0, "share": 1.0, "rms_um": 600.0, "left_um": 10.0, "r": null });
    let (zeros, ones) = ([0.0; 6], [1.0; 6]);
    let mut network: Value =
        serde_json::from_str(include_str!("../controller/tests/linear_network.json")).expect("JSON");
    // The bias of z; seven weights each of x and y come before it.
    let mut weights = [0.0; 21];
    weights[14] = -0.6e-3;
    network["weights"] = json!(weights);
    json!({
        "format": "freeplay.remainder", "version": 2,
        "learned": {
            "machine": { "arm": file.arm.name(), "arm_hash": identity(&file.arm), "model_hash": model_identity(&file), "mode": "torque", "rate": 1000.0,
                         "gains": { "natural_frequency": 50.0, "damping_ratio": 1.0 } },
            "command": "by hand",
            "conditions": [{ "name": "by hand", "duration": 1.0, "rms_um": [0.0, 0.0, 600.0] }],
            "inputs": ["position"],
            "axes": [axis(0.0), axis(0.0), axis(-0.7e-3)],
            "region": { "inputs": ["position"], "gain": ones, "centres": [zeros], "trust": [[100.0, 1.0]] },
        },
        "network": network,
        "receipt": { "proved": true, "chance": 0.001, "runs": [] },
    })
}

/// A folder with the model and its weights.
fn place() -> tempfile::TempDir {
    let place = fresh_folder();
    let urdf = concat!(env!("CARGO_MANIFEST_DIR"), "/../scenarios/arm.urdf");
    std::fs::write(place.path().join(NOMINAL), format!("urdf = \"{urdf}\"\n")).expect("written");
    write(place.path(), &weights(place.path()));
    place
}

fn write(folder: &Path, weights: &Value) {
    std::fs::write(folder.join(WEIGHTS), weights.to_string()).expect("written");
}

/// `freeplay` with `arguments` in `folder`.
fn freeplay(folder: &Path, arguments: &[&str]) -> Ran {
    let mut call = Call::new(fresh_folder(), arguments);
    call.command.current_dir(folder);
    call.run()
}

/// A run of `narx-qp` with the model of `folder` and the keys `sets`.
fn run(folder: &Path, out: &str, sets: &[&str]) -> Ran {
    let mut arguments = vec!["run", "--controller", "narx-qp", "--out", out, "--format", "json"];
    arguments.extend([
        "--set",
        "controller.model=nominal.toml",
        "--set",
        "duration=1",
        "--set",
        "path.period=3",
    ]);
    sets.iter().for_each(|set| arguments.extend(["--set", *set]));
    freeplay(folder, &arguments)
}

fn rms(ran: &Ran) -> f64 {
    let said: Value = serde_json::from_str(&ran.stdout()).expect("JSON");
    said["runs"][0]["deviation_mm"]["rms_after_start"].as_f64().expect("a number")
}

#[test]
fn weights_of_another_arm_model_or_layout_are_refused() {
    let place = place();
    let folder = place.path();
    let good = weights(folder);
    let with = run(folder, "with", &["sensors.track_tool=false"]).expect(0);
    let without = run(folder, "without", &["sensors.track_tool=false", "controller.weights=none"]).expect(0);
    println!("{:.4} mm without, {:.4} mm with weights", rms(&without), rms(&with));
    assert!(rms(&without) > 0.5 && rms(&with) < 0.1, "weights that fit are used");

    let change = |pointer: &str, value: Value| {
        let mut other = good.clone();
        *other.pointer_mut(pointer).expect("a field") = value;
        other
    };
    let other = json!("0123456789abcdef");
    let mut velocities = change("/learned/inputs", json!(["velocity"]));
    velocities["learned"]["region"]["inputs"] = json!(["velocity"]);
    let cases = [
        (change("/learned/machine/arm_hash", other.clone()), "the arm", "0123456789abcdef"),
        (change("/learned/machine/model_hash", other), "the model", "train for it"),
        (velocities, "the inputs", "velocity_1"),
        (change("/network/layers", json!([6, 4, 3])), "weights", "train again"),
        (change("/network/layout/output_lags", json!([0])), "regressors", "the network takes 6"),
        (change("/learned/region/inputs", json!(["elapsed"])), "the region", "train again"),
        (change("/version", json!(1)), "version 1", "train again"),
    ];
    for (number, (weights, what, remedy)) in cases.into_iter().enumerate() {
        write(folder, &weights);
        let ran = run(folder, &format!("refused{number}"), &[]).expect(3);
        let said = ran.stderr();
        println!("{said}");
        assert!(said.contains(what) && said.contains(remedy), "{what}: {}", ran.dump());
    }
}

/// Weights trained in mode torque do not apply to prescribed motion: the run ignores weights beside the model, with a message, and refuses named ones.
#[test]
fn other_modes_do_not_use_what_was_learned_in_mode_torque() {
    let place = place();
    let folder = place.path();
    let driven = run(folder, "driven", &["mode=driven"]).expect(0);
    let plain = run(folder, "plain", &["mode=driven", "controller.weights=none"]).expect(0);
    assert!(driven.stderr().contains("is not used: it was learned in mode torque"), "{}", driven.dump());
    assert!(!plain.stderr().contains("is not used"), "{}", plain.dump());
    assert_eq!(rms(&driven).to_bits(), rms(&plain).to_bits(), "nothing moves");
    let named = run(folder, "named", &["mode=driven", "controller.weights=nominal.weights.json"]).expect(3);
    assert!(named.stderr().contains("Torque") && named.stderr().contains("Driven"), "{}", named.dump());
    let arguments = ["train", "--model", NOMINAL, "--recording", "driven", "plain", "--out", "other.json"];
    let refused = freeplay(folder, &arguments).expect(3);
    assert!(refused.stderr().contains("mode torque"), "{}", refused.dump());
    assert!(!folder.join("other.json").exists());
}

/// The verdicts of an exam or of swaps, without the measured numbers.
fn verdicts(folder: &Path, command: &[&str], more: &[&str]) -> Value {
    let out = if more.is_empty() { "with" } else { "without" };
    let mut arguments = command.to_vec();
    let out = format!("{}-{out}", command[0]);
    arguments.extend([
        "--quiet",
        "--out",
        &out,
        "--format",
        "json",
        "--set",
        "controller.model=nominal.toml",
    ]);
    arguments.extend(more);
    let ran = freeplay(folder, &arguments).expect(0);
    serde_json::from_str(&ran.stdout()).expect("JSON")
}

const NONE: [&str; 2] = ["--set", "controller.weights=none"];

#[test]
fn an_exam_has_the_same_verdicts_with_and_without_weights() {
    let place = place();
    let mut command = vec!["faults", "narx-qp", "--seeds", "1"];
    for kind in ["ok", "nan", "crash", "sign-flip", "stuck"] {
        command.extend(["--kind", kind]);
    }
    let of = |more: &[&str]| {
        let said = verdicts(place.path(), &command, more);
        let verdicts = said["verdicts"].as_array().expect("verdicts");
        let judged = |verdict: &Value| {
            ["kind", "holds", "detected", "bad_applied", "most_held", "slowest"]
                .map(|key| verdict[key].clone())
        };
        verdicts.iter().map(judged).collect::<Vec<_>>()
    };
    let (with, without) = (of(&[]), of(&NONE));
    println!("{with:?}");
    assert!(with.len() == 5 && with.iter().all(|verdict| verdict[1] == true));
    assert_eq!(with, without);
}

#[test]
fn swaps_hold_with_and_without_weights() {
    let place = place();
    let command =
        ["swap", "--controller", "narx-qp", "--controller", "quasi-static", "--swaps", "6", "--per-run", "6"];
    for more in [&[][..], &NONE] {
        let said = verdicts(place.path(), &command, more);
        println!("{:#}", said["verdicts"]);
        assert!(said["swaps"].as_array().is_some_and(|swaps| swaps.len() == 6), "{said:#}");
    }
}
