//! The controllers of a run: one in charge, the others warm. All of them answer every state; only the answer of the one in
//! charge is put in force.
//!
//! At the end of a tick each answer is judged at its controller's own [`Gate`]. Then, in this order:
//!
//! 1. a swap that is planned for this tick takes place if the new controller's answer passes, else at the first tick at which
//!    it does;
//! 2. where the answer of the one in charge does not pass, the standby with the longest faultless record takes over with the
//!    answer it gave to the same tick: no command is held;
//! 3. where no standby has a good answer, the gate of the one in charge falls back: hold, then brake.
//!
//! A position has to lead on from where the joints are measured, with the blend: where it does not, the hand-over is refused as too fast. A torque
//! is cut to its rate.
//!
//! Either way the [`Blend`] makes the new commands continue the old ones. After a planned swap they continue what the old
//! controller says for the next instant; after a failure, whose command is not to be trusted, what was in force moved on as
//! the new one moved on, and for a short time.

use freeplay_shm::{Command, Joints, MAX_JOINTS, MAX_SLOTS, Mode};
use serde::Serialize;

use crate::cross_check::{CrossCheck, PROBATION};
use crate::limit_violation::{LimitViolation, RefusedCommand};
use crate::{Applied, Blend, Comparison, Gate, GateLimits, Rejection};

/// Fail-overs that are kept; more are counted.
const RECORDED_FAIL_OVERS: usize = 4096;

/// A swap that was asked for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PlannedSwap {
    /// Tick whose answer is to be the new controller's.
    pub tick: u64,
    /// Slot of the new controller.
    pub to: usize,
}

/// Who plays, and who is to be in charge when.
#[derive(Clone, Debug, PartialEq)]
pub struct ControllerSet {
    /// Number of controllers, 1 to [`MAX_SLOTS`]; the one in slot 0 begins.
    pub controllers: usize,
    /// Swaps by tick, ascending.
    pub swaps: Vec<PlannedSwap>,
    /// Length of the blend after a change, ticks.
    pub blend: u32,
    /// Greatest change of a torque from tick to tick as it changes hands by plan, by joint, N·m; what is cut off comes with the next
    /// tick. Absent: as much as the old controller would have changed it. Positions are not cut: they come with derivatives.
    pub hand_over_change: Option<Joints>,
    /// How far the one in charge may differ from the others; absent: as far as it likes.
    pub comparison: Option<Comparison>,
}

impl Default for ControllerSet {
    /// One controller.
    fn default() -> Self {
        Self { controllers: 1, swaps: Vec::new(), blend: 100, hand_over_change: None, comparison: None }
    }
}

/// Why somebody else is in charge.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Cause {
    /// It was planned.
    Planned,
    /// The answer of the one in charge did not pass.
    Failed(Rejection),
}

/// A change of who is in charge.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Swap {
    /// Tick whose answer was the first to be the new controller's; it is in force from the next tick on.
    pub tick: u64,
    /// Slot of the old controller.
    pub from: usize,
    /// Slot of the new controller.
    pub to: usize,
    /// Why.
    pub cause: Cause,
    /// Ticks from the one that was asked for, or at which the old controller first failed, to this one.
    pub gap: u64,
    /// Of these, ticks for which the last command was held.
    pub held: u64,
    /// Change of the command in force as it changed hands, by joint, N·m or rad.
    pub jump: Joints,
    /// Greatest change of the command in force from tick to tick until the blend ended or the next swap, by joint.
    pub greatest_change: Joints,
}

/// One controller.
#[derive(Clone, Debug)]
pub(crate) struct Slot {
    gate: Gate,
    /// Its answer to this tick.
    pub(crate) answer: Option<Command>,
    /// What the gate says of it.
    rejection: Option<Rejection>,
    /// Ticks in charge.
    in_charge: u64,
}

/// What comes of a tick.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Verdict {
    /// What is to be applied in the next tick.
    pub applied: Applied,
    /// Why not the answer of the one who was in charge.
    pub rejection: Option<Rejection>,
    /// The answer that was let through, or that was not.
    pub answer: Option<Command>,
}

