//! Search for the size at which an effect has the requested strength.

use rand_chacha::ChaCha8Rng;

use crate::calibrate::{Floor, Residual, Strength, residual, strength};
use crate::case::{Bench, Demand, GenerateError};
use crate::distinct::is_distinct;
use crate::draft::Context;
use crate::kinds::{Seat, depends_on_time, shows_at_tool_only};
use crate::machine::{Plan, PlanError, Trace};
use crate::physics::{Effect, Physics};

/// Length of motion for an initial size, s.
const TRIAL: f64 = 8.0;
/// Runs of the whole motion per search.
const TRIALS: usize = 5;
/// The search ends if the log of the signal-to-floor ratio is within this distance of the wanted one.
const NEAR: f64 = 0.15;
/// The same for accepting the best size when the runs are used up.
const NEAR_ENOUGH: f64 = 0.24;
/// An effect weaker or stronger than wanted by up to this factor, natural logarithm, may still become distinct with another size.
const UNSURE: f64 = 0.5;

/// A search for the size of an effect.
pub(crate) struct Sizing<'a> {
    pub bench: &'a Bench,
    pub floor: &'a Floor,
    pub without: &'a Residual,
}

/// An effect of the requested strength, with the machine and its trace over the whole motion.
pub(crate) struct Found {
    pub effect: Effect,
    pub strength: Strength,
    pub plan: Plan,
    pub trace: Trace,
    distinct: bool,
}

impl Sizing<'_> {
    /// Finds an effect of the requested strength, and its strength over the whole motion.
    ///
    /// The first run is short if the effect does not depend on time; all further runs cover the whole motion, and the last of them is the recording.
    pub fn find(&self, demand: &Demand, seat: Seat, rng: &mut ChaCha8Rng) -> Result<Found, GenerateError> {
        let bench = self.bench;
        let (machine, kind) = (bench.machine, &demand.kind);
        let target = demand.severity.target(rng);
        let context = Context {
            arm: &bench.sheet,
            load: &bench.load,
            floor: self.floor,
            duration: bench.duration,
            target,
        };
        let no_place = || GenerateError::NoPlace { kind: kind.clone(), machine, joint: seat };
        let riddle = || GenerateError::Riddle { kind: kind.clone(), machine };
        let weak = |reached| GenerateError::TooWeak { kind: kind.clone(), machine, reached, wanted: target };
        let guess = context.guess(kind, seat, rng).ok_or_else(no_place)?;
        let mut physics = context.bounded(guess, seat);
        let mut best: Option<(f64, Found)> = None;
        let mut power = Power::default();
        if !depends_on_time(kind) && bench.duration > TRIAL {
            let found = self.strength(&physics, seat, TRIAL)?;
            let ratio = found.strength.signal_to_floor;
            if !found.distinct && (ratio / target).ln().abs() < UNSURE {
                return Err(riddle());
            }
            physics = context.bounded(physics.scaled(power.factor(target / ratio)), seat);
        }
        for _ in 0..TRIALS {
            let found = self.strength(&physics, seat, bench.duration)?;
            let ratio = found.strength.signal_to_floor;
            let miss = (ratio / target).ln().abs();
            if !found.distinct && miss < UNSURE {
                return Err(riddle());
            }
            let next = context.bounded(physics.scaled(power.factor(target / ratio)), seat);
            if best.as_ref().is_none_or(|(least, _)| miss < *least) {
                best = Some((miss, found));
            }
            // The effect is at the limit of the machine.
            if miss < NEAR || next == physics {
                break;
            }
            physics = next;
        }
        match best {
            Some((_, found)) if !found.distinct => Err(riddle()),
            Some((miss, found)) if miss < NEAR_ENOUGH => Ok(found),
            Some((_, found)) => Err(weak(found.strength.signal_to_floor)),
            None => Err(no_place()),
        }
    }

    fn strength(&self, physics: &Physics, seat: Seat, duration: f64) -> Result<Found, PlanError> {
        let bench = self.bench;
        let effect = Effect { joint: seat, physics: physics.clone() };
        let (plan, trace) = bench.run(std::slice::from_ref(&effect), &bench.motion, duration)?;
        let with = residual(&bench.sheet, &plan, &trace, &bench.deviations, duration);
        let strength = strength(&with, self.without, self.floor, shows_at_tool_only(&physics.kind()));
        let distinct = is_distinct(&effect, &trace, &with, self.without, self.floor);
        Ok(Found { effect, strength, plan, trace, distinct })
    }
}

/// Growth of a trace with the size of its effect: approximately a power law, fitted to the last two sizes.
#[derive(Default)]
struct Power {
    /// The missing factor of the trace, and the factor of the size tried for it, both as logarithms.
    last: Option<[f64; 2]>,
}

impl Power {
    /// The factor of the size that multiplies the trace by `lack`, within limits.
    fn factor(&mut self, lack: f64) -> f64 {
        // Without any trace it is infinite.
        let lack = lack.max(f64::MIN_POSITIVE).ln().min(f64::MAX.ln());
        let power = match self.last {
            Some([before, step]) if step != 0.0 => ((before - lack) / step).clamp(0.5, 6.0),
            _ => 1.0,
        };
        let step = (lack / power).clamp(0.15_f64.ln(), 6.0_f64.ln());
        self.last = Some([lack, step]);
        step.exp()
    }
}
