//! The controllers of a run: one is active, the others are standbys. All of them answer every state; the plant applies only the answer of
//! the active one.
//!
//! At the end of a tick each controller's own [`Gate`] checks its answer. Then, in this order:
//!
//! 1. a swap that is planned for this tick takes place if the new controller's answer passes, else at the first later tick at which it
//!    passes;
//! 2. if the answer of the active controller does not pass, the standby with the longest faultless record takes over with its answer to the
//!    same tick: no command is held;
//! 3. if no standby has a valid answer, the gate of the active controller falls back: hold, then brake.
//!
//! A position command, with its blend, must be reachable from the measured joints; otherwise the manager refuses the hand-over as too fast.
//! It limits a torque to its rate instead.
//!
//! In both cases the [`Blend`] makes the new commands continue the old ones. After a planned swap they continue the old controller's
//! command for the next instant. After a failure the old controller's command is not to be trusted: the new commands then continue the
//! command in force, extrapolated by the change of the new controller's commands, and the blend is short.

use freeplay_shm::{Command, Joints, MAX_JOINTS, MAX_SLOTS, Mode};
use serde::Serialize;

use crate::cross_check::{CrossCheck, PROBATION};
use crate::limit_violation::{LimitViolation, RefusedCommand};
use crate::{Applied, Blend, Comparison, Gate, GateLimits, Rejection};

/// Fail-overs that the list keeps; the manager only counts more.
const RECORDED_FAIL_OVERS: usize = 4096;

/// A requested swap.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PlannedSwap {
    /// Tick whose answer shall be the new controller's.
    pub tick: u64,
    /// Slot of the new controller.
    pub to: usize,
}

/// The controllers of a run and their planned swaps.
#[derive(Clone, Debug, PartialEq)]
pub struct ControllerSet {
    /// Number of controllers, 1 to [`MAX_SLOTS`]; slot 0 is active first.
    pub controllers: usize,
    /// Swaps by tick, ascending.
    pub swaps: Vec<PlannedSwap>,
    /// Length of the blend after a change, ticks.
    pub blend: u32,
    /// Greatest change of a torque from tick to tick at a planned swap, by joint, N·m; the rest of the change follows with the next tick.
    /// Absent: as much as the old controller would have changed it. The limit does not apply to positions: they come with derivatives.
    pub hand_over_change: Option<Joints>,
    /// Greatest difference between the active controller and the others; absent: no limit.
    pub comparison: Option<Comparison>,
}

impl Default for ControllerSet {
    /// One controller.
    fn default() -> Self {
        Self { controllers: 1, swaps: Vec::new(), blend: 100, hand_over_change: None, comparison: None }
    }
}

/// Reason of a change of the active controller.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Cause {
    /// It was planned.
    Planned,
    /// The answer of the active controller did not pass.
    Failed(Rejection),
}

/// A change of the active controller.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Swap {
    /// First tick whose answer is the new controller's; that answer is in force from the next tick on.
    pub tick: u64,
    /// Slot of the old controller.
    pub from: usize,
    /// Slot of the new controller.
    pub to: usize,
    /// The reason.
    pub cause: Cause,
    /// Ticks from the requested tick, or from the old controller's first failure, to this one.
    pub gap: u64,
    /// Of these, ticks for which the last command was held.
    pub held: u64,
    /// Change of the command in force at the swap, by joint, N·m or rad.
    pub jump: Joints,
    /// Greatest change of the command in force from tick to tick until the end of the blend or the next swap, by joint.
    pub greatest_change: Joints,
}

/// One controller.
#[derive(Clone, Debug)]
pub(crate) struct Slot {
    gate: Gate,
    /// Its answer to this tick.
    pub(crate) answer: Option<Command>,
    /// The gate's rejection of it.
    rejection: Option<Rejection>,
    /// Ticks as the active controller.
    in_charge: u64,
}

/// The result of a tick.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Verdict {
    /// Command source for the next tick.
    pub applied: Applied,
    /// The reason why the answer of the previously active controller did not pass.
    pub rejection: Option<Rejection>,
    /// The answer of the active controller, accepted or not.
    pub answer: Option<Command>,
}

