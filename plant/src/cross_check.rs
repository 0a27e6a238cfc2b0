//! Whether the controller in charge says what the others make of the same state.
//!
//! A command that is finite, within its limits and on time may still be wrong: a sign, a gain, a drift. Nothing in the message
//! tells; what the standbys answer to the same state does. They are cross_check: where more than half of those that can be
//! trusted differ from the one in charge by more than the tolerance, for as many ticks in a row as are asked for, it is not
//! believed any more. One standby alone is believed against the one in charge; with two or more the majority decides, and a
//! standby that is in the minority is no witness until it has agreed for a while.
//!
//! Different controllers differ when all is well: one corrects what another does not see. What a sound run differed by at the same ticks
//! is therefore no disagreement: the tolerance is what they may be beyond [`ReferenceDivergence`]. Without it, it has to hold the greatest difference of
//! the whole motion, which [`CrossCheck::greatest`] gives.

use std::sync::Arc;

use freeplay_shm::{Command, Joints, MAX_JOINTS, MAX_SLOTS};

use crate::ReferenceDivergence;

/// Ticks of agreement after which somebody who was not believed is believed again.
pub const PROBATION: u32 = 100;

/// Share of what a sound difference varies by around a tick that it may vary by beyond that.
const LATITUDE: f64 = 0.5;

/// When controllers disagree.
#[derive(Clone, Debug, PartialEq)]
pub struct Comparison {
    /// Greatest difference of each joint's value between two controllers that agree, beyond what is usual, N·m or rad.
    pub tolerance: Joints,
    /// Ticks in a row, ≥ 1.
    pub ticks: u32,
    /// What is usual; absent: nothing. Where it tells nothing of a tick, whatever is said agrees.
    pub divergence: Option<Arc<ReferenceDivergence>>,
}

impl Comparison {
    /// Least and greatest difference of `joint` from slot `one` to slot `other` at `tick` with which they agree.
    fn span(&self, tick: u64, [one, other]: [usize; 2], joint: usize) -> Option<[f64; 2]> {
        let tolerance = self.tolerance[joint];
        let Some(divergence) = &self.divergence else { return Some([-tolerance, tolerance]) };
        let [least, most] = divergence.span(tick, [one, other], joint)?;
        let room = tolerance + LATITUDE * (most - least);
        Some([least - room, most + room])
    }

    /// Whether the commands of two slots agree.
    fn agree(&self, slots: [usize; 2], one: &Command, other: &Command) -> bool {
        (0..one.joints as usize).all(|joint| {
            let difference = one.value[joint] - other.value[joint];
            self.span(one.tick, slots, joint).is_none_or(|[least, most]| (least..=most).contains(&difference))
        })
    }

    /// The most that the values of two slots that agree at `tick` are apart, by joint; infinite where that is not known.
    pub(crate) fn most(&self, tick: u64, slots: [usize; 2]) -> Joints {
        std::array::from_fn(|joint| {
            let span = self.span(tick, slots, joint);
            span.map_or(f64::INFINITY, |[least, most]| most.max(-least))
        })
    }
}

/// What is known of who agrees with whom.
#[derive(Clone, Debug)]
pub(crate) struct CrossCheck {
    comparison: Option<Comparison>,
    /// Ticks of agreement of each slot, up to [`PROBATION`]: from there on it is believed.
    agreed: Vec<u32>,
    /// Ticks in a row for which each slot has been in the minority.
    doubt: Vec<u32>,
    greatest: Joints,
}

impl CrossCheck {
    pub(crate) fn new(comparison: Option<Comparison>, slots: usize) -> Self {
        Self {
            comparison,
            agreed: vec![PROBATION; slots],
            doubt: vec![0; slots],
            greatest: [0.0; MAX_JOINTS],
        }
    }

    /// Greatest difference of each joint's value between the one in charge and a standby so far, N·m or rad.
    pub(crate) fn greatest(&self) -> &Joints {
        &self.greatest
    }

    /// Ticks of agreement of `slot`, up to [`PROBATION`].
    pub(crate) fn agreed(&self, slot: usize) -> u32 {
        self.agreed[slot]
    }

