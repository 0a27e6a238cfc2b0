//! The check of commands from a controller to the joints, and the fallback for commands that fail.
//!
//! A command passes if it is well-formed, fresh (it echoes the tick for which it is due), finite and in range, and if it does not change
//! too fast: a torque no faster than the drive's torque rate, a position no faster than the joint can move from its measured state. The
//! gate counts each rejected command by reason and never applies it: it holds the last command that passed for [`GateLimits::hold`] ticks;
//! then the brakes close and stay closed.

use freeplay_arm::Arm;
use freeplay_shm::{Command, CommandKind, CommandStatus, Joints, MAX_JOINTS, Mode};
use serde::{Deserialize, Serialize};

use crate::limit_violation::{LimitViolation, Quantity};
use crate::rejection::Rejection;

/// The source of the joints' motion.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Applied {
    /// No command can have arrived yet: the plant guides the joints along the reference.
    Guided,
    /// The controller's command.
    Command,
    /// The last command that passed.
    Hold,
    /// The brakes.
    Brake,
}

/// Relative tolerance of a step against a limit, for rounding: positions of some radians have 16 digits, so that their change in a tick has
/// 11.
const ROUNDING: f64 = 1e-9;

/// Limits for commands.
#[derive(Clone, Debug, PartialEq)]
pub struct GateLimits {
    /// The kind of the values: torques or positions.
    pub mode: Mode,
    /// Least value of each joint, N·m or rad.
    pub lower: Joints,
    /// Greatest value of each joint.
    pub upper: Joints,
    /// Length of a tick, s.
    pub period: f64,
    /// Greatest change of each joint's value from tick to tick.
    pub change: Joints,
    /// Greatest speed of each joint in a position command, rad/s (m/s).
    pub speed: Joints,
    /// Greatest acceleration of each joint in a position command, rad/s² (m/s²).
    pub acceleration: Joints,
    /// Ticks for which the gate holds the last good command.
    pub hold: u32,
}

impl GateLimits {
    /// Limits of `arm`, stepped by `period` s: in torque mode the effort and its rate, at most `torque_rate` (N·m/s, N/s); else range,
    /// speed and acceleration of positions.
    pub fn of(arm: &Arm, mode: Mode, period: f64, hold: u32, torque_rate: &Joints) -> Self {
        let mut limits = Self {
            mode,
            period,
            lower: [0.0; MAX_JOINTS],
            upper: [0.0; MAX_JOINTS],
            change: [0.0; MAX_JOINTS],
            speed: [0.0; MAX_JOINTS],
            acceleration: [0.0; MAX_JOINTS],
            hold,
        };
        for (i, joint) in arm.joints().iter().enumerate().take(MAX_JOINTS) {
            let of = &joint.limits;
            (limits.lower[i], limits.upper[i], limits.change[i]) = match mode {
                Mode::Torque => (-of.effort, of.effort, torque_rate[i] * period),
                Mode::Driven | Mode::Servo => (of.lower, of.upper, of.velocity * period),
            };
            // An arm file without acceleration limits still has speed limits: no joint reverses from one to the other within less than a
            // tick.
            let reversal = 2.0 * of.velocity / period;
            let acceleration = if of.acceleration.is_finite() { of.acceleration } else { reversal };
            (limits.speed[i], limits.acceleration[i]) = (of.velocity, acceleration);
        }
        limits
    }

    /// The limit that `command` violates with its position, velocity and acceleration at the end of a tick. The joints are at `measured`
    /// (\[q, v, a\]) at its start and have followed no command for `held` ticks.
    ///
    /// The mean speed of the step must be within the speed limit. Between two velocities, a joint with the acceleration limit a can move by
    /// at most a T²/4 more or less than at their mean. While joints were held at their velocity, a reference may have accelerated: T is
    /// then the time since the last command that a joint followed.
    pub fn step_excess(&self, command: &Command, measured: &[[f64; 3]], held: u32) -> Option<LimitViolation> {
        let span = self.period * f64::from(held + 1);
        measured.iter().enumerate().take(command.joints as usize).find_map(|(joint, &[q, v, _])| {
            let (step, end) = (command.value[joint] - q, command.velocity[joint]);
            let excess = |quantity, value: f64, limit: f64| {
                (value > limit * (1.0 + ROUNDING)).then_some(LimitViolation { quantity, joint, value, limit })
            };
            let unmeant = (step - 0.5 * (v + end) * self.period).abs();
            let acceleration = ((end - v).abs() / span).max(4.0 * unmeant / (span * span));
            excess(Quantity::Speed, step.abs() / self.period, self.speed[joint])
                .or_else(|| excess(Quantity::Acceleration, acceleration, self.acceleration[joint]))
        })
    }

