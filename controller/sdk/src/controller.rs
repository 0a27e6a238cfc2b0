//! The interface of a controller: one trait with its inputs and its answer.

use freeplay_shm::{CommandStatus, Joints, MAX_JOINTS, State};

use crate::controller_error::ControllerError;
use crate::run_info::RunInfo;
use crate::task::Task;

/// A controller. It starts once with its task and then answers one state after another.
///
/// The answer to the state of tick k is in force from tick k + 1 to tick k + 2. A torque is for the instant of tick k + 1, when it takes
/// effect; a position is for tick k + 2, when the joint reaches it (see [`TaskMode::lead`](crate::TaskMode::lead)). [`State::reference_next`]
/// is the reference at that instant. States arrive in order; some are missing if the controller was too slow. [`Controller::answer`] should
/// not allocate, log or wait, and must depend only on the task and the states so far, so that a recorded run can be replayed.
pub trait Controller {
    /// Name of the controller for people, at most 64 bytes.
    fn name(&self) -> &str;

    /// Prepares a run; everything that takes time or memory belongs here.
    ///
    /// # Errors
    /// A reason why the controller cannot start; the process shows it to the user and ends.
    fn start(&mut self, task: &Task, run: &RunInfo) -> Result<(), ControllerError>;

    /// Answers `state`. `answer` is blank: everything zero, status ok.
    fn answer(&mut self, state: &State, answer: &mut Answer);

    /// Announces that the answer to `state`, the next call, is the first one in force after a takeover from another controller. A controller
    /// with internal state (an integrator, an active correction) may align it with the arm, so that the blend is small. The program calls it
    /// before a planned swap only; a failure of the other controller gives no notice. The default does nothing.
    fn take_over(&mut self, state: &State) {
        let _ = state;
    }
}

/// The answer to one state, which becomes a command.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Answer {
    /// Status of the answer.
    pub status: CommandStatus,
    /// Torque, N·m (N), or position, rad (m), depending on the mode of the run.
    pub value: Joints,
    /// Velocity of the joints at that instant, rad/s (m/s). In mode torque it is informative: it is not sent, and only a run in one process
    /// shows it as the commanded velocity. It is zero if a controller does not set it.
    pub velocity: Joints,
    /// Acceleration of the joints, rad/s² (m/s²): in mode driven at that instant, in mode torque the mean over the tick for which the torque
    /// is held; in other respects as the velocity.
    pub acceleration: Joints,
    /// Predicted deviation of the tool by the play of the joints at the instant of the answer, before compensation, base frame, m.
    pub deviation: [f64; 3],
    /// Time of the prediction, ns.
    pub predict_ns: u64,
    /// Time of the quadratic programme, ns.
    pub qp_ns: u64,
    /// Iterations of the quadratic programme; 0 if no limit is active.
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

    /// Returns true if every number for the joints and the deviation is finite.
    pub fn is_finite(&self) -> bool {
        let joints = [&self.value, &self.velocity, &self.acceleration];
        let finite = |value: &f64| value.is_finite();
        joints.into_iter().flatten().all(finite) && self.deviation.iter().all(finite)
    }

    /// Marks this answer as missing; the plant's gate then applies its fallback.
    pub fn give_up(&mut self) {
        *self = Answer { status: CommandStatus::NoAnswer, ..Answer::BLANK };
    }
}
