//! A recording prepared for training: the reference, the commanded encoder positions, and the residual of the model in the tool's
//! position.

use std::path::{Path, PathBuf};

use freeplay_arm::Arm;
use freeplay_controller::computed_torque::COMPUTED_TORQUE;
use freeplay_controller::observed_remainder::{Observed, remainder};
use freeplay_controller::{Model, Task};
use freeplay_harness::columns::path_columns;
use freeplay_laws::Trajectory;
use freeplay_recording::Recording;
use freeplay_storage::plain_words;
use freeplay_terminal::exit::Failure;
use nalgebra::Vector3;

/// Half the span of the moving average over a measured or commanded motion before differentiation, samples; applied twice.
const HALF_SPAN: usize = 10;
/// Greatest difference of a time step from the median, as a share of the median.
const UNEVEN: f64 = 0.5;

/// One recorded run; see the module.
pub struct RecordedRun {
    /// Name in messages.
    pub name: String,
    /// Time between two samples, s.
    pub period: f64,
    /// Index of the first sample since the motion began.
    pub first_tick: u64,
    /// The reference, without corrections.
    pub reference: Trajectory,
    /// Measured torques, `[joint][point]`, N·m (N); empty if there are none.
    pub torque: Vec<Vec<f64>>,
    /// Residual of the model in the tool's position, averaged, m.
    pub left: Vec<Vector3<f64>>,
}

/// The recordings at the path `given`: the file itself, or those of the runs in that folder.
///
/// # Errors
/// A folder without recordings of runs.
pub fn files(given: &Path) -> Result<Vec<PathBuf>, Failure> {
    if !given.is_dir() {
        return Ok(vec![given.to_owned()]);
    }
    let summary = given.join("summary.json");
    let none = || {
        Failure::input(format!(
            "{}: no recordings of runs in this folder; give a recording, or what freeplay run left",
            given.display()
        ))
    };
    let text = freeplay_storage::read_text(&summary).map_err(|_| none())?;
    let summary: serde_json::Value = serde_json::from_str(&text).map_err(|error| {
        Failure::input(format!("{}: {}", summary.display(), plain_words(&error.to_string())))
    })?;
    let runs = summary["runs"].as_array().map(Vec::as_slice).unwrap_or_default();
    let files: Vec<PathBuf> =
        runs.iter().filter_map(|run| run["recording"].as_str()).map(|name| given.join(name)).collect();
    if files.is_empty() { Err(none()) } else { Ok(files) }
}

/// The task of the run of the recording `file`; `None` if there is no task file next to it.
///
/// # Errors
/// An unreadable task file.
pub fn task_of(file: &Path) -> Result<Option<Task>, Failure> {
    let task = file.parent().unwrap_or(Path::new(".")).join("task.toml");
    if task.is_file() { Task::load(&task).map(Some).map_err(Failure::input) } else { Ok(None) }
}

/// The name of the recording `file`: its folder and its own name.
pub fn name_of(file: &Path) -> String {
    let folder = file.parent().and_then(Path::file_name);
    folder.map_or_else(
        || file.display().to_string(),
        |folder| {
            format!("{}/{}", folder.to_string_lossy(), file.file_name().unwrap_or_default().to_string_lossy())
        },
    )
}

impl RecordedRun {
    /// Prepares `recording` for `model`; deviations are relative to the `nominal` arm.
    ///
    /// # Errors
    /// A recording without a tracked tool, with a different number of joints, or unevenly sampled.
    pub fn of(recording: &Recording, name: String, model: &Model, nominal: &Arm) -> Result<Self, Failure> {
        let origin = recording.origin.display();
        let (found, wanted) = (recording.joints(), model.arm.dof());
        if found != wanted {
            return Err(Failure::input(format!(
                "{origin}: {found} joints, but the model has {wanted}: give the model of this machine"
            )));
        }
        let tool = recording.tool_positions().map_err(Failure::input)?;
        let period = evenly(recording)?;
        if recording.len() <= 4 * HALF_SPAN {
            return Err(Failure::input(format!(
                "{origin}: {} samples are too few to learn from; record a motion of some seconds",
                recording.len()
            )));
        }
        let reference = reference(recording, period);
        let sent = sent(recording, &reference);
        let compensated_deviation = compensated_deviation(recording);
        let observed =
            Observed { nominal, reference: &reference, sent, taken_out: &compensated_deviation, tool };
        let left = remainder(model, &observed, period).map_err(Failure::input)?;
        if let Some(at) = left.iter().position(|left| !left.iter().all(|value| value.is_finite())) {
            return Err(Failure::input(format!(
                "{origin}, sample {}: the tool or a joint is not a number: cut this sample out, or repair it",
                at + 1
            )));
        }
        let first = recording.column("tick").and_then(|ticks| ticks.first().copied()).unwrap_or(0.0);
        Ok(Self {
            name,
            period,
            first_tick: first.max(0.0) as u64,
            torque: recording.tau.clone().unwrap_or_default(),
            left: averaged(&left),
            reference,
        })
    }