/// The controllers of a run.
#[derive(Clone, Debug)]
pub struct ControllerManager {
    slots: Vec<Slot>,
    in_charge: usize,
    planned: Vec<PlannedSwap>,
    next_planned: usize,
    /// A swap requested during the run; it precedes the planned ones.
    asked: Option<PlannedSwap>,
    blend: Blend,
    /// The slot whose commands the blend started from, while no other swap contributes to it.
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
    /// Greatest change from tick to tick while no blend is in progress.
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

    /// Always false: there is at least one controller.
    pub fn is_empty(&self) -> bool {
        self.slots.is_empty()
    }

    /// The active slot.
    pub fn active(&self) -> usize {
        self.in_charge
    }

    /// The slot whose answer to `tick` shall be put in force.
    pub fn next_active(&self, tick: u64) -> usize {
        self.due(tick).map_or(self.in_charge, |swap| swap.to)
    }

    /// The command in force, or the last one that was.
    pub fn in_force(&self) -> Option<&Command> {
        self.in_force.as_ref()
    }

    /// The gate of the controller in `slot`.
    pub fn gate(&self, slot: usize) -> &Gate {
        &self.slots[slot].gate
    }

    /// Ticks in which `slot` was active.
    pub fn active_ticks(&self, slot: usize) -> u64 {
        self.slots[slot].in_charge
    }

    /// The first refused command of a controller that was active or about to be; missing commands do not count.
    pub fn first_refusal(&self) -> Option<&RefusedCommand> {
        self.first_refusal.as_ref()
    }

    /// Number of commands rejected for `reason`, of controllers that were active or about to be.
    pub fn rejected(&self, reason: Rejection) -> u64 {
        self.rejected[reason as usize]
    }

    /// All changes of the active controller, in their order.
    pub fn swaps(&self) -> &[Swap] {
        &self.swaps
    }

    /// Changes that did not fit into the list.
    pub fn unlisted(&self) -> u64 {
        self.unlisted
    }

    /// Greatest change of the command in force from tick to tick while one controller was active and no blend was in progress, by joint,
    /// N·m or rad; after the start.
    pub fn steady_change(&self) -> &Joints {
        &self.steady_change
    }

    /// Greatest difference between the active controller and a standby, by joint, N·m or rad; after the start.
    pub fn greatest_difference(&self) -> &Joints {
        self.cross_check.greatest()
    }

    /// Answer of each slot from 1 on to this tick minus that of slot 0, by joint, N·m or rad; NaN if one of them has no valid answer, or
    /// there is no such slot.
    pub fn differences(&self) -> [Joints; MAX_SLOTS - 1] {
        let answer_of = |slot: usize| match self.slots.get(slot)? {
            Slot { rejection: None | Some(Rejection::Disagrees), answer, .. } => answer.as_ref(),
            _ => None,
        };
        let first = answer_of(0);
        std::array::from_fn(|standby| match (first, answer_of(standby + 1)) {
            (Some(first), Some(other)) => {
                std::array::from_fn(|joint| other.value[joint] - first.value[joint])
            }
            _ => [f64::NAN; MAX_JOINTS],
        })
    }

    pub(crate) fn slot_mut(&mut self, slot: usize) -> &mut Slot {
        &mut self.slots[slot]
    }

    /// True if every controller has answered this tick.
    pub(crate) fn all_have_answered(&self) -> bool {
        self.slots.iter().all(|slot| slot.answer.is_some())
    }

    /// Discards the answers to the last tick.
    pub(crate) fn begin_tick(&mut self) {
        self.slots.iter_mut().for_each(|slot| slot.answer = None);
    }

    /// Resets `slot` for another process.
    pub(crate) fn renew(&mut self, slot: usize) {
        if let Some(slot) = self.slots.get_mut(slot) {
            slot.gate.renew();
        }
    }

    /// Requests that the controller in slot `to` be active from `tick` on; of several such requests the last counts.
    pub(crate) fn ask(&mut self, tick: u64, to: usize) {
        if to < self.slots.len() {
            self.asked = Some(PlannedSwap { tick, to });
        }
    }

    /// The swap that is due at `tick`, requested or planned.
    fn due(&self, tick: u64) -> Option<PlannedSwap> {
        let planned = self.planned.get(self.next_planned).copied();
        self.asked.or(planned.filter(|swap| swap.tick <= tick))
    }

