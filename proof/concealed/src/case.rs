//! A case: from the request to data sheet, recordings and truth.

use freeplay_arm::Arm;
use freeplay_model::{ArmFile, ModelError, to_toml};
use rand_chacha::ChaCha8Rng;
use thiserror::Error;

use crate::arms::{Load, Machine};
use crate::calibrate::{Floor, floor};
use crate::data_sheet_deviations::DataSheetDeviations;
use crate::distinct::{can_be_distinct, equivalents};
use crate::kinds::{CATALOGUE, Seat, seats};
use crate::machine::{Plan, PlanError, Trace};
use crate::motion::{Family, Motion};
use crate::physics::Effect;
use crate::random::{pick, stream, uniform};
use crate::sensors::{Chain, Noise, Samples};
use crate::servo::Servo;
use crate::sizing::{Found, Sizing};
use crate::truth::{SCHEMA, Truth, TruthEffect, weak};

/// Attempts with other places, motions and sizes if an effect cannot reach the wanted strength.
const ATTEMPTS: u64 = 6;

/// Strength of an effect, by its signal-to-floor ratio.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Severity {
    /// 1.5 to 2.5.
    Slight,
    /// About 4.
    Clear,
    /// About 10.
    Strong,
}

impl Severity {
    /// Every severity.
    pub const ALL: [Severity; 3] = [Severity::Slight, Severity::Clear, Severity::Strong];

    /// `slight`, `clear`, `strong`.
    pub fn name(self) -> &'static str {
        ["slight", "clear", "strong"][self as usize]
    }

    /// A ratio of this severity, at random.
    pub(crate) fn target(self, rng: &mut ChaCha8Rng) -> f64 {
        match self {
            Severity::Slight => uniform(rng, 1.6, 2.4),
            Severity::Clear => uniform(rng, 3.6, 4.6),
            Severity::Strong => uniform(rng, 9.0, 11.0),
        }
    }
}

/// One requested effect.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Demand {
    /// Its kind, one of [`CATALOGUE`] or [`crate::OUTSIDE`].
    pub kind: String,
    /// Its joint; `None` for any possible one.
    pub joint: Option<usize>,
    /// Its strength.
    pub severity: Severity,
}

/// Request for a case.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Case {
    /// The machine.
    pub machine: Machine,
    /// The effects; none for a negative control.
    pub effects: Vec<Demand>,
    /// Family of the motion; `None` for any.
    pub family: Option<Family>,
    /// Quality of the sensors.
    pub noise: Noise,
    /// Marks a negative control: machine, joint and motion are chosen as for the effects, which are then left out. So a control differs from the corresponding
    /// cases in the effects alone.
    pub hollow: bool,
    /// Seed of all random draws.
    pub seed: u64,
}

/// The files of a case.
#[derive(Clone, Debug)]
pub struct Made {
    /// The data sheet: a TOML arm file without effects.
    pub model: String,
    /// The recording.
    pub recording: Samples,
    /// The same machine in another motion.
    pub second: Samples,
    /// The concealed effects.
    pub truth: Truth,
}

/// Reason why a case can't be made.
#[derive(Debug, Error)]
pub enum GenerateError {
    /// The data sheet can't be read.
    #[error("the data sheet can't be read: {0}")]
    Model(#[from] ModelError),
    /// The machine can't be built or run.
    #[error("{0}")]
    Plan(#[from] PlanError),
    /// No place for an effect in this machine.
    #[error("{kind} has no place in {machine:?}{}; ask for another machine, kind or joint", joint.map_or(String::new(), |j| format!(" at joint number {j} (from 0)")))]
    NoPlace {
        /// The kind.
        kind: String,
        /// The machine.
        machine: Machine,
        /// The requested joint.
        joint: Option<usize>,
    },
    /// The recording could not distinguish the effect from a simpler one.
    #[error(
        "the motions of {machine:?} never show the distinctive feature of {kind}; ask for another motion or machine"
    )]
    Riddle {
        /// The kind.
        kind: String,
        /// The machine.
        machine: Machine,
    },
    /// The effect can't reach the requested strength.
    #[error(
        "{kind} on {machine:?} reaches a signal-to-floor ratio of {reached:.2}, not {wanted:.2}; ask for another severity, motion or machine"
    )]
    TooWeak {
        /// The kind.
        kind: String,
        /// The machine.
        machine: Machine,
        /// The best ratio of all attempts.
        reached: f64,
        /// The requested ratio.
        wanted: f64,
    },
}

/// Data shared by all runs of a case.
pub(crate) struct Bench {
    pub machine: Machine,
    pub sheet: Arm,
    pub load: Load,
    pub deviations: DataSheetDeviations,
    pub chain: Chain,
    pub servo: Servo,
    pub duration: f64,
    pub motion: Motion,
    pub families: [Family; 2],
}

