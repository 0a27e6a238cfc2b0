//! Tests of the built-in controllers on the arm with play: the deviation that remains after the compensation.
//!
//! The reference figures are those of an independent implementation (`compensation_qs.json` and `reference_runs.csv` of the
//! oracles, made with Python and Pinocchio): feed-forward of the quasi-static deviation under computed torque, c = 0.6 mm, after
//! 0.5 s.

use crate::simulation::{Outcome, model_file, run};
use freeplay_controller::{BUILT_IN, Task, TaskMode, built_in};
use freeplay_path::PathKind;
use freeplay_shm::CommandStatus;

/// One run of a table.
#[derive(Clone, Copy)]
struct Case {
    mode: TaskMode,
    kind: PathKind,
    /// Period of the path, s.
    period: f64,
    /// Length of the run, s.
    seconds: f64,
    gravity: [f64; 3],
    /// True clearances: joint, m.
    truth: &'static [(usize, f64)],
    /// Clearances in the controller's model as a share of the true ones.
    believed: f64,
}

const SMOOTH: Case = Case {
    mode: TaskMode::Torque,
    kind: PathKind::Lissajous,
    period: 6.0,
    seconds: 1.0,
    gravity: [0.0, 0.0, -9.81],
    truth: &[(4, 6e-4)],
    believed: 1.0,
};

fn measure(name: &str, case: Case) -> Outcome {
    let folder = tempfile::tempdir().unwrap();
    let believed: Vec<_> = case.truth.iter().map(|&(joint, c)| (joint, c * case.believed)).collect();
    let model = model_file(folder.path(), &believed).display().to_string();
    let mut task = Task { model, mode: case.mode, gravity: Some(case.gravity), ..Task::default() };
    (task.path.kind, task.path.period) = (case.kind, case.period);
    let mut controller = built_in(name).unwrap();
    let outcome = run(controller.as_mut(), &task, case.truth, (case.seconds * task.rate) as u64);
    let failed = outcome.answers.iter().filter(|answer| answer.status != CommandStatus::Ok).count();
    let axes = outcome.rms_axes();
    println!(
        "{name:>15} {:?} {} T = {} s, {} s, g = {:?}, play {:?}, believed x {}: RMS after 0.5 s {:.4} mm \
         (x {:.4}, y {:.4}, z {:.4}), max {:.4} mm, failed {failed}",
        case.mode,
        case.kind.name(),
        case.period,
        case.seconds,
        case.gravity,
        case.truth,
        case.believed,
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
    let without = measure("computed-torque", SMOOTH);
    let with = measure("quasi-static", SMOOTH);
    assert!((without.rms() - 0.6).abs() < 0.01, "without compensation it is the clearance");
    assert!(with.rms() < 0.002, "the reference leaves 0.0115 mm");
    assert!(with.answers.iter().all(|answer| answer.status == CommandStatus::Ok));
}

#[test]
fn driven_joints_are_compensated_too() {
    let driven = Case { mode: TaskMode::Driven, ..SMOOTH };
    let without = measure("computed-torque", driven);
    let with = measure("quasi-static", driven);
    assert!((without.rms() - 0.6).abs() < 0.02, "without compensation it is the clearance");
    assert!(with.rms() < 0.002, "the reference leaves 0.0074 mm");
}

#[test]
fn a_clearance_that_is_ten_per_cent_wrong_is_still_better_than_none() {
    let with = measure("quasi-static", Case { believed: 0.9, seconds: 0.8, ..SMOOTH });
    assert!(with.rms() < 0.07, "a tenth of the clearance remains");
}

#[test]
fn a_tracked_tool_corrects_a_wrong_clearance() {
    for believed in [0.9, 1.1] {
        let case = Case { believed, seconds: 1.0, ..SMOOTH };
        let (without, with) = (measure("quasi-static", case), measure("narx-qp", case));
        assert!(without.rms() > 0.05, "there is something to correct");
        assert!(with.rms() < 0.3 * without.rms(), "most of what the model has wrong is learned");
        let last = |outcome: &Outcome| 1e3 * outcome.deviation.last().unwrap().norm();
        println!("in the end {:.4} mm, {:.4} mm", last(&without), last(&with));
        assert!(last(&with) < 0.05 * last(&without), "an integral action leaves nothing");
    }
}

#[test]
fn learning_harms_nothing_where_the_model_is_right() {
    let (without, with) = (measure("quasi-static", SMOOTH), measure("narx-qp", SMOOTH));
    // Tolerance, mm: a tenth of a micrometre is below the resolution of a tracker, and half a second is too short to learn it.
    let resolution = 1e-4;
    assert!(with.rms() <= without.rms() + resolution && with.max() <= without.max() + resolution);
}

#[test]
fn two_joints_with_play_are_compensated_together() {
    // The test uses mode driven; in mode torque, two journals bounce for up to two seconds, with or without compensation.
    let two = Case { mode: TaskMode::Driven, truth: &[(2, 3e-4), (4, 6e-4)], seconds: 0.8, ..SMOOTH };
    let without = measure("computed-torque", two);
    for name in ["quasi-static", "narx-qp"] {
        let with = measure(name, two);
        assert!(with.rms() < 0.01 * without.rms());
    }
}

/// The whole table; it takes minutes in the dev profile:
/// `cargo test --release -p freeplay-controller --test all -- runs:: --ignored --nocapture`.
#[test]
#[ignore = "whole runs, for the release profile"]
fn whole_runs() {
    let mut cases = Vec::new();
    for mode in [TaskMode::Torque, TaskMode::Driven] {
        for kind in [PathKind::Lissajous, PathKind::Square, PathKind::SquareSharp, PathKind::Circle] {
            for period in [6.0, 12.0] {
                cases.push(Case { mode, kind, period, seconds: period, ..SMOOTH });
            }
        }
        let smooth = Case { mode, seconds: 6.0, ..SMOOTH };
        cases.push(Case { gravity: [0.0; 3], ..smooth });
        cases.push(Case { truth: &[(2, 3e-4), (4, 6e-4)], ..smooth });
        cases.push(Case { truth: &[(4, 2e-4)], ..smooth });
    }
    for case in cases {
        for name in BUILT_IN {
            measure(name, case);
        }
    }
}
