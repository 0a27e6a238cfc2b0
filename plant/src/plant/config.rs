//! Configuration and outcome of a plant.

use std::sync::Arc;
use std::time::Duration;

use freeplay_arm::Arm;
use freeplay_laws::{Effects, LawError, SensorLaw};
use freeplay_path::JointPath;
use freeplay_shm::{LinkError, MAX_JOINTS, Mode, Pace};
use thiserror::Error;

use crate::damping::check_damping;
use crate::rotor::with_rotors;
use crate::{ControllerSet, ReflexLimits, ReflexSpec, SensorsSpec, StopReason, System, SystemError};

/// The configuration of a plant.
#[derive(Clone, Debug)]
pub struct PlantConfig {
    /// The arm without its effects: the reference for the deviation.
    pub arm: Arm,
    /// Effects beyond the rigid model.
    pub effects: Arc<Effects>,
    /// Source of the joints' motion.
    pub mode: Mode,
    /// In mode servo one command in so many ticks reaches the servos, which hold it until the next.
    pub command_every: u32,
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
    /// Ticks for which the last command replaces a missing one.
    pub hold: u32,
    /// Longest wait for a controller to start, and in lockstep for an answer.
    pub patience: Duration,
    /// Longest wait in lockstep for an answer while a standby could take over; absent: `patience`.
    pub answer_patience: Option<Duration>,
    /// Gathers evidence for the cause of every missed deadline: real time only, some microseconds a tick.
    pub evidence: bool,
    /// The controllers.
    pub controller_set: ControllerSet,
    /// Limits beyond which the brakes stop the arm.
    pub reflex: ReflexSpec,
    /// Natural frequency of the controllers' feedback, rad/s.
    pub natural_frequency: f64,
}

/// Postures of the planned motion for inertias: those of motors behind transmissions, and those in the limits of torque rates.
const POSTURES: u32 = 64;

impl PlantConfig {
    /// The arm with its effects, and the laws of each tick, for a motion along `path`.
    ///
    /// # Errors
    /// See [`SystemError`].
    pub fn system(&self, path: &JointPath) -> Result<(System, TickLaws), SystemError> {
        let body = self.effects.changed(&self.arm)?;
        let mut injection = self.effects.injection();
        let [tool, sensors] = [&mut injection.tool, &mut injection.sensors].map(std::mem::take);
        let postures = self.postures(path);
        let rotors = injection.rotors.clone();
        let mut system = System::with_effects(&body, injection, &postures, self.period(), self.substeps)?;
        let blank = vec![0.0; self.arm.dof()];
        if self.mode != Mode::Driven {
            let damped = if self.mode == Mode::Servo { system.close_servos(&body)? } else { body };
            let step = self.period() / f64::from(self.substeps);
            check_damping(&damped, &rotors, &postures, step, self.substeps)?;
        }
        let [mut q, mut v, mut a] = [blank.clone(), blank.clone(), blank];
        path.at(0.0, &mut q, &mut v, &mut a);
        system.start(&q, &v);
        Ok((system, TickLaws { tool, sensors }))
    }

    /// The limits beyond which the brakes stop the arm, for a motion along `path`.
    ///
    /// # Errors
    /// See [`SystemError`].
    pub fn reflex_limits(&self, path: &JointPath) -> Result<ReflexLimits, SystemError> {
        let body = with_rotors(&self.effects.changed(&self.arm)?, &self.effects.injection().rotors)?;
        let (period, postures) = (self.period(), self.postures(path));
        let mut limits = ReflexLimits::of(&body, &self.reflex, self.natural_frequency, period, &postures);
        limits.deviation += self.effects.clearances.iter().map(|(_, play)| play.clearance).sum::<f64>();
        Ok(limits)
    }

    /// Length of a tick, s.
    fn period(&self) -> f64 {
        self.period_ns as f64 * 1e-9
    }

