//! What may pass from a controller to the joints, and what is applied instead.
//!
//! A command passes if it is well-formed, fresh (it echoes the tick it is due for), finite, in range and does not
//! change faster than the joint allows. What does not pass is counted by name and never applied: the last command
//! that passed is held for [`GateLimits::hold`] ticks, then the brakes close and stay closed.

use freeplay_arm::Arm;
use freeplay_shm::{Command, CommandKind, CommandStatus, Joints, MAX_JOINTS, Mode};
use serde::{Deserialize, Serialize};

/// Why a command did not pass.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Rejection {
    /// None came in time.
    Missing,
    /// It echoes another tick than the one it was due for.
    Stale,
    /// Its magic, layout, run or number of joints is not this run's, or it is of the wrong kind for the mode.
    Malformed,
    /// The controller itself says that it has no answer.
    NoAnswer,
    /// A value is NaN or infinite.
    NotFinite,
    /// A torque is above the joint's effort limit, or a position outside its range.
    OutOfRange,
    /// A value changes faster than the joint allows.
    TooFast,
    /// It is a possible command, but not what the other controllers make of the same state.
    Disagrees,
}

impl Rejection {
    /// All reasons, in the order in which they are looked for.
    pub const ALL: [Rejection; 8] = [
        Self::Missing,
        Self::Malformed,
        Self::Stale,
        Self::NoAnswer,
        Self::NotFinite,
        Self::OutOfRange,
        Self::TooFast,
        Self::Disagrees,
    ];

    /// The name in `summary.json`.
    pub fn name(self) -> &'static str {
        match self {
            Self::Missing => "missing",
            Self::Stale => "stale",
            Self::Malformed => "malformed",
            Self::NoAnswer => "no_answer",
            Self::NotFinite => "not_finite",
            Self::OutOfRange => "out_of_range",
            Self::TooFast => "too_fast",
            Self::Disagrees => "disagrees",
        }
    }
}

/// What is in force on the joints.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Applied {
    /// No command can have come yet: the joints are guided along the reference.
    Guided,
    /// The controller's command.
    Command,
    /// The last command that passed.
    Hold,
    /// The brakes.
    Brake,
}

/// Limits of what passes.
#[derive(Clone, Debug, PartialEq)]
pub struct GateLimits {
    /// Whether values are torques or positions.
    pub mode: Mode,
    /// Least value of each joint, N·m or rad.
    pub lower: Joints,
    /// Greatest value of each joint.
    pub upper: Joints,
    /// Greatest change of each joint's value from tick to tick.
    pub change: Joints,
    /// Greatest speed of each joint that a position may come with, rad/s (m/s).
    pub speed: Joints,
    /// Greatest acceleration of each joint that a position may come with, rad/s² (m/s²).
    pub acceleration: Joints,
    /// Ticks for which the last good command is held.
    pub hold: u32,
}

impl GateLimits {
    /// Limits of `arm`, stepped by `period` s: effort and its change by one effort limit a tick in torque mode; range,
    /// speed and acceleration in driven mode.
    pub fn of(arm: &Arm, mode: Mode, period: f64, hold: u32) -> Self {
        let mut limits = Self {
            mode,
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
                Mode::Torque => (-of.effort, of.effort, of.effort),
                Mode::Driven => (of.lower, of.upper, of.velocity * period),
            };
            (limits.speed[i], limits.acceleration[i]) = (of.velocity, of.acceleration);
        }
        limits
    }

    /// Brings what is put together of two commands within the limits: its value no further from `last` than one tick allows.
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
    joints: usize,
    last: Option<Command>,
    before_last: Option<Command>,
    missed: u32,
    streak: u32,
    braking: bool,
    rejected: [u64; Rejection::ALL.len()],
}

impl Gate {
    /// A gate for the run `run` and `joints` joints that nothing has passed yet.
    pub fn new(limits: GateLimits, run: u64, joints: usize) -> Self {
        Self {
            limits,
            run,
            joints,
            last: None,
            before_last: None,
            missed: 0,
            streak: 0,
            braking: false,
            rejected: [0; Rejection::ALL.len()],
        }
    }

    /// Judges the answer of the controller in charge to the tick `due`; says what is to be applied in the next tick, and why
    /// not the command.
    pub fn pass(&mut self, command: Option<&Command>, due: u64) -> (Applied, Option<Rejection>) {
        let rejection = self.watch(command, due);
        if rejection.is_none() {
            return (if self.braking { Applied::Brake } else { Applied::Command }, None);
        }
        (self.fall_back(), rejection)
    }

