//! What a controller is: one trait, and what it is told and asked.

use freeplay_shm::{CommandStatus, Joints, MAX_JOINTS, State};

use crate::controller_error::ControllerError;
use crate::run_info::RunInfo;
use crate::task::Task;

/// A controller: it is started once with its task and then answers one state after another.
///
/// The answer to the state of tick k is in force from tick k + 1 to tick k + 2. A torque is computed for the instant of tick k + 1, at
/// which it sets in; a position for that of tick k + 2, at which it is reached (see [`TaskMode::lead`](crate::TaskMode::lead)).
/// [`State::reference_next`] is the reference at that instant. States come in order; where this side was too slow, some are missing. [`Controller::answer`] should neither allocate nor log nor wait, and must depend on nothing but the task and the states
/// it was given, so that a recorded run can be replayed.
pub trait Controller {
    /// Name of the controller for people, at most 64 bytes.
    fn name(&self) -> &str;

    /// Gets ready for a run; everything that takes time or memory belongs here.
    ///
    /// # Errors
    /// What the controller cannot do; it is shown to the user and ends the process.
    fn start(&mut self, task: &Task, run: &RunInfo) -> Result<(), ControllerError>;

    /// Answers `state`. `answer` is blank: everything zero, status ok.
    fn answer(&mut self, state: &State, answer: &mut Answer);

    /// The answer to `state`, which is asked for next, is the first of this controller to be put in force, from another controller's
    /// hand: a controller with a state of its own (an integrator, a correction that is under way) may bring it to where the arm is, so
    /// that there is less to blend. Called before a planned swap only; what fails gives no notice. Does nothing unless written.
    fn take_over(&mut self, state: &State) {
        let _ = state;
    }
}

/// The answer to one state: what becomes a command.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Answer {
    /// How the controller arrived at it.
    pub status: CommandStatus,
    /// Torque, N·m (N), or position, rad (m), by the mode of the run.
    pub value: Joints,
    /// Velocity that the joints are to have at that instant, rad/s (m/s). In mode torque nobody acts on it and it is not sent; a run in
    /// one process shows by it what was commanded. Zero where a controller does not say.
    pub velocity: Joints,
    /// Acceleration that they are to have, rad/s² (m/s²): in mode driven at that instant, in mode torque the mean over the tick for which
    /// the torque is held; otherwise as the velocity.
    pub acceleration: Joints,
    /// Predicted deviation of the tool at the instant of the answer that the play of the joints causes, before it is taken out, base frame, m.
    pub deviation: [f64; 3],
    /// How long the prediction took, ns.
    pub predict_ns: u64,
    /// How long the quadratic programme took, ns.
    pub qp_ns: u64,
    /// Iterations of the quadratic programme; 0 where no limit binds.
    pub qp_iterations: u32,
}

impl Answer {
    /// A blank answer.
    pub const BLANK: Answer = Answer {
        status: CommandStatus::Ok,
        value: [0.0; MAX_JOINTS],
        velocity: [0.0; MAX_JOINTS],
        acceleration: [0.0; MAX_JOINTS],
        deviation: [0.0; 3],
        predict_ns: 0,
        qp_ns: 0,
        qp_iterations: 0,
    };

    /// Whether every number for the joints and the deviation is finite.
    pub fn is_finite(&self) -> bool {
        let joints = [&self.value, &self.velocity, &self.acceleration];
        let finite = |value: &f64| value.is_finite();
        joints.into_iter().flatten().all(finite) && self.deviation.iter().all(finite)
    }

    /// Makes this the answer of a controller that has none: the plant's gate takes its fallback.
    pub fn give_up(&mut self) {
        *self = Answer { status: CommandStatus::NoAnswer, ..Answer::BLANK };
    }
}
