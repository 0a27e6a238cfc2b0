//! The built-in `narx-qp`: the compensation programme corrects the deviation by the physical prediction plus the learned remainder. Through the
//! corners of its own path the controller follows passages planned before the run ([`crate::passage`]).
//!
//! The learned remainder ([`Remainder`]) comes from a weight file of the task with a proof for its model; without one, the controller uses the
//! physical prediction alone. With a tracked tool, the controller learns the residual of both online ([`ToolResidual`]), for example by a wrong
//! clearance or by friction that the model lacks.

use freeplay_controller_sdk::{Answer, Controller, ControllerError, RunInfo};
use std::path::Path;

use freeplay_path::JointPath;
use freeplay_shm::State;
use serde::{Deserialize, Serialize};

use crate::compensation::Weights;
use crate::model::Model;
use crate::not_ready::NotReady;
use crate::passage::{PassageOptions, Unplanned};
use crate::remainder::{Machine, Remainder, WeightFile};
use crate::task::{Task, TaskError};
use crate::tool_residual::{LONGEST_DELAY, ToolResidual};
use crate::tracking::{Plan, Tracking, TrackingOptions};

/// Name of the controller.
pub const NARX_QP: &str = "narx-qp";

/// Options of the controller in the task's `[options]`.
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
    /// If true, passages through the corners of the path are planned before the run; see [`crate::passage`].
    pub passages: bool,
    /// Options of the planning of passages.
    pub passage: PassageOptions,
    /// Delay of the tracker, ticks.
    pub tracker_delay: u64,
    /// If true, the feedback is softer for a while after a journal has landed; with play in one joint, only while the journal keeps bouncing. See
    /// [`crate::impact_detector`].
    pub soft_landing: bool,
    /// If true, the commands compensate the dynamics of the servos in the model; mode servo. See [`crate::command_filter`].
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
    remainder: Option<Remainder>,
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
        let path = JointPath::plan(&model.nominal, &task.path, task.rate).map_err(NotReady::from)?;
        let tracking = Tracking::new(task, &model, path, run.ticks, &tracking)?;
        for Unplanned { first, fault, .. } in tracking.unplanned() {
            let at = *first as f64 * task.period();
            eprintln!(
                "narx-qp: no passage through the corner at {at:.3} s, only the quasi-static correction: {fault}"
            );
        }
        let reach: f64 = model.clearances.iter().map(|(_, clearance)| clearance.clearance).sum();
        self.ready = Some(Ready {
            remainder: learned(task, &model)?,
            tracking,
            residual: ToolResidual::new(&model.nominal, reach, task.period(), options.tracker_delay),
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

/// The learned remainder of `task`, if it names one; the function reports a file without a proof.
fn learned(task: &Task, model: &Model) -> Result<Option<Remainder>, NotReady> {
    let Some(name) = &task.weights else { return Ok(None) };
    let file = WeightFile::load(Path::new(name))?;
    let [arm_hash, model_hash] = model.hashes.clone();
    let machine = Machine::of(model.arm.name(), arm_hash, model_hash, task);
    let other = |source| NotReady::OtherWeights { file: name.clone(), source: Box::new(source) };
    file.check(&machine, model.arm.dof()).map_err(other)?;
    if !file.receipt.proved {
        eprintln!(
            "narx-qp: {name} is not used: simulated runs did not prove it (freeplay train prints them)"
        );
        return Ok(None);
    }
    Ok(Some(Remainder::new(&file, &model.arm, task.period()).map_err(other)?))
}

impl Drop for Ready {
    fn drop(&mut self) {
        let ignored = self.remainder.as_ref().map_or(0, |remainder| remainder.usage().not_finite);
        if ignored > 0 {
            eprintln!("narx-qp: {ignored} predictions of the network were not finite and were not used");
        }
    }
}

impl Ready {
    fn answer(&mut self, state: &State, answer: &mut Answer) -> Option<()> {
        if self.tick.is_some_and(|last| state.tick <= last) {
            self.residual.restart();
        }
        self.tick = Some(state.tick);
        self.residual.observe(state);
        let Ready { tracking, residual, remainder, .. } = self;
        let mut beyond = |plan: &Plan<'_>| {
            let learned = remainder
                .as_mut()
                .map_or_else(Default::default, |learned| learned.at(plan.tick, plan.motion));
            let Plan { tick, motion, deviation } = *plan;
            residual.estimate_for(&Plan { tick, motion, deviation: deviation + learned }) + learned
        };
        tracking.answer(state, &mut beyond, answer)?;
        self.residual.aim(state.tick + self.lead, self.tracking.links(), &answer.value);
        Some(())
    }
}