    /// Clamps a blend of two commands to the limits: its value stays within one tick's change of `last`.
    pub fn clamp(&self, command: &mut Command, last: &Command) {
        for joint in 0..command.joints as usize {
            let (from, change) = (last.value[joint], self.change[joint]);
            let value = command.value[joint].clamp(from - change, from + change);
            command.value[joint] = value.clamp(self.lower[joint], self.upper[joint]);
            let (speed, acceleration) = (self.speed[joint], self.acceleration[joint]);
            command.velocity[joint] = command.velocity[joint].clamp(-speed, speed);
            command.acceleration[joint] = command.acceleration[joint].clamp(-acceleration, acceleration);
        }
    }
}

/// The gate of one controller.
#[derive(Clone, Debug)]
pub struct Gate {
    limits: GateLimits,
    run: u64,
    slot: u32,
    joints: usize,
    last: Option<Command>,
    before_last: Option<Command>,
    missed: u32,
    streak: u32,
    braking: bool,
    rejected: [u64; Rejection::ALL.len()],
    excess: Option<LimitViolation>,
}

impl Gate {
    /// A gate for the controller in `slot` of the run `run`, with `joints` joints; no command has passed yet.
    pub fn new(limits: GateLimits, run: u64, slot: u32, joints: usize) -> Self {
        Self {
            limits,
            run,
            slot,
            joints,
            last: None,
            before_last: None,
            missed: 0,
            streak: 0,
            braking: false,
            rejected: [0; Rejection::ALL.len()],
            excess: None,
        }
    }

    /// Checks the answer of the active controller to the tick `due`. Returns the command source for the next tick, and the reason if it is
    /// not the command.
    pub fn pass(&mut self, command: Option<&Command>, due: u64) -> (Applied, Option<Rejection>) {
        let rejection = self.watch(command, due);
        if rejection.is_none() {
            return (if self.braking { Applied::Brake } else { Applied::Command }, None);
        }
        (self.fall_back(), rejection)
    }

    /// Checks the answer of a standby to the tick `due`, without applying it.
    pub fn watch(&mut self, command: Option<&Command>, due: u64) -> Option<Rejection> {
        let verdict = match command {
            None => Err((Rejection::Missing, None)),
            Some(command) => self.judge(command, due).map(|()| command),
        };
        match verdict {
            Ok(command) => {
                self.before_last = if self.missed == 0 { self.last } else { None };
                self.last = Some(*command);
                self.missed = 0;
                self.streak = self.streak.saturating_add(1);
                None
            }
            Err((rejection, excess)) => {
                self.refuse(rejection, excess);
                Some(rejection)
            }
        }
    }

    /// Counts a command as refused for `rejection`, also one that [`Gate::watch`] has accepted; `excess` is the limit that it violates.
    pub fn refuse(&mut self, rejection: Rejection, excess: Option<LimitViolation>) {
        self.rejected[rejection as usize] += 1;
        self.excess = excess;
        self.missed = self.missed.saturating_add(1);
        self.streak = 0;
    }

    /// The command source after a rejection, if no standby takes over.
    pub fn fall_back(&mut self) -> Applied {
        self.braking |= self.missed > self.limits.hold || self.last.is_none();
        if self.braking { Applied::Brake } else { Applied::Hold }
    }

    /// Resets the state for another process in the controller's slot; the counts stay.
    pub fn renew(&mut self) {
        *self = Self {
            rejected: self.rejected,
            ..Self::new(self.limits.clone(), self.run, self.slot, self.joints)
        };
    }

    /// The limits.
    pub fn limits(&self) -> &GateLimits {
        &self.limits
    }

    /// The command that passed one tick before the last one; `None` unless both passed in a row.
    pub fn before_last(&self) -> Option<&Command> {
        self.before_last.as_ref()
    }

    /// The limit that the last refused command violated, if that was the reason.
    pub fn excess(&self) -> Option<LimitViolation> {
        self.excess
    }

    /// Number of successive commands that have not passed.
    pub fn missed(&self) -> u32 {
        self.missed
    }

    /// Number of successive commands that have passed.
    pub fn streak(&self) -> u32 {
        self.streak
    }

    /// The last command that passed.
    pub fn last(&self) -> Option<&Command> {
        self.last.as_ref()
    }

    /// Number of commands rejected for `reason`.
    pub fn rejected(&self, reason: Rejection) -> u64 {
        self.rejected[reason as usize]
    }

