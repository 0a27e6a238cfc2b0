//! Finding the size at which an effect is as strong as asked for.

use rand_chacha::ChaCha8Rng;

use crate::calibrate::{Floor, Residual, Strength, residual, strength};
use crate::case::{Bench, Demand, GenerateError};
use crate::distinct::is_distinct;
use crate::draft::Context;
use crate::kinds::{Seat, depends_on_time, shows_at_tool};
use crate::machine::PlanError;
use crate::physics::{Effect, Physics};

/// Length of motion on which sizes are found, s.
const TRIAL: f64 = 8.0;
/// Runs spent on finding the size of an effect.
const TRIALS: usize = 5;
/// How near the signal-to-floor ratio has to come to what is wanted, as a fraction.
const NEAR: f64 = 0.12;

/// Finding the size of an effect.
pub(crate) struct Sizing<'a> {
    pub bench: &'a Bench,
    pub floor: &'a Floor,
    pub without: &'a Residual,
}

impl Sizing<'_> {
    /// An effect as strong as asked for, and its strength over the whole motion.
    pub fn find(
        &self,
        demand: &Demand,
        seat: Seat,
        rng: &mut ChaCha8Rng,
    ) -> Result<(Effect, Strength), GenerateError> {
        let bench = self.bench;
        let target = demand.severity.target(rng);
        let context = Context {
            arm: &bench.sheet,
            load: &bench.load,
            floor: self.floor,
            duration: bench.duration,
            target,
        };
        let guess = context.guess(&demand.kind, seat, rng);
        let machine = bench.machine;
        let no_place = || GenerateError::NoPlace { kind: demand.kind.clone(), machine, joint: seat };
        let mut physics = context.bounded(guess.ok_or_else(no_place)?, seat);
        let short = if depends_on_time(&demand.kind) { bench.duration } else { TRIAL.min(bench.duration) };
        let mut best: Option<(f64, Found)> = None;
        for trial in 0..TRIALS {
            // The first runs are short; the last decide on the whole motion.
            let duration = if trial < 2 { short } else { bench.duration };
            let found = self.strength(&physics, seat, duration)?;
            let ratio = found.strength.signal_to_floor;
            let miss = (ratio / target).ln().abs();
            let whole = duration >= bench.duration;
            if whole && best.as_ref().is_none_or(|(least, _)| miss < *least) {
                best = Some((miss, found));
            }
            if whole && miss < NEAR {
                break;
            }
            physics = context.bounded(physics.scaled((target / ratio.max(1e-3)).clamp(0.15, 6.0)), seat);
        }
        let (miss, found) = best.ok_or_else(no_place)?;
        let kind = demand.kind.clone();
        if !found.distinct {
            return Err(GenerateError::Riddle { kind, machine });
        }
        if miss > 2.0 * NEAR {
            let reached = found.strength.signal_to_floor;
            return Err(GenerateError::TooWeak { kind, machine, reached, wanted: target });
        }
        Ok((found.effect, found.strength))
    }

    fn strength(&self, physics: &Physics, seat: Seat, duration: f64) -> Result<Found, PlanError> {
        let bench = self.bench;
        let effect = Effect { joint: seat, physics: physics.clone() };
        let (plan, trace) = bench.run(std::slice::from_ref(&effect), &bench.motion, duration)?;
        let with = residual(&bench.sheet, &plan, &trace, &bench.tolerances, duration);
        let strength = strength(&with, self.without, self.floor, shows_at_tool(&physics.kind()));
        let distinct = is_distinct(&effect, &trace, &with, self.without, self.floor);
        Ok(Found { effect, strength, distinct })
    }
}

/// An effect of some size in a machine.
struct Found {
    effect: Effect,
    strength: Strength,
    distinct: bool,
}
