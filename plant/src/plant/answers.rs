//! The answers to a tick: whose are waited for, and what they tell of the time they took.

use freeplay_shm::{COMMAND_BUFFER, Command, Pace, now_ns};

use crate::Stage;
use crate::cause::Links;
use crate::misses::Ended;
use crate::plant::{PUBLISHED, Plant, PlantError};

/// Real time: a standby that has missed so many ticks in a row is no longer waited for before the plant steps.
const MISSED_WAITED_FOR: u32 = 3;
/// How long lockstep waits before it asks whether the peer still lives, ns.
const LIFE_CHECK_NS: u64 = 20_000_000;

impl Plant {
    /// Takes answers until all that are waited for are there, the `deadline` has passed or those that lack are gone.
    pub(super) fn await_answers(
        &mut self,
        tick: u64,
        scheduled: u64,
        deadline: u64,
    ) -> Result<(), PlantError> {
        self.backoff.reset();
        let mut next_check = LIFE_CHECK_NS;
        loop {
            for slot in 0..self.line_up.len() {
                self.take_answer(slot, tick, scheduled)?;
            }
            let now = now_ns();
            if now >= deadline || self.braked.is_some() || self.all_in(tick) {
                return Ok(());
            }
            match self.config.pace {
                Pace::RealTime => std::hint::spin_loop(),
                Pace::Lockstep => {
                    let waited = self.backoff.wait();
                    if waited > next_check {
                        next_check = waited + LIFE_CHECK_NS;
                        self.note_the_dead(tick);
                    }
                }
            }
        }
    }

    /// Takes the answer of `slot` to `tick` if it is there; older ones are counted as late. No more of them than a buffer holds,
    /// so that a flood does not keep the loop.
    fn take_answer(&mut self, slot: usize, tick: u64, scheduled: u64) -> Result<(), PlantError> {
        if self.line_up.slot_mut(slot).answer.is_some() {
            return Ok(());
        }
        for _ in 0..COMMAND_BUFFER {
            let Some(mut command) = self.link.next_command(slot)? else { break };
            let received = now_ns();
            let in_charge = slot == self.line_up.in_charge();
            if command.tick < tick && command.check(self.run).is_ok() {
                if in_charge && self.braked.is_none() {
                    self.deadlines.late += 1;
                    self.clock(&command, scheduled, received);
                }
                continue;
            }
            if self.attendance.is_away(slot, tick) {
                continue;
            }
            if in_charge && !self.is_planning {
                self.clock(&command, scheduled, received);
            }
            if in_charge && std::mem::take(&mut self.spoils_next) {
                command.value[0] = f64::NAN;
            }
            self.line_up.slot_mut(slot).answer = Some(command);
            break;
        }
        Ok(())
    }

    /// Whether every answer to `tick` that is waited for is there.
    pub(super) fn all_in(&mut self, tick: u64) -> bool {
        (0..self.line_up.len()).all(|slot| {
            let is_waited_for = match self.config.pace {
                Pace::Lockstep => !self.attendance.is_away(slot, tick),
                Pace::RealTime => {
                    slot == self.line_up.in_charge() || self.line_up.gate(slot).missed() < MISSED_WAITED_FOR
                }
            };
            !is_waited_for || self.line_up.slot_mut(slot).answer.is_some()
        })
    }

    /// Lockstep: who has left its seat is not waited for.
    fn note_the_dead(&mut self, tick: u64) {
        for slot in 0..self.line_up.len() {
            if self.line_up.slot_mut(slot).answer.is_none()
                && !self.attendance.is_away(slot, tick)
                && !self.link.is_held(slot)
            {
                self.attendance.left(slot);
            }
        }
    }

    /// Counts the latencies that a command tells of, in time or late.
    fn clock(&mut self, command: &Command, scheduled: u64, received: u64) {
        let stages = &mut self.stages;
        let took = |from: u64, to: u64| to.saturating_sub(from);
        let is_remembered = self.state.tick.saturating_sub(command.tick) < PUBLISHED as u64;
        let published = self.published[command.tick as usize % PUBLISHED];
        if is_remembered {
            stages.record(Stage::StateTransport, took(published, command.received_ns));
        }
        stages.record(Stage::Compute, took(command.received_ns, command.sent_ns));
        stages.record(Stage::CommandTransport, took(command.sent_ns, received));
        match &mut self.round_trips {
            Some(trips) => {
                trips.answered(command.tick, received, |ns| stages.record(Stage::RoundTrip, ns));
                if command.tick == self.state.tick {
                    stages.record(Stage::Uncorrected, took(published, received));
                }
            }
            None => stages.record(Stage::RoundTrip, took(scheduled, received)),
        }
        if command.predict_ns > 0 {
            stages.record(Stage::Predict, command.predict_ns);
        }
        if command.qp_ns > 0 {
            stages.record(Stage::Qp, command.qp_ns);
            if command.qp_iterations > 0 {
                stages.record(Stage::QpIterated, command.qp_ns);
            }
            stages.record_iterations(command.qp_iterations);
        }
        let links = Links {
            state_ns: if is_remembered { took(published, command.received_ns) } else { 0 },
            compute_ns: took(command.received_ns, command.sent_ns),
            command_ns: took(command.sent_ns, received),
            qp_ns: command.qp_ns,
            qp_iterations: command.qp_iterations,
            ..self.links
        };
        if command.tick == self.state.tick {
            self.links = links;
        }
        if let Some(misses) = &mut self.misses {
            misses.answered(command.tick, &links);
        }
    }

    /// Whether the deadline of this tick passes without an answer of the one in charge.
    pub(super) fn misses_deadline(&mut self) -> bool {
        let in_charge = self.line_up.in_charge();
        self.braked.is_none() && self.line_up.slot_mut(in_charge).answer.is_none()
    }

    /// Writes into the book how `tick` went with the controller `in_charge`: whether its deadline was `missed`, and the links that are known
    /// by now.
    pub(super) fn note_links(&mut self, tick: u64, in_charge: usize, missed: bool) {
        let Some(misses) = &mut self.misses else { return };
        let now = now_ns();
        if missed {
            self.links.compute_ns = now.saturating_sub(self.state.published_ns);
        }
        let over_ns = now.saturating_sub(self.state.scheduled_ns + self.config.period_ns);
        misses.end_tick(&Ended { tick, in_charge, missed, over_ns, links: self.links }, &self.stages);
    }

    /// The run is over after `played` ticks: what has no answer by now will have none.
    pub(super) fn settle_accounts(&mut self, played: u64) {
        let stages = &mut self.stages;
        if let (Some(trips), None) = (&mut self.round_trips, self.braked) {
            trips.finish(played, now_ns(), |ns| stages.record(Stage::RoundTrip, ns));
        }
        if let Some(misses) = &mut self.misses {
            misses.close();
        }
    }
}
