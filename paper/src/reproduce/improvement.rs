//! The paper's last sentence, measured: can the predictions of a network improve the motion?
//!
//! The paper trains networks but controls nothing. Here an arm with play is commissioned with a tracker on three paths while the controller's model has no
//! play. `freeplay train` learns the remaining deviation of that model. Then `narx-qp` follows the paper's paths, which are not part of the training, without a
//! tracker, with the network and without.

use freeplay_controller::Task as ControllerTask;
use freeplay_controller::computed_torque::COMPUTED_TORQUE;
use freeplay_controller::narx_qp::NARX_QP;
use freeplay_harness::closed_loop::{ClosedLoop, effects_with_plays};
use freeplay_harness::loop_recorder::LoopRecorder;
use freeplay_harness::weights::beside;
use freeplay_laws::Effects;
use freeplay_model::{ArmFile, paper_arm, to_toml};
use freeplay_path::{PathKind, PathSpec, Size};
use freeplay_plant::{DeviationStatistics, SensorsSpec};
use freeplay_recording::Recording;
use freeplay_terminal::exit::Failure;
use freeplay_terminal::files::write;
use freeplay_training::{Settings, train};
use serde::Serialize;
use std::path::Path;

use super::case::{drive_name, path_name};
use super::claim::{Claim, Quantity, Row};
use super::compensation::Task;
use freeplay_harness::scenario::Drive;

/// The joint with play.
const JOINT: usize = 4;
/// Least share of the deviation whose removal counts as an improvement.
const LEAST: f64 = 0.5;

/// Effect of a network on one path.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Improved {
    /// Path, period and clearance.
    pub task: Task,
    /// RMS of the tool's deviation after 0.5 s without the network, mm.
    pub without: f64,
    /// With it.
    pub with: f64,
}

impl Improved {
    /// Share of the deviation that the network removes.
    fn taken(&self) -> f64 {
        1.0 - self.with / self.without
    }
}

/// The paths on which the arm is commissioned: none of the paper's.
fn commissioning() -> [PathSpec; 3] {
    let path = |kind, size, period| PathSpec { kind, size: Some(size), period, ..PathSpec::default() };
    [
        path(PathKind::Lissajous, Size::Axes([0.2, 0.15, 0.1]), 5.0),
        path(PathKind::Lissajous, Size::Axes([0.1, 0.28, 0.08]), 8.0),
        path(PathKind::Square, Size::One(0.2), 9.0),
    ]
}

/// An arm with play, and the folder of the model without play.
struct Commissioned<'a> {
    truth: Effects,
    nominal: ArmFile,
    model: &'a Path,
}

impl Commissioned<'_> {
    /// A run of `controller` along `path`: the RMS of the tool's deviation, mm, and the recording of a tracked run.
    fn run(
        &self,
        controller: &'static str,
        path: &PathSpec,
        weights: Option<&Path>,
        is_tracked: bool,
    ) -> Result<(f64, Option<Recording>), Failure> {
        let task = ControllerTask {
            model: self.model.display().to_string(),
            weights: weights.map(|file| file.display().to_string()),
            path: path.clone(),
            ..ControllerTask::default()
        };
        let closed = ClosedLoop {
            arm: &self.nominal.arm,
            effects: &self.truth,
            path,
            controller,
            task: &task,
            tracked: is_tracked,
            after: DeviationStatistics::START_DURATION,
            sensors: (SensorsSpec::default(), 0),
            beyond: &[],
        };
        let mut recorder = LoopRecorder::new(self.nominal.arm.dof());
        let outcome = closed.run(|tick| {
            if is_tracked {
                recorder.keep(tick);
            }
        })?;
        let [norm, ..] = outcome.deviation.components();
        Ok((norm.rms_after_start, is_tracked.then(|| recorder.finish(controller)).transpose()?))
    }
}

