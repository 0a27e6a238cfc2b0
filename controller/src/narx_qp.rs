//! The built-in `narx-qp`: the deviation that physics predicts plus what is learned beyond it, taken out by the compensation
//! programme; through the corners of its own path it goes as planned before the run ([`crate::passage`]).
//!
//! With a tracked tool the slowly varying residual is learned online ([`ToolResidual`]): a wrong clearance, a friction that the
//! model leaves out. What moves faster is forecast by the twin of the journal and the network ([`Learned`]), trusted as far as it has
//! proved right; the share `fast` of it, smoothed and bounded to [`LARGEST_FAST`] of the reach, is corrected, too.

use std::path::Path;

use freeplay_laws::ArmWithPlay;
use freeplay_path::{JointPath, PathSpec};
use freeplay_predictor::Narx;
use freeplay_shm::State;
use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

use crate::compensation::Weights;
use crate::controller::{Answer, Controller, ControllerError, RunInfo};
use crate::features::Features;
use crate::learned::{self, Learned};
use crate::model::Model;
use crate::not_ready::NotReady;
use crate::passage::{PassageOptions, Unplanned};
use crate::task::{Task, TaskError};
use crate::tool_residual::{LONGEST_DELAY, ToolResidual};
use crate::tracking::{Tracking, TrackingOptions};

/// Name of the controller.
pub const NARX_QP: &str = "narx-qp";
/// Largest fast correction, share of the reach.
pub const LARGEST_FAST: f64 = 0.1;
/// Time constant of each of the two filters that smooth the fast correction, s.
const SMOOTHING: f64 = 0.004;
/// Ticks looked ahead without a network.
const HORIZON: usize = 3;

/// What the controller understands in the task's `[options]`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct NarxQpOptions {
    /// Time in which the correction goes from none to full, s.
    pub blend: f64,
    /// Span of the moving average over the predicted journals, s.
    pub average: f64,
    /// Span of the horizon over which corrections are planned, s; 0 for none. See [`TrackingOptions::horizon`].
    pub horizon: f64,
    /// Weights of the compensation's cost.
    pub cost: Weights,
    /// Whether passages through the corners of the path are planned before the run; see [`crate::passage`].
    pub passages: bool,
    /// What they are judged by.
    pub passage: PassageOptions,
    /// Age of the tracker's readings, ticks.
    pub tracker_delay: u64,
    /// File with the network's weights; absent: those that come with the project for this arm, if there are any.
    pub weights: Option<String>,
    /// Share of what the forecast says beyond the residual that is corrected, 0 to 1. None by default: a bearing that is moved after
    /// its swinging journal feeds the swinging, as measured on the soft square.
    pub fast: f64,
    /// Whether the feedback is softer for a while after a journal has landed, with play in one joint only where it goes on bouncing; see
    /// [`crate::knocks`].
    pub soft_landing: bool,
    /// Whether commands make up for what the servos of the model do to them; mode servo. See [`crate::command_filter`].
    pub command_filter: bool,
}

impl Default for NarxQpOptions {
    fn default() -> NarxQpOptions {
        let TrackingOptions { blend, average, weights, horizon, .. } = TrackingOptions::default();
        NarxQpOptions {
            blend,
            average,
            horizon,
            cost: weights,
            passages: true,
            passage: PassageOptions::default(),
            tracker_delay: 0,
            weights: None,
            fast: 0.0,
            soft_landing: true,
            command_filter: false,
        }
    }
}

impl NarxQpOptions {
    fn tracking(&self, period: f64) -> Result<TrackingOptions, TaskError> {
        if self.tracker_delay > LONGEST_DELAY {
            let fault = "tracker_delay must be 0 to 50 ticks";
            return Err(TaskError::OptionValue { controller: NARX_QP.to_owned(), fault });
        }
        if !(0.0..=1.0).contains(&self.fast) {
            let fault = "fast must be 0 to 1";
            return Err(TaskError::OptionValue { controller: NARX_QP.to_owned(), fault });
        }
        let tracking = TrackingOptions {
            blend: self.blend,
            average: self.average,
            horizon: self.horizon,
            weights: self.cost,
            passages: self.passages,
            passage: self.passage,
            soft_landing: self.soft_landing,
            command_filter: self.command_filter,
        };
        tracking.check(NARX_QP, period)?;
        Ok(tracking)
    }
}

/// The controller; see the module. Its options are [`NarxQpOptions`].
#[derive(Default)]
pub struct NarxQp {
    ready: Option<Ready>,
}

struct Ready {
    tracking: Tracking,
    residual: ToolResidual,
    learned: Option<Learned>,
    /// Largest fast correction, m.
    largest: f64,
    period: f64,
    /// Share of what moves fast that is corrected.
    share: f64,
    /// The fast correction after one filter and after two, base frame, m.
    fast: [Vector3<f64>; 2],
    /// Ticks from a state to the instant of its answer.
    lead: u64,
    /// Tick of the last state.
    tick: Option<u64>,
}

impl Controller for NarxQp {
    fn name(&self) -> &str {
        NARX_QP
    }