    /// Hears what the slots say to one tick, `None` for what did not pass the gate; whether the one in charge is not to be
    /// believed. Counts nothing else than how far they are apart where there is no tolerance.
    pub(crate) fn contradict<'a>(
        &mut self,
        in_charge: usize,
        said: impl Fn(usize) -> Option<&'a Command>,
    ) -> bool {
        let Some(claim) = said(in_charge) else { return false };
        let (mut heard, mut against) = (0, 0);
        let mut differs = [false; MAX_SLOTS];
        for slot in (0..self.agreed.len()).filter(|&slot| slot != in_charge) {
            let Some(other) = said(slot) else { continue };
            let agrees = self.compare([in_charge, slot], claim, other);
            differs[slot] = !agrees;
            if self.agreed[slot] >= PROBATION {
                heard += 1;
                against += usize::from(!agrees);
            } else {
                self.agreed[slot] = if agrees { self.agreed[slot] + 1 } else { 0 };
            }
        }
        let Some(ticks) = self.comparison.as_ref().map(|comparison| comparison.ticks) else { return false };
        let contradicted = 2 * against > heard;
        for slot in (0..self.agreed.len()).filter(|&slot| slot != in_charge && heard > 1) {
            self.count(slot, !contradicted && differs[slot], ticks);
        }
        self.count(in_charge, contradicted, ticks)
    }

    /// Notes how far two commands are apart; whether they agree.
    fn compare(&mut self, slots: [usize; 2], one: &Command, other: &Command) -> bool {
        for joint in 0..one.joints as usize {
            let difference = (one.value[joint] - other.value[joint]).abs();
            self.greatest[joint] = self.greatest[joint].max(difference);
        }
        self.comparison.as_ref().is_none_or(|comparison| comparison.agree(slots, one, other))
    }

    /// Counts the ticks for which `slot` `is_alone`; whether it has been for too long.
    fn count(&mut self, slot: usize, is_alone: bool, ticks: u32) -> bool {
        self.doubt[slot] = if is_alone { self.doubt[slot] + 1 } else { 0 };
        let is_out = self.doubt[slot] >= ticks.max(1);
        if is_out {
            (self.doubt[slot], self.agreed[slot]) = (0, 0);
        }
        is_out
    }
}

#[cfg(test)]
mod tests {
    use super::{Comparison, CrossCheck, PROBATION};
    use std::sync::Arc;

    use crate::ReferenceDivergence;
    use freeplay_shm::{Command, MAX_JOINTS, State};

    /// The tick of a hundred at which the one in charge, slot 0, is no longer believed, if slot `i` says `say(i, tick)`.
    fn contradicted(slots: usize, say: impl Fn(usize, u32) -> f64) -> (Option<u32>, CrossCheck) {
        let comparison = Comparison { tolerance: [1.0; MAX_JOINTS], ticks: 2, divergence: None };
        let mut cross_check = CrossCheck::new(Some(comparison), slots);
        let at = (0..100).find(|&tick| {
            let said: Vec<Command> = (0..slots)
                .map(|slot| {
                    let mut command = Command::answer_to(&State::new(1, 2), 0);
                    command.value[1] = say(slot, tick);
                    command
                })
                .collect();
            cross_check.contradict(0, |slot| said.get(slot))
        });
        (at, cross_check)
    }

    #[test]
    fn what_a_sound_run_differed_by_is_no_disagreement_and_what_it_did_not_is() {
        // A corner: for ten ticks they are 20 apart, else 3.
        let course = |tick: usize| if (50..60).contains(&tick) { 20.0 } else { 3.0 };
        let divergence =
            ReferenceDivergence::new(vec![(0..100).map(|tick| [course(tick); MAX_JOINTS]).collect()]);
        let comparison =
            Comparison { tolerance: [1.0; MAX_JOINTS], ticks: 2, divergence: Some(Arc::new(divergence)) };
        let found = |wrong: f64, from: usize| {
            let mut cross_check = CrossCheck::new(Some(comparison.clone()), 2);
            (0..100).find(|&tick| {
                let said = [if tick >= from { wrong } else { 0.0 }, course(tick)];
                let said = said.map(|value| {
                    let mut command = Command::answer_to(&State { tick: tick as u64, ..State::new(1, 2) }, 0);
                    command.value[..2].copy_from_slice(&[value, 0.0]);
                    command
                });
                let mut said = said;
                // The second joint is as it was in the sound run.
                said[1].value[1] = course(tick);
                cross_check.contradict(0, |slot| said.get(slot))
            })
        };
        assert_eq!(found(0.0, 0), None, "a sound run is no alarm");
        assert_eq!(found(1.5, 20), Some(21), "a little between corners is told");
        assert_eq!(found(-2.0, 52), Some(53), "and within one");
        // Where the sound run has ended nothing is judged.
        assert_eq!(comparison.most(200, [0, 1])[0], f64::INFINITY);
        assert_eq!(comparison.most(10, [0, 1])[0], 4.0);
    }

    #[test]
    fn one_standby_is_believed_and_of_several_the_majority() {
        let wrong =
            |who: usize| move |slot: usize, tick: u32| if slot == who && tick >= 40 { 9.0 } else { 0.5 };
        assert_eq!(contradicted(2, wrong(0)).0, Some(41));
        assert_eq!(contradicted(3, wrong(0)).0, Some(41));
        let (at, cross_check) = contradicted(3, wrong(2));
        assert_eq!((at, cross_check.agreed(1), cross_check.agreed(2)), (None, PROBATION, 0));
        assert_eq!(contradicted(2, |slot, tick| if slot == 0 && tick % 2 == 0 { 9.0 } else { 0.5 }).0, None);
        assert_eq!(contradicted(1, wrong(0)).0, None);
    }
}
