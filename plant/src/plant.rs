//! The loop that plays the machine: publish, take the answer, step, judge, record.
//!
//! The answer to tick k is applied during tick k + 1. In lockstep the plant waits for it; in real time it is due at
//! the schedule's time of tick k + 1 (less the 50 µs in which it is judged), and what comes later is late. During tick 0 no command can have come yet: the
//! joints are guided along the reference.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use crossbeam::queue::ArrayQueue;
use freeplay_arm::{Arm, Workspace, forward_kinematics};
use freeplay_laws::{Effects, LawError, Readings, SensorLaw};
use freeplay_path::JointPath;
use freeplay_shm::{
    Backoff, COMMAND_BUFFER, Command, Greeting, Joints, LinkError, MAX_JOINTS, Mode, Pace, PlantLink,
    Schedule, State, now_ns, sleep_then_spin_until,
};
use thiserror::Error;

use crate::attendance::Attendance;
use crate::{
    Applied, Braking, DeviationStatistics, GateLimits, Hermite, Input, LineUp, LineUpSpec, Motion,
    PlayRecord, Rejection, Sensors, SensorsSpec, Stage, Stages, System, SystemError, TickRecord, Wish,
    Wishes,
};

/// All that makes a plant.
#[derive(Clone, Debug)]
pub struct PlantConfig {
    /// The arm without its effects: what the deviation is taken against.
    pub arm: Arm,
    /// What the arm has beyond the rigid model.
    pub effects: Arc<Effects>,
    /// Who moves the joints.
    pub mode: Mode,
    /// Lockstep or real time.
    pub pace: Pace,
    /// Length of a tick, ns.
    pub period_ns: u64,
    /// Sub-steps of a tick.
    pub substeps: u32,
    /// Length of the run, ticks.
    pub ticks: u64,
    /// The sensors.
    pub sensors: SensorsSpec,
    /// Seed of all noise.
    pub seed: u64,
    /// Ticks for which a missing command is bridged by the last one.
    pub hold: u32,
    /// How long to wait for a controller to start, and in lockstep for an answer.
    pub patience: Duration,
    /// How long to wait in lockstep for an answer while a standby could take over; absent: `patience`.
    pub answer_patience: Option<Duration>,
    /// The controllers.
    pub line_up: LineUpSpec,
}

/// Postures of the planned motion from which the inertias of motors behind transmissions are taken.
const POSTURES: u32 = 64;

impl PlantConfig {
    /// The arm with its effects, and the laws of its sensors, for a motion along `path`.
    ///
    /// # Errors
    /// See [`SystemError`].
    pub fn system(&self, path: &JointPath) -> Result<(System, Vec<Box<dyn SensorLaw>>), SystemError> {
        let body = self.effects.changed(&self.arm)?;
        let mut injection = self.effects.injection();
        let sensors = std::mem::take(&mut injection.sensors);
        let blank = vec![0.0; self.arm.dof()];
        let posture = |number: u32| {
            let [mut q, mut v, mut a] = [blank.clone(), blank.clone(), blank.clone()];
            path.at(path.duration() * f64::from(number) / f64::from(POSTURES), &mut q, &mut v, &mut a);
            q
        };
        let postures: Vec<Vec<f64>> = (0..=POSTURES).map(posture).collect();
        let period = self.period_ns as f64 * 1e-9;
        let mut system = System::with_effects(&body, injection, &postures, period, self.substeps)?;
        let [mut q, mut v, mut a] = [blank.clone(), blank.clone(), blank];
        path.at(0.0, &mut q, &mut v, &mut a);
        system.start(&q, &v);
        Ok((system, sensors))
    }
}