/// Makes the recordings of `case`. The same case gives the same numbers, bit by bit.
///
/// # Errors
/// [`GenerateError`]: see its variants.
pub fn generate(case: &Case) -> Result<Made, GenerateError> {
    let mut failure = None;
    for attempt in 0..ATTEMPTS {
        let bench = Bench::new(case, attempt)?;
        match bench.make(case, attempt) {
            Ok(made) => return Ok(made),
            Err(
                error @ (GenerateError::TooWeak { .. }
                | GenerateError::Riddle { .. }
                | GenerateError::Plan(_)),
            ) => {
                failure = Some(error);
            }
            Err(error) => return Err(error),
        }
    }
    Err(failure.unwrap_or(GenerateError::NoPlace { kind: String::new(), machine: case.machine, joint: None }))
}

impl Bench {
    /// Draws everything that precedes the effects, so that none of it depends on them.
    fn new(case: &Case, attempt: u64) -> Result<Self, GenerateError> {
        let mut rng = stream(case.seed, "bench");
        let (sheet, load) = case.machine.loaded(case.machine.capacity() * uniform(&mut rng, 0.3, 1.0))?;
        let deviations = DataSheetDeviations::draw(sheet.dof(), &mut rng);
        let chain = chain(&sheet, case.noise, &mut rng);
        let longest = if chain.rate > 400.0 { 20.0 } else { 40.0 };
        let duration = if uniform(&mut rng, 0.0, 1.0) < 0.7 {
            uniform(&mut rng, 12.0, 20.0)
        } else {
            uniform(&mut rng, 10.0, longest)
        };
        let servo = Servo {
            bandwidth: uniform(&mut rng, 25.0, 45.0),
            integral: uniform(&mut rng, 1.0, 4.0),
            creep: uniform(&mut rng, 0.005, 0.02),
            resolution: chain.encoder_step.clone(),
        };
        let mut rng = stream(case.seed, &format!("motion {attempt}"));
        let family = case.family.unwrap_or_else(|| pick(&mut rng, &Family::ALL));
        let second = pick(&mut rng, &Family::ALL);
        let motion = Motion::draw(case.machine, &sheet, family, duration, &mut rng);
        let families = [family, second];
        Ok(Self { machine: case.machine, sheet, load, deviations, chain, servo, duration, motion, families })
    }

    fn make(&self, case: &Case, attempt: u64) -> Result<Made, GenerateError> {
        let ordinary = self.plan(&[], &self.motion)?;
        let trace = ordinary.run(&self.sheet, &self.servo, &self.motion, self.duration)?;
        let mut found = self.conceal(case, attempt, &ordinary, &trace)?;
        if case.hollow {
            found.clear();
        }
        let effects: Vec<Effect> = found.iter().map(|found| found.effect.clone()).collect();
        let mut noise = stream(case.seed, "noise");
        let recording = match found.as_slice() {
            [] => self.sample(&ordinary, &trace, &self.motion, &mut noise),
            [one] => self.sample(&one.plan, &one.trace, &self.motion, &mut noise),
            _ => self.record(&effects, &self.motion, &mut noise)?,
        };
        let mut rng = stream(case.seed, "second motion");
        let motion = Motion::draw(self.machine, &self.sheet, self.families[1], self.duration, &mut rng);
        let second = self.record(&effects, &motion, &mut stream(case.seed, "second noise"))?;
        let truth = self.truth(case, &found);
        let file = ArmFile { arm: self.sheet.clone(), effects: Vec::new(), ignored: Vec::new() };
        Ok(Made { model: to_toml(&file), recording, second, truth })
    }

    /// The requested effects with their requested strengths, in a machine whose motion without them is `trace`.
    fn conceal(
        &self,
        case: &Case,
        attempt: u64,
        ordinary: &Plan,
        trace: &Trace,
    ) -> Result<Vec<Found>, GenerateError> {
        if case.effects.is_empty() {
            return Ok(Vec::new());
        }
        let (floor, without) =
            floor(&self.sheet, ordinary, trace, &self.deviations, &self.chain, self.duration);
        let sizing = Sizing { bench: self, floor: &floor, without: &without };
        let mut all: Vec<Found> = Vec::new();
        for (number, demand) in case.effects.iter().enumerate() {
            let mut rng = stream(case.seed, &format!("effect {number} attempt {attempt}"));
            let seat = self.seat(demand, &all, &floor, &mut rng)?;
            all.push(sizing.find(demand, seat, &mut rng)?);
        }
        Ok(all)
    }

