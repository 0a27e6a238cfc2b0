//! Tests of a learned remainder in the controller: it is compensated only if proved and only inside the trained region; weights for another
//! machine are refused.

use std::path::Path;

use freeplay_arm::{Workspace, forward_kinematics};
use freeplay_controller::compensation::Motion;
use freeplay_controller::identity::{identity, model_identity};
use freeplay_controller::remainder::{
    Axis, Condition, InputGroup, Learned, Machine, Region, Remainder, WeightFile,
};
use freeplay_controller::{Answer, Controller, NarxQp, RunInfo, Task, TaskMode};
use freeplay_model::paper_arm;
use freeplay_path::JointPath;
use freeplay_predictor::Narx;
use freeplay_shm::{Mode, Pace, State};
use nalgebra::Vector3;

const PERIOD: f64 = 1e-3;
/// Constant output of the network, m.
const SAID: [f64; 3] = [0.3e-3, -0.2e-3, 0.1e-3];

fn task() -> Task {
    Task { mode: TaskMode::Driven, ..Task::default() }
}

fn machine() -> Machine {
    let file = paper_arm();
    Machine::of(file.arm.name(), identity(&file.arm), model_identity(&file), &task())
}

/// A linear network of the six positions with the constant output [`SAID`].
fn network() -> Narx {
    let mut text: serde_json::Value = serde_json::from_str(include_str!("../linear_network.json")).unwrap();
    let weights = SAID.iter().flat_map(|said| [vec![*said], vec![0.0; 6]].concat());
    text["weights"] = weights.collect();
    Narx::from_json(&text.to_string(), "by hand").unwrap()
}

/// Weights around the joints `centre`, with a trust of 0.5 at the distance 1 (rad) and none beyond 2.
fn weights(centre: &[f64], share: f64) -> WeightFile {
    let axis = || Axis { lowest: -0.25e-3, highest: 0.25e-3, share, rms_um: 1.0, left_um: 0.1, r: Some(0.9) };
    let condition = Condition { name: "by hand".to_owned(), duration: 1.0, rms_um: [1.0; 3] };
    let learned = Learned {
        machine: machine(),
        command: "by hand".to_owned(),
        conditions: vec![condition],
        inputs: vec![InputGroup::Position],
        axes: [axis(), axis(), axis()],
        region: Region {
            inputs: vec![InputGroup::Position],
            gain: vec![1.0; 6],
            centres: vec![centre.to_vec()],
            trust: vec![[0.5, 1.0], [1.0, 0.5], [2.0, 0.0]],
        },
    };
    let mut file = WeightFile::new(&network(), learned).unwrap();
    file.receipt.proved = true;
    file
}

fn saved(file: &WeightFile, folder: &Path) -> String {
    let path = folder.join("w.json");
    std::fs::write(&path, file.to_json().unwrap()).unwrap();
    path.display().to_string()
}

const RUN: RunInfo =
    RunInfo { joints: 6, mode: Mode::Driven, pace: Pace::Lockstep, period_ns: 1_000_000, ticks: 2000 };

/// Displacement of the tool from the reference by the commanded joints after `ticks` ticks, m.
fn moved(weights: Option<String>, ticks: u64) -> Vector3<f64> {
    let arm = paper_arm().arm;
    let task = Task { weights, ..task() };
    let mut controller = NarxQp::default();
    controller.start(&task, &RUN).unwrap();
    let path = JointPath::plan(&arm, &task.path, task.rate).unwrap();
    let mut state = State::new(1, 6);
    let at = |tick: u64, reference: &mut freeplay_shm::Reference| {
        let (q, v, a) = (&mut reference.q[..6], &mut reference.qd[..6], &mut reference.qdd[..6]);
        path.at(tick as f64 * PERIOD, q, v, a);
    };
    let mut answer = Answer::BLANK;
    for tick in 0..ticks {
        state.tick = tick;
        at(tick, &mut state.reference);
        at(tick + 2, &mut state.reference_next);
        state.q = state.reference.q;
        answer = Answer::BLANK;
        controller.answer(&state, &mut answer);
    }
    let mut workspace = Workspace::new(&arm);
    let mut tool = |q: &[f64]| forward_kinematics(&arm, &mut workspace, q).translation.vector;
    tool(&answer.value[..6]) - tool(&state.reference_next.q[..6])
}

fn start_of_path() -> Vec<f64> {
    let arm = paper_arm().arm;
    let path = JointPath::plan(&arm, &task().path, 1000.0).unwrap();
    let (mut q, mut v, mut a) = (vec![0.0; 6], vec![0.0; 6], vec![0.0; 6]);
    path.at(0.0, &mut q, &mut v, &mut a);
    q
}