/// Runs `tasks`, those with a clearance of `clearance` mm, with and without the network of that arm.
///
/// # Errors
/// A run or a training that fails.
pub fn improved(clearance: f64, tasks: &[Task]) -> Result<Vec<Improved>, Failure> {
    let folder = tempfile::tempdir().map_err(Failure::internal)?;
    let model = folder.path().join("nominal.toml");
    let nominal = ArmFile { effects: Vec::new(), ..paper_arm() };
    write(&model, &to_toml(&nominal))?;
    let truth = effects_with_plays(&nominal.arm, &[(JOINT, clearance * 1e-3)])?;
    let arm = Commissioned { truth, nominal, model: &model };
    let recordings = commissioning().into_iter().enumerate().map(|(number, path)| {
        let (_, recording) = arm.run(COMPUTED_TORQUE, &path, None, true)?;
        let recording = recording.ok_or_else(|| Failure::internal("a run was not recorded"))?;
        Ok((format!("path {}", number + 1), recording))
    });
    let recordings: Vec<(String, Recording)> = recordings.collect::<Result<_, Failure>>()?;
    let settings = Settings { command: "freeplay reproduce".to_owned(), ..Settings::default() };
    let trained = train(&recordings, ControllerTask::default(), &model, &settings)?;
    let weights = beside(&model);
    write(&weights, &trained.file.to_json().map_err(Failure::internal)?)?;
    tasks
        .iter()
        .filter(|task| task.clearance == clearance)
        .map(|task| {
            let path = PathSpec { kind: task.path, period: task.period, ..PathSpec::default() };
            let (without, _) = arm.run(NARX_QP, &path, None, false)?;
            let (with, _) = arm.run(NARX_QP, &path, Some(&weights), false)?;
            Ok(Improved { task: *task, without, with })
        })
        .collect()
}

/// The claim, judged by the runs.
pub fn claim(improved: &[Improved]) -> Claim {
    let row = |one: &Improved| {
        let Task { path, period, clearance } = one.task;
        let tag = match path {
            PathKind::SquareSharp => ("path", "the path has sharp corners"),
            _ => ("path", "the path has no sharp corners"),
        };
        Row {
            situation: format!(
                "{}, {}, T = {period} s, c = {clearance} mm",
                path_name(path),
                drive_name(Drive::Torque)
            ),
            tags: vec![tag],
            values: vec![one.without, one.with, 1e2 * one.taken()],
            reference: vec![None; 3],
            holds: one.taken() >= LEAST,
        }
    };
    let shares = || improved.iter().map(|one| 1e2 * one.taken());
    let (least, most) = (shares().fold(f64::INFINITY, f64::min), shares().fold(f64::NEG_INFINITY, f64::max));
    let claim = Claim::judged(
        "outputs_improve_motion",
        "The outputs of a network can be used to improve the motion by a controller",
        format!(
            "agrees where a controller whose model knows no play leaves at most {:.0} % of the deviation with the network, on a path that did not train it and without a tracker",
            (1.0 - LEAST) * 100.0
        ),
        vec![
            Quantity::new("without the network, RMS", "mm"),
            Quantity::new("with the network, RMS", "mm"),
            Quantity::new("taken away", "%"),
        ],
        improved.iter().map(row).collect(),
    );
    if improved.is_empty() {
        return claim;
    }
    let taken = match improved {
        [_] => format!("In one run, the network removes {least:.0} % of the deviation."),
        _ => format!(
            "In {} runs, the network removes {least:.0} to {most:.0} % of the deviation.",
            improved.len()
        ),
    };
    claim.remark(format!(
        "{taken} It was trained by `freeplay train` on three other paths with a tracked tool. The paper itself controls nothing."
    ))
}

#[cfg(test)]
mod tests {
    use super::{Improved, Task, claim};
    use crate::reproduce::claim::Ruling;
    use freeplay_path::PathKind;

    #[test]
    fn the_verdict_follows_the_runs() {
        let run =
            |path, with| Improved { task: Task { path, period: 6.0, clearance: 0.6 }, without: 0.6, with };
        let (smooth, sharp) = (PathKind::Lissajous, PathKind::SquareSharp);
        let all = claim(&[run(smooth, 0.02), run(sharp, 0.2)]);
        assert_eq!(all.ruling, Ruling::Holds);
        assert!(all.remark.contains("67 to 97 %"), "{}", all.remark);
        let some = claim(&[run(smooth, 0.02), run(sharp, 0.5)]);
        assert_eq!(some.ruling, Ruling::HoldsOnlyIf("the path has no sharp corners".to_owned()));
        let one = claim(&[run(smooth, 0.7)]);
        assert_eq!(one.ruling, Ruling::DoesNotHold);
        assert!(one.remark.starts_with("In one run, the network removes -17 %"), "{}", one.remark);
    }
}
