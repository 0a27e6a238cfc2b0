//! A closed-loop run in this process: the arm with its effects under a built-in controller, in mode torque.
//!
//! The states equal those that a plant publishes in lockstep; there is no shared memory and no gate.

use std::path::Path;
use std::sync::Arc;

use freeplay_arm::{Arm, Workspace, forward_kinematics};
use freeplay_controller::{Answer, RunInfo, Task, built_in};
use freeplay_laws::{Clearance, Effects, Readings, SensorLaw};
use freeplay_model::{ArmFile, EffectTable, to_toml};
use freeplay_path::{JointPath, PathSpec};
use freeplay_plant::{DeviationStatistics, Input, JointUse, Sensors, SensorsSpec, System};
use freeplay_shm::{CommandStatus, Mode, Pace, Reference, State};
use freeplay_terminal::exit::Failure;
use nalgebra::Vector3;

/// Ticks per second.
pub const RATE: f64 = 1000.0;
/// Sub-steps of a tick.
const SUBSTEPS: u32 = 50;
/// Number of intervals of the path between the postures at which rotors are distributed.
const POSTURES: u32 = 32;

/// Laws that are evaluated once a tick.
type Laws = Vec<Box<dyn SensorLaw>>;

/// Joints with play, by index, and their radial clearances, m.
pub type Plays = Vec<(usize, f64)>;

/// Settings of a run.
#[derive(Clone, Debug)]
pub struct ClosedLoop<'a> {
    /// The nominal arm.
    pub arm: &'a Arm,
    /// Effects of the arm.
    pub effects: &'a Effects,
    /// The reference.
    pub path: &'a PathSpec,
    /// Name of the built-in controller.
    pub controller: &'a str,
    /// Task of the controller.
    pub task: &'a Task,
    /// True if the controller sees the tool.
    pub tracked: bool,
    /// Time after which the deviation is evaluated, s.
    pub after: f64,
    /// The sensors, and the seed of their noise.
    pub sensors: (SensorsSpec, u64),
    /// Displacement of the tool at each tick in addition to the effects, base frame, m; zero beyond its end.
    pub beyond: &'a [Vector3<f64>],
}

/// One tick of a run, before the plant steps.
pub struct Tick<'a> {
    /// State that the controller saw; it includes the tool, which the controller may not have seen.
    pub state: &'a State,
    /// The simulated true system.
    pub system: &'a System,
    /// Answer of the controller.
    pub answer: &'a Answer,
}

/// Results of a run.
#[derive(Clone, Debug)]
pub struct Outcome {
    /// The tool's deviation.
    pub deviation: DeviationStatistics,
    /// Greatest use of the motors according to their encoders.
    pub joint_use: JointUse,
    /// Greatest commanded use: the reference with its correction, and the torque.
    pub commanded: JointUse,
    /// Number of answers whose programme had no solution.
    pub failures: u64,
}

impl ClosedLoop<'_> {
    /// Simulates the run and passes every tick to `keep`.
    ///
    /// # Errors
    /// A path that the arm cannot follow, a controller that cannot start or has no answer, or a failed integration.
    pub fn run(&self, mut keep: impl FnMut(&Tick<'_>)) -> Result<Outcome, Failure> {
        let path = Arc::new(JointPath::plan(self.arm, self.path, RATE).map_err(Failure::input)?);
        let (mut system, [mut laws, mut readers]) = self.system(&path)?;
        let mut sensors = Sensors::new(&self.sensors.0, self.arm.dof(), self.sensors.1);
        let n = self.arm.dof();
        let ticks = (path.duration() * RATE).round() as u64;
        let mut controller = built_in(self.controller)
            .ok_or_else(|| Failure::internal(format!("no controller {}", self.controller)))?;
        let period_ns = (1e9 / RATE) as u64;
        let run = RunInfo { joints: n, mode: Mode::Torque, pace: Pace::Lockstep, period_ns, ticks };
        controller.start(self.task, &run).map_err(Failure::input)?;
        let start = reference(&path, 0.0, n);
        system.start(&start.q[..n], &start.qd[..n]);
        let mut workspace = Workspace::new(self.arm);
        let mut outcome = Outcome {
            deviation: DeviationStatistics::new(self.after),
            joint_use: JointUse::new(self.arm, 1.0 / RATE),
            commanded: JointUse::new(self.arm, 1.0 / RATE),
            failures: 0,
        };
        let mut state = State::new(1, n);
        for tick in 0..ticks {
            observe(&mut system, &path, tick, &mut state);
            self.displace(&mut laws, tick, &mut state);
            let desired = forward_kinematics(self.arm, &mut workspace, &state.reference.q[..n]);
            let tool = Vector3::new(state.tool[0], state.tool[1], state.tool[2]);
            outcome.deviation.add(tick as f64 / RATE, &(tool - desired.translation.vector));
            outcome.joint_use.add(&system);
            sense(&mut readers, &mut sensors, &mut state);
            let mut answer = Answer::BLANK;
            let seen = if self.tracked { state } else { State { flags: 0, tool: [0.0; 7], ..state } };
            controller.answer(&seen, &mut answer);
            keep(&Tick { state: &state, system: &system, answer: &answer });
            match answer.status {
                CommandStatus::NoAnswer => {
                    return Err(Failure::internal(format!("{}: no answer at tick {tick}", self.controller)));
                }
                CommandStatus::QpFailed | CommandStatus::QpLimit => outcome.failures += 1,
                _ => {}
            }
            let instant = (tick + 1) as f64 / RATE;
            outcome.commanded.add_commanded(instant, &answer.velocity, &answer.acceleration, &answer.value);
            let input = Input { torque: &state.applied[..n], driven: &vec![tick == 0; n], motion: &*path };
            system.tick(&input).map_err(Failure::input)?;
            state.applied = answer.value;
        }
        Ok(outcome)
    }
}

