//! Weights for another arm, of another layout, or broken: refused by name.

#![allow(clippy::unwrap_used, reason = "a test ends at the first surprise")]

use std::fmt::Write as _;

use freeplay_arm::paper_arm;
use freeplay_controller::features::{OUTPUTS, REGRESSORS};
use freeplay_controller::identity::identity;
use freeplay_controller::learned::check;
use freeplay_controller::{Controller, NarxQp, RunInfo, Task};
use freeplay_predictor::Narx;
use freeplay_shm::{Mode, Pace};

/// A weight file for the paper's arm, of a linear network that says nothing.
fn weights() -> String {
    let names = |names: &[&str]| format!("{names:?}");
    let width = REGRESSORS.len();
    let list = |value: &str, count: usize| vec![value; count].join(",");
    let mut text = String::from("{\"format\": \"freeplay.narx\", \"version\": 1, ");
    let hash = identity(&paper_arm().arm);
    let _ = write!(
        text,
        "\"provenance\": {{\"arm\": \"paper\", \"arm_hash\": \"{hash}\", \"command\": \"by hand\"}}, \
         \"inputs\": {}, \"outputs\": {}, \"layout\": {{\"input_lags\": [0], \"output_lags\": [], \"horizon\": 3, \
         \"input_at_target\": false}}, \"layers\": [{width}, 2], \"activation\": \"tanh\", \
         \"input_scaling\": {{\"minimum\": [{}], \"gain\": [{}]}}, \
         \"output_scaling\": {{\"minimum\": [-1, -1], \"gain\": [1, 1]}}, \"weights\": [{}]}}",
        names(&REGRESSORS),
        names(&OUTPUTS),
        list("0", width),
        list("1", width),
        list("0", 2 * (width + 1)),
    );
    text
}

fn start(text: &str) -> Result<(), String> {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("w.json");
    std::fs::write(&file, text).unwrap();
    let mut task = Task::default();
    task.options.insert("weights".to_owned(), file.display().to_string().into());
    let run =
        RunInfo { joints: 6, mode: Mode::Torque, pace: Pace::Lockstep, period_ns: 1_000_000, ticks: 10 };
    let said = NarxQp::default().start(&task, &run).map_err(|error| error.to_string());
    println!("{said:?}");
    said
}

#[test]
fn weights_that_fit_are_taken_and_others_are_refused_by_name() {
    let good = weights();
    assert_eq!(start(&good), Ok(()));
    let refused = |from: &str, to: &str, words: &[&str]| {
        assert!(good.contains(from), "{from}");
        let said = start(&good.replacen(from, to, 1)).unwrap_err();
        assert!(words.iter().all(|word| said.contains(word)), "{said}");
    };
    let hash = identity(&paper_arm().arm);
    refused(&hash, "0123456789abcdef", &["trained on arm", "0123456789abcdef", "train for this arm"]);
    refused(
        "\"error_n_0\"",
        "\"torque\"",
        &["input channels", "channel 1 of 26 is `torque`, not `error_n_0`", "train with"],
    );
    refused("\"horizon\": 3", "\"horizon\": 99", &["predict 99 ahead", "train with this program"]);
    refused("\"version\": 1", "\"version\": 2", &["version 2", "train again"]);
    refused("\"weights\": [0,", "\"weights\": [null,", &["w.json", "weight 0 is not a finite number"]);
    refused("\"weights\": [0,", "\"weights\": [", &["w.json", "weights"]);
    assert!(start("").unwrap_err().contains("w.json"));
    let elsewhere = good.replacen("\"by hand\"", "\"by hand\", \"joint\": \"joint_3\"", 1);
    let narx = Narx::from_json(&elsewhere, "w.json").unwrap();
    let said = |joint: &str| check(&narx, &paper_arm().arm, Some(joint)).map_err(|error| error.to_string());
    assert_eq!(said("joint_3"), Ok(()));
    assert!(
        said("joint_5").unwrap_err().contains("play in `joint_3`, not in `joint_5`: train for this joint")
    );
    let mut task = Task::default();
    task.options.insert("weights".to_owned(), "/nowhere/w.json".into());
    let run =
        RunInfo { joints: 6, mode: Mode::Torque, pace: Pace::Lockstep, period_ns: 1_000_000, ticks: 10 };
    let said = NarxQp::default().start(&task, &run).unwrap_err().to_string();
    assert!(said.contains("/nowhere/w.json") && said.contains("train to make the file"), "{said}");
}

#[test]
fn an_identity_survives_writing_and_reading_and_tells_arms_apart() {
    let file = paper_arm();
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("arm.toml");
    std::fs::write(&path, freeplay_arm::to_toml(&file)).unwrap();
    let again = freeplay_arm::load(&path).unwrap().arm;
    assert_eq!(identity(&file.arm), identity(&again));
    let mut joints = file.arm.joints().to_vec();
    joints[2].inertia.mass *= 1.001;
    let other = freeplay_arm::Arm::new("other", joints, *file.arm.tool(), *file.arm.gravity()).unwrap();
    assert_ne!(identity(&file.arm), identity(&other));
}