    fn judge(&self, command: &Command, due: u64) -> Result<(), Refused> {
        let kind = match self.limits.mode {
            Mode::Torque => CommandKind::Torque,
            Mode::Driven | Mode::Servo => CommandKind::Position,
        };
        let status = CommandStatus::from_code(command.status);
        if command.check(self.run).is_err()
            || command.joints as usize != self.joints
            || command.slot != self.slot
            || command.kind != kind.code()
            || status.is_none()
        {
            return Err((Rejection::Malformed, None));
        }
        if command.tick != due {
            return Err((Rejection::Stale, None));
        }
        if status == Some(CommandStatus::NoAnswer) {
            return Err((Rejection::NoAnswer, None));
        }
        let numbers = [&command.value, &command.velocity, &command.acceleration].into_iter().flatten();
        if !numbers.chain(&command.deviation).all(|number| number.is_finite()) {
            return Err((Rejection::NotFinite, None));
        }
        (0..self.joints).try_for_each(|joint| self.judge_joint(command, joint))
    }

    fn judge_joint(&self, command: &Command, joint: usize) -> Result<(), Refused> {
        let refused = |rejection, quantity, value, limit| {
            Err((rejection, Some(LimitViolation { quantity, joint, value, limit })))
        };
        let (limits, value) = (&self.limits, command.value[joint]);
        let (whole, rate) = match limits.mode {
            Mode::Torque => (Quantity::Torque, Quantity::TorqueRate),
            Mode::Driven | Mode::Servo => (Quantity::Position, Quantity::Speed),
        };
        if value < limits.lower[joint] || value > limits.upper[joint] {
            let limit = if value < limits.lower[joint] { limits.lower[joint] } else { limits.upper[joint] };
            return refused(Rejection::OutOfRange, whole, value, limit);
        }
        for (quantity, value, limit) in [
            (Quantity::Speed, command.velocity[joint].abs(), limits.speed[joint]),
            (Quantity::Acceleration, command.acceleration[joint].abs(), limits.acceleration[joint]),
        ] {
            if value > limit {
                return refused(Rejection::TooFast, quantity, value, limit);
            }
        }
        // A joint that was held for m ticks has moved on for m + 1; a held torque has not changed.
        let room = match limits.mode {
            Mode::Torque => limits.change[joint],
            Mode::Driven | Mode::Servo => limits.change[joint] * f64::from(self.missed + 1),
        };
        let change = self.last.as_ref().map_or(0.0, |last| (value - last.value[joint]).abs());
        if change > room {
            return refused(Rejection::TooFast, rate, change / limits.period, room / limits.period);
        }
        Ok(())
    }
}

/// The reason of a rejection, and the violated limit.
type Refused = (Rejection, Option<LimitViolation>);

#[cfg(test)]
mod tests {
    use super::{Applied, Gate, GateLimits, Rejection};
    use crate::limit_violation::{LimitViolation, Quantity};
    use freeplay_shm::{Command, CommandStatus, MAX_JOINTS, Mode, State};

    const RUN: u64 = 7;

    /// A rejection and a change of the command that causes it.
    type Case = (Rejection, fn(&mut Command));

    fn gate() -> Gate {
        let limits = GateLimits {
            mode: Mode::Torque,
            lower: [-100.0; MAX_JOINTS],
            upper: [100.0; MAX_JOINTS],
            period: 1e-3,
            change: [10.0; MAX_JOINTS],
            speed: [5.0; MAX_JOINTS],
            acceleration: [50.0; MAX_JOINTS],
            hold: 2,
        };
        Gate::new(limits, RUN, 0, 2)
    }

    fn command(tick: u64, value: f64) -> Command {
        let mut state = State::new(RUN, 2);
        state.tick = tick;
        let mut command = Command::answer_to(&state, 0);
        command.value[..2].fill(value);
        command
    }

    #[test]
    fn each_fault_is_named_and_none_is_applied() {
        let cases: [Case; 16] = [
            (Rejection::Malformed, |c| c.magic = 1),
            (Rejection::Malformed, |c| c.layout += 1),
            (Rejection::Malformed, |c| c.run = 8),
            (Rejection::Malformed, |c| c.joints = 3),
            (Rejection::Malformed, |c| c.kind = 1),
            (Rejection::Malformed, |c| c.slot = 1),
            (Rejection::Malformed, |c| c.status = 77),
            (Rejection::NotFinite, |c| c.deviation[2] = f64::NAN),
            (Rejection::NotFinite, |c| c.velocity[MAX_JOINTS - 1] = f64::INFINITY),
            (Rejection::Stale, |c| c.tick -= 1),
            (Rejection::NoAnswer, |c| c.status = CommandStatus::NoAnswer.code()),
            (Rejection::NotFinite, |c| c.value[1] = f64::NAN),
            (Rejection::OutOfRange, |c| c.value[1] = 101.0),
            (Rejection::TooFast, |c| c.value[0] = 30.0),
            (Rejection::TooFast, |c| c.velocity[1] = -6.0),
            (Rejection::TooFast, |c| c.acceleration[1] = 51.0),
        ];
        for (expected, spoil) in cases {
            let mut gate = gate();
            assert_eq!(gate.pass(Some(&command(4, 5.0)), 4), (Applied::Command, None));
            let mut bad = command(5, 5.0);
            spoil(&mut bad);
            assert_eq!(gate.pass(Some(&bad), 5), (Applied::Hold, Some(expected)));
            assert_eq!(gate.rejected(expected), 1);
            assert_eq!(gate.last().map(|c| c.value[0]), Some(5.0));
        }
    }