impl ClosedLoop<'_> {
    /// The plant, with the laws that displace the tool and those of the sensors.
    fn system(&self, path: &JointPath) -> Result<(System, [Laws; 2]), Failure> {
        let body = self.effects.changed(self.arm).map_err(Failure::input)?;
        let mut injection = self.effects.injection();
        let laws = [&mut injection.tool, &mut injection.sensors].map(std::mem::take);
        let posture = |number: u32| {
            let instant = path.duration() * f64::from(number) / f64::from(POSTURES);
            reference(path, instant, self.arm.dof()).q[..self.arm.dof()].to_vec()
        };
        let postures: Vec<Vec<f64>> = (0..=POSTURES).map(posture).collect();
        let system = System::with_effects(&body, injection, &postures, 1.0 / RATE, SUBSTEPS);
        Ok((system.map_err(Failure::input)?, laws))
    }

    /// Displaces the tool of `state` by the laws and by the remainder at `tick`.
    fn displace(&self, laws: &mut [Box<dyn SensorLaw>], tick: u64, state: &mut State) {
        read(laws, state);
        if let Some(beyond) = usize::try_from(tick).ok().and_then(|tick| self.beyond.get(tick)) {
            state.tool.iter_mut().zip(beyond.iter()).for_each(|(tool, beyond)| *tool += beyond);
        }
    }
}

/// Applies `laws` to the readings of `state`.
fn read(laws: &mut [Box<dyn SensorLaw>], state: &mut State) {
    let n = state.joints as usize;
    let mut link = state.q;
    let mut readings = Readings {
        period: 1.0 / RATE,
        q: &mut state.q[..n],
        v: &mut state.qd[..n],
        torque: &mut state.tau[..n],
        link: &mut link[..n],
        tool: &mut state.tool,
    };
    laws.iter_mut().for_each(|law| law.read(&mut readings));
}

/// Replaces the true values in `state` by sensor readings.
fn sense(laws: &mut [Box<dyn SensorLaw>], sensors: &mut Sensors, state: &mut State) {
    read(laws, state);
    let n = state.joints as usize;
    sensors.read(&mut state.q[..n], &mut state.qd[..n], &mut state.tau[..n], &mut state.tool[..3]);
}

/// The effects of `arm` with `plays`.
///
/// # Errors
/// An invalid clearance.
pub fn effects_with_plays(arm: &Arm, plays: &[(usize, f64)]) -> Result<Effects, Failure> {
    Effects::of(&with_tables(arm, plays)).map_err(Failure::input)
}

/// The arm file of `arm` with `plays`.
fn with_tables(arm: &Arm, plays: &[(usize, f64)]) -> ArmFile {
    let effect = |&(joint, clearance): &(usize, f64)| EffectTable {
        kind: Clearance::KIND.to_owned(),
        joint: Some(arm.joints()[joint].name.clone()),
        parameters: toml::Table::from_iter([("clearance".to_owned(), toml::Value::from(clearance))]),
        line: 0,
    };
    ArmFile { arm: arm.clone(), effects: plays.iter().map(effect).collect(), ignored: Vec::new() }
}

/// The task of a controller that assumes `arm` with `plays`, with its model file in `folder`.
///
/// # Errors
/// An unwritable file.
pub fn task(
    arm: &Arm,
    plays: &[(usize, f64)],
    path: &PathSpec,
    options: toml::Table,
    folder: &Path,
) -> Result<Task, Failure> {
    let file = with_tables(arm, plays);
    let model = folder.join("model.toml");
    freeplay_terminal::files::write(&model, &to_toml(&file))?;
    Ok(Task {
        model: model.display().to_string(),
        gravity: Some((*arm.gravity()).into()),
        rate: RATE,
        path: path.clone(),
        options,
        ..Task::default()
    })
}

fn reference(path: &JointPath, time: f64, n: usize) -> Reference {
    let mut reference = Reference::REST;
    path.at(time, &mut reference.q[..n], &mut reference.qd[..n], &mut reference.qdd[..n]);
    reference
}

/// Updates `state` for `tick`, as the plant does.
fn observe(system: &mut System, path: &JointPath, tick: u64, state: &mut State) {
    let n = state.joints as usize;
    state.tick = tick;
    state.flags = State::FLAG_TOOL_TRACKED;
    system.encoders(&mut state.q[..n], &mut state.qd[..n]);
    system.drive_torque(&mut state.tau[..n]);
    state.reference = reference(path, tick as f64 / RATE, n);
    state.reference_next = reference(path, (tick + 1) as f64 / RATE, n);
    let pose = system.tool();
    let (p, r) = (pose.translation.vector, pose.rotation.coords);
    state.tool = [p.x, p.y, p.z, r.x, r.y, r.z, r.w];
}
