//! Command filter for position servos: it computes the commands with which the servos of the model follow the path.
//!
//! A servo of stiffness k and damping d gives τ = k e − d q̇ for the error e, delayed by its dead time. To put the joint at q with the velocity q̇ while its
//! drive gives τ, the command is u = q + (τ + d q̇)/k, sent earlier by the delay and by half the hold time of a command. τ is that of the model along the path:
//! inertia, gravity, friction. At a reversal dry friction changes its sign and u jumps. The filter smooths the jump over the same span as known shifts, and
//! limits the commands to the torque of the servo and to the speed of the joint.
//! Source: Åström & Murray 2008, Feedback Systems, §12.2 (feed-forward by inversion).

use freeplay_arm::Joint;
use freeplay_controller_sdk::Answer;
use freeplay_laws::{Baseline, Injection, Placed, ServoLaw};
use freeplay_path::JointPath;
use freeplay_shm::Reference;

use crate::displacement_preview::SAME_PATH;
use crate::known_effects::{BLEND, HALF_SPAN, MOST_ROWS, averaged, by_row, rate_of, sampled, smooth_step};
use crate::model::Model;
use crate::not_ready::NotReady;
use crate::task::{Task, TaskError, TaskMode};

/// Share of a joint's speed limit for the commands; the rest is for corrections that are added to them.
const SPEED_SHARE: f64 = 0.9;

/// The filter; see the module.
#[derive(Clone, Debug)]
pub struct CommandFilter {
    step: f64,
    joints: usize,
    /// The path, `[row][joint]`.
    path: Vec<f64>,
    /// Commands minus path, `[row][joint]`, rad (m), and the rate of that difference.
    shift: [Vec<f64>; 2],
}

impl CommandFilter {
    /// Creates the filter for the servos of `model` along `path`, for the controller `controller` of `task`.
    ///
    /// # Errors
    /// [`TaskError::OptionValue`] in a mode other than servo, or for a model that lacks a servo; effects that give an impossible arm.
    pub fn along(
        model: &Model,
        path: &JointPath,
        task: &Task,
        controller: &str,
    ) -> Result<CommandFilter, NotReady> {
        let refused = |fault| {
            let fault = TaskError::OptionValue { controller: controller.to_owned(), fault };
            NotReady::Task(fault.into())
        };
        if task.mode != TaskMode::Servo {
            return Err(refused("command_filter is for mode servo"));
        }
        let injection = model.effects.injection();
        let servo = |joint: usize| Servo::of(&injection, joint);
        let servos: Option<Vec<Servo>> = (0..model.arm.dof()).map(servo).collect();
        let servos =
            servos.ok_or_else(|| refused("command_filter needs a servo at each joint of the model"))?;
        let step = task.period().max(path.duration() / MOST_ROWS);
        let motion = sampled(&model.arm, path, step);
        let as_it_is = |column: &[f64]| column.to_vec();
        let laws: Vec<&Placed> = model.effects.placed.iter().filter(|placed| costs_torque(placed)).collect();
        let spent = Baseline::new(&model.arm, &laws, &motion, &as_it_is).map_err(NotReady::Law)?;
        let held = task.command_rate.map_or(task.period(), f64::recip);
        let half = (HALF_SPAN / step).round() as usize;
        let shift = |(index, servo): (usize, &Servo)| {
            let (q, v) = (&motion.q[index], &motion.v[index]);
            let torque = &spent.prediction().torque[index];
            let error: Vec<f64> = torque.iter().zip(v).map(|(torque, v)| servo.error(*torque, *v)).collect();
            let error = averaged(&averaged(&error, half), half);
            let wanted: Vec<f64> = q.iter().zip(&error).map(|(q, error)| q + error).collect();
            let early = earlier(&wanted, (servo.delay + 0.5 * held) / step);
            let joint = &model.arm.joints()[index];
            let blended =
                early.iter().zip(q).zip(&motion.t).map(|((u, q), t)| q + smooth_step(t / BLEND) * (u - q));
            let led = led(&blended.collect::<Vec<f64>>(), joint, step);
            led.iter().zip(q).map(|(u, q)| u - q).collect::<Vec<f64>>()
        };
        let shift: Vec<Vec<f64>> = servos.iter().enumerate().map(shift).collect();
        let rate: Vec<Vec<f64>> = shift.iter().map(|column| rate_of(column, step)).collect();
        let rows = motion.len();
        Ok(CommandFilter {
            step,
            joints: model.arm.dof(),
            path: by_row(&motion.q, rows),
            shift: [by_row(&shift, rows), by_row(&rate, rows)],
        })
    }

    /// Shifts the commanded positions and velocities of `answer` for the instant `t`, s. If `reference` is not on the path, the answer stays unchanged.
    pub fn apply(&self, t: f64, reference: &Reference, answer: &mut Answer) {
        let last = self.path.len() / self.joints - 1;
        let row = ((t / self.step).round().max(0.0) as usize).min(last) * self.joints;
        let path = &self.path[row..row + self.joints];
        if path.iter().zip(&reference.q).any(|(own, given)| (own - given).abs() > SAME_PATH) {
            return;
        }
        for joint in 0..self.joints {
            answer.value[joint] += self.shift[0][row + joint];
            answer.velocity[joint] += self.shift[1][row + joint];
        }
    }
}

/// The servo of one joint of the model.
struct Servo {
    law: ServoLaw,
    delay: f64,
}

impl Servo {
    fn of(injection: &Injection, joint: usize) -> Option<Servo> {
        let (_, law) = injection.servos.iter().find(|(at, _)| *at == joint)?;
        let delays = injection.command_delays.iter().filter(|(at, _)| *at == joint);
        Some(Servo { law: *law, delay: delays.map(|(_, delay)| delay).sum() })
    }

    /// Command minus position for which the servo gives `torque`, N·m (N), at the velocity `v`.
    fn error(&self, torque: f64, v: f64) -> f64 {
        let law = &self.law;
        let asked = (torque + law.damping * v).clamp(-law.torque_limit, law.torque_limit);
        // Rounding down subtracts half a step on average.
        let rounded = 0.5 * law.resolution - law.offset;
        let band = if asked == 0.0 { 0.0 } else { law.deadband.copysign(asked) };
        asked / law.stiffness + band + rounded
    }
}

/// Returns true if the drives need torque for `placed`; they need none for sensors, and none for springs and gaps behind the encoder.
fn costs_torque(placed: &Placed) -> bool {
    let mut injection = Injection::default();
    placed.effect.inject(&mut injection);
    !injection.drives.is_empty() || !injection.rotors.is_empty()
}

/// `column` shifted `rows` rows earlier, by linear interpolation; beyond its end it keeps its last value.
fn earlier(column: &[f64], rows: f64) -> Vec<f64> {
    let last = column.len() - 1;
    let read = |row: usize| {
        let at = row as f64 + rows;
        let (from, share) = ((at as usize).min(last), at.fract());
        let to = (from + 1).min(last);
        column[from] + share * (column[to] - column[from])
    };
    (0..column.len()).map(read).collect()
}

/// `column` limited to the range of `joint` and to its speed.
fn led(column: &[f64], joint: &Joint, step: f64) -> Vec<f64> {
    let limits = &joint.limits;
    let most = SPEED_SHARE * limits.velocity * step;
    let mut now = column[0];
    let follow = |wanted: &f64| {
        now += (wanted - now).clamp(-most, most);
        now = now.max(limits.lower).min(limits.upper);
        now
    };
    column.iter().map(follow).collect()
}