    /// Removes the due swap: it has taken place, or is needless.
    fn settle(&mut self) {
        if self.asked.take().is_none() {
            self.next_planned += 1;
        }
    }

    /// Checks all answers to `tick` and returns the command source for joints at `measured` (\[q, v, a\] each). `settled` is true after the
    /// start of the run; changes before that are not steady.
    pub(crate) fn judge(&mut self, tick: u64, settled: bool, measured: &[[f64; 3]]) -> Verdict {
        for slot in &mut self.slots {
            slot.rejection = slot.gate.watch(slot.answer.as_ref(), tick);
        }
        let old = self.in_charge;
        if settled {
            self.check_against_standbys();
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

    /// Refuses the answer of the active controller if the others contradict it.
    fn check_against_standbys(&mut self) {
        let slots = &self.slots;
        let answer_of = |slot: usize| match &slots[slot] {
            Slot { rejection: None, answer: Some(answer), .. } => Some(answer),
            _ => None,
        };
        if self.cross_check.contradict(self.in_charge, answer_of) {
            let slot = &mut self.slots[self.in_charge];
            slot.gate.refuse(Rejection::Disagrees, None);
            slot.rejection = Some(Rejection::Disagrees);
        }
    }

    /// Counts a refusal of the active controller, or of one that `takes_over`.
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

    /// Refuses the answer of the active controller if joints at `measured` cannot reach it within a tick.
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

    /// The limit that a step from joints at `measured` to `command` of `slot` violates. A torque is no step: the manager limits its rate
    /// instead.
    fn step_excess(&self, slot: &Slot, command: &Command, measured: &[[f64; 3]]) -> Option<LimitViolation> {
        let limits = slot.gate.limits();
        (limits.mode == Mode::Driven).then(|| limits.step_excess(command, measured, self.held)).flatten()
    }

    /// The limit that the first command of the controller in `to` would violate at `tick`, with its blend.
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

    /// The controller that takes over at `tick`, the reason, and the tick since which the change is due.
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
        Some((self.best_standby(tick, measured)?, Cause::Failed(reason), first))
    }

    /// The standby with the longest faultless record, of equals the first. Only a standby whose answer to this tick passed and is reachable
    /// from joints at `measured` qualifies.
    fn best_standby(&self, tick: u64, measured: &[[f64; 3]]) -> Option<usize> {
        let record =
            |slot: usize| self.slots[slot].gate.streak().min(self.cross_check.agreed(slot)).min(PROBATION);
        (0..self.slots.len())
            .filter(|&slot| slot != self.in_charge && self.slots[slot].rejection.is_none())
            .filter(|&slot| self.hand_over_excess(tick, slot, measured).is_none())
            .max_by_key(|&slot| (record(slot), std::cmp::Reverse(slot)))
    }

    /// The command in force under the controller in `from`, and the command of the one in `to` for the same instant.
    fn continued(&self, tick: u64, from: usize, to: usize) -> Option<(Command, Command)> {
        let (old, new) = (&self.slots[from], &self.slots[to]);
        match (old.rejection, &old.answer) {
            (None, Some(answer)) => {
                let mut was = *answer;
                self.blend.add(tick, &mut was);
                new.answer.map(|says| (was, says))
            }
            // Both for the instant before; without an answer of the new controller to that, its answer to this tick replaces it.
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
            self.blend.shorten();
        }
        if let (Cause::Failed(Rejection::Disagrees), Some(comparison)) = (cause, &self.comparison) {
            // The command in force is already wrong: the blend keeps no more of it than two valid controllers may differ by.
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

    /// Puts `command` in force, with the rest of a blend and within `most` of the command `before`, and records its change.
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
        // Outside of a blend, too, a torque changes no faster than its rate.
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

    /// Updates a held position after a tick: the joint has moved on to `[q, v, a]`.
    pub(crate) fn moved_on(&mut self, joint: usize, [q, v, a]: [f64; 3]) {
        if let Some(command) = &mut self.in_force {
            (command.value[joint], command.velocity[joint], command.acceleration[joint]) = (q, v, a);
        }
    }
}

#[cfg(test)]
mod tests;
