//! Compares the commands of the active controller with those of the standbys for the same state.
//!
//! A command that is finite, within its limits and on time may still be wrong: a sign, a gain, a drift. The message alone does not reveal
//! this; the standbys' answers to the same state do. The cross-check compares them: if more than half of the trusted standbys differ from
//! the active controller by more than the tolerance, for the required number of ticks in a row, it no longer trusts the active controller.
//! A single standby overrules the active controller; with two or more the majority decides. A standby in the minority loses its vote until
//! it has agreed for a while.
//!
//! Different controllers differ in a normal run, too: one corrects errors that another does not model. The differences at the same ticks of
//! a fault-free run are therefore no disagreement: the tolerance is the greatest difference beyond [`ReferenceDivergence`]. Without a
//! reference divergence, the tolerance must cover the greatest difference of the whole motion, which [`CrossCheck::greatest`] gives.

use std::sync::Arc;

use freeplay_shm::{Command, Joints, MAX_JOINTS, MAX_SLOTS};

use crate::ReferenceDivergence;

/// Ticks of agreement after which the cross-check trusts a controller again.
pub const PROBATION: u32 = 100;

/// Margin beyond the range of the fault-free differences around a tick, as a share of that range.
const MARGIN: f64 = 0.5;

/// The condition under which controllers disagree.
#[derive(Clone, Debug, PartialEq)]
pub struct Comparison {
    /// Greatest difference of each joint's value between two agreeing controllers, beyond the reference divergence, N·m or rad.
    pub tolerance: Joints,
    /// Ticks in a row, ≥ 1.
    pub ticks: u32,
    /// The reference divergence; absent: zero. At a tick without a reference any two commands agree.
    pub divergence: Option<Arc<ReferenceDivergence>>,
}

impl Comparison {
    /// Least and greatest difference of `joint` between slots `one` and `other` at `tick` at which they agree.
    fn span(&self, tick: u64, [one, other]: [usize; 2], joint: usize) -> Option<[f64; 2]> {
        let tolerance = self.tolerance[joint];
        let Some(divergence) = &self.divergence else { return Some([-tolerance, tolerance]) };
        let [least, most] = divergence.span(tick, [one, other], joint)?;
        let room = tolerance + MARGIN * (most - least);
        Some([least - room, most + room])
    }

    /// True if the commands of two slots agree.
    fn agree(&self, slots: [usize; 2], one: &Command, other: &Command) -> bool {
        (0..one.joints as usize).all(|joint| {
            let difference = one.value[joint] - other.value[joint];
            self.span(one.tick, slots, joint).is_none_or(|[least, most]| (least..=most).contains(&difference))
        })
    }

    /// Greatest difference between two agreeing slots at `tick`, by joint; infinite if unknown.
    pub(crate) fn most(&self, tick: u64, slots: [usize; 2]) -> Joints {
        std::array::from_fn(|joint| {
            let span = self.span(tick, slots, joint);
            span.map_or(f64::INFINITY, |[least, most]| most.max(-least))
        })
    }
}

/// The agreement of the controllers so far.
#[derive(Clone, Debug)]
pub(crate) struct CrossCheck {
    comparison: Option<Comparison>,
    /// Ticks of agreement of each slot, up to [`PROBATION`]; at that count the slot is trusted.
    agreed: Vec<u32>,
    /// Ticks in a row for which each slot has been in the minority.
    minority_ticks: Vec<u32>,
    greatest: Joints,
}

impl CrossCheck {
    pub(crate) fn new(comparison: Option<Comparison>, slots: usize) -> Self {
        Self {
            comparison,
            agreed: vec![PROBATION; slots],
            minority_ticks: vec![0; slots],
            greatest: [0.0; MAX_JOINTS],
        }
    }

    /// Greatest difference of each joint's value between the active controller and a standby so far, N·m or rad.
    pub(crate) fn greatest(&self) -> &Joints {
        &self.greatest
    }

    /// Ticks of agreement of `slot`, up to [`PROBATION`].
    pub(crate) fn agreed(&self, slot: usize) -> u32 {
        self.agreed[slot]
    }

