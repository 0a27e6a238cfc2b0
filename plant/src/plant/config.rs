//! What makes a plant, and what it leaves.

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

/// All that makes a plant.
#[derive(Clone, Debug)]
pub struct PlantConfig {
    /// The arm without its effects: what the deviation is taken against.
    pub arm: Arm,
    /// What the arm has beyond the rigid model.
    pub effects: Arc<Effects>,
    /// Who moves the joints.
    pub mode: Mode,
    /// In mode servo a command in so many ticks reaches the servos, which hold it until the next.
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
    /// Ticks for which a missing command is bridged by the last one.
    pub hold: u32,
    /// How long to wait for a controller to start, and in lockstep for an answer.
    pub patience: Duration,
    /// How long to wait in lockstep for an answer while a standby could take over; absent: `patience`.
    pub answer_patience: Option<Duration>,
    /// Whether the evidence for the cause of every missed deadline is gathered: real time only, some microseconds a tick.
    pub evidence: bool,
    /// The controllers.
    pub controller_set: ControllerSet,
    /// When the arm is stopped for what it does.
    pub reflex: ReflexSpec,
    /// Natural frequency of the feedback that is asked of the controllers, rad/s.
    pub natural_frequency: f64,
}

/// Postures of the planned motion from which inertias are taken: of motors behind transmissions, and for the limits of torque rates.
const POSTURES: u32 = 64;

impl PlantConfig {
    /// The arm with its effects, and the laws that are asked once a tick, for a motion along `path`.
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

    /// The limits beyond which the arm is stopped, for a motion along `path`.
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

/// The laws that are asked once a tick.
#[derive(Debug, Default)]
pub struct TickLaws {
    /// Where the tool is beside where the joints put it.
    pub tool: Vec<Box<dyn SensorLaw>>,
    /// What the sensors make of the truth.
    pub sensors: Vec<Box<dyn SensorLaw>>,
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
    /// The process of a controller ended before it came.
    #[error("no controller to wait for in {}: its process ended before it joined the run", said_slots(.slots))]
    ControllerEnded {
        /// The slots that stay empty.
        slots: Vec<usize>,
    },
}

fn said_slots(slots: &[usize]) -> String {
    let numbers: Vec<String> = slots.iter().map(ToString::to_string).collect();
    format!("slot {}", numbers.join(", "))
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
    /// Commands failed the gate for too long, or the arm was beyond a limit; the rest was played with the brakes closed.
    Braked {
        /// Tick at which the brakes closed.
        tick: u64,
        /// Why the last command did not pass, or which limit the arm did not keep.
        reason: StopReason,
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
