//! The commands of one joint as its servo receives them: held between stamps, delayed, rounded down.

use crate::joint::JointServo;

/// The commands of one joint over a recording. Each holds until the next; before the first, the first.
#[derive(Clone, Debug)]
pub struct Commands {
    stamps: Vec<f64>,
    values: Vec<f64>,
}

impl Commands {
    /// Commands `values` (rad) at `stamps` (s, increasing). NaN repeats the previous value.
    ///
    /// # Panics
    /// If the two differ in length or are empty.
    pub fn new(stamps: &[f64], values: &[f64]) -> Commands {
        assert_eq!(stamps.len(), values.len(), "one stamp for each command");
        assert!(!stamps.is_empty(), "there is at least one command");
        let mut last = values.iter().copied().find(|value| value.is_finite()).unwrap_or(0.0);
        let held = |value: &f64| {
            if value.is_finite() {
                last = *value;
            }
            last
        };
        Commands { stamps: stamps.to_vec(), values: values.iter().map(held).collect() }
    }

    /// Position among the stamps from which [`Commands::mean`] reads at the time `t`, s.
    pub fn cursor(&self, t: f64) -> usize {
        self.stamps.partition_point(|stamp| *stamp <= t).saturating_sub(1)
    }

    /// Mean over the time from `from` to `to` (s) of the set-point of `joint` for the commands, rad: exact for held commands, so that it
    /// changes smoothly with the delay. `cursor` follows the time and must not be ahead of it.
    #[inline]
    pub fn mean(&self, cursor: &mut usize, joint: &JointServo, from: f64, to: f64) -> f64 {
        let (from, to) = (from - joint.delay, to - joint.delay);
        while *cursor + 1 < self.stamps.len() && self.stamps[*cursor + 1] <= from {
            *cursor += 1;
        }
        if self.stamps.get(*cursor + 1).is_none_or(|next| *next >= to) {
            return self.set_point(joint, *cursor);
        }
        let (mut index, mut begin, mut sum) = (*cursor, from, 0.0);
        while index + 1 < self.stamps.len() && self.stamps[index + 1] < to {
            sum += self.set_point(joint, index) * (self.stamps[index + 1] - begin);
            begin = self.stamps[index + 1];
            index += 1;
        }
        sum += self.set_point(joint, index) * (to - begin);
        sum / (to - from)
    }

    /// The command in force at the time `t` without delay, s; rad (m).
    pub fn held(&self, t: f64) -> f64 {
        self.values[self.cursor(t)]
    }

    /// The command at the time `t` (s) by linear interpolation between the stamps, rad (m).
    pub fn between(&self, t: f64) -> f64 {
        let at = self.cursor(t);
        let (Some(next), Some(value)) = (self.stamps.get(at + 1), self.values.get(at + 1)) else {
            return self.values[at];
        };
        let share = ((t - self.stamps[at]) / (next - self.stamps[at])).clamp(0.0, 1.0);
        self.values[at] + share * (value - self.values[at])
    }

    /// The set-point of `joint` for the command in force at the time `t`, s; rad.
    pub fn at(&self, joint: &JointServo, t: f64) -> f64 {
        self.set_point(joint, self.cursor(t - joint.delay))
    }

    #[inline]
    fn set_point(&self, joint: &JointServo, index: usize) -> f64 {
        let command = self.values[index];
        let rounded = if joint.resolution > 0.0 {
            (command / joint.resolution).floor() * joint.resolution
        } else {
            command
        };
        rounded + joint.offset
    }
}
