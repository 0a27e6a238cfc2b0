//! One tick: wake, observe, publish, step, judge, record.

use std::time::Duration;

use freeplay_arm::forward_kinematics;
use freeplay_laws::Readings;
use freeplay_shm::{
    Joints, MAX_JOINTS, Mode, Pace, Reference, Schedule, State, now_ns, sleep_then_spin_until,
};
use nalgebra::Vector3;

use crate::cause::TickLatencies;
use crate::plant::{PUBLISHED, Plant, PlantError};
use crate::{
    Applied, DeviationStatistics, Input, LimitViolation, Motion, NO_DIFFERENCES, OperatorRequest, PlayRecord,
    Stage, Stop, StopReason, TickRecord,
};

/// The plant spins for this long before the scheduled time, ns.
const SPIN_NS: u64 = 200_000;
/// Real time: the plant awaits the answer for one period divided by this, then steps.
const ANSWER_WINDOW: u64 = 2;
/// Real time: the plant judges the answers this long before the next tick, ns.
const JUDGING_NS: u64 = 50_000;
/// Real time: the plant wakes this long before it judges, to take answers that arrived after its step, ns: the system wakes sleepers 40 to
/// 130 µs late.
const LAST_LOOK_NS: u64 = 100_000;

impl Plant {
    pub(super) fn tick(&mut self, tick: u64, schedule: &Schedule) -> Result<(), PlantError> {
        let scheduled = self.wake(tick, schedule);
        self.take_requests(tick);
        let mut record = self.observe(tick, scheduled);
        self.state.published_ns = now_ns();
        self.published[tick as usize % PUBLISHED] = self.state.published_ns;
        self.link.publish(&self.state)?;
        record.state = self.state;
        self.manager.begin_tick();
        if self.config.pace == Pace::RealTime {
            // Counted from publication, so that a delayed plant still waits for answers while it catches up.
            let window = self.state.published_ns + self.config.period_ns / ANSWER_WINDOW;
            self.await_answers(tick, scheduled, window)?;
        }
        self.step(tick)?;
        let is_complete = match self.config.pace {
            Pace::RealTime => self.manager.all_have_answered(),
            Pace::Lockstep => self.all_answered(tick),
        };
        if !is_complete {
            let deadline = match self.config.pace {
                Pace::RealTime => {
                    // The plant sleeps instead of spinning. With few cores, the standby whose answer is missing computes on this core while
                    // the system tears down the dying process of the active controller, at that process's priority, on the other.
                    let deadline = schedule.due_ns(tick + 1) - JUDGING_NS;
                    sleep_then_spin_until(deadline - LAST_LOOK_NS, 0);
                    deadline
                }
                Pace::Lockstep => now_ns() + self.answer_patience(tick).as_nanos() as u64,
            };
            self.await_answers(tick, scheduled, deadline)?;
        }
        // Judging may change the active controller.
        let (missed, in_charge, awaited) =
            (self.misses_deadline(), self.manager.active(), self.awaited(tick));
        self.judge(tick, &mut record);
        self.keep(record);
        self.note_links(tick, in_charge, missed, awaited);
        Ok(())
    }

    /// Longest wait of lockstep for the answer to `tick`; before the first tick, controllers still plan.
    fn answer_patience(&self, tick: u64) -> Duration {
        let of_several = self.config.answer_patience.filter(|_| tick > 0 && self.manager.len() > 1);
        of_several.unwrap_or(self.config.patience)
    }

    /// Waits for the tick's time; returns the reference time for the latencies of this tick, ns.
    fn wake(&mut self, tick: u64, schedule: &Schedule) -> u64 {
        match self.config.pace {
            Pace::Lockstep => now_ns(),
            Pace::RealTime => {
                let arrival = schedule.await_tick(tick, SPIN_NS);
                self.stages.record_arrival(arrival);
                self.links = TickLatencies { wake_up_ns: arrival.late_ns, ..TickLatencies::default() };
                self.deadlines.plant_late += u64::from(arrival.late_ns > self.config.period_ns);
                schedule.due_ns(tick)
            }
        }
    }

    fn take_requests(&mut self, tick: u64) {
        while let Some(request) = self.requests.next() {
            match request {
                OperatorRequest::Swap { to } => self.manager.ask(tick, to),
                OperatorRequest::Spoil => self.spoils_next = true,
                OperatorRequest::Mark => self.marks += 1,
            }
        }
    }

