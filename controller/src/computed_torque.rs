//! The built-in `computed-torque`: inverse dynamics of the perfect arm with feedback, without compensation.
//!
//! `τ = RNEA(q⁺, v⁺, q̈_d + 2ζω (q̇_d − v⁺) + ω² (q_d − q⁺)) + friction of the drives at q̇_d`, with q⁺, v⁺ the predicted state and q_d, q̇_d, q̈_d the
//! reference at the instant at which the torque takes effect. In modes driven and servo the controller sends the reference unchanged; with the option
//! `command_filter` it sends the commands with which the servos of the model follow the reference.

use freeplay_arm::{Arm, Workspace, rnea};
use freeplay_controller_sdk::{Answer, Controller, ControllerError, RunInfo};
use freeplay_laws::DriveFriction;
use freeplay_path::JointPath;
use freeplay_shm::{Joints, Reference, State};

use crate::command_filter::CommandFilter;
use crate::compensation::Motion;
use crate::look_ahead::{JointState, LookAhead, drive_frictions};
use crate::model::Model;
use crate::task::{Gains, Task, TaskMode};

/// Name of the controller.
pub const COMPUTED_TORQUE: &str = "computed-torque";

/// The controller; see the module.
#[derive(Default)]
pub struct ComputedTorque {
    ready: Option<Ready>,
}

struct Ready {
    arm: Arm,
    workspace: Workspace,
    mode: TaskMode,
    gains: Gains,
    friction: Vec<DriveFriction>,
    look_ahead: LookAhead,
    no_torque: Vec<f64>,
    acceleration: Vec<f64>,
    filter: Option<CommandFilter>,
    period: f64,
}

impl Controller for ComputedTorque {
    fn name(&self) -> &str {
        COMPUTED_TORQUE
    }

    fn start(&mut self, task: &Task, run: &RunInfo) -> Result<(), ControllerError> {
        let options: Options = task.options(COMPUTED_TORQUE)?;
        let model = Model::load(task, run)?;
        let filter = options.command_filter.then(|| {
            let path = JointPath::plan(&model.nominal, &task.path, task.rate)?;
            CommandFilter::along(&model, &path, task, COMPUTED_TORQUE)
        });
        let filter = filter.transpose()?;
        let arm = model.arm;
        let n = arm.dof();
        self.ready = Some(Ready {
            workspace: Workspace::new(&arm),
            mode: task.mode,
            gains: task.gains,
            friction: drive_frictions(&arm),
            look_ahead: LookAhead::new(&arm, task.period()),
            no_torque: vec![0.0; n],
            acceleration: vec![0.0; n],
            filter,
            period: task.period(),
            arm,
        });
        Ok(())
    }

    fn answer(&mut self, state: &State, answer: &mut Answer) {
        let Some(ready) = &mut self.ready else { return answer.give_up() };
        let reference = &state.reference_next;
        (answer.velocity, answer.acceleration) = (reference.qd, reference.qdd);
        let computed = match ready.mode {
            TaskMode::Torque => ready.torque(state, reference, &mut answer.value),
            TaskMode::Driven | TaskMode::Servo => {
                answer.value = reference.q;
                if let Some(filter) = &ready.filter {
                    let t = (state.tick + ready.mode.lead()) as f64 * ready.period;
                    filter.apply(t, reference, answer);
                }
                Some(())
            }
        };
        if computed.is_none() || !answer.is_finite() {
            answer.give_up();
        }
    }
}

/// The options of this controller.
#[derive(Default, serde::Deserialize)]
#[serde(deny_unknown_fields, default)]
struct Options {
    /// If true, the commands compensate the dynamics of the servos in the model; mode servo.
    command_filter: bool,
}

impl Ready {
    fn torque(&mut self, state: &State, reference: &Reference, torque: &mut Joints) -> Option<()> {
        let n = self.arm.dof();
        let desired = Motion { q: &reference.q[..n], v: &reference.qd[..n], a: &reference.qdd[..n] };
        let ahead = self.look_ahead.predict(&self.arm, state, &self.no_torque)?;
        feedback(self.gains, desired, ahead, &mut self.acceleration);
        rnea(&self.arm, &mut self.workspace, &ahead.q, &ahead.v, &self.acceleration, &mut torque[..n]);
        add_drive_friction(&self.friction, desired.v, &mut torque[..n]);
        Some(())
    }
}

/// The acceleration command of the feedback from `state` to `desired`: `q̈_d + 2ζω (q̇_d − v) + ω² (q_d − q)`.
pub(crate) fn feedback(gains: Gains, desired: Motion<'_>, state: &JointState, acceleration: &mut [f64]) {
    let stiffness = gains.natural_frequency * gains.natural_frequency;
    let damping = 2.0 * gains.damping_ratio * gains.natural_frequency;
    for (joint, out) in acceleration.iter_mut().enumerate() {
        *out = desired.a[joint]
            + damping * (desired.v[joint] - state.v[joint])
            + stiffness * (desired.q[joint] - state.q[joint]);
    }
}

/// Adds the torques against the friction of the drives at the velocities `v`.
pub(crate) fn add_drive_friction(friction: &[DriveFriction], v: &[f64], torque: &mut [f64]) {
    for ((torque, friction), &v) in torque.iter_mut().zip(friction).zip(v) {
        *torque += friction.resisting(v);
    }
}
