//! Simulated runs as a proof: the plant is the model with the recorded remainder, and the weights of the controller were not trained on the path.
//!
//! For each held-out path the arm of the model runs along that path, while the recorded remainder displaces its tool tick by tick. `narx-qp` controls
//! the arm without weights and with the network of the other paths. The remainder is the measurement, not a prediction of the network, because a
//! network cannot prove itself. [`crate::significance`] tests the improvement.

use std::fmt::Write as _;
use std::path::Path;

use freeplay_arm::{Workspace, forward_kinematics};
use freeplay_controller::narx_qp::NARX_QP;
use freeplay_controller::remainder::{Receipt, Rehearsed, WeightFile};
use freeplay_controller::{Model, Task, TaskMode};
use freeplay_harness::closed_loop::{ClosedLoop, RATE};
use freeplay_model::ArmFile;
use freeplay_path::{PathKind, PathSpec};
use freeplay_plant::SensorsSpec;
use freeplay_terminal::exit::Failure;
use freeplay_terminal::files::write;
use freeplay_terminal::parallel::on_all_cores;
use nalgebra::Vector3;

use crate::data::{Data, START_DURATION};
use crate::recorded::RecordedRun;
use crate::significance::chance;

/// Largest permitted ratio of the deviations with and without the weights.
const WORSE: f64 = 1.02;
/// Negligible deviation, mm: a tenth of a micrometre.
const NEGLIGIBLE: f64 = 1e-4;
/// Significance level: probability with which useless weights may pass.
const LEVEL: f64 = 0.05;
/// Samples between rows of a path.
const EVERY: usize = 10;
/// Longest part of a recording that is simulated, s.
const LONGEST: f64 = 8.0;
/// Ticks between points of a curve.
const CURVE_STRIDE: u64 = 10;

/// The tool's deviation along one run, for the page.
#[derive(Clone, Debug, Default)]
pub struct DeviationCurve {
    /// Name of the run.
    pub name: String,
    /// Instants, s.
    pub t: Vec<f64>,
    /// Distance of the tool from its desired position without the network, mm.
    pub without_mm: Vec<f64>,
    /// Distance with the network, mm.
    pub with_mm: Vec<f64>,
}

/// Inputs of the simulated runs: recorded paths on the arm of a model.
pub struct RehearsalInputs<'a> {
    /// The recordings.
    pub data: &'a Data,
    /// The file of the model.
    pub model: &'a Path,
    /// The model as a controller loads it.
    pub believed: &'a Model,
    /// The contents of that file.
    pub file: &'a ArmFile,
    /// The task of the recordings.
    pub task: &'a Task,
}

/// Checks that simulated runs support the mode of `task`.
///
/// # Errors
/// A mode other than torque.
pub fn check_mode(task: &Task) -> Result<(), Failure> {
    if task.mode == TaskMode::Torque {
        return Ok(());
    }
    Err(Failure::input(format!(
        "the recordings have mode {:?}, but the simulated runs that prove weights have mode torque; record in mode torque",
        task.mode
    )))
}

/// Checks that simulated runs support recordings with a sample every `period` s.
///
/// # Errors
/// A different rate.
pub fn check_rate(period: f64) -> Result<(), Failure> {
    if (period * RATE - 1.0).abs() <= 1e-6 {
        return Ok(());
    }
    Err(Failure::input(format!(
        "the recordings have {:.6} Hz, but the simulated runs that prove weights have {RATE} Hz; record at this rate",
        1.0 / period
    )))
}

/// The proof by the runs `runs`, one for each recording. `folds` groups the recordings of one path.
fn verdict(runs: Vec<Rehearsed>, folds: &[usize]) -> Receipt {
    let is_worse = |run: &Rehearsed| run.with_mm > (run.without_mm * WORSE).max(run.without_mm + NEGLIGIBLE);
    // Adding the negligible deviation keeps tiny improvements from counting, however often they recur.
    let ratio = |run: &Rehearsed| ((run.with_mm + NEGLIGIBLE) / run.without_mm.max(NEGLIGIBLE)).ln();
    let of_path = |fold: usize| {
        let runs = || runs.iter().zip(folds).filter(move |(_, of)| **of == fold).map(|(run, _)| ratio(run));
        runs().sum::<f64>() / runs().count().max(1) as f64
    };
    let paths = folds.iter().max().map_or(0, |last| last + 1);
    let chance = chance(&(0..paths).map(of_path).collect::<Vec<_>>());
    Receipt { proved: chance < LEVEL && !runs.iter().any(is_worse), chance, runs }
}

