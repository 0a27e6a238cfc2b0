//! The answers to a tick: which of them the plant awaits, and their latencies.

use freeplay_shm::{COMMAND_BUFFER, Command, Pace, now_ns};

use crate::Stage;
use crate::cause::TickLatencies;
use crate::misses::Ended;
use crate::plant::{PUBLISHED, Plant, PlantError};

/// Real time: after so many missed ticks in a row, the plant steps without waiting for a standby.
const MISSED_WAITED_FOR: u32 = 3;
/// Lockstep waits this long before it checks that the peer still lives, ns.
const LIFE_CHECK_NS: u64 = 20_000_000;

impl Plant {
    /// Collects answers until every awaited controller has answered, the `deadline` has passed or the processes of the missing controllers have ended.
    pub(super) fn await_answers(
        &mut self,
        tick: u64,
        scheduled: u64,
        deadline: u64,
    ) -> Result<(), PlantError> {
        self.backoff.reset();
        let mut next_check = LIFE_CHECK_NS;
        loop {
            for slot in 0..self.manager.len() {
                self.take_answer(slot, tick, scheduled)?;
            }
            let now = now_ns();
            if now >= deadline || self.stopped.is_some() || self.all_answered(tick) {
                return Ok(());
            }
            match self.config.pace {
                Pace::RealTime => std::hint::spin_loop(),
                Pace::Lockstep => {
                    let waited = self.backoff.wait();
                    if waited > next_check {
                        next_check = waited + LIFE_CHECK_NS;
                        self.note_ended_processes(tick);
                    }
                }
            }
        }
    }

    /// Takes the answer of `slot` to `tick` if it has arrived, and counts older answers as late. The plant reads at most one buffer of answers,
    /// so that a flood does not stall the loop.
    fn take_answer(&mut self, slot: usize, tick: u64, scheduled: u64) -> Result<(), PlantError> {
        if self.manager.slot_mut(slot).answer.is_some() {
            return Ok(());
        }
        for _ in 0..COMMAND_BUFFER {
            let Some(mut command) = self.link.next_command(slot)? else { break };
            let received = now_ns();
            let in_charge = slot == self.manager.active();
            let belongs = command.check(self.run).is_ok();
            let has_times = belongs && self.drop_implausible_times(&mut command, received);
            if command.tick < tick && belongs {
                if in_charge && self.stopped.is_none() {
                    self.deadlines.late += 1;
                    self.record_latencies(slot, &command, has_times, scheduled, received);
                } else {
                    self.note_answer(slot, &command, received);
                }
                continue;
            }
            if self.timeouts.is_unresponsive(slot, tick) {
                continue;
            }
            // A command of a foreign process, or for a future tick, is no answer to this tick.
            let is_answer = belongs && command.tick == tick;
            if is_answer && !in_charge {
                self.note_answer(slot, &command, received);
            } else if is_answer && !self.is_planning {
                self.record_latencies(slot, &command, has_times, scheduled, received);
            }
            if in_charge && std::mem::take(&mut self.spoils_next) {
                command.value[0] = f64::NAN;
            }
            self.manager.slot_mut(slot).answer = Some(command);
            break;
        }
        Ok(())
    }

    /// True if every awaited answer to `tick` has arrived.
    pub(super) fn all_answered(&mut self, tick: u64) -> bool {
        (0..self.manager.len()).all(|slot| {
            let is_waited_for = match self.config.pace {
                Pace::Lockstep => !self.timeouts.is_unresponsive(slot, tick),
                Pace::RealTime => {
                    slot == self.manager.active() || self.manager.gate(slot).missed() < MISSED_WAITED_FOR
                }
            };
            !is_waited_for || self.manager.slot_mut(slot).answer.is_some()
        })
    }

    /// Lockstep: the plant does not wait for a controller that has left its slot.
    fn note_ended_processes(&mut self, tick: u64) {
        for slot in 0..self.manager.len() {
            if self.manager.slot_mut(slot).answer.is_none()
                && !self.timeouts.is_unresponsive(slot, tick)
                && !self.link.has_controller(slot)
            {
                self.timeouts.mark_ended(slot);
            }
        }
    }

    /// Removes the times from `command`, received at `received` ns, if they are impossible or missing; returns true if they stay.
    ///
    /// All processes read one clock. A controller receives a state after its publication, and sends its answer before the plant receives
    /// it. The controller spends the times of the parts of the answer in between, and no iteration takes less than a nanosecond.
    fn drop_implausible_times(&mut self, command: &mut Command, received: u64) -> bool {
        let published = self.published_ns(command.tick);
        let are_told = command.received_ns != 0 || command.sent_ns != 0;
        let spent = command.sent_ns.checked_sub(command.received_ns);
        let parts = command.predict_ns.checked_add(command.qp_ns);
        let are_kept = are_told
            && published.is_none_or(|published| published <= command.received_ns)
            && command.sent_ns <= received
            && spent.zip(parts).is_some_and(|(spent, parts)| parts <= spent)
            && u64::from(command.qp_iterations) <= command.qp_ns;
        if !are_kept {
            (command.predict_ns, command.qp_ns) = (0, 0);
            (command.received_ns, command.sent_ns) = (published.unwrap_or(received), received);
            self.answers.implausible_times += u64::from(are_told);
        }
        are_kept
    }