/// The controllers of a run.
#[derive(Clone, Debug)]
pub struct ControllerManager {
    slots: Vec<Slot>,
    in_charge: usize,
    planned: Vec<PlannedSwap>,
    next_planned: usize,
    /// What was asked for while the run goes on; it comes before what is planned.
    asked: Option<PlannedSwap>,
    blend: Blend,
    /// The slot whose commands the blend started from, while nothing else is in it.
    blends_from: Option<usize>,
    hand_over_change: Option<Joints>,
    comparison: Option<Comparison>,
    cross_check: CrossCheck,
    in_force: Option<Command>,
    /// Ticks in a row for which no command was put in force.
    held: u32,
    first_refusal: Option<RefusedCommand>,
    rejected: [u64; Rejection::ALL.len()],
    swaps: Vec<Swap>,
    unlisted: u64,
    /// Greatest change from tick to tick while nothing blends.
    steady_change: Joints,
}

impl ControllerManager {
    /// The controllers of `spec`, each with a gate of `limits`, in the run `run` with `joints` joints and ticks of `period` s.
    pub fn new(spec: &ControllerSet, limits: GateLimits, run: u64, joints: usize, period: f64) -> Self {
        let mode: Mode = limits.mode;
        let slot = |slot: usize| {
            let gate = Gate::new(limits.clone(), run, slot as u32, joints);
            Slot { gate, answer: None, rejection: None, in_charge: 0 }
        };
        Self {
            slots: (0..spec.controllers.clamp(1, MAX_SLOTS)).map(slot).collect(),
            in_charge: 0,
            planned: spec.swaps.clone(),
            next_planned: 0,
            asked: None,
            blend: Blend::new(mode, period, spec.blend),
            blends_from: None,
            hand_over_change: spec.hand_over_change.filter(|_| mode == Mode::Torque),
            comparison: spec.comparison.clone(),
            cross_check: CrossCheck::new(spec.comparison.clone(), spec.controllers.clamp(1, MAX_SLOTS)),
            in_force: None,
            held: 0,
            first_refusal: None,
            rejected: [0; Rejection::ALL.len()],
            swaps: Vec::with_capacity(spec.swaps.len() + RECORDED_FAIL_OVERS),
            unlisted: 0,
            steady_change: [0.0; MAX_JOINTS],
        }
    }

    /// Number of controllers.
    pub fn len(&self) -> usize {
        self.slots.len()
    }

    /// Never: there is at least one controller.
    pub fn is_empty(&self) -> bool {
        self.slots.is_empty()
    }

    /// The slot in charge.
    pub fn in_charge(&self) -> usize {
        self.in_charge
    }

    /// The slot whose answer to `tick` is to be put in force.
    pub fn next_in_charge(&self, tick: u64) -> usize {
        self.due(tick).map_or(self.in_charge, |swap| swap.to)
    }

    /// The command in force, or the last that was.
    pub fn in_force(&self) -> Option<&Command> {
        self.in_force.as_ref()
    }

    /// The gate of the controller in `slot`.
    pub fn gate(&self, slot: usize) -> &Gate {
        &self.slots[slot].gate
    }

    /// Ticks for which `slot` was in charge.
    pub fn ticks_in_charge(&self, slot: usize) -> u64 {
        self.slots[slot].in_charge
    }

    /// The first command of who was, or was to be, in charge that was refused for more than not having come.
    pub fn first_refusal(&self) -> Option<&RefusedCommand> {
        self.first_refusal.as_ref()
    }

    /// How many commands of who was, or was to be, in charge were rejected for `reason`.
    pub fn rejected(&self, reason: Rejection) -> u64 {
        self.rejected[reason as usize]
    }

    /// All changes of who is in charge, in their order.
    pub fn swaps(&self) -> &[Swap] {
        &self.swaps
    }

    /// Changes there was no room to list.
    pub fn unlisted(&self) -> u64 {
        self.unlisted
    }

    /// Greatest change of the command in force from tick to tick while one controller was in charge and nothing blended, by
    /// joint, N·m or rad; after the start.
    pub fn steady_change(&self) -> &Joints {
        &self.steady_change
    }

    /// Greatest difference between the one in charge and a standby, by joint, N·m or rad; after the start.
    pub fn greatest_difference(&self) -> &Joints {
        self.cross_check.greatest()
    }