    #[test]
    fn it_holds_then_brakes_and_stays_braked() {
        let mut gate = gate();
        gate.pass(Some(&command(0, 5.0)), 0);
        let applied: Vec<Applied> = (1..5).map(|tick| gate.pass(None, tick).0).collect();
        assert_eq!(applied, [Applied::Hold, Applied::Hold, Applied::Brake, Applied::Brake]);
        assert_eq!(gate.pass(Some(&command(5, 5.0)), 5), (Applied::Brake, None));
        assert_eq!(gate.rejected(Rejection::Missing), 4);
    }

    #[test]
    fn without_any_command_it_brakes_at_once() {
        assert_eq!(gate().pass(None, 0), (Applied::Brake, Some(Rejection::Missing)));
    }

    #[test]
    fn the_limit_that_a_command_does_not_keep_is_told() {
        let mut gate = gate();
        assert_eq!(gate.pass(Some(&command(4, 5.0)), 4).1, None);
        assert_eq!(gate.pass(Some(&command(5, 25.0)), 5).1, Some(Rejection::TooFast));
        let expected = LimitViolation { quantity: Quantity::TorqueRate, joint: 0, value: 2e4, limit: 1e4 };
        assert_eq!(gate.excess(), Some(expected));
        assert_eq!(gate.pass(Some(&command(6, -101.0)), 6).1, Some(Rejection::OutOfRange));
        let expected = LimitViolation { quantity: Quantity::Torque, joint: 0, value: -101.0, limit: -100.0 };
        assert_eq!(gate.excess(), Some(expected));
        assert_eq!(gate.pass(None, 7).1, Some(Rejection::Missing));
        assert_eq!(gate.excess(), None);
    }

    #[test]
    fn a_position_is_judged_by_the_step_from_where_the_joint_is() {
        let mut limits = gate().limits;
        limits.mode = Mode::Driven;
        // 5 rad/s and 50 rad/s² in ticks of 1 ms; the joints are at 1 rad and 2 rad, the second moves.
        let measured = [[1.0, 0.0, 0.0], [2.0, 4.0, 0.0]];
        let step = |by: [f64; 2], speed: [f64; 2], held| {
            let mut command = command(0, 0.0);
            command.value[..2].copy_from_slice(&[1.0 + by[0], 2.0 + by[1]]);
            command.velocity[..2].copy_from_slice(&speed);
            limits.step_excess(&command, &measured, held).map(|excess| (excess.quantity, excess.joint))
        };
        assert_eq!(step([0.0, 4e-3], [0.0, 4.0], 0), None);
        assert_eq!(step([0.243, 4e-3], [0.0, 4.0], 0), Some((Quantity::Speed, 0)));
        // In turn: a speed that does not fit the step, a step that does not fit the speeds, a joint that stops at once.
        assert_eq!(step([0.0, 4e-3], [3.0, 4.0], 0), Some((Quantity::Acceleration, 0)));
        assert_eq!(step([1e-3, 4e-3], [0.0, 4.0], 0), Some((Quantity::Acceleration, 0)));
        assert_eq!(step([0.0, 0.0], [0.0, 0.0], 0), Some((Quantity::Acceleration, 1)));
        assert_eq!(step([0.0, 4.02e-3], [0.0, 4.05], 0), None);
        // After three held ticks the reference may have moved on.
        assert_eq!(step([1e-4, 4e-3], [0.0, 4.0], 0), Some((Quantity::Acceleration, 0)));
        assert_eq!(step([1e-4, 4e-3], [0.0, 4.0], 3), None);
    }

    #[test]
    fn a_position_after_a_gap_may_have_moved_on_a_torque_may_not() {
        for (mode, second) in [(Mode::Driven, None), (Mode::Torque, Some(Rejection::TooFast))] {
            let mut gate = gate();
            gate.limits.mode = mode;
            let command =
                |tick, value| Command { kind: u32::from(mode == Mode::Driven), ..command(tick, value) };
            assert_eq!(gate.pass(Some(&command(0, 0.0)), 0).1, None);
            gate.pass(None, 1);
            assert_eq!(gate.pass(Some(&command(2, 19.0)), 2).1, second);
        }
    }
}