    /// Compares the answers of the slots to one tick (`None` for an answer that did not pass the gate). Returns true if the active
    /// controller is no longer trusted. Without a tolerance it only records the greatest differences.
    pub(crate) fn contradict<'a>(
        &mut self,
        in_charge: usize,
        answer_of: impl Fn(usize) -> Option<&'a Command>,
    ) -> bool {
        let Some(active_answer) = answer_of(in_charge) else { return false };
        let (mut votes, mut against) = (0, 0);
        let mut differs = [false; MAX_SLOTS];
        for slot in (0..self.agreed.len()).filter(|&slot| slot != in_charge) {
            let Some(other) = answer_of(slot) else { continue };
            let agrees = self.compare([in_charge, slot], active_answer, other);
            differs[slot] = !agrees;
            if self.agreed[slot] >= PROBATION {
                votes += 1;
                against += usize::from(!agrees);
            } else {
                self.agreed[slot] = if agrees { self.agreed[slot] + 1 } else { 0 };
            }
        }
        let Some(ticks) = self.comparison.as_ref().map(|comparison| comparison.ticks) else { return false };
        let contradicted = 2 * against > votes;
        for slot in (0..self.agreed.len()).filter(|&slot| slot != in_charge && votes > 1) {
            self.count(slot, !contradicted && differs[slot], ticks);
        }
        self.count(in_charge, contradicted, ticks)
    }

    /// Records the difference between two commands; returns true if they agree.
    fn compare(&mut self, slots: [usize; 2], one: &Command, other: &Command) -> bool {
        for joint in 0..one.joints as usize {
            let difference = (one.value[joint] - other.value[joint]).abs();
            self.greatest[joint] = self.greatest[joint].max(difference);
        }
        self.comparison.as_ref().is_none_or(|comparison| comparison.agree(slots, one, other))
    }

    /// Counts the ticks for which `slot` `is_alone`; returns true if there have been too many.
    fn count(&mut self, slot: usize, is_alone: bool, ticks: u32) -> bool {
        self.minority_ticks[slot] = if is_alone { self.minority_ticks[slot] + 1 } else { 0 };
        let is_out = self.minority_ticks[slot] >= ticks.max(1);
        if is_out {
            (self.minority_ticks[slot], self.agreed[slot]) = (0, 0);
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

    /// The tick of a hundred at which the active controller, slot 0, loses trust, if slot `i` answers `say(i, tick)`.
    fn contradicted(slots: usize, say: impl Fn(usize, u32) -> f64) -> (Option<u32>, CrossCheck) {
        let comparison = Comparison { tolerance: [1.0; MAX_JOINTS], ticks: 2, divergence: None };
        let mut cross_check = CrossCheck::new(Some(comparison), slots);
        let at = (0..100).find(|&tick| {
            let answers: Vec<Command> = (0..slots)
                .map(|slot| {
                    let mut command = Command::answer_to(&State::new(1, 2), 0);
                    command.value[1] = say(slot, tick);
                    command
                })
                .collect();
            cross_check.contradict(0, |slot| answers.get(slot))
        });
        (at, cross_check)
    }

    #[test]
    fn what_a_sound_run_differed_by_is_no_disagreement_and_what_it_did_not_is() {
        // A corner: for ten ticks the controllers differ by 20, else by 3.
        let course = |tick: usize| if (50..60).contains(&tick) { 20.0 } else { 3.0 };
        let divergence =
            ReferenceDivergence::new(vec![(0..100).map(|tick| [course(tick); MAX_JOINTS]).collect()]);
        let comparison =
            Comparison { tolerance: [1.0; MAX_JOINTS], ticks: 2, divergence: Some(Arc::new(divergence)) };
        let found = |wrong: f64, from: usize| {
            let mut cross_check = CrossCheck::new(Some(comparison.clone()), 2);
            (0..100).find(|&tick| {
                let answers = [if tick >= from { wrong } else { 0.0 }, course(tick)];
                let answers = answers.map(|value| {
                    let mut command = Command::answer_to(&State { tick: tick as u64, ..State::new(1, 2) }, 0);
                    command.value[..2].copy_from_slice(&[value, 0.0]);
                    command
                });
                let mut answers = answers;
                // The second joint has the same difference as in the fault-free run.
                answers[1].value[1] = course(tick);
                cross_check.contradict(0, |slot| answers.get(slot))
            })
        };
        assert_eq!(found(0.0, 0), None, "a sound run is no alarm");
        assert_eq!(found(1.5, 20), Some(21), "a little between corners is told");
        assert_eq!(found(-2.0, 52), Some(53), "and within one");
        // After the end of the fault-free run the check judges nothing.
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