    /// Postures along `path`.
    fn postures(&self, path: &JointPath) -> Vec<Vec<f64>> {
        let posture = |number: u32| {
            let blank = vec![0.0; self.arm.dof()];
            let [mut q, mut v, mut a] = [blank.clone(), blank.clone(), blank];
            path.at(path.duration() * f64::from(number) / f64::from(POSTURES), &mut q, &mut v, &mut a);
            q
        };
        (0..=POSTURES).map(posture).collect()
    }
}

/// The laws that the plant calls once a tick.
#[derive(Debug, Default)]
pub struct TickLaws {
    /// Displacements of the tool from its position by the joints.
    pub tool: Vec<Box<dyn SensorLaw>>,
    /// Laws of the sensors, which turn the true state into measurements.
    pub sensors: Vec<Box<dyn SensorLaw>>,
}

/// Reasons for which the plant stopped without finishing.
#[derive(Debug, Error)]
pub enum PlantError {
    /// The arm with play is impossible.
    #[error(transparent)]
    Law(#[from] LawError),
    /// The motion can't be integrated.
    #[error(transparent)]
    System(#[from] SystemError),
    /// Shared memory can't be used.
    #[error(transparent)]
    Link(#[from] LinkError),
    /// The histograms can't be created.
    #[error("latency histograms: {0}")]
    Histogram(#[from] hdrhistogram::CreationError),
    /// The arm is too large for the messages.
    #[error("the arm has {joints} joints; messages hold {MAX_JOINTS}")]
    TooManyJoints {
        /// Joints of the arm.
        joints: usize,
    },
    /// No controller connected.
    #[error("no controller came within {patience:?}{}{}", said_missing(.missing), said_refused(.refused))]
    NoController {
        /// The slots that stayed empty, where there are several.
        missing: Vec<usize>,
        /// The time that the plant waited.
        patience: Duration,
        /// Controllers that tried to connect and were refused.
        refused: Vec<String>,
    },
    /// The process of a controller ended before the controller connected.
    #[error("no controller to wait for in {}: its process ended before it joined the run", slot_list(.slots))]
    ControllerEnded {
        /// The slots that stay empty.
        slots: Vec<usize>,
    },
}

fn slot_list(slots: &[usize]) -> String {
    let numbers: Vec<String> = slots.iter().map(ToString::to_string).collect();
    format!("slot {}", numbers.join(", "))
}

fn said_missing(missing: &[usize]) -> String {
    if missing.is_empty() { String::new() } else { format!(" for the slots {missing:?}") }
}

fn said_refused(refused: &[String]) -> String {
    if refused.is_empty() { String::new() } else { format!("; refused: {}", refused.join("; ")) }
}

/// The ending of a run.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Ending {
    /// All ticks ran with a controller active.
    Finished,
    /// Commands failed the gate for too long, or the arm was beyond a limit; the rest of the run had the brakes closed.
    Braked {
        /// Tick at which the brakes closed.
        tick: u64,
        /// The rejection of the last command, or the limit that the arm violated.
        reason: StopReason,
    },
    /// The motion could no longer be integrated.
    Diverged {
        /// Completed ticks.
        tick: u64,
    },
    /// A user stopped the run.
    Interrupted {
        /// Completed ticks.
        tick: u64,
    },
}

/// Ticks without a command in time.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Deadlines {
    /// Ticks whose answer had not arrived by its deadline.
    pub missed: u64,
    /// Answers that arrived after their deadline.
    pub late: u64,
    /// Ticks at which the plant itself woke up more than a period late.
    pub plant_late: u64,
    /// Records that did not fit into the queue.
    pub unrecorded: u64,
}

/// The outcome of a run.
#[derive(Clone, Debug)]
pub struct PlantOutcome {
    /// The ending of the run.
    pub ending: Ending,
    /// Names that the controllers gave, by slot.
    pub controllers: Vec<String>,
    /// Completed ticks.
    pub ticks: u64,
    /// Refused controllers, in words.
    pub refused: Vec<String>,
    /// The error of the integration, if it failed.
    pub divergence: Option<SystemError>,
}