    /// What each slot from 1 on says to this tick less what slot 0 says, by joint, N·m or rad; NaN where one of them has no answer that
    /// passes, or there is no such slot.
    pub fn differences(&self) -> [Joints; MAX_SLOTS - 1] {
        let said = |slot: usize| match self.slots.get(slot)? {
            Slot { rejection: None | Some(Rejection::Disagrees), answer, .. } => answer.as_ref(),
            _ => None,
        };
        let first = said(0);
        std::array::from_fn(|standby| match (first, said(standby + 1)) {
            (Some(first), Some(other)) => {
                std::array::from_fn(|joint| other.value[joint] - first.value[joint])
            }
            _ => [f64::NAN; MAX_JOINTS],
        })
    }

    pub(crate) fn slot_mut(&mut self, slot: usize) -> &mut Slot {
        &mut self.slots[slot]
    }

    /// Whether every controller has answered this tick.
    pub(crate) fn all_have_answered(&self) -> bool {
        self.slots.iter().all(|slot| slot.answer.is_some())
    }

    /// Forgets the answers to the last tick.
    pub(crate) fn begin_tick(&mut self) {
        self.slots.iter_mut().for_each(|slot| slot.answer = None);
    }

    /// Another process has taken `slot`.
    pub(crate) fn renew(&mut self, slot: usize) {
        if let Some(slot) = self.slots.get_mut(slot) {
            slot.gate.renew();
        }
    }

    /// The controller in slot `to` is to be in charge from `tick` on; of several such requests the last counts.
    pub(crate) fn ask(&mut self, tick: u64, to: usize) {
        if to < self.slots.len() {
            self.asked = Some(PlannedSwap { tick, to });
        }
    }

    /// The swap that is due at `tick`, asked for or planned.
    fn due(&self, tick: u64) -> Option<PlannedSwap> {
        let planned = self.planned.get(self.next_planned).copied();
        self.asked.or(planned.filter(|swap| swap.tick <= tick))
    }

    /// The swap that was due has taken place, or need not.
    fn settle(&mut self) {
        if self.asked.take().is_none() {
            self.next_planned += 1;
        }
    }

    /// Judges all answers to `tick` and says what is to be applied to joints that are at `measured` (\[q, v, a\] each); `settled` after the
    /// start of the run, whose changes are not steady ones.
    pub(crate) fn judge(&mut self, tick: u64, settled: bool, measured: &[[f64; 3]]) -> Verdict {
        for slot in &mut self.slots {
            slot.rejection = slot.gate.watch(slot.answer.as_ref(), tick);
        }
        let old = self.in_charge;
        if settled {
            self.hear_witnesses();
        }
        self.judge_step(tick, measured);
        let rejection = self.slots[old].rejection;
        if let Some(reason) = rejection {
            self.count(tick, old, false, reason, self.slots[old].gate.excess());
        }
        self.slots[old].in_charge += 1;
        let before = self.in_force;
        let change = self.change(tick, measured);
        if let Some((to, cause, asked)) = change {
            self.hand_over(tick, to, cause, asked);
        }
        let most = self.hand_over_change.filter(|_| matches!(change, Some((_, Cause::Planned, _))));
        let slot = &mut self.slots[self.in_charge];
        let answer = slot.answer;
        let (applied, let_through) = match (slot.rejection, answer) {
            (None, Some(answer)) => (Applied::Command, Some(answer)),
            _ => (slot.gate.fall_back(), None),
        };
        self.held = if let_through.is_some() { 0 } else { self.held.saturating_add(1) };
        if let Some(command) = let_through {
            self.put_in_force(tick, command, before.as_ref(), most.as_ref(), settled);
        }
        Verdict { applied, rejection, answer }
    }

    /// Refuses what the one in charge says where the others contradict it.
    fn hear_witnesses(&mut self) {
        let slots = &self.slots;
        let said = |slot: usize| match &slots[slot] {
            Slot { rejection: None, answer: Some(answer), .. } => Some(answer),
            _ => None,
        };
        if self.cross_check.contradict(self.in_charge, said) {
            let slot = &mut self.slots[self.in_charge];
            slot.gate.refuse(Rejection::Disagrees, None);
            slot.rejection = Some(Rejection::Disagrees);
        }
    }