    /// Number of samples.
    pub fn len(&self) -> usize {
        self.left.len()
    }

    /// Returns true if there are none.
    pub fn is_empty(&self) -> bool {
        self.left.is_empty()
    }
}

/// The time step of `recording`, s.
fn evenly(recording: &Recording) -> Result<f64, Failure> {
    let step = recording.median_step();
    let off = recording.t.windows(2).position(|pair| ((pair[1] - pair[0]) / step - 1.0).abs() > UNEVEN);
    match off {
        Some(at) => Err(Failure::input(format!(
            "{}: between the samples {} and {} lie {} s, elsewhere {step} s: give a recording without gaps",
            recording.origin.display(),
            at + 1,
            at + 2,
            recording.t[at + 1] - recording.t[at]
        ))),
        None if step > 0.0 => Ok(step),
        None => Err(Failure::input(format!("{}: time stands still", recording.origin.display()))),
    }
}

/// The columns `NAME1`… or `NAME_1`… of all joints.
fn columns(recording: &Recording, name: &str) -> Option<Vec<Vec<f64>>> {
    (1..=recording.joints())
        .map(|joint| recording.column(&format!("{name}{joint}")).map(<[f64]>::to_vec))
        .collect()
}

/// The reference of `recording`: its path, or else its commanded positions, or else the measured ones.
fn reference(recording: &Recording, period: f64) -> Trajectory {
    let points = recording.len();
    let t = (0..points).map(|k| k as f64 * period).collect();
    let of =
        |q: Vec<Vec<f64>>, v, a| Trajectory { t, q, v, a, stretches: std::iter::once(0..points).collect() };
    let path = path_columns(recording).map(|columns| columns.into_iter().map(<[f64]>::to_vec).collect());
    let rates = columns(recording, "qd_ref_").zip(columns(recording, "qdd_ref_"));
    match (path, rates) {
        (Some(q), Some((v, a))) => of(q, v, a),
        (path, _) => {
            let q = path.unwrap_or_else(|| recording.q.clone());
            let q: Vec<Vec<f64>> = q.iter().map(|column| smooth(&smooth(column))).collect();
            let rate = |columns: &[Vec<f64>]| -> Vec<Vec<f64>> {
                columns.iter().map(|column| rate_of(column, period)).collect()
            };
            let v = rate(&q);
            let a = rate(&v);
            of(q, v, a)
        }
    }
}

/// The commanded encoder positions: the commands of servos, the reference, or else the measured positions.
fn sent<'a>(recording: &'a Recording, reference: &'a Trajectory) -> &'a [Vec<f64>] {
    match &recording.q_ref {
        Some(commanded) if recording.column("q_path_1").is_some() => commanded,
        Some(_) => &reference.q,
        None => &recording.q,
    }
}

/// The deviation that the controller of a run in mode torque compensated: its prediction for each instant, in its answer to the state
/// before. It is empty for a controller without compensation.
fn compensated_deviation(recording: &Recording) -> Vec<Vector3<f64>> {
    let is_plain = recording.origin.file_stem().is_some_and(|stem| stem == COMPUTED_TORQUE);
    let predicted = ["x", "y", "z"].map(|axis| recording.column(&format!("predicted_{axis}")));
    let [Some(x), Some(y), Some(z)] = predicted else { return Vec::new() };
    if is_plain || recording.column("q_path_1").is_some() {
        return Vec::new();
    }
    let at = |k: usize| {
        let predicted = Vector3::new(x[k], y[k], z[k]);
        if predicted.iter().all(|value| value.is_finite()) { predicted } else { Vector3::zeros() }
    };
    averaged(&(0..recording.len()).map(|k| at(k.saturating_sub(1))).collect::<Vec<_>>())
}

/// Centred mean over [`HALF_SPAN`] samples before and after, fewer at the ends.
fn smooth(column: &[f64]) -> Vec<f64> {
    let mut sums = vec![0.0];
    column.iter().for_each(|x| sums.push(sums[sums.len() - 1] + x));
    let mean = |k: usize| {
        let reach = HALF_SPAN.min(k).min(column.len() - 1 - k);
        (sums[k + reach + 1] - sums[k - reach]) / (2 * reach + 1) as f64
    };
    (0..column.len()).map(mean).collect()
}

fn averaged(left: &[Vector3<f64>]) -> Vec<Vector3<f64>> {
    let axes = [0, 1, 2].map(|axis| smooth(&left.iter().map(|left| left[axis]).collect::<Vec<_>>()));
    (0..left.len()).map(|k| Vector3::new(axes[0][k], axes[1][k], axes[2][k])).collect()
}

/// Central differences.
fn rate_of(column: &[f64], period: f64) -> Vec<f64> {
    let last = column.len() - 1;
    let rate = |k: usize| {
        let (from, to) = (k.saturating_sub(1), (k + 1).min(last));
        (column[to] - column[from]) / ((to - from).max(1) as f64 * period)
    };
    (0..column.len()).map(rate).collect()
}
