//! A machine in its folder: commissioning, training and runs.

use std::path::Path;

use freeplay_arm::{Workspace, forward_kinematics};
use freeplay_controller::Task;
use freeplay_harness::closed_loop::ClosedLoop;
use freeplay_harness::loop_recorder::LoopRecorder;
use freeplay_harness::weights::beside;
use freeplay_laws::Effects;
use freeplay_model::{ArmFile, paper_arm};
use freeplay_path::PathSpec;
use freeplay_plant::DeviationStatistics;
use freeplay_recording::Recording;
use freeplay_terminal::exit::Failure;
use freeplay_terminal::files::write;
use freeplay_training::{Settings, Trained, train};

use super::super::play::sensors;
use super::machines::DemoPaths;
use super::outcome::Reached;

/// A machine in its folder.
pub struct Bench {
    truth: ArmFile,
    effects: Effects,
    paths: DemoPaths,
    seed: u64,
}

/// Control of a run.
#[derive(Clone, Copy)]
pub struct Method<'a> {
    /// The built-in controller.
    pub controller: &'static str,
    /// Its model.
    pub model: &'a Path,
    /// True if it gets the weights beside the model, if there are any.
    pub has_weights: bool,
}

/// A finished run.
struct Ran {
    recording: Option<Recording>,
    reached: Reached,
    course: Vec<f64>,
}

/// Ticks from one point of a course to the next.
pub const CURVE_STRIDE: u64 = 20;

impl Bench {
    /// The bench of the machine `truth` on `paths`; `seed` is that of all noise.
    ///
    /// # Errors
    /// Impossible effects.
    pub fn new(truth: ArmFile, paths: DemoPaths, seed: u64) -> Result<Bench, Failure> {
        Ok(Bench { effects: Effects::of(&truth).map_err(Failure::internal)?, truth, paths, seed })
    }

    /// Deviation of a run along `path` without a tracker, and the tool's deviation every [`CURVE_STRIDE`] ticks, mm.
    ///
    /// # Errors
    /// A run that fails.
    pub fn reached(&self, way: Method<'_>, path: &PathSpec) -> Result<(Reached, Vec<f64>), Failure> {
        self.run(way, path, None).map(|ran| (ran.reached, ran.course))
    }

    /// A run along `path`, in this process; with a tracker if it is the recording of this `number`. Every recording has different noise: the training would
    /// learn noise that is the same in all of them.
    fn run(
        &self,
        Method { controller, model, has_weights }: Method<'_>,
        path: &PathSpec,
        number: Option<u64>,
    ) -> Result<Ran, Failure> {
        let is_tracked = number.is_some();
        let weights = Some(beside(model)).filter(|file| has_weights && file.is_file());
        let task = Task {
            model: model.display().to_string(),
            weights: weights.map(|file| file.display().to_string()),
            path: path.clone(),
            ..Task::default()
        };
        let closed = ClosedLoop {
            arm: &self.truth.arm,
            effects: &self.effects,
            path,
            controller,
            task: &task,
            tracked: is_tracked,
            after: DeviationStatistics::START_DURATION,
            sensors: (sensors(), self.seed.wrapping_add(number.map_or(0, |number| number + 1))),
            beyond: &[],
        };
        let arm = &self.truth.arm;
        let (mut recorder, mut course) = (LoopRecorder::new(arm.dof()), Vec::new());
        let mut workspace = Workspace::new(arm);
        let outcome = closed.run(|tick| {
            if is_tracked {
                recorder.keep(tick);
            } else if tick.state.tick % CURVE_STRIDE == 0 {
                let desired = forward_kinematics(arm, &mut workspace, &tick.state.reference.q[..arm.dof()]);
                let off = desired
                    .translation
                    .vector
                    .iter()
                    .zip(&tick.state.tool)
                    .map(|(desired, tool)| tool - desired);
                course.push(1e3 * off.map(|off| off * off).sum::<f64>().sqrt());
            }
        })?;
        let [norm, ..] = outcome.deviation.components();
        let reached = Reached { rms: norm.rms_after_start, max: norm.max_after_start };
        let recording = is_tracked.then(|| recorder.finish(controller)).transpose()?;
        Ok(Ran { recording, reached, course })
    }

    /// The recordings of the commissioning under `quasi-static` with `model`, by name.
    ///
    /// # Errors
    /// A run that fails.
    pub fn commission(&self, model: &Path) -> Result<Vec<(String, Recording)>, Failure> {
        let paths = self.paths.commissioning();
        let way = Method { controller: "quasi-static", model, has_weights: false };
        let recorded = (0..).zip(&paths).map(|(number, (name, path))| {
            let recording = self.run(way, path, Some(number))?.recording;
            let recording = recording.ok_or_else(|| Failure::internal("a run was not recorded"))?;
            Ok(((*name).to_owned(), recording))
        });
        recorded.collect()
    }

    /// Trains on the remaining deviation of `model` in `recordings`; writes the weights beside the model.
    ///
    /// # Errors
    /// Recordings without enough information, or a file that can't be written.
    pub fn learn(&self, recordings: &[(String, Recording)], model: &Path) -> Result<Trained, Failure> {
        let command = format!("freeplay demo, seed {}", self.seed);
        let nominal = Some(paper_arm().arm);
        let settings = Settings { seed: self.seed, command, nominal, ..Settings::default() };
        let trained = train(recordings, Task::default(), model, &settings)?;
        write(&beside(model), &trained.file.to_json().map_err(Failure::internal)?)?;
        Ok(trained)
    }
}