    /// Counts a refusal of who is, or `takes_over` to be, in charge.
    fn count(
        &mut self,
        tick: u64,
        slot: usize,
        takes_over: bool,
        reason: Rejection,
        excess: Option<LimitViolation>,
    ) {
        self.rejected[reason as usize] += 1;
        if reason != Rejection::Missing {
            self.first_refusal.get_or_insert(RefusedCommand { tick, slot, takes_over, reason, excess });
        }
    }

    /// Refuses what the one in charge says where joints at `measured` cannot get there within a tick.
    fn judge_step(&mut self, tick: u64, measured: &[[f64; 3]]) {
        let slot = &self.slots[self.in_charge];
        let (None, Some(mut command)) = (slot.rejection, slot.answer) else { return };
        if let (true, Some(before)) = (self.blend.holds(tick), &self.in_force) {
            self.blend.add(tick, &mut command);
            slot.gate.limits().clamp(&mut command, before);
        }
        if let Some(excess) = self.step_excess(slot, &command, measured) {
            let slot = &mut self.slots[self.in_charge];
            slot.gate.refuse(Rejection::TooFast, Some(excess));
            slot.rejection = Some(Rejection::TooFast);
        }
    }

    /// What is wrong with going on with `command` of `slot` from joints at `measured`. A torque is no step: it is cut to its rate instead.
    fn step_excess(&self, slot: &Slot, command: &Command, measured: &[[f64; 3]]) -> Option<LimitViolation> {
        let limits = slot.gate.limits();
        (limits.mode == Mode::Driven).then(|| limits.step_excess(command, measured, self.held)).flatten()
    }

    /// What is wrong with the first command of the controller in `to` as it would be put in force at `tick`, with its blend.
    fn hand_over_excess(&self, tick: u64, to: usize, measured: &[[f64; 3]]) -> Option<LimitViolation> {
        let slot = &self.slots[to];
        let mut command = slot.answer?;
        let mut blend = self.blend.clone();
        match self.continued(tick, self.in_charge, to) {
            Some((was, says)) => blend.begin(tick, &was, &says),
            None => blend.end(),
        }
        if let (true, Some(before)) = (blend.holds(tick), &self.in_force) {
            blend.add(tick, &mut command);
            slot.gate.limits().clamp(&mut command, before);
        }
        self.step_excess(slot, &command, measured)
    }

    /// Who takes over at `tick`, why, and since when that is due.
    fn change(&mut self, tick: u64, measured: &[[f64; 3]]) -> Option<(usize, Cause, u64)> {
        while let Some(swap) = self.due(tick) {
            if swap.to == self.in_charge {
                self.settle();
                continue;
            }
            if self.slots.get(swap.to).is_some_and(|slot| slot.rejection.is_none()) {
                let Some(excess) = self.hand_over_excess(tick, swap.to, measured) else {
                    self.settle();
                    return Some((swap.to, Cause::Planned, swap.tick));
                };
                let slot = &mut self.slots[swap.to];
                slot.gate.refuse(Rejection::TooFast, Some(excess));
                slot.rejection = Some(Rejection::TooFast);
                self.count(tick, swap.to, true, Rejection::TooFast, Some(excess));
            }
            break;
        }
        let slot = &self.slots[self.in_charge];
        let reason = slot.rejection?;
        let first = tick.saturating_sub(u64::from(slot.gate.missed().saturating_sub(1)));
        Some((self.soundest(tick, measured)?, Cause::Failed(reason), first))
    }

    /// The standby with the longest faultless record, of equals the first; only one whose answer to this tick passed and leads on from joints
    /// at `measured`.
    fn soundest(&self, tick: u64, measured: &[[f64; 3]]) -> Option<usize> {
        let record =
            |slot: usize| self.slots[slot].gate.streak().min(self.cross_check.agreed(slot)).min(PROBATION);
        (0..self.slots.len())
            .filter(|&slot| slot != self.in_charge && self.slots[slot].rejection.is_none())
            .filter(|&slot| self.hand_over_excess(tick, slot, measured).is_none())
            .max_by_key(|&slot| (record(slot), std::cmp::Reverse(slot)))
    }