    /// Records the latencies of a command of the active controller, in `slot`, in time or late; those of its parts if it `has_times`.
    fn record_latencies(
        &mut self,
        slot: usize,
        command: &Command,
        has_times: bool,
        scheduled: u64,
        received: u64,
    ) {
        let (links, published) = (self.latencies_of(command, received), self.published_ns(command.tick));
        let stages = &mut self.stages;
        if has_times {
            if published.is_some() {
                stages.record(Stage::StateTransport, links.state_ns);
            }
            stages.record(Stage::Compute, links.compute_ns);
            stages.record(Stage::CommandTransport, links.command_ns);
        }
        match &mut self.round_trips {
            Some(trips) => {
                trips.answered(command.tick, received, |ns| stages.record(Stage::RoundTrip, ns));
                if let Some(published) = published.filter(|_| command.tick == self.state.tick) {
                    stages.record(Stage::Uncorrected, received.saturating_sub(published));
                }
            }
            None => stages.record(Stage::RoundTrip, received.saturating_sub(scheduled)),
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
        if command.tick == self.state.tick {
            self.links = links;
        }
        self.note_answer(slot, command, received);
    }

    /// Passes the latencies of a command of `slot` to the record of missed deadlines.
    fn note_answer(&mut self, slot: usize, command: &Command, received: u64) {
        let links = self.latencies_of(command, received);
        if let Some(misses) = &mut self.misses {
            misses.answered(slot, command.tick, &links);
        }
    }

    /// Time of publication of the state of `tick`, ns; `None` if it was too long ago to be remembered.
    fn published_ns(&self, tick: u64) -> Option<u64> {
        let is_remembered = self.state.tick.saturating_sub(tick) < PUBLISHED as u64;
        is_remembered.then(|| self.published[tick as usize % PUBLISHED])
    }

    /// The latencies of the tick of `command`, received at `received` ns.
    fn latencies_of(&self, command: &Command, received: u64) -> TickLatencies {
        let published = self.published_ns(command.tick).unwrap_or(command.received_ns);
        TickLatencies {
            state_ns: command.received_ns.saturating_sub(published),
            compute_ns: command.sent_ns.saturating_sub(command.received_ns),
            command_ns: received.saturating_sub(command.sent_ns),
            qp_ns: command.qp_ns,
            // Without a time, the number of iterations is unknown, too.
            qp_iterations: if command.qp_ns > 0 { command.qp_iterations } else { 0 },
            ..self.links
        }
    }

    /// True if the deadline of this tick passes without an answer of the active controller.
    pub(super) fn misses_deadline(&mut self) -> bool {
        let in_charge = self.manager.active();
        self.stopped.is_none() && self.manager.slot_mut(in_charge).answer.is_none()
    }

    /// The standby that shall take over at `tick`, if its answer is missing.
    pub(super) fn awaited(&mut self, tick: u64) -> Option<usize> {
        let next = self.manager.next_active(tick);
        let lacks = next != self.manager.active() && self.manager.slot_mut(next).answer.is_none();
        (lacks && self.stopped.is_none()).then_some(next)
    }

    /// Records the end of `tick` with the controller `in_charge`: whether it `missed` its deadline, which standby was `awaited` in vain,
    /// and the latencies known by now.
    pub(super) fn note_links(&mut self, tick: u64, in_charge: usize, missed: bool, awaited: Option<usize>) {
        let Some(misses) = &mut self.misses else { return };
        let now = now_ns();
        let unanswered_ns = now.saturating_sub(self.state.published_ns);
        let over_ns = now.saturating_sub(self.state.scheduled_ns + self.config.period_ns);
        let ended = Ended { tick, in_charge, missed, awaited, unanswered_ns, over_ns, links: self.links };
        misses.end_tick(&ended, &self.stages);
    }

    /// Counts the missing answers at the end of the run, after `played` ticks: they will not arrive any more.
    pub(super) fn count_unanswered(&mut self, played: u64) {
        let stages = &mut self.stages;
        if let (Some(trips), None) = (&mut self.round_trips, self.stopped) {
            trips.finish(played, now_ns(), |ns| stages.record(Stage::RoundTrip, ns));
        }
        if let Some(misses) = &mut self.misses {
            misses.close();
        }
    }
}
