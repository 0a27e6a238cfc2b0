//! Smooths the command at a change of controller.
//!
//! Two controllers answer one state differently. When the second takes over, the blend adds the difference between the command in force and
//! the new controller's command to the new commands, and reduces it to zero by a quintic. The quintic starts with that difference, its rate
//! and its curvature, and ends at rest. (For torques both derivatives are set to zero. Starting with the recent rate of change makes the
//! command smoother still, but carries a moving arm further off: measurements gave up to a fifth.) The first command of the new controller
//! thus continues the old one's, and the blend leads the arm from one target to the other.
//!
//! A difference of torques may last only a few ticks: at a corner one controller pushes where another does not yet. Over the length of the
//! blend such a difference would push the arm away. While the old controller goes on answering, the blend therefore keeps no more of the
//! difference than the two controllers still differ by. After a failure the old answers are not reliable, and the blend is short.

use freeplay_shm::{Command, Joints, MAX_JOINTS, Mode};

use crate::motion::quintic;

/// Longest blend of torques after a failure, s: the time constant of a feedback of 50 rad/s.
const AFTER_FAILURE: f64 = 0.02;

/// The decaying difference between two controllers.
#[derive(Clone, Debug)]
pub struct Blend {
    mode: Mode,
    period: f64,
    /// Ticks of a blend, and of the one in progress.
    ticks: u32,
    length: u32,
    /// The initial difference of each joint, with its first and second derivative.
    from: [[f64; 3]; MAX_JOINTS],
    start: u64,
    active: bool,
}

impl Blend {
    /// A blend over `ticks` ticks of `period` s; 0 for none: the commands then change abruptly.
    pub fn new(mode: Mode, period: f64, ticks: u32) -> Self {
        Self { mode, period, ticks, length: ticks, from: [[0.0; 3]; MAX_JOINTS], start: 0, active: false }
    }

    /// Begins at `tick`: `was` is the command in force, `says` the new controller's command, for the same instant.
    pub fn begin(&mut self, tick: u64, was: &Command, says: &Command) {
        for (joint, from) in self.from.iter_mut().enumerate() {
            *from = [was.value[joint] - says.value[joint], 0.0, 0.0];
            if self.mode != Mode::Torque {
                from[1] = was.velocity[joint] - says.velocity[joint];
                from[2] = was.acceleration[joint] - says.acceleration[joint];
            }
        }
        (self.start, self.length, self.active) = (tick, self.ticks, self.ticks > 0);
    }

    /// Shortens the blend: the old controller has failed.
    pub fn shorten(&mut self) {
        if self.mode == Mode::Torque {
            self.length = self.ticks.min((AFTER_FAILURE / self.period).round() as u32);
            self.active &= self.length > 0;
        }
    }

    /// Limits the remaining difference of torques to that between the answers of the `old` and the `new` controller to this tick.
    pub fn shrink(&mut self, old: &Command, new: &Command) {
        if self.mode == Mode::Torque {
            for (joint, [from, ..]) in self.from.iter_mut().enumerate() {
                let apart = old.value[joint] - new.value[joint];
                *from = from.clamp(apart.min(0.0), apart.max(0.0));
            }
        }
    }

    /// Limits the initial difference to `most`, by joint; a limited difference has no derivatives.
    pub fn limit(&mut self, most: &Joints) {
        for (from, &most) in self.from.iter_mut().zip(most) {
            if from[0].abs() > most {
                *from = [from[0].clamp(-most, most), 0.0, 0.0];
            }
        }
    }

    /// Ends the blend.
    pub fn end(&mut self) {
        self.active = false;
    }

    /// True if a difference remains at `tick`.
    pub fn holds(&self, tick: u64) -> bool {
        self.active && tick < self.start + u64::from(self.length)
    }