/// The network gives 0.3, −0.2 and 0.1 mm; the bounds limit the first to 0.25; the share halves all; the correction moves the tool the
/// opposite way.
#[test]
fn a_proved_remainder_is_taken_out_within_its_bounds() {
    let folder = tempfile::tempdir().unwrap();
    let centre = start_of_path();
    let expected = -Vector3::new(0.25e-3, -0.2e-3, 0.1e-3);
    for share in [1.0, 0.5] {
        let found = moved(Some(saved(&weights(&centre, share), folder.path())), 600);
        let off = (found - expected * share).norm();
        println!("share {share}: moved by {found:?}, off by {off:.2e} m");
        assert!(off < 2e-6);
    }
    let mut unproved = weights(&centre, 1.0);
    unproved.receipt.proved = false;
    assert!(
        moved(Some(saved(&unproved, folder.path())), 600).norm() < 1e-9,
        "what is not proved moves nothing"
    );
    assert!(moved(None, 600).norm() < 1e-9);
    let far: Vec<f64> = centre.iter().map(|q| q + 3.0).collect();
    assert!(
        moved(Some(saved(&weights(&far, 1.0), folder.path())), 600).norm() < 1e-9,
        "nothing far from what trained"
    );
}

#[test]
fn the_remainder_fades_with_the_distance_and_allocates_nothing() {
    let arm = paper_arm().arm;
    let mut remainder = Remainder::new(&weights(&[0.0; 6], 1.0), &arm, PERIOD).unwrap();
    let zeros = [0.0; 6];
    let mut at = |tick: u64, q: f64| {
        let q = [q, 0.0, 0.0, 0.0, 0.0, 0.0];
        remainder.at(tick, Motion { q: &q, v: &zeros, a: &zeros }).x
    };
    let found: Vec<f64> =
        [0.2, 0.75, 1.0, 1.5, 2.5, f64::NAN].iter().zip(0..).map(|(q, k)| at(k, *q)).collect();
    let expected = [1.0, 0.75, 0.5, 0.25, 0.0, 0.0].map(|trust| trust * 0.25e-3);
    println!("{found:?}");
    assert!(found.iter().zip(expected).all(|(found, expected)| (found - expected).abs() < 1e-12));
    let mut sum = 0.0;
    let counted = allocation_counter::measure(|| (10..1000).for_each(|tick| sum += at(tick, 0.1)));
    assert!(sum > 0.0 && counted.count_total == 0);
    let usage = remainder.usage();
    assert_eq!((usage.instants, usage.outside, usage.not_finite), (996, 2, 0));
}

#[test]
fn weights_for_something_else_are_refused_by_name() {
    let folder = tempfile::tempdir().unwrap();
    let good = weights(&start_of_path(), 1.0);
    let said = |file: &WeightFile, task: Task| {
        let task = Task { weights: Some(saved(file, folder.path())), ..task };
        NarxQp::default().start(&task, &RUN).map_err(|error| error.to_string())
    };
    assert_eq!(said(&good, task()), Ok(()));
    let mut gains = task();
    gains.gains.natural_frequency = 30.0;
    let (mut arm, mut model, mut inputs) = (good.clone(), good.clone(), good.clone());
    arm.learned.machine.arm_hash = "0123456789abcdef".to_owned();
    model.learned.machine.model_hash = "0123456789abcdef".to_owned();
    inputs.learned.inputs = vec![InputGroup::Velocity];
    inputs.learned.region.inputs = vec![InputGroup::Velocity];
    let cases = [
        (said(&arm, task()), ["the arm", "0123456789abcdef", "by hand"]),
        (said(&model, task()), ["the model", "0123456789abcdef", "train for it"]),
        (said(&good, gains), ["natural frequency 50", "natural frequency 30", "w.json"]),
        (said(&inputs, task()), ["the inputs", "position_1", "velocity_1"]),
    ];
    for (said, words) in cases {
        let said = said.unwrap_err();
        println!("{said}");
        assert!(words.iter().all(|word| said.contains(word)), "{said}");
    }
}

#[test]
fn a_broken_file_is_refused_with_its_place() {
    let text = weights(&[0.0; 6], 1.0).to_json().unwrap();
    let refused = |from: &str, to: &str, words: &str| {
        assert!(text.contains(from), "{from}");
        let said = WeightFile::parse(&text.replacen(from, to, 1), "w.json").unwrap_err().to_string();
        println!("{said}");
        assert!(said.contains(words), "{said}");
    };
    assert!(WeightFile::parse(&text, "w.json").is_ok());
    refused("freeplay.remainder", "freeplay.other", "freeplay.other");
    refused("\"version\": 2", "\"version\": 9", "version 9");
    refused("\"share\": 1.0", "\"share\": 2.0", "bounds of an axis");
    refused("\"centres\"", "\"centers\"", "line");
    refused("\"highest\": 0.00025", "\"highest\": -1.0", "bounds of an axis");
    let cut = WeightFile::parse(&text[..text.len() / 2], "w.json").unwrap_err().to_string();
    assert!(cut.contains("w.json") && cut.contains("line"), "{cut}");
}
