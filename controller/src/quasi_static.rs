//! The built-in `quasi-static`: the compensation programme corrects the deviation by the physical prediction, without learning.
//!
//! [`Tracking`] contains the whole algorithm.

use freeplay_controller_sdk::{Answer, Controller, ControllerError, RunInfo};
use freeplay_path::JointPath;
use freeplay_shm::State;
use nalgebra::Vector3;

use crate::model::Model;
use crate::not_ready::NotReady;
use crate::task::Task;
use crate::tracking::{Tracking, TrackingOptions};

/// Name of the controller.
pub const QUASI_STATIC: &str = "quasi-static";

/// The controller; see the module. Its options are [`TrackingOptions`].
#[derive(Default)]
pub struct QuasiStaticControl {
    tracking: Option<Tracking>,
}

impl Controller for QuasiStaticControl {
    fn name(&self) -> &str {
        QUASI_STATIC
    }

    fn start(&mut self, task: &Task, run: &RunInfo) -> Result<(), ControllerError> {
        let options: TrackingOptions = task.options(QUASI_STATIC)?;
        options.check(QUASI_STATIC, task.period())?;
        let model = Model::load(task, run)?;
        let path = JointPath::plan(&model.nominal, &task.path, task.rate).map_err(NotReady::from)?;
        self.tracking = Some(Tracking::new(task, &model, path, run.ticks, &options)?);
        Ok(())
    }

    fn answer(&mut self, state: &State, answer: &mut Answer) {
        let Some(tracking) = &mut self.tracking else { return answer.give_up() };
        if tracking.answer(state, &mut |_| Vector3::zeros(), answer).is_none() {
            answer.give_up();
        }
    }
}