    /// Judges the answer to the tick `due` of a controller that is not in charge: nothing is applied.
    pub fn watch(&mut self, command: Option<&Command>, due: u64) -> Option<Rejection> {
        let verdict = match command {
            None => Err(Rejection::Missing),
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
            Err(rejection) => {
                self.refuse(rejection);
                Some(rejection)
            }
        }
    }

    /// Counts a command as refused for `rejection`, be it one that [`Gate::watch`] let pass.
    pub fn refuse(&mut self, rejection: Rejection) {
        self.rejected[rejection as usize] += 1;
        self.missed = self.missed.saturating_add(1);
        self.streak = 0;
    }

    /// What is to be applied after a rejection where nobody else takes over.
    pub fn fall_back(&mut self) -> Applied {
        self.braking |= self.missed > self.limits.hold || self.last.is_none();
        if self.braking { Applied::Brake } else { Applied::Hold }
    }

    /// Forgets a controller whose place another process has taken; the counts stay.
    pub fn renew(&mut self) {
        *self = Self { rejected: self.rejected, ..Self::new(self.limits.clone(), self.run, self.joints) };
    }

    /// The limits.
    pub fn limits(&self) -> &GateLimits {
        &self.limits
    }

    /// The command that passed one tick before the last one; `None` unless both passed in a row.
    pub fn before_last(&self) -> Option<&Command> {
        self.before_last.as_ref()
    }

    /// How many commands in a row have not passed.
    pub fn missed(&self) -> u32 {
        self.missed
    }

    /// How many commands in a row have passed.
    pub fn streak(&self) -> u32 {
        self.streak
    }

    /// The last command that passed.
    pub fn last(&self) -> Option<&Command> {
        self.last.as_ref()
    }

    /// How many commands were rejected for `reason`.
    pub fn rejected(&self, reason: Rejection) -> u64 {
        self.rejected[reason as usize]
    }

    fn judge(&self, command: &Command, due: u64) -> Result<(), Rejection> {
        let kind = match self.limits.mode {
            Mode::Torque => CommandKind::Torque,
            Mode::Driven => CommandKind::Position,
        };
        if command.check(self.run).is_err()
            || command.joints as usize != self.joints
            || command.kind != kind.code()
        {
            return Err(Rejection::Malformed);
        }
        if command.tick != due {
            return Err(Rejection::Stale);
        }
        if command.status == CommandStatus::NoAnswer.code() {
            return Err(Rejection::NoAnswer);
        }
        (0..self.joints).try_for_each(|joint| self.judge_joint(command, joint))
    }

    fn judge_joint(&self, command: &Command, joint: usize) -> Result<(), Rejection> {
        let value = command.value[joint];
        if ![value, command.velocity[joint], command.acceleration[joint]].into_iter().all(f64::is_finite) {
            return Err(Rejection::NotFinite);
        }
        if value < self.limits.lower[joint] || value > self.limits.upper[joint] {
            return Err(Rejection::OutOfRange);
        }
        let (speed, acceleration) = (self.limits.speed[joint], self.limits.acceleration[joint]);
        if command.velocity[joint].abs() > speed || command.acceleration[joint].abs() > acceleration {
            return Err(Rejection::TooFast);
        }
        // A joint that was held for m ticks has moved on for m + 1; a held torque has stayed.
        let room = match self.limits.mode {
            Mode::Torque => self.limits.change[joint],
            Mode::Driven => self.limits.change[joint] * f64::from(self.missed + 1),
        };
        match &self.last {
            Some(last) if (value - last.value[joint]).abs() > room => Err(Rejection::TooFast),
            _ => Ok(()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::{Applied, Gate, GateLimits, Rejection};
    use freeplay_shm::{Command, CommandStatus, MAX_JOINTS, Mode, State};

    const RUN: u64 = 7;

    /// A rejection and what provokes it.
    type Case = (Rejection, fn(&mut Command));

    fn gate() -> Gate {
        let limits = GateLimits {
            mode: Mode::Torque,
            lower: [-100.0; MAX_JOINTS],
            upper: [100.0; MAX_JOINTS],
            change: [10.0; MAX_JOINTS],
            speed: [5.0; MAX_JOINTS],
            acceleration: [50.0; MAX_JOINTS],
            hold: 2,
        };
        Gate::new(limits, RUN, 2)
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
        let cases: [Case; 12] = [
            (Rejection::Malformed, |c| c.magic = 1),
            (Rejection::Malformed, |c| c.layout += 1),
            (Rejection::Malformed, |c| c.run = 8),
            (Rejection::Malformed, |c| c.joints = 3),
            (Rejection::Malformed, |c| c.kind = 1),
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