/// Why the plant stopped without finishing.
#[derive(Debug, Error)]
pub enum PlantError {
    /// The arm with play can't be built.
    #[error(transparent)]
    Law(#[from] LawError),
    /// The motion can't be integrated.
    #[error(transparent)]
    System(#[from] SystemError),
    /// Shared memory can't be used.
    #[error(transparent)]
    Link(#[from] LinkError),
    /// The histograms can't be made.
    #[error("latency histograms: {0}")]
    Histogram(#[from] hdrhistogram::CreationError),
    /// The arm is too large for the messages.
    #[error("the arm has {joints} joints; messages hold {MAX_JOINTS}")]
    TooManyJoints {
        /// Joints of the arm.
        joints: usize,
    },
    /// No controller came.
    #[error("no controller came within {patience:?}{}{}", said_missing(.missing), said_refused(.refused))]
    NoController {
        /// The slots that stayed empty, where there are several.
        missing: Vec<usize>,
        /// How long the plant waited.
        patience: Duration,
        /// Who knocked and was refused.
        refused: Vec<String>,
    },
}

fn said_missing(missing: &[usize]) -> String {
    if missing.is_empty() { String::new() } else { format!(" for the slots {missing:?}") }
}

fn said_refused(refused: &[String]) -> String {
    if refused.is_empty() { String::new() } else { format!("; refused: {}", refused.join("; ")) }
}

/// How a run ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Ending {
    /// All ticks were played with the controller in charge.
    Finished,
    /// Commands failed the gate for too long; the rest was played with the brakes closed.
    Braked {
        /// Tick at which the brakes closed.
        tick: u64,
        /// Why the last command did not pass.
        reason: Rejection,
    },
    /// The motion could no longer be integrated.
    Diverged {
        /// Ticks played.
        tick: u64,
    },
    /// Someone asked the run to stop.
    Interrupted {
        /// Ticks played.
        tick: u64,
    },
}

/// Ticks without a command in time.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Deadlines {
    /// Ticks whose answer had not come when it was due.
    pub missed: u64,
    /// Answers that came after they were due.
    pub late: u64,
    /// Ticks at which the plant itself woke up more than a period late.
    pub plant_late: u64,
    /// Records that the queue had no room for.
    pub unrecorded: u64,
}

/// What a run leaves.
#[derive(Clone, Debug)]
pub struct PlantOutcome {
    /// How it ended.
    pub ending: Ending,
    /// Names of the controllers as they said, by slot.
    pub controllers: Vec<String>,
    /// Ticks played.
    pub ticks: u64,
    /// Controllers that knocked and were refused, in words.
    pub refused: Vec<String>,
    /// Why the motion could no longer be integrated, if it could not.
    pub divergence: Option<SystemError>,
}

/// The plant of one run.
pub struct Plant {
    config: PlantConfig,
    system: System,
    path: Arc<JointPath>,
    nominal: Workspace,
    link: PlantLink,
    run: u64,
    line_up: LineUp,
    attendance: Attendance,
    sensor_laws: Vec<Box<dyn SensorLaw>>,
    sensors: Sensors,
    queue: Arc<ArrayQueue<TickRecord>>,
    stages: Stages,
    deviation: DeviationStatistics,
    deadlines: Deadlines,
    applied: Applied,
    motion: Hermite,
    brakes: Braking,
    driven: Vec<bool>,
    torque: Vec<f64>,
    state: State,
    braked: Option<(u64, Rejection)>,
    backoff: Backoff,
    peak_base_force: f64,
    wishes: Wishes,
    spoils_next: bool,
    marks: u32,
}

/// Deceleration of a braking joint whose file names no acceleration limit, rad/s² (m/s²).
const BRAKE_RATE: f64 = 10.0;
/// How long the plant spins before the schedule's time, ns.
const SPIN_NS: u64 = 200_000;
/// Share of the period for which the answer is awaited before the plant steps, in real time.
const ANSWER_WINDOW: u64 = 2;
/// Real time: how long before the next tick the plant judges what it has, ns.
const JUDGING_NS: u64 = 50_000;
/// Every so many ticks the plant looks who else knocks.
const GREETING_TICKS: u64 = 128;
/// Real time: a standby that has missed so many ticks in a row is no longer waited for before the plant steps.
const MISSED_WAITED_FOR: u32 = 3;
/// How long lockstep waits before it asks whether the peer still lives, ns.
const LIFE_CHECK_NS: u64 = 20_000_000;

impl Plant {
    /// A plant at the start of `path`, with its end of the run open and nobody greeted yet.
    ///
    /// # Errors
    /// See [`PlantError`].
    pub fn new(
        config: PlantConfig,
        path: Arc<JointPath>,
        link: PlantLink,
        run: u64,
        queue: Arc<ArrayQueue<TickRecord>>,
    ) -> Result<Self, PlantError> {
        let joints = config.arm.dof();
        if joints > MAX_JOINTS {
            return Err(PlantError::TooManyJoints { joints });
        }
        let period = config.period_ns as f64 * 1e-9;
        let (system, sensor_laws) = config.system(&path)?;
        let rates = config.arm.joints().iter().map(|joint| joint.limits.acceleration);
        Ok(Self {
            nominal: Workspace::new(&config.arm),
            line_up: LineUp::new(
                &config.line_up,
                GateLimits::of(&config.arm, config.mode, period, config.hold),
                run,
                joints,
                period,
            ),
            attendance: Attendance::new(config.line_up.controllers),
            sensor_laws,
            sensors: Sensors::new(&config.sensors, joints, config.seed),
            stages: Stages::new()?,
            deviation: DeviationStatistics::new(DeviationStatistics::START),
            deadlines: Deadlines::default(),
            applied: Applied::Guided,
            motion: Hermite::new(joints),
            brakes: Braking::new(
                rates.map(|rate| if rate.is_finite() { rate } else { BRAKE_RATE }).collect(),
            ),
            driven: vec![true; joints],
            torque: vec![0.0; joints],
            state: State::new(run, joints),
            braked: None,
            backoff: Backoff::for_this_machine(),
            peak_base_force: 0.0,
            wishes: Wishes::default(),
            spoils_next: false,
            marks: 0,
            config,
            system,
            path,
            link,
            run,
            queue,
        })
    }

    /// Where to ask something of the plant while it runs.
    pub fn wishes(&self) -> Wishes {
        self.wishes.clone()
    }

    /// Waits for the controllers, then plays the run; `stop` ends it early.
    ///
    /// # Errors
    /// [`PlantError::NoController`] if none came; [`PlantError::System`] if the motion could not be integrated.
    pub fn run(&mut self, stop: &AtomicBool) -> Result<PlantOutcome, PlantError> {
        let mut refused = Vec::new();
        let Some(controllers) = self.await_controllers(stop, &mut refused)? else {
            return Ok(PlantOutcome {
                ending: Ending::Interrupted { tick: 0 },
                controllers: Vec::new(),
                ticks: 0,
                refused,
                divergence: None,
            });
        };
        let (mut played, mut divergence) = (0, None);
        match self.play(stop, &mut refused, &mut played) {
            Ok(()) => {}
            Err(PlantError::System(error)) => divergence = Some(error),
            Err(error) => return Err(error),
        }
        let ending = match self.braked {
            _ if divergence.is_some() => Ending::Diverged { tick: played },
            _ if played < self.config.ticks => Ending::Interrupted { tick: played },
            Some((tick, reason)) => Ending::Braked { tick, reason },
            None => Ending::Finished,
        };
        Ok(PlantOutcome { ending, controllers, ticks: played, refused, divergence })
    }

    /// Plays tick after tick; `played` counts them.
    fn play(
        &mut self,
        stop: &AtomicBool,
        refused: &mut Vec<String>,
        played: &mut u64,
    ) -> Result<(), PlantError> {
        // Tick 0 waits for its answer at either pace: the controller may still be planning. The schedule starts then.
        let pace = std::mem::replace(&mut self.config.pace, Pace::Lockstep);
        self.tick(0, &Schedule { start_ns: now_ns(), period_ns: self.config.period_ns })?;
        self.config.pace = pace;
        let schedule = Schedule { start_ns: now_ns(), period_ns: self.config.period_ns };
        *played = 1;
        while *played < self.config.ticks && !stop.load(Ordering::Relaxed) {
            self.tick(*played, &schedule)?;
            *played += 1;
            if (*played).is_multiple_of(GREETING_TICKS) {
                self.note_greetings(refused)?;
            }
        }
        Ok(())
    }

    /// Greets until every slot has its controller; their names.
    fn await_controllers(
        &mut self,
        stop: &AtomicBool,
        refused: &mut Vec<String>,
    ) -> Result<Option<Vec<String>>, PlantError> {
        let deadline = now_ns() + self.config.patience.as_nanos() as u64;
        let mut names: Vec<Option<String>> = vec![None; self.line_up.len()];
        while !stop.load(Ordering::Relaxed) {
            for greeting in self.link.greet()? {
                match greeting {
                    Greeting::Accepted { slot, name, .. } => names[slot as usize] = Some(name),
                    Greeting::Refused { name, verdict, .. } => refused.push(format!("{name}: {verdict:?}")),
                }
            }
            if names.iter().all(Option::is_some) {
                return Ok(Some(names.into_iter().flatten().collect()));
            }
            if now_ns() > deadline {
                let several = names.len() > 1;
                return Err(PlantError::NoController {
                    missing: (0..names.len()).filter(|&slot| several && names[slot].is_none()).collect(),
                    patience: self.config.patience,
                    refused: std::mem::take(refused),
                });
            }
            std::thread::sleep(Duration::from_millis(1));
        }
        Ok(None)
    }

    fn note_greetings(&mut self, refused: &mut Vec<String>) -> Result<(), PlantError> {
        for greeting in self.link.greet()? {
            match greeting {
                Greeting::Refused { name, verdict, .. } => refused.push(format!("{name}: {verdict:?}")),
                // A process in the place of one that has ended. The only controller of a run is not replaced.
                Greeting::Accepted { slot, .. } if self.line_up.len() > 1 => {
                    self.line_up.renew(slot as usize);
                    self.attendance.renew(slot as usize);
                }
                Greeting::Accepted { .. } => {}
            }
        }
        Ok(())
    }

    fn tick(&mut self, tick: u64, schedule: &Schedule) -> Result<(), PlantError> {
        let scheduled = self.wake(tick, schedule);
        self.hear_wishes(tick);
        let mut record = self.observe(tick, scheduled);
        self.state.published_ns = now_ns();
        self.link.publish(&self.state)?;
        record.state = self.state;
        self.line_up.begin_tick();
        if self.config.pace == Pace::RealTime {
            // From publication, so that a plant that was held up waits for its answers while it catches up.
            let window = self.state.published_ns + self.config.period_ns / ANSWER_WINDOW;
            self.await_answers(tick, scheduled, window)?;
        }
        self.step()?;
        let is_complete = match self.config.pace {
            Pace::RealTime => self.line_up.all_have_answered(),
            Pace::Lockstep => self.all_in(tick),
        };
        if !is_complete {
            // With one controller this is rare. A standby that is slow or gone makes it the rule: then the plant wakes in time.
            let spin = if self.line_up.len() > 1 { SPIN_NS } else { 0 };
            let deadline = match self.config.pace {
                Pace::RealTime => sleep_then_spin_until(schedule.due_ns(tick + 1) - JUDGING_NS, spin),
                Pace::Lockstep => now_ns() + self.answer_patience(tick).as_nanos() as u64,
            };
            self.await_answers(tick, scheduled, deadline)?;
        }
        self.judge(tick, &mut record);
        self.keep(record);
        Ok(())
    }

    /// How long lockstep waits for the answer to `tick`; before the first, controllers still plan.
    fn answer_patience(&self, tick: u64) -> Duration {
        let of_several = self.config.answer_patience.filter(|_| tick > 0 && self.line_up.len() > 1);
        of_several.unwrap_or(self.config.patience)
    }

    /// Waits for the tick's time; returns the time that latencies of this tick are taken against, ns.
    fn wake(&mut self, tick: u64, schedule: &Schedule) -> u64 {
        match self.config.pace {
            Pace::Lockstep => now_ns(),
            Pace::RealTime => {
                let due = schedule.due_ns(tick);
                let awake = sleep_then_spin_until(due, SPIN_NS);
                self.stages.record(Stage::WakeUp, awake.saturating_sub(due));
                self.deadlines.plant_late += u64::from(awake.saturating_sub(due) > self.config.period_ns);
                due
            }
        }
    }

    fn hear_wishes(&mut self, tick: u64) {
        while let Some(wish) = self.wishes.next() {
            match wish {
                Wish::Swap { to } => self.line_up.ask(tick, to),
                Wish::Spoil => self.spoils_next = true,
                Wish::Mark => self.marks += 1,
            }
        }
    }

    /// Reads the sensors into the State of `tick`, and the truth into its record.
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
        // The answer is applied from the next tick on: a torque from its start, a position at its end.
        let ahead = match self.config.mode {
            Mode::Torque => period,
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
        let pose = self.system.tool();
        let deviation = pose.translation.vector - desired.translation.vector;
        self.deviation.add(time, &deviation);
        let tool = tool_row(&pose);
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
            marks: self.marks,
        }
    }

    /// Puts what the sensors make of the truth into the State, and the flags.
    fn sense(&mut self, tick: u64, mut tool: [f64; 7], link: &mut Joints) {
        let joints = self.config.arm.dof();
        let State { q, qd, tau, .. } = &mut self.state;
        let mut readings = Readings {
            period: self.config.period_ns as f64 * 1e-9,
            q: &mut q[..joints],
            v: &mut qd[..joints],
            torque: &mut tau[..joints],
            link: &mut link[..joints],
            tool: &mut tool[..3],
        };
        self.sensor_laws.iter_mut().for_each(|law| law.read(&mut readings));
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
        let charge = [self.line_up.in_charge(), self.line_up.next_in_charge(tick)];
        self.state.flags = flags | State::charge_flags(charge[0] as u32, charge[1] as u32);
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

    /// Takes answers until all that are waited for are there, the `deadline` has passed or those that lack are gone.
    fn await_answers(&mut self, tick: u64, scheduled: u64, deadline: u64) -> Result<(), PlantError> {
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
                self.deadlines.late += u64::from(in_charge && self.braked.is_none());
                continue;
            }
            if self.attendance.is_away(slot, tick) {
                continue;
            }
            if in_charge {
                self.clock(&command, scheduled, received);
                if std::mem::take(&mut self.spoils_next) {
                    command.value[0] = f64::NAN;
                }
            }
            self.line_up.slot_mut(slot).answer = Some(command);
            break;
        }
        Ok(())
    }

