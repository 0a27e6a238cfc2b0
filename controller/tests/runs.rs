//! The built-in controllers on the arm with play: what the compensation leaves of the deviation.
//!
//! The figures to beat are those of an independent reference (`compensation_qs.json` and `reference_runs.csv` of the oracles, made
//! with Python and Pinocchio): feed-forward of the quasi-static deviation under computed torque, c = 0.6 mm, after 0.5 s.

mod simulation;

use freeplay_controller::{BUILT_IN, Task, TaskMode, built_in};
use freeplay_path::PathKind;
use freeplay_shm::CommandStatus;
use simulation::{Outcome, model_file, run};

const C: f64 = 6e-4;
const JOINT: usize = 4;

/// Runs the built-in `name` with a model whose clearance is `believed`.
fn measure(
    name: &str,
    mode: TaskMode,
    kind: PathKind,
    period: f64,
    seconds: f64,
    believed: f64,
    average: f64,
) -> Outcome {
    let folder = tempfile::tempdir().unwrap();
    let model = model_file(folder.path(), believed).display().to_string();
    let mut task = Task { model, mode, ..Task::default() };
    (task.path.kind, task.path.period) = (kind, period);
    if name == "quasi-static" {
        task.options.insert("average".into(), average.into());
    }
    let mut controller = built_in(name).unwrap();
    let outcome = run(controller.as_mut(), &task, &[(JOINT, C)], (seconds * task.rate) as u64);
    let failed = outcome.answers.iter().filter(|answer| answer.status != CommandStatus::Ok).count();
    let axes = outcome.rms_axes();
    println!(
        "{name:>15} {mode:?} {} T = {period} s, {seconds} s, model c = {:.2} mm: RMS after 0.5 s {:.4} mm \
         (x {:.4}, y {:.4}, z {:.4}), max {:.4} mm, failed {failed}",
        kind.name(),
        1e3 * believed,
        outcome.rms(),
        axes.x,
        axes.y,
        axes.z,
        outcome.max()
    );
    outcome
}

#[test]
fn compensation_takes_the_deviation_out() {
    let (torque, smooth) = (TaskMode::Torque, PathKind::Lissajous);
    let without = measure("computed-torque", torque, smooth, 6.0, 1.0, C, 0.041);
    let with = measure("quasi-static", torque, smooth, 6.0, 1.0, C, 0.041);
    assert!((without.rms() - 0.6).abs() < 0.01, "without compensation it is the clearance");
    assert!(with.rms() < 0.0115, "the reference leaves 0.0115 mm");
    assert!(with.answers.iter().all(|answer| answer.status == CommandStatus::Ok));
}

#[test]
fn driven_joints_are_compensated_too() {
    let (driven, smooth) = (TaskMode::Driven, PathKind::Lissajous);
    let without = measure("computed-torque", driven, smooth, 6.0, 1.0, C, 0.041);
    let with = measure("quasi-static", driven, smooth, 6.0, 1.0, C, 0.041);
    assert!((without.rms() - 0.6).abs() < 0.02, "without compensation it is the clearance");
    assert!(with.rms() < 0.0074, "the reference leaves 0.0074 mm");
}

#[test]
fn a_clearance_that_is_ten_per_cent_wrong_is_still_better_than_none() {
    let with = measure("quasi-static", TaskMode::Torque, PathKind::Lissajous, 6.0, 0.8, 0.9 * C, 0.041);
    assert!(with.rms() < 0.07, "a tenth of the clearance remains");
}

/// The whole table; takes minutes in the dev profile:
/// `cargo test --release -p freeplay-controller --test runs -- --ignored --nocapture`.
#[test]
#[ignore = "whole runs, for the release profile"]
fn whole_runs() {
    for mode in [TaskMode::Torque, TaskMode::Driven] {
        for kind in [PathKind::Lissajous, PathKind::Square, PathKind::SquareSharp] {
            for period in [6.0, 12.0] {
                for name in BUILT_IN {
                    measure(name, mode, kind, period, period, C, 0.041);
                }
            }
        }
    }
}
