//! A controller with an added computing time, to find the limit of a tick's time budget.

use freeplay_controller::{Answer, Controller, ControllerError, RunInfo, Task};
use freeplay_shm::{State, now_ns};

/// A controller that spins for a given time before each of its answers.
pub struct SlowedController {
    inner: Box<dyn Controller>,
    load_ns: u64,
}

impl SlowedController {
    /// Adds `load` s to each answer of `inner`.
    pub fn new(inner: Box<dyn Controller>, load: f64) -> Self {
        Self { inner, load_ns: (load * 1e9) as u64 }
    }
}

impl Controller for SlowedController {
    fn name(&self) -> &str {
        self.inner.name()
    }

    fn start(&mut self, task: &Task, run: &RunInfo) -> Result<(), ControllerError> {
        self.inner.start(task, run)
    }

    fn answer(&mut self, state: &State, answer: &mut Answer) {
        self.inner.answer(state, answer);
        let end = now_ns() + self.load_ns;
        while now_ns() < end {
            std::hint::spin_loop();
        }
    }

    fn take_over(&mut self, state: &State) {
        self.inner.take_over(state);
    }
}
