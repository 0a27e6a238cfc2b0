//! Effect of each fault on an answer: no message, one or several.

use freeplay_shm::{Command, LAYOUT_VERSION, MAX_JOINTS};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use crate::faults::kinds::{Injection, Kind};

/// Delay of delayed answers, ticks.
const DELAY: usize = 3;
/// Number of copies of each answer in a flood.
const FLOOD: usize = 64;

/// A fault while it acts.
pub struct ActiveFault {
    injection: Injection,
    random: ChaCha8Rng,
    limits: Vec<[f64; 2]>,
    /// The affected joint, once chosen.
    joint: Option<usize>,
    before: Option<Command>,
    /// The latest answers, oldest first.
    waiting: [Option<Command>; DELAY],
}

impl ActiveFault {
    /// The fault of `injection` on an arm whose joints take values within `limits`; `before` is the last good answer.
    pub fn new(injection: Injection, limits: &[[f64; 2]], before: Option<Command>) -> Self {
        Self {
            injection,
            random: ChaCha8Rng::seed_from_u64(injection.seed),
            limits: limits.to_vec(),
            joint: None,
            before,
            waiting: [None; DELAY],
        }
    }

    /// Passes the messages that replace `good`, the answer to a tick with the fault, to `send`.
    pub fn spoil<E>(
        &mut self,
        good: Command,
        mut send: impl FnMut(&Command) -> Result<(), E>,
    ) -> Result<(), E> {
        let age = good.tick.saturating_sub(self.injection.tick);
        match self.injection.kind {
            Kind::Off | Kind::Hang | Kind::Crash | Kind::LoanLost => Ok(()),
            Kind::Slow if age % 4 != 3 => Ok(()),
            Kind::Intermittent if self.random.random_bool(0.5) => Ok(()),
            Kind::Delayed => {
                let late = self.waiting[0];
                self.waiting.rotate_left(1);
                self.waiting[DELAY - 1] = Some(good);
                late.map_or(Ok(()), |late| send(&late))
            }
            Kind::Reorder => match self.waiting[0].take() {
                Some(first) => send(&good).and_then(|()| send(&first)),
                None => {
                    self.waiting[0] = Some(good);
                    Ok(())
                }
            },
            Kind::Flood => (0..FLOOD).try_for_each(|_| send(&good)),
            _ => send(&self.altered(good, age)),
        }
    }

    fn altered(&mut self, mut command: Command, age: u64) -> Command {
        let joint = self.chosen(&command);
        let [lower, upper] = self.limits.get(joint).copied().unwrap_or([-1.0, 1.0]);
        let value = &mut command.value[joint];
        match self.injection.kind {
            Kind::Stuck => {
                if let Some(before) = self.before {
                    (command.value, command.velocity) = (before.value, before.velocity);
                    command.acceleration = before.acceleration;
                }
            }
            Kind::Garbage => {
                let random = &mut self.random;
                let joints = command.joints as usize;
                for values in [&mut command.value, &mut command.velocity, &mut command.acceleration] {
                    values[..joints].fill_with(|| f64::from_bits(random.random()));
                }
            }
            Kind::Wrong => {
                let shift = 0.2 * (upper - lower);
                *value = if *value + shift < upper { *value + shift } else { *value - shift };
            }
            Kind::StaleVersion => command.layout = LAYOUT_VERSION.wrapping_sub(1),
            Kind::Nan => *value = f64::NAN,
            Kind::Limit => *value = upper + 0.001 * (upper - lower),
            // The joint's range over the thousand ticks of a second.
            Kind::Drift => *value += 1e-3 * (upper - lower) * (age + 1) as f64,
            Kind::SignFlip => *value = -*value,
            Kind::Gain => *value *= 1.5,
            _ => {}
        }
        command
    }

    /// The affected joint: one of those with a non-zero command at the moment.
    fn chosen(&mut self, command: &Command) -> usize {
        if let Some(joint) = self.joint {
            return joint;
        }
        let share = |joint: usize| {
            let [lower, upper] = self.limits.get(joint).copied().unwrap_or([-1.0, 1.0]);
            (command.value[joint] / (upper - lower)).abs()
        };
        let joints = (command.joints as usize).min(MAX_JOINTS);
        let largest = (0..joints).map(share).fold(0.0, f64::max);
        let at_work = (0..joints).filter(|&joint| share(joint) >= 0.2 * largest).count().max(1);
        let pick = self.random.random_range(0..at_work);
        let joint = (0..joints).filter(|&joint| share(joint) >= 0.2 * largest).nth(pick).unwrap_or(0);
        self.joint = Some(joint);
        joint
    }
}

#[cfg(test)]
mod tests {
    use super::ActiveFault;
    use crate::faults::kinds::{Injection, Kind};
    use freeplay_shm::{Command, State};

    /// The messages for ten answers, each with its tick.
    fn sent(kind: Kind) -> Vec<Command> {
        let good = |tick| {
            let mut state = State::new(7, 2);
            state.tick = tick;
            let mut command = Command::answer_to(&state, 0);
            command.value[..2].copy_from_slice(&[10.0 + tick as f64, -5.0]);
            command
        };
        let injection = Injection { kind, tick: 100, seed: 3 };
        let mut spoiler = ActiveFault::new(injection, &[[-100.0, 100.0]; 2], Some(good(99)));
        let mut sent = Vec::new();
        for tick in 100..110 {
            let keep = |command: &Command| {
                sent.push(*command);
                Ok::<(), ()>(())
            };
            spoiler.spoil(good(tick), keep).unwrap();
        }
        sent
    }

    #[test]
    fn each_fault_does_what_its_word_says() {
        let ticks = |kind| sent(kind).iter().map(|command| command.tick).collect::<Vec<_>>();
        assert_eq!(ticks(Kind::Ok), (100..110).collect::<Vec<_>>());
        assert_eq!(ticks(Kind::Off), [] as [u64; 0]);
        assert_eq!(ticks(Kind::Slow), [103, 107]);
        assert_eq!(ticks(Kind::Delayed), (100..107).collect::<Vec<_>>());
        assert_eq!(ticks(Kind::Reorder)[..4], [101, 100, 103, 102]);
        assert_eq!(ticks(Kind::Flood).len(), 640);
        assert!((1..10).contains(&ticks(Kind::Intermittent).len()));
        assert!(sent(Kind::Stuck).iter().all(|command| command.value[0] == 109.0));
        assert!(sent(Kind::Nan).iter().all(|command| command.value[..2].iter().any(|value| value.is_nan())));
        assert!(
            sent(Kind::Limit).iter().all(|command| command.value[..2].iter().any(|&value| value > 100.0))
        );
        assert!(sent(Kind::StaleVersion).iter().all(|command| command.layout == 0));
        for kind in [Kind::Wrong, Kind::Drift, Kind::SignFlip, Kind::Gain] {
            for (spoiled, good) in sent(kind).iter().zip(sent(Kind::Ok)) {
                let within = spoiled.value.iter().all(|value| value.abs() <= 200.0);
                assert!(within && spoiled.value != good.value && spoiled.tick == good.tick, "{kind:?}");
            }
        }
    }
}