impl RehearsalInputs<'_> {
    /// Runs the simulations of the weights `files`, one for each held-out path, and returns the proof.
    ///
    /// # Errors
    /// A failed run.
    pub fn decide(&self, files: &[WeightFile]) -> Result<(Receipt, Vec<DeviationCurve>), Failure> {
        let Data { runs, folds, .. } = self.data;
        let came = on_all_cores(runs.len(), |number| self.one(&runs[number], &files[folds[number]]))?;
        let (runs, courses) = came.into_iter().unzip();
        Ok((verdict(runs, folds), courses))
    }

    fn one(&self, run: &RecordedRun, weights: &WeightFile) -> Result<(Rehearsed, DeviationCurve), Failure> {
        let folder = tempfile::tempdir().map_err(Failure::internal)?;
        let path = written_path(run, folder.path())?;
        let believable = folder.path().join("weights.json");
        let mut proved = weights.clone();
        proved.receipt.proved = true;
        write(&believable, &proved.to_json().map_err(Failure::internal)?)?;
        let beyond = course(run);
        let without = self.played(run, None, &path, &beyond)?;
        let with = self.played(run, Some(believable.display().to_string()), &path, &beyond)?;
        let rehearsed = Rehearsed { name: run.name.clone(), without_mm: without.0, with_mm: with.0 };
        let t = (0..without.1.len()).map(|k| (k as u64 * CURVE_STRIDE) as f64 / RATE).collect();
        Ok((rehearsed, DeviationCurve { name: run.name.clone(), t, without_mm: without.1, with_mm: with.1 }))
    }

    /// Simulates the run along `path` with the `weights`; returns the RMS of the tool's deviation after the start, and its curve, mm.
    fn played(
        &self,
        run: &RecordedRun,
        weights: Option<String>,
        path: &PathSpec,
        beyond: &[Vector3<f64>],
    ) -> Result<(f64, Vec<f64>), Failure> {
        let arm = &self.file.arm;
        let arm = self.task.gravity.map_or_else(|| arm.clone(), |g| arm.with_gravity(Vector3::from(g)));
        let task = Task {
            model: self.model.display().to_string(),
            weights,
            path: path.clone(),
            options: toml::Table::new(),
            ..self.task.clone()
        };
        let closed = ClosedLoop {
            arm: &arm,
            effects: &self.believed.effects,
            path,
            controller: NARX_QP,
            task: &task,
            tracked: false,
            after: START_DURATION,
            sensors: (SensorsSpec::default(), 0),
            beyond,
        };
        let mut course = Vec::new();
        let mut workspace = Workspace::new(&arm);
        let outcome = closed.run(|tick| {
            if tick.state.tick % CURVE_STRIDE == 0 {
                let desired = forward_kinematics(&arm, &mut workspace, &tick.state.reference.q[..arm.dof()]);
                let tool = Vector3::from_column_slice(&tick.state.tool[..3]);
                course.push(1e3 * (tool - desired.translation.vector).norm());
            }
        });
        let outcome = outcome.map_err(|failure| {
            let message = format!("a simulated run along {}: {}", run.name, failure.message);
            Failure { message, ..failure }
        })?;
        let [norm, ..] = outcome.deviation.components();
        Ok((norm.rms_after_start, course))
    }
}

/// The recorded remainder tick by tick, faded in over the start.
fn course(run: &RecordedRun) -> Vec<Vector3<f64>> {
    let share = |k: usize| {
        let x = (k as f64 * run.period / START_DURATION).min(1.0);
        x * x * x * (10.0 - 15.0 * x + 6.0 * x * x)
    };
    run.left.iter().enumerate().map(|(k, left)| left * share(k)).collect()
}

/// Writes the reference of `run` as a path file in `folder`.
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

#[cfg(test)]
mod tests {
    use super::verdict;
    use freeplay_controller::remainder::Rehearsed;

    fn proved(pairs: &[(f64, f64)], folds: &[usize]) -> bool {
        let run =
            |&(without_mm, with_mm): &(f64, f64)| Rehearsed { name: String::new(), without_mm, with_mm };
        let receipt = verdict(pairs.iter().map(run).collect(), folds);
        println!("{pairs:?}: chance {:.4}", receipt.chance);
        receipt.proved
    }

    #[test]
    fn paths_decide_and_neither_one_path_nor_a_sum() {
        assert!(proved(&[(0.6, 0.06), (0.5, 0.1), (0.7, 0.05)], &[0, 1, 2]));
        assert!(!proved(&[(0.6, 0.06), (0.5, 0.499), (0.7, 0.71)], &[0, 1, 2]), "one path is no proof");
        assert!(!proved(&[(0.6, 0.06), (0.5, 0.1), (0.1, 0.11)], &[0, 1, 2]), "one path is worse");
        assert!(
            !proved(&[(0.6, 0.3), (0.6, 0.3), (0.5, 0.49)], &[0, 0, 1]),
            "two runs of one path are one draw"
        );
        assert!(!proved(&[(2e-5, 1e-6), (2e-5, 3e-6), (2e-5, 4e-5)], &[0, 1, 2]), "less than what counts");
        assert!(
            !proved(&[(3.71e-3, 3.69e-3), (3.74e-3, 3.73e-3), (3.77e-3, 3.76e-3)], &[0, 1, 2]),
            "less than what counts, of more"
        );
    }
}