    /// What was in force under the controller in `from`, and what the one in `to` says for the same instant.
    fn continued(&self, tick: u64, from: usize, to: usize) -> Option<(Command, Command)> {
        let (old, new) = (&self.slots[from], &self.slots[to]);
        match (old.rejection, &old.answer) {
            (None, Some(answer)) => {
                let mut was = *answer;
                self.blend.add(tick, &mut was);
                new.answer.map(|says| (was, says))
            }
            // For the instant before; without an answer to that, the command stays what it was for this tick.
            _ => self.in_force.zip(new.gate.before_last().copied().or(new.answer)),
        }
    }

    fn hand_over(&mut self, tick: u64, to: usize, cause: Cause, asked: u64) {
        let continued = self.continued(tick, self.in_charge, to);
        let from = std::mem::replace(&mut self.in_charge, to);
        let is_first = !self.blend.holds(tick);
        self.blends_from = Some(from).filter(|_| cause == Cause::Planned && is_first);
        match continued {
            Some((was, says)) => self.blend.begin(tick, &was, &says),
            None => self.blend.end(),
        }
        if cause != Cause::Planned {
            self.blend.hurry();
        }
        if let (Cause::Failed(Rejection::Disagrees), Some(comparison)) = (cause, &self.comparison) {
            // What is in force is already wrong: no more of it lives on than two sound controllers may differ by.
            self.blend.limit(&comparison.most(tick, [from, to]));
        }
        let held = if cause == Cause::Planned { 0 } else { tick - asked };
        let none = [0.0; MAX_JOINTS];
        let swap = Swap { tick, from, to, cause, gap: tick - asked, held, jump: none, greatest_change: none };
        if self.swaps.len() < self.swaps.capacity() {
            self.swaps.push(swap);
        } else {
            self.unlisted += 1;
        }
    }

    /// Puts `command` in force, with what is left of a blend and no further than `most` from the one `before`, and notes how far it is.
    fn put_in_force(
        &mut self,
        tick: u64,
        mut command: Command,
        before: Option<&Command>,
        most: Option<&Joints>,
        settled: bool,
    ) {
        let blends = self.blend.holds(tick);
        if blends && before.is_some() {
            let old = self.blends_from.map(|slot| &self.slots[slot]);
            if let Some(Slot { rejection: None, answer: Some(old), .. }) = old {
                self.blend.shrink(old, &command);
            }
            self.blend.add(tick, &mut command);
        }
        let limits = self.slots[self.in_charge].gate.limits();
        // A torque changes no faster than its rate either where nothing blends as it changes hands.
        if let (true, Some(before)) = (blends || limits.mode == Mode::Torque, before) {
            limits.clamp(&mut command, before);
        }
        if let (Some(before), Some(most)) = (before, most) {
            for (value, (from, most)) in command.value.iter_mut().zip(before.value.iter().zip(most)) {
                *value = value.clamp(from - most, from + most);
            }
        }
        if let Some(before) = before {
            let mut change = [0.0; MAX_JOINTS];
            for (joint, change) in change.iter_mut().enumerate() {
                *change = (command.value[joint] - before.value[joint]).abs();
            }
            self.note(tick, &change, blends, settled);
        }
        self.in_force = Some(command);
    }

    fn note(&mut self, tick: u64, change: &Joints, blends: bool, settled: bool) {
        let widen = |most: &mut Joints| {
            most.iter_mut().zip(change).for_each(|(most, change)| *most = most.max(*change));
        };
        match self.swaps.last_mut() {
            Some(swap) if swap.tick == tick => (swap.jump, swap.greatest_change) = (*change, *change),
            Some(swap) if blends => widen(&mut swap.greatest_change),
            _ if settled => widen(&mut self.steady_change),
            _ => {}
        }
    }

    /// A position was held for a tick: the joints have moved on to `[q, v, a]`.
    pub(crate) fn moved_on(&mut self, joint: usize, [q, v, a]: [f64; 3]) {
        if let Some(command) = &mut self.in_force {
            (command.value[joint], command.velocity[joint], command.acceleration[joint]) = (q, v, a);
        }
    }
}

#[cfg(test)]
mod tests;
