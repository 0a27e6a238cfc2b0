//! Simulated runs that decide: the plant is the model with the recorded remainder, the controller has weights that the path did not train.
//!
//! For each held-out path the arm of the model runs along that path while its tool is off by the recorded remainder, tick by tick. `narx-qp` runs on it
//! without weights and with the network of the other paths. The remainder is the measurement, not what a network says of it: a
//! network can't prove itself.

use std::fmt::Write as _;
use std::path::Path;

use freeplay_arm::ArmFile;
use freeplay_controller::narx_qp::NARX_QP;
use freeplay_controller::remainder::{Receipt, Rehearsed, WeightFile};
use freeplay_controller::{Model, Task, TaskMode};
use freeplay_harness::closed_loop::{ClosedLoop, RATE};
use freeplay_path::{PathKind, PathSpec};
use freeplay_plant::SensorsSpec;
use freeplay_terminal::exit::Failure;
use freeplay_terminal::files::write;
use freeplay_terminal::parallel::on_all_cores;
use nalgebra::Vector3;

use crate::data::{Data, START};
use crate::recorded::RecordedRun;

/// How much worse a run may be with the weights.
const WORSE: f64 = 1.02;
/// What no controller has to be better than, mm: a tenth of a micrometre.
const NEGLIGIBLE: f64 = 1e-4;
/// Samples from one row of a path to the next.
const EVERY: usize = 10;
/// Most of a recording that is played, s.
const LONGEST: f64 = 8.0;

/// What the runs of the weights `files`, one for each held-out path of `data`, came to. `model` is the file of the model, `arm` what it holds.
///
/// # Errors
/// A run that fails.
pub fn rehearse(
    data: &Data,
    model: &Path,
    believed: &Model,
    file: &ArmFile,
    task: &Task,
    files: &[WeightFile],
) -> Result<Receipt, Failure> {
    if (1.0 / data.runs[0].period - RATE).abs() > 1e-6 * RATE || task.mode != TaskMode::Torque {
        return Err(Failure::input(format!(
            "recordings of {} Hz in mode {:?}: runs that prove weights are of mode torque at {RATE} Hz; record such ones",
            1.0 / data.runs[0].period,
            task.mode
        )));
    }
    let runs = on_all_cores(files.len(), |fold| {
        let run = data.folds.iter().position(|of| *of == fold);
        let run = run.ok_or_else(|| Failure::internal("a fold without a run"))?;
        one(&data.runs[run], model, believed, file, task, &files[fold])
    })?;
    let is_worse = |run: &Rehearsed| run.with_mm > (run.without_mm * WORSE).max(run.without_mm + NEGLIGIBLE);
    let sum = |of: fn(&Rehearsed) -> f64| runs.iter().map(of).sum::<f64>();
    let is_better = sum(|run| run.with_mm) < sum(|run| run.without_mm);
    Ok(Receipt { proved: is_better && !runs.iter().any(is_worse), runs })
}

fn one(
    run: &RecordedRun,
    model: &Path,
    believed: &Model,
    file: &ArmFile,
    task: &Task,
    weights: &WeightFile,
) -> Result<Rehearsed, Failure> {
    let folder = tempfile::tempdir().map_err(Failure::internal)?;
    let path = written_path(run, folder.path())?;
    let believable = folder.path().join("weights.json");
    let mut proved = weights.clone();
    proved.receipt.proved = true;
    write(&believable, &proved.to_json().map_err(Failure::internal)?)?;
    let beyond = course(run);
    let arm = task.gravity.map_or_else(|| file.arm.clone(), |g| file.arm.with_gravity(Vector3::from(g)));
    let rms = |weights: Option<String>| {
        let task = Task {
            model: model.display().to_string(),
            weights,
            path: path.clone(),
            options: toml::Table::new(),
            ..task.clone()
        };
        let closed = ClosedLoop {
            arm: &arm,
            effects: &believed.effects,
            path: &path,
            controller: NARX_QP,
            task: &task,
            tracked: false,
            after: START,
            sensors: (SensorsSpec::default(), 0),
            beyond: &beyond,
        };
        let outcome = closed.run(|_| {}).map_err(|failure| {
            let message = format!("a simulated run along {}: {}", run.name, failure.message);
            Failure { message, ..failure }
        })?;
        let [norm, ..] = outcome.deviation.components();
        Ok::<f64, Failure>(norm.rms_after_start)
    };
    Ok(Rehearsed {
        name: run.name.clone(),
        without_mm: rms(None)?,
        with_mm: rms(Some(believable.display().to_string()))?,
    })
}

/// The recorded remainder tick by tick, set in smoothly over the start.
fn course(run: &RecordedRun) -> Vec<Vector3<f64>> {
    let share = |k: usize| {
        let x = (k as f64 * run.period / START).min(1.0);
        x * x * x * (10.0 - 15.0 * x + 6.0 * x * x)
    };
    run.left.iter().enumerate().map(|(k, left)| left * share(k)).collect()
}

/// The reference of `run` as a path file in `folder`.
fn written_path(run: &RecordedRun, folder: &Path) -> Result<PathSpec, Failure> {
    let joints = run.reference.q.len();
    let mut text = String::from("t");
    for joint in 1..=joints {
        let _ = write!(text, ",q{joint}");
    }
    let most = ((LONGEST / run.period) as usize).min(run.len() - 1);
    for point in (0..=most).step_by(EVERY) {
        let _ = write!(text, "\n{}", run.reference.t[point]);
        for q in &run.reference.q {
            let _ = write!(text, ",{}", q[point]);
        }
    }
    text.push('\n');
    let file = folder.join("path.csv");
    write(&file, &text)?;
    Ok(PathSpec { kind: PathKind::File, file: Some(file), ..PathSpec::default() })
}