    /// Whether every answer to `tick` that is waited for is there.
    fn all_in(&mut self, tick: u64) -> bool {
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

    /// Counts the latencies that a command tells of.
    fn clock(&mut self, command: &Command, scheduled: u64, received: u64) {
        let published = self.state.published_ns;
        let took = |from: u64, to: u64| to.saturating_sub(from);
        self.stages.record(Stage::StateTransport, took(published, command.received_ns));
        self.stages.record(Stage::Compute, took(command.received_ns, command.sent_ns));
        self.stages.record(Stage::CommandTransport, took(command.sent_ns, received));
        self.stages.record(Stage::RoundTrip, took(scheduled, received));
        if command.predict_ns > 0 {
            self.stages.record(Stage::Predict, command.predict_ns);
        }
        if command.qp_ns > 0 {
            self.stages.record(Stage::Qp, command.qp_ns);
        }
    }

    /// Integrates the tick under what is in force.
    fn step(&mut self) -> Result<(), PlantError> {
        let before = now_ns();
        let motion: &dyn Motion = match self.applied {
            Applied::Guided => &*self.path,
            Applied::Brake => &self.brakes,
            Applied::Command | Applied::Hold => &self.motion,
        };
        let by_motion = match self.applied {
            Applied::Guided | Applied::Brake => true,
            Applied::Command | Applied::Hold => self.config.mode == Mode::Driven,
        };
        self.driven.fill(by_motion);
        self.system.tick(&Input { torque: &self.torque, driven: &self.driven, motion })?;
        self.stages.record(Stage::PlantStep, now_ns() - before);
        Ok(())
    }

    /// Judges the answers and sets what is in force in the next tick; closed brakes stay closed.
    fn judge(&mut self, tick: u64, record: &mut TickRecord) {
        if self.braked.is_some() {
            record.command = self.line_up.slot_mut(self.line_up.in_charge()).answer;
            return;
        }
        if self.config.pace == Pace::Lockstep {
            let several = self.line_up.len() > 1;
            for slot in 0..self.line_up.len() {
                let came = self.line_up.slot_mut(slot).answer.is_some();
                self.attendance.note(slot, tick, came, several);
            }
        }
        self.deadlines.missed += u64::from(self.line_up.slot_mut(self.line_up.in_charge()).answer.is_none());
        let settled = tick as f64 * self.config.period_ns as f64 * 1e-9 >= DeviationStatistics::START;
        let verdict = self.line_up.judge(tick, settled);
        let applied = verdict.applied;
        (record.command, record.rejection) = (verdict.answer, verdict.rejection);
        self.applied = applied;
        if let (Applied::Brake, Some(reason)) = (applied, verdict.rejection) {
            self.braked = Some((tick, reason));
        }
        let joints = self.config.arm.dof();
        match applied {
            Applied::Guided => {}
            Applied::Brake => {
                let motors = (0..joints).map(|joint| self.system.joint(joint));
                self.brakes.close(self.system.time(), motors.map(|[q, v, _]| [q, v]));
            }
            Applied::Command | Applied::Hold => self.command(),
        }
    }

    /// Puts the command that passed, or the last one that did, in force.
    fn command(&mut self) {
        let Some(command) = self.line_up.in_force().copied() else { return };
        let joints = self.config.arm.dof();
        let held = self.applied == Applied::Hold;
        self.torque.copy_from_slice(&command.value[..joints]);
        if !held {
            self.state.applied = command.value;
        }
        if self.config.mode == Mode::Driven {
            let period = self.config.period_ns as f64 * 1e-9;
            let (system, line_up) = (&self.system, &mut self.line_up);
            let now = (0..joints).map(|joint| system.joint(joint));
            let next = (0..joints).map(|joint| {
                if held {
                    let [q, v, _] = system.joint(joint);
                    let next = [q + v * period, v, 0.0];
                    line_up.moved_on(joint, next);
                    next
                } else {
                    [command.value[joint], command.velocity[joint], command.acceleration[joint]]
                }
            });
            self.motion.begin(system.time(), period, now);
            self.motion.finish(next);
        }
    }

    /// Hands the record to who keeps it. In lockstep nothing is lost: the plant waits for room.
    fn keep(&mut self, record: TickRecord) {
        let before = now_ns();
        self.peak_base_force = self.peak_base_force.max(record.peak_base_force);
        let mut pending = self.queue.push(record);
        self.stages.record(Stage::Record, now_ns() - before);
        while let (Err(record), Pace::Lockstep) = (pending, self.config.pace) {
            std::thread::yield_now();
            pending = self.queue.push(record);
        }
        self.deadlines.unrecorded += u64::from(pending.is_err());
    }

    /// Number of joints of the arm.
    pub fn joints(&self) -> usize {
        self.config.arm.dof()
    }

    /// Latencies of all stages.
    pub fn stages(&self) -> &Stages {
        &self.stages
    }

    /// The tool's deviation.
    pub fn deviation(&self) -> &DeviationStatistics {
        &self.deviation
    }

    /// Ticks without a command in time.
    pub fn deadlines(&self) -> Deadlines {
        self.deadlines
    }

    /// The controllers with their gates and their counts.
    pub fn line_up(&self) -> &LineUp {
        &self.line_up
    }

    /// The arm with play as the run left it.
    pub fn system(&self) -> &System {
        &self.system
    }

    /// The greatest force of the base on the first moving body, N.
    pub fn peak_base_force(&self) -> f64 {
        self.peak_base_force
    }
}

/// A pose as x y z qx qy qz qw.
fn tool_row(pose: &nalgebra::Isometry3<f64>) -> [f64; 7] {
    let (p, r) = (pose.translation.vector, pose.rotation.coords);
    [p.x, p.y, p.z, r.x, r.y, r.z, r.w]
}