    /// Reads the sensors into the State of `tick`, and the true state into its record.
    fn observe(&mut self, tick: u64, scheduled: u64) -> TickRecord {
        let joints = self.config.arm.dof();
        let period = self.config.period_ns as f64 * 1e-9;
        let time = tick as f64 * period;
        let state = &mut self.state;
        state.tick = tick;
        state.mode = self.config.mode.code();
        state.scheduled_ns = match self.config.pace {
            Pace::Lockstep => tick * self.config.period_ns,
            Pace::RealTime => scheduled,
        };
        let mut link = [0.0; MAX_JOINTS];
        self.system.encoders(&mut state.q[..joints], &mut state.qd[..joints]);
        self.system.drive_torque(&mut state.tau[..joints]);
        self.system.play().gather(self.system.q(), &mut link[..joints]);
        // The answer acts from the next tick on: a torque from its start, a position at its end.
        let ahead = match self.config.mode {
            Mode::Torque | Mode::Servo => period,
            Mode::Driven => 2.0 * period,
        };
        for (reference, at) in [(&mut state.reference, time), (&mut state.reference_next, time + ahead)] {
            self.path.at(
                at,
                &mut reference.q[..joints],
                &mut reference.qd[..joints],
                &mut reference.qdd[..joints],
            );
        }
        let desired =
            forward_kinematics(&self.config.arm, &mut self.nominal, &self.state.reference.q[..joints]);
        let mut tool = tool_row(&self.system.tool());
        let mut truth = readings(&mut self.state, &mut link, &mut tool, joints, period);
        self.laws.tool.iter_mut().for_each(|law| law.read(&mut truth));
        let deviation = Vector3::new(tool[0], tool[1], tool[2]) - desired.translation.vector;
        self.deviation.add(time, &deviation);
        self.joint_use.add(&self.system);
        self.sense(tick, tool, &mut link);
        TickRecord {
            state: self.state,
            command: None,
            applied: self.applied,
            rejection: None,
            deviation: deviation.into(),
            tool,
            link,
            peak_base_force: self.system.take_peaks().base_force,
            plays: self.plays(),
            differences: NO_DIFFERENCES,
            marks: self.marks,
        }
    }

    /// Writes the sensors' measurements of the true state and the flags into the State.
    fn sense(&mut self, tick: u64, mut tool: [f64; 7], link: &mut Joints) {
        let (joints, period) = (self.config.arm.dof(), self.config.period_ns as f64 * 1e-9);
        let mut readings = readings(&mut self.state, link, &mut tool, joints, period);
        self.laws.sensors.iter_mut().for_each(|law| law.read(&mut readings));
        let Readings { q, v, torque, tool: position, .. } = readings;
        self.sensors.read(q, v, torque, position);
        let tracked = self.config.sensors.track_tool;
        self.state.tool = if tracked { tool } else { [f64::NAN; 7] };
        let flags = [
            (State::FLAG_LAST, tick + 1 == self.config.ticks),
            (State::FLAG_TOOL_TRACKED, tracked),
            (State::FLAG_FALLBACK, matches!(self.applied, Applied::Hold | Applied::Brake)),
        ];
        let flags: u32 = flags.iter().map(|&(flag, holds)| if holds { flag } else { 0 }).sum();
        let charge = [self.manager.active(), self.manager.next_active(tick)];
        self.state.flags = flags | State::slot_flags(charge[0] as u32, charge[1] as u32);
    }

    fn plays(&mut self) -> [PlayRecord; MAX_JOINTS] {
        let mut records = [PlayRecord::default(); MAX_JOINTS];
        for (index, record) in records.iter_mut().enumerate().take(self.system.bearings().len()) {
            let [first, second] = self.system.play().plays()[index].slides;
            record.offset = [self.system.q()[first], self.system.q()[second]];
            let bearing = self.system.bearing_mut(index);
            record.peak_normal_force = bearing.take_peak();
            record.episode = bearing.episode();
        }
        records
    }

    /// Integrates `tick` under the command in force. If a torque drives a joint beyond a limit, the brakes close within the tick.
    fn step(&mut self, tick: u64) -> Result<(), PlantError> {
        let before = now_ns();
        let is_commanded = matches!(self.applied, Applied::Command | Applied::Hold);
        let by_motion = !is_commanded || self.config.mode == Mode::Driven;
        self.driven.fill(by_motion);
        let (torque, driven) = (&self.torque, &self.driven);
        let excess = if by_motion {
            let motion: &dyn Motion = match self.applied {
                Applied::Guided => &*self.path,
                Applied::Brake => &self.brakes,
                Applied::Command | Applied::Hold => &self.motion,
            };
            self.system.tick(&Input { torque, driven, motion })?;
            None
        } else {
            let input = Input { torque, driven, motion: &self.motion };
            self.system.watched_tick(&input, self.reflexes.limits(), &mut self.brakes)?
        };
        if let Some(excess) = excess {
            self.stop(tick, StopReason::Reflex(excess.quantity), Some(excess));
        }
        self.links.step_ns = now_ns() - before;
        self.stages.record(Stage::PlantStep, self.links.step_ns);
        Ok(())
    }

    /// Closes the brakes from `tick` on.
    fn stop(&mut self, tick: u64, reason: StopReason, excess: Option<LimitViolation>) {
        self.stopped = Some(Stop { tick, reason, excess });
        self.applied = Applied::Brake;
    }