    /// A joint for the effect without another effect.
    fn seat(
        &self,
        demand: &Demand,
        taken: &[Found],
        floor: &Floor,
        rng: &mut ChaCha8Rng,
    ) -> Result<Seat, GenerateError> {
        let mut places = seats(&demand.kind, &self.sheet);
        places.retain(|seat| demand.joint.is_none() || *seat == demand.joint);
        let free: Vec<Seat> = places
            .iter()
            .copied()
            .filter(|seat| seat.is_none() || taken.iter().all(|other| other.effect.joint != *seat))
            .filter(|seat| seat.is_none_or(|joint| can_be_distinct(&demand.kind, joint, floor)))
            .collect();
        if free.is_empty() && !places.is_empty() {
            return Err(GenerateError::Riddle { kind: demand.kind.clone(), machine: self.machine });
        }
        if free.is_empty() {
            let (kind, machine) = (demand.kind.clone(), self.machine);
            return Err(GenerateError::NoPlace { kind, machine, joint: demand.joint });
        }
        Ok(pick(rng, &free))
    }

    fn plan(&self, effects: &[Effect], motion: &Motion) -> Result<Plan, PlanError> {
        let n = self.sheet.dof();
        let mut poses = vec![self.machine.home().to_vec()];
        for k in 0..24 {
            let mut state = [vec![0.0; n], vec![0.0; n], vec![0.0; n]];
            let [q, v, a] = &mut state;
            motion.at(self.duration * f64::from(k) / 24.0, q, v, a);
            poses.push(state[0].clone());
        }
        Plan::new(&self.sheet, &self.load, &self.deviations, effects, &poses)
    }

    /// Builds the machine with `effects` and runs it through `motion` for `duration` s.
    pub fn run(
        &self,
        effects: &[Effect],
        motion: &Motion,
        duration: f64,
    ) -> Result<(Plan, Trace), PlanError> {
        let plan = self.plan(effects, motion)?;
        let trace = plan.run(&self.sheet, &self.servo, motion, duration)?;
        Ok((plan, trace))
    }

    fn record(
        &self,
        effects: &[Effect],
        motion: &Motion,
        rng: &mut ChaCha8Rng,
    ) -> Result<Samples, PlanError> {
        let (plan, trace) = self.run(effects, motion, self.duration)?;
        Ok(self.sample(&plan, &trace, motion, rng))
    }

    /// Samples `trace` with the sensors.
    fn sample(&self, plan: &Plan, trace: &Trace, motion: &Motion, rng: &mut ChaCha8Rng) -> Samples {
        let n = self.sheet.dof();
        let reference = |t: f64, out: &mut [f64]| {
            let (mut v, mut a) = (vec![0.0; n], vec![0.0; n]);
            motion.at(t, out, &mut v, &mut a);
        };
        self.chain.sample(plan, trace, &self.deviations, self.duration, reference, rng)
    }

    fn truth(&self, case: &Case, found: &[Found]) -> Truth {
        let rows = found.iter().zip(&case.effects);
        let effects = rows.map(|(Found { effect, strength, .. }, demand)| TruthEffect {
            kind: demand.kind.clone(),
            joint: effect.joint.map(|joint| self.sheet.joints()[joint].name.clone()),
            parameters: effect.physics.parameters(),
            weak: weak(&demand.kind),
            equivalents: equivalents(effect, &self.sheet),
            catalogued: CATALOGUE.contains(&demand.kind.as_str()),
            severity: demand.severity.name(),
            signal_to_floor: strength.signal_to_floor,
            channel: strength.channel.clone(),
        });
        Truth {
            schema: SCHEMA,
            seed: case.seed,
            machine: self.sheet.name().to_owned(),
            joints: self.sheet.dof(),
            noise: format!("{:?}", case.noise).to_lowercase(),
            families: self.families.map(|family| format!("{family:?}").to_lowercase()),
            rate: self.chain.rate,
            duration: self.duration,
            effects: effects.collect(),
        }
    }
}

/// The sensors of a case.
fn chain(sheet: &Arm, noise: Noise, rng: &mut ChaCha8Rng) -> Chain {
    let rate = pick(rng, &[125.0, 200.0, 250.0, 250.0, 250.0, 500.0, 500.0, 1000.0]);
    let spread = uniform(rng, 0.8, 1.25);
    let of_effort =
        |share: f64| sheet.joints().iter().map(|j| share * 0.5 * j.limits.effort).collect::<Vec<f64>>();
    Chain {
        rate,
        torque_noise: of_effort(spread * noise.torque()),
        torque_step: of_effort(noise.torque_step()),
        encoder_step: vec![noise.encoder_step(); sheet.dof()],
        tool_noise: spread * noise.tool(),
        tracker: (uniform(rng, 0.0, 1.0) < 0.3).then(|| uniform(rng, 240.0, 900.0)),
        jitter: noise.jitter() / rate,
        link_encoders: uniform(rng, 0.0, 1.0) < 0.15,
        reference: uniform(rng, 0.0, 1.0) < 0.8,
    }
}
