//! The loop of the simulated machine: publish, take the answer, step, judge, record.
//!
//! The answer to tick k acts during tick k + 1. In lockstep the plant waits for it. In real time it is due at the scheduled time of
//! tick k + 1 (less the 50 µs for judging); a later answer is late. During tick 0 no command can have arrived yet: the plant guides the
//! joints along the reference.

mod answers;
mod config;
mod start;
mod tick;

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use crossbeam::queue::ArrayQueue;
use freeplay_arm::Workspace;
use freeplay_path::JointPath;
use freeplay_shm::{Backoff, Foreign, Pace, PlantLink, Schedule, State, now_ns};

pub use config::{Deadlines, Ending, PlantConfig, PlantError, PlantOutcome, TickLaws};

use crate::cause::TickLatencies;
use crate::misses::Misses;
use crate::response_timeouts::ResponseTimeouts;
use crate::round_trips::RoundTrips;
use crate::{
    AnswerCounts, Applied, Braking, ControllerManager, DeviationStatistics, Hermite, JointUse,
    OperatorRequests, ReflexLimits, Reflexes, Sensors, Stages, Stop, System, TickRecord,
};

/// The plant of one run.
pub struct Plant {
    config: PlantConfig,
    system: System,
    path: Arc<JointPath>,
    nominal: Workspace,
    link: PlantLink,
    run: u64,
    manager: ControllerManager,
    timeouts: ResponseTimeouts,
    laws: TickLaws,
    sensors: Sensors,
    queue: Arc<ArrayQueue<TickRecord>>,
    stages: Stages,
    deviation: DeviationStatistics,
    joint_use: JointUse,
    answers: AnswerCounts,
    deadlines: Deadlines,
    applied: Applied,
    motion: Hermite,
    brakes: Braking,
    driven: Vec<bool>,
    torque: Vec<f64>,
    state: State,
    reflexes: Reflexes,
    /// State of each joint as its drive's own encoder measures it: \[q, v, a\].
    measured: Vec<[f64; 3]>,
    stopped: Option<Stop>,
    backoff: Backoff,
    peak_base_force: f64,
    requests: OperatorRequests,
    spoils_next: bool,
    marks: u32,
    /// The controllers' processes, by slot.
    processes: Vec<Option<u32>>,
    /// Real time, tick 0: controllers may still be planning, and no latency counts.
    is_planning: bool,
    /// Real time: the ticks that have had their answer.
    round_trips: Option<RoundTrips>,
    /// Times of publication of the latest states, ns.
    published: [u64; PUBLISHED],
    /// The latencies of this tick that the plant itself measures.
    links: TickLatencies,
    misses: Option<Misses>,
}

/// States whose time of publication the plant remembers, for late answers.
const PUBLISHED: usize = 256;

/// Ticks between two checks for new controllers that want to connect.
const GREETING_TICKS: u64 = 128;

impl Plant {
    /// The handle for requests to the running plant.
    pub fn requests(&self) -> OperatorRequests {
        self.requests.clone()
    }

    /// Waits for the controllers, then performs the run; `stop` ends it early.
    ///
    /// # Errors
    /// [`PlantError::NoController`] if none connected; [`PlantError::System`] if the integration failed.
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
        let ending = match self.stopped {
            _ if divergence.is_some() => Ending::Diverged { tick: played },
            _ if played < self.config.ticks => Ending::Interrupted { tick: played },
            Some(Stop { tick, reason, .. }) => Ending::Braked { tick, reason },
            None => Ending::Finished,
        };
        Ok(PlantOutcome { ending, controllers, ticks: played, refused, divergence })
    }

    /// Performs tick after tick; `played` counts them.
    fn play(
        &mut self,
        stop: &AtomicBool,
        refused: &mut Vec<String>,
        played: &mut u64,
    ) -> Result<(), PlantError> {
        // Tick 0 waits for its answer at either pace, since the controller may still be planning. The schedule starts afterwards.
        let pace = std::mem::replace(&mut self.config.pace, Pace::Lockstep);
        self.is_planning = pace == Pace::RealTime;
        self.tick(0, &Schedule { start_ns: now_ns(), period_ns: self.config.period_ns })?;
        (self.config.pace, self.is_planning) = (pace, false);
        let schedule = Schedule { start_ns: now_ns(), period_ns: self.config.period_ns };
        if pace == Pace::RealTime {
            self.round_trips = Some(RoundTrips::new(schedule, 1));
            self.misses = self.config.evidence.then(|| Misses::new(self.config.period_ns, &self.processes));
        }
        *played = 1;
        while *played < self.config.ticks && !stop.load(Ordering::Relaxed) {
            self.tick(*played, &schedule)?;
            *played += 1;
            if (*played).is_multiple_of(GREETING_TICKS) {
                self.note_greetings(refused)?;
            }
        }
        self.count_unanswered(*played);
        Ok(())
    }

    /// The missed deadlines with their causes, if the plant gathered evidence.
    pub fn misses(&self) -> Option<&Misses> {
        self.misses.as_ref()
    }

    /// Commands for `slot` from a process that does not own the slot.
    pub fn foreign(&self, slot: usize) -> Foreign {
        self.link.foreign(slot)
    }

    /// True if a living controller owns `slot`.
    pub fn has_controller(&self, slot: usize) -> bool {
        self.link.has_controller(slot)
    }

    /// The time and the reason of the closing of the brakes, if they closed.
    pub fn stopped(&self) -> Option<&Stop> {
        self.stopped.as_ref()
    }

    /// The limits beyond which the brakes stop the arm.
    pub fn reflex_limits(&self) -> &ReflexLimits {
        self.reflexes.limits()
    }

    /// The arm without its effects.
    pub fn arm(&self) -> &freeplay_arm::Arm {
        &self.config.arm
    }

    /// Number of joints of the arm.
    pub fn joints(&self) -> usize {
        self.config.arm.dof()
    }

    /// Latencies of all stages.
    pub fn stages(&self) -> &Stages {
        &self.stages
    }

    /// Statistics of the tool's deviation from the path.
    pub fn tool_deviation(&self) -> &DeviationStatistics {
        &self.deviation
    }

    /// Use of the drives.
    pub fn joint_use(&self) -> &JointUse {
        &self.joint_use
    }

    /// Counts of the ways in which the active controllers arrived at their answers.
    pub fn answers(&self) -> AnswerCounts {
        self.answers
    }

    /// Counts of ticks without a command in time.
    pub fn missed_deadlines(&self) -> Deadlines {
        self.deadlines
    }

    /// The controllers with their gates and their counts.
    pub fn manager(&self) -> &ControllerManager {
        &self.manager
    }

    /// The arm with play at the end of the run.
    pub fn system(&self) -> &System {
        &self.system
    }

    /// The greatest force of the base on the first moving body, N.
    pub fn peak_base_force(&self) -> f64 {
        self.peak_base_force
    }
}