    /// Adds the remaining difference at `tick` to `command`. Without a difference the command stays the same to the bit.
    pub fn add(&self, tick: u64, command: &mut Command) {
        if !self.holds(tick) {
            return;
        }
        let span = f64::from(self.length);
        let share = (tick - self.start) as f64 / span;
        for joint in 0..command.joints as usize {
            let [value, rate, curvature] = quintic(span * self.period, share, self.from[joint], [0.0; 3]);
            command.value[joint] += value;
            if self.mode != Mode::Torque {
                command.velocity[joint] += rate;
                command.acceleration[joint] += curvature;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::Blend;
    use freeplay_shm::{Command, Mode, State};

    fn command(value: f64) -> Command {
        let mut command = Command::answer_to(&State::new(1, 2), 0);
        command.value[..2].fill(value);
        command
    }

    #[test]
    fn it_starts_with_the_old_command_ends_with_the_new_one_and_goes_from_one_to_the_other() {
        let mut blend = Blend::new(Mode::Torque, 1e-3, 100);
        blend.begin(40, &command(7.0), &command(3.0));
        let at = |tick| {
            let mut new = command(3.0);
            blend.add(tick, &mut new);
            new.value[1]
        };
        let course: Vec<f64> = (40..=141).map(at).collect();
        let largest = course.windows(2).map(|pair| pair[0] - pair[1]).fold(0.0, f64::max);
        println!("from {} to {}, at most {largest:.4} a tick", course[0], course[100]);
        assert_eq!((course[0], course[100], course[101]), (7.0, 3.0, 3.0));
        assert!(course.windows(2).all(|pair| pair[1] <= pair[0]), "it never turns back");
        // The steepest slope of the quintic from 1 to 0 is 15/8 of its mean slope.
        assert!((largest / (4.0 * 1.875 / 100.0) - 1.0).abs() < 1e-3, "{largest}");
    }

    #[test]
    fn of_a_torque_no_more_is_left_than_the_two_still_differ_by() {
        let mut blend = Blend::new(Mode::Torque, 1e-3, 100);
        let left = |blend: &Blend, tick| {
            let mut new = command(0.0);
            blend.add(tick, &mut new);
            new.value[0]
        };
        blend.begin(0, &command(9.0), &command(1.0));
        assert_eq!(left(&blend, 0), 8.0);
        // The difference between the controllers falls to 2, rises to 5 and changes its sign.
        blend.shrink(&command(3.0), &command(1.0));
        assert_eq!(left(&blend, 0), 2.0);
        blend.shrink(&command(6.0), &command(1.0));
        assert_eq!(left(&blend, 0), 2.0);
        blend.shrink(&command(0.0), &command(1.0));
        assert_eq!(left(&blend, 0), 0.0);
        blend.begin(0, &command(9.0), &command(1.0));
        blend.shorten();
        assert!(blend.holds(19) && !blend.holds(20), "after a failure it is short");
    }

    #[test]
    fn positions_come_with_the_derivatives_of_the_blend() {
        let mut blend = Blend::new(Mode::Driven, 1e-3, 50);
        let (mut was, says) = (command(0.01), command(0.0));
        was.velocity[0] = 0.2;
        blend.begin(0, &was, &says);
        let at = |tick| {
            let mut new = says;
            blend.add(tick, &mut new);
            [new.value[0], new.velocity[0], new.acceleration[0]]
        };
        assert!((at(0)[0] - 0.01).abs() < 1e-15 && (at(0)[1] - 0.2).abs() < 1e-12, "{:?}", at(0));
        for tick in 1..49 {
            let [before, here, after] = [at(tick - 1), at(tick), at(tick + 1)];
            let (rate, curvature) = ((after[0] - before[0]) / 2e-3, (after[1] - before[1]) / 2e-3);
            assert!((rate - here[1]).abs() < 2e-3, "tick {tick}: rate {rate}, {}", here[1]);
            assert!((curvature - here[2]).abs() < 0.2, "tick {tick}: curvature {curvature}, {}", here[2]);
        }
    }
}
