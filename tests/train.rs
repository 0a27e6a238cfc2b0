//! A network learns the play that the model lacks on three paths with a tracker, and compensates it on a fourth without one, in the real binary.

use std::path::Path;

use crate::common::{Call, fresh_folder};
use serde_json::Value;

/// A lockstep run of the paper's arm with play under a model without any, in `folder`.
fn run(folder: &Path, controller: &str, out: &str, sets: &[&str]) -> crate::common::Ran {
    let mut arguments = vec!["run", "--quiet", "--controller", controller, "--out", out, "--format", "json"];
    arguments.extend(["--set", "controller.model=nominal.toml", "--set", "path.period=3"]);
    sets.iter().for_each(|set| arguments.extend(["--set", *set]));
    let call = Call::new(fresh_folder(), &arguments);
    let mut call = call;
    call.command.current_dir(folder);
    call.run()
}

fn rms(said: &Value) -> f64 {
    said["runs"][0]["deviation_mm"]["rms_after_start"].as_f64().expect("a number")
}

#[test]
fn what_the_model_leaves_is_learned_proved_and_taken_out() {
    let place = fresh_folder();
    let folder = place.path();
    let urdf = concat!(env!("CARGO_MANIFEST_DIR"), "/../scenarios/arm.urdf");
    std::fs::write(folder.join("nominal.toml"), format!("urdf = \"{urdf}\"\n")).expect("written");
    let paths: [&[&str]; 3] = [
        &["path.kind=lissajous"],
        &["path.kind=lissajous", "path.size=[0.2,0.15,0.1]"],
        &["path.kind=square", "path.size=0.2"],
    ];
    for (number, path) in paths.iter().enumerate() {
        run(folder, "computed-torque", &format!("run{number}"), path).expect(0);
    }
    let mut train = Call::new(
        fresh_folder(),
        &[
            "train",
            "--quiet",
            "--model",
            "nominal.toml",
            "--hidden",
            "6",
            "--format",
            "json",
            "--recording",
            "run0",
            "run1",
            "run2",
        ],
    );
    train.command.current_dir(folder);
    let trained: Value = serde_json::from_str(&train.run().expect(0).stdout()).expect("JSON");
    let receipt = &trained["receipt"];
    println!("{receipt:#}");
    assert_eq!(
        (receipt["proved"].as_bool(), receipt["runs"].as_array().map(Vec::len)),
        (Some(true), Some(3))
    );
    assert!(receipt["chance"].as_f64().is_some_and(|chance| chance < 0.05), "{receipt:#}");
    assert!(folder.join("nominal.weights.json").is_file(), "where runs with this model find it");
    let page = std::fs::read_to_string(folder.join("nominal.weights.html")).expect("a page");
    assert!(
        page.contains("Permitted use of the network") && page.contains("forecast"),
        "what was learned is drawn"
    );

    let fourth = ["path.kind=lissajous", "path.size=[0.12,0.18,0.06]", "sensors.track_tool=false"];
    let played = |more: &[&str], out: &str| {
        let ran = run(folder, "narx-qp", out, &[&fourth, more].concat()).expect(0);
        serde_json::from_str::<Value>(&ran.stdout()).expect("JSON")
    };
    let (without, with) = (played(&["controller.weights=none"], "without"), played(&[], "with"));
    println!("{:.4} -> {:.4} mm, {:#}", rms(&without), rms(&with), with["runs"][0]["learned"]);
    assert!(without["runs"][0]["learned"].is_null());
    assert!(with["runs"][0]["learned"]["inside"].as_f64().expect("a share") > 0.9);
    assert!(rms(&without) > 0.5 && rms(&with) < 0.2 * rms(&without));
    assert!(with["runs"][0]["answers"]["iterated"].is_u64());

    let other = run(folder, "narx-qp", "other", &["controller.gains.natural_frequency=40"]).expect(3);
    assert!(
        other.stderr().contains("natural frequency 50") && other.stderr().contains("train for it"),
        "{}",
        other.dump()
    );
}