    fn start(&mut self, task: &Task, run: &RunInfo) -> Result<(), ControllerError> {
        let options: NarxQpOptions = task.options(NARX_QP)?;
        let tracking = options.tracking(task.period())?;
        let model = Model::load(task, run)?;
        let path = JointPath::plan(&model.arm, &task.path, task.rate).map_err(NotReady::from)?;
        let tracking = Tracking::new(task, &model, path.clone(), run.ticks, &tracking)?;
        for Unplanned { first, fault, .. } in tracking.unplanned() {
            let at = *first as f64 * task.period();
            eprintln!(
                "narx-qp: no passage through the corner at {at:.3} s, only the quasi-static correction: {fault}"
            );
        }
        let reach: f64 = model.clearances.iter().map(|(_, clearance)| clearance.clearance).sum();
        self.ready = Some(Ready {
            learned: learn(task, &options, &model, &path)?,
            share: options.fast,
            largest: LARGEST_FAST * reach,
            period: task.period(),
            fast: [Vector3::zeros(); 2],
            tracking,
            residual: ToolResidual::new(&model.arm, reach, task.period(), options.tracker_delay),
            lead: task.mode.lead(),
            tick: None,
        });
        Ok(())
    }

    fn answer(&mut self, state: &State, answer: &mut Answer) {
        let Some(ready) = &mut self.ready else { return answer.give_up() };
        if ready.answer(state, answer).is_none() {
            answer.give_up();
        }
    }
}

/// The forecast for `task`, if one can be made: for one joint with play.
fn learn(
    task: &Task,
    options: &NarxQpOptions,
    model: &Model,
    path: &JointPath,
) -> Result<Option<Learned>, NotReady> {
    let network = network(options.weights.as_deref(), model)?;
    let arm = ArmWithPlay::new(&model.arm, &model.clearances)?;
    let horizon = network.as_ref().map_or(HORIZON, |narx| narx.layout().horizon);
    let features = Features::new(model, &arm, path.clone(), task.mode, task.period(), horizon);
    let lap = lap(&task.path, task.rate);
    Ok(features.map(|features| Learned::new(features, network, task.period(), lap)))
}

/// Ticks of a lap of `path` at `rate`, 1/s, if it is run several times and a lap is a whole number of ticks.
pub fn lap(path: &PathSpec, rate: f64) -> Option<u64> {
    let ticks = path.period * rate;
    let whole = ticks.is_finite() && (ticks - ticks.round()).abs() < 1e-6;
    (path.laps > 1 && whole).then(|| ticks.round() as u64)
}

/// The network of `file`, or the one that comes with the project for `model`; says so where there is none.
fn network(file: Option<&str>, model: &Model) -> Result<Option<Narx>, NotReady> {
    let alone = match model.clearances.as_slice() {
        [(joint, _)] => Some(model.arm.joints()[*joint].name.as_str()),
        _ => None,
    };
    if let Some(file) = file {
        let narx = Narx::load(Path::new(file))?;
        let other = |source| NotReady::OtherWeights { file: file.to_owned(), source: Box::new(source) };
        learned::check(&narx, &model.arm, alone).map_err(other)?;
        if alone.is_none() {
            let found = model.clearances.len();
            eprintln!(
                "narx-qp: {file} is not used: a network forecasts for one joint with play, the model has {found}"
            );
            return Ok(None);
        }
        return Ok(Some(narx));
    }
    let found = alone.and_then(|joint| learned::shipped(&model.arm, joint));
    if found.is_none() {
        let joints: Vec<&str> =
            model.clearances.iter().map(|(joint, _)| model.arm.joints()[*joint].name.as_str()).collect();
        let joints = if joints.is_empty() { "no joint".to_owned() } else { joints.join(", ") };
        eprintln!(
            "narx-qp: no weights for the arm {} with play in {joints}: it runs on physics and what a tracked tool says \
             (freeplay train makes weights)",
            model.arm.name()
        );
    }
    Ok(found)
}

impl Drop for Ready {
    fn drop(&mut self) {
        let ignored = self.learned.as_ref().map_or(0, Learned::ignored);
        if ignored > 0 {
            eprintln!("narx-qp: {ignored} predictions of the network were not finite and were not used");
        }
    }
}

impl Ready {
    /// What moves faster than the residual learns, smoothed and bounded, base frame, m.
    fn forecast(&mut self, state: &State) -> Vector3<f64> {
        let beyond = self.learned.as_mut().and_then(|learned| learned.push(state)).unwrap_or_default();
        let fast = (beyond - self.residual.now()) * self.share;
        let length = fast.norm();
        let trusted = beyond != Vector3::zeros() && length.is_finite();
        let fast = if !trusted {
            Vector3::zeros()
        } else if length > self.largest {
            fast * (self.largest / length)
        } else {
            fast
        };
        let share = (self.period / SMOOTHING).min(1.0);
        self.fast[0] += (fast - self.fast[0]) * share;
        self.fast[1] += (self.fast[0] - self.fast[1]) * share;
        self.fast[1]
    }

    fn answer(&mut self, state: &State, answer: &mut Answer) -> Option<()> {
        if self.tick.is_some_and(|last| state.tick <= last) {
            self.residual.restart();
        }
        self.tick = Some(state.tick);
        self.residual.observe(state);
        let fast = self.forecast(state);
        let residual = &mut self.residual;
        self.tracking.answer(state, &mut |plan| residual.beyond(plan) + fast, answer)?;
        self.residual.aim(state.tick + self.lead, self.tracking.target(), &answer.value);
        Some(())
    }
}