    /// Checks the joints at the end of `tick`; closes the brakes if one of them is beyond a limit.
    fn watch(&mut self, tick: u64) {
        let joints = self.config.arm.dof();
        for (joint, measured) in self.measured.iter_mut().enumerate() {
            *measured = self.system.joint(joint);
        }
        let mut reference = Reference::REST;
        let Reference { q, qd, qdd } = &mut reference;
        self.path.at(self.system.time(), &mut q[..joints], &mut qd[..joints], &mut qdd[..joints]);
        let found = self.reflexes.watch(&self.measured, &reference.q[..joints]);
        if let (Some(excess), Applied::Command | Applied::Hold) = (found, self.applied) {
            self.stop(tick, StopReason::Reflex(excess.quantity), Some(excess));
            self.close_brakes();
        }
    }

    /// Closes the brakes on the joints at their measured positions.
    fn close_brakes(&mut self) {
        self.brakes.close(self.system.time(), self.measured.iter().map(|&[q, v, _]| [q, v]));
    }

    /// Judges the answers and sets the command source for the next tick; closed brakes stay closed.
    fn judge(&mut self, tick: u64, record: &mut TickRecord) {
        if self.stopped.is_none() {
            self.watch(tick);
        }
        if self.stopped.is_some() {
            record.command = self.manager.slot_mut(self.manager.active()).answer;
            return;
        }
        if self.config.pace == Pace::Lockstep {
            let several = self.manager.len() > 1;
            for slot in 0..self.manager.len() {
                let came = self.manager.slot_mut(slot).answer.is_some();
                self.timeouts.note(slot, tick, came, several);
            }
        }
        self.deadlines.missed += u64::from(self.misses_deadline());
        let settled =
            tick as f64 * self.config.period_ns as f64 * 1e-9 >= DeviationStatistics::START_DURATION;
        let verdict = self.manager.judge(tick, settled, &self.measured);
        let applied = verdict.applied;
        (record.command, record.rejection) = (verdict.answer, verdict.rejection);
        record.differences = self.manager.differences();
        self.applied = applied;
        if let (Applied::Brake, Some(reason)) = (applied, verdict.rejection) {
            let excess = self.manager.gate(self.manager.active()).excess();
            self.stop(tick, StopReason::Rejected(reason), excess);
        }
        match applied {
            Applied::Guided => {}
            Applied::Brake => self.close_brakes(),
            Applied::Command | Applied::Hold => self.command(tick),
        }
    }

    /// Puts the accepted command, or the last accepted one, in force.
    fn command(&mut self, tick: u64) {
        let Some(command) = self.manager.in_force().copied() else { return };
        let joints = self.config.arm.dof();
        let held = self.applied == Applied::Hold;
        self.torque.copy_from_slice(&command.value[..joints]);
        // At the start of the next tick, servos keep the last command that reached them.
        let every = u64::from(self.config.command_every);
        let arrives = self.config.mode != Mode::Servo || (tick + 1).is_multiple_of(every);
        if !held && arrives {
            self.state.applied = command.value;
        }
        if self.config.mode == Mode::Servo {
            if !held && arrives {
                self.system.command_servos(&command.value[..joints]);
            }
            return;
        }
        if self.config.mode == Mode::Driven {
            let period = self.config.period_ns as f64 * 1e-9;
            let (system, manager) = (&self.system, &mut self.manager);
            let now = (0..joints).map(|joint| system.joint(joint));
            let next = (0..joints).map(|joint| {
                if held {
                    let [q, v, _] = system.joint(joint);
                    let next = [q + v * period, v, 0.0];
                    manager.moved_on(joint, next);
                    next
                } else {
                    [command.value[joint], command.velocity[joint], command.acceleration[joint]]
                }
            });
            self.motion.begin(system.time(), period, now);
            self.motion.finish(next);
        }
    }

    /// Passes the record to the recorder. In lockstep no record is lost: the plant waits for space.
    fn keep(&mut self, record: TickRecord) {
        let before = now_ns();
        self.peak_base_force = self.peak_base_force.max(record.peak_base_force);
        if let Some(command) = &record.command {
            self.answers.add(command.status, command.qp_iterations);
        }
        let mut pending = self.queue.push(record);
        self.stages.record(Stage::Record, now_ns() - before);
        while let (Err(record), Pace::Lockstep) = (pending, self.config.pace) {
            std::thread::yield_now();
            pending = self.queue.push(record);
        }
        self.deadlines.unrecorded += u64::from(pending.is_err());
    }
}

/// The inputs and outputs of the laws of each tick: `joints` joints in `state` and at the links, and the tool.
fn readings<'a>(
    state: &'a mut State,
    link: &'a mut Joints,
    tool: &'a mut [f64; 7],
    joints: usize,
    period: f64,
) -> Readings<'a> {
    let State { q, qd, tau, .. } = state;
    Readings {
        period,
        q: &mut q[..joints],
        v: &mut qd[..joints],
        torque: &mut tau[..joints],
        link: &mut link[..joints],
        tool: &mut tool[..3],
    }
}

/// A pose as x y z qx qy qz qw.
fn tool_row(pose: &nalgebra::Isometry3<f64>) -> [f64; 7] {
    let (p, r) = (pose.translation.vector, pose.rotation.coords);
    [p.x, p.y, p.z, r.x, r.y, r.z, r.w]
}
