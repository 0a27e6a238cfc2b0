//! The built-in `narx-qp`: the deviation that physics predicts plus what is learned beyond it, taken out by the compensation
//! programme; through the corners of its own path it goes as planned before the run ([`crate::passage`]).
//!
//! With a tracked tool the slowly varying residual is learned online ([`ToolResidual`]): a wrong clearance, a friction that the
//! model leaves out.

use freeplay_path::JointPath;
use freeplay_shm::State;
use serde::{Deserialize, Serialize};

use crate::compensation::Weights;
use crate::controller::{Answer, Controller, ControllerError, RunInfo};
use crate::model::Model;
use crate::task::{Task, TaskError};
use crate::tool_residual::{LONGEST_DELAY, ToolResidual};
use crate::tracking::{Tracking, TrackingOptions};

/// Name of the controller.
pub const NARX_QP: &str = "narx-qp";

/// What the controller understands in the task's `[options]`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct NarxQpOptions {
    /// Time in which the correction goes from none to full, s.
    pub blend: f64,
    /// Span of the moving average over the predicted journals, s.
    pub average: f64,
    /// Weights of the compensation's cost.
    pub cost: Weights,
    /// Whether passages through the corners of the path are planned before the run; see [`crate::passage`].
    pub passages: bool,
    /// Age of the tracker's readings, ticks.
    pub tracker_delay: u64,
}

impl Default for NarxQpOptions {
    fn default() -> NarxQpOptions {
        let TrackingOptions { blend, average, weights, .. } = TrackingOptions::default();
        NarxQpOptions { blend, average, cost: weights, passages: true, tracker_delay: 0 }
    }
}

impl NarxQpOptions {
    fn tracking(&self) -> Result<TrackingOptions, TaskError> {
        if self.tracker_delay > LONGEST_DELAY {
            let fault = "tracker_delay must be 0 to 50 ticks";
            return Err(TaskError::OptionValue { controller: NARX_QP.to_owned(), fault });
        }
        let tracking = TrackingOptions {
            blend: self.blend,
            average: self.average,
            weights: self.cost,
            passages: self.passages,
        };
        tracking.check(NARX_QP)?;
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
        let tracking = options.tracking()?;
        let model = Model::load(task, run)?;
        let path = JointPath::plan(&model.arm, &task.path, task.rate)?;
        let reach = model.clearances.iter().map(|(_, clearance)| clearance.clearance).sum();
        self.ready = Some(Ready {
            tracking: Tracking::new(task, &model, path, run.ticks, &tracking)?,
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

impl Ready {
    fn answer(&mut self, state: &State, answer: &mut Answer) -> Option<()> {
        if self.tick.is_some_and(|last| state.tick <= last) {
            self.residual.restart();
        }
        self.tick = Some(state.tick);
        self.residual.observe(state);
        let residual = &mut self.residual;
        self.tracking.answer(state, &mut |plan| residual.beyond(plan), answer)?;
        self.residual.aim(state.tick + self.lead, self.tracking.target());
        Some(())
    }
}
