//! An FMU as a [`Controller`].
//!
//! At tick k the FMU gets the state, steps from k to k + 1 periods, and its outputs are the answer. If the FMU refuses a call, there is no answer, which
//! the plant's gate counts and bridges; after an error the controller calls the FMU no more.

use std::path::{Path, PathBuf};

use freeplay_controller_sdk::{Answer, Controller, ControllerError, PAPER_MODEL, RunInfo, Task};
use freeplay_model::paper_arm;
use freeplay_shm::State;

use super::slave::Slave;
use super::{GuestError, Mapping, Opened};

/// A controller implemented by an FMU.
#[derive(Debug)]
pub struct FmuController {
    path: PathBuf,
    name: String,
    ready: Option<Ready>,
}

#[derive(Debug)]
struct Ready {
    slave: Slave,
    mapping: Mapping,
    inputs: Vec<f64>,
    outputs: Vec<f64>,
    period: f64,
    /// The tick at which the FMU started.
    first: Option<u64>,
    /// Number of ticks that it has stepped since.
    done: u64,
    failed: bool,
}

impl FmuController {
    /// Creates a controller from the FMU `path`.
    pub fn new(path: &Path) -> FmuController {
        let name = path.file_name().map_or_else(String::new, |name| name.to_string_lossy().into_owned());
        FmuController { path: path.to_path_buf(), name: name.chars().take(60).collect(), ready: None }
    }

    /// Returns true if `path` names an FMU.
    pub fn is_named(path: &Path) -> bool {
        path.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("fmu"))
    }

    fn prepare(&self, joints: &[String], period: f64) -> Result<Ready, GuestError> {
        let opened = Opened::new(&self.path)?;
        let mapping = Mapping::of(&opened.guest, &self.path, joints)?;
        let slave = opened.start()?;
        let (inputs, outputs) = (vec![0.0; mapping.signals.len()], vec![0.0; mapping.commands.len()]);
        Ok(Ready { slave, mapping, inputs, outputs, period, first: None, done: 0, failed: false })
    }
}

impl Controller for FmuController {
    fn name(&self) -> &str {
        &self.name
    }

    fn start(&mut self, task: &Task, run: &RunInfo) -> Result<(), ControllerError> {
        let custom = |error: Box<dyn std::error::Error + Send + Sync>| ControllerError::Custom(error);
        let arm = match task.model.as_str() {
            PAPER_MODEL => paper_arm().arm,
            model => freeplay_model::load(Path::new(model)).map_err(|error| custom(error.into()))?.arm,
        };
        task.check(arm.dof(), run)?;
        let joints: Vec<String> = arm.joints().iter().map(|joint| joint.name.clone()).collect();
        let ready = self.prepare(&joints, task.period());
        let named = |error: GuestError| custom(format!("{}: {error}", self.path.display()).into());
        self.ready = Some(ready.map_err(named)?);
        Ok(())
    }

    fn answer(&mut self, state: &State, answer: &mut Answer) {
        let Some(ready) = self.ready.as_mut().filter(|ready| !ready.failed) else { return answer.give_up() };
        if ready.step(state).is_err() {
            ready.failed = true;
            return answer.give_up();
        }
        // A NaN passes to the plant's gate, which counts it by its reason.
        ready.mapping.answer(state, &ready.outputs, answer);
    }
}

impl Ready {
    fn step(&mut self, state: &State) -> Result<(), GuestError> {
        for (input, signal) in self.inputs.iter_mut().zip(&self.mapping.signals) {
            *input = signal.of(state, self.period);
        }
        // An FMU starts at its time 0 when its controller joins; one longer step covers missed states.
        let first = *self.first.get_or_insert(state.tick);
        let until = (state.tick + 1).saturating_sub(first).max(self.done + 1);
        self.slave.set(&self.mapping.input_references, &mut self.inputs)?;
        let [from, step] = [self.done, until - self.done].map(|ticks| ticks as f64 * self.period);
        self.slave.step(from, step)?;
        self.done = until;
        self.slave.get(&self.mapping.output_references, &mut self.outputs)
    }
}
