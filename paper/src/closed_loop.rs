//! A run in this process: the arm with play under a built-in controller, torque mode, ideal sensors.
//!
//! The states are those that a plant would publish in lockstep; there is no shared memory and no gate in between.

use std::path::Path;
use std::sync::Arc;

use freeplay_arm::{Arm, ArmFile, EffectTable, Workspace, forward_kinematics, to_toml};
use freeplay_controller::{Answer, RunInfo, Task, built_in};
use freeplay_laws::{ArmWithPlay, Clearance, ClearanceTable};
use freeplay_path::{JointPath, PathSpec};
use freeplay_plant::{DeviationStatistics, Input, JointUse, System};
use freeplay_shm::{CommandStatus, Mode, Pace, Reference, State};
use freeplay_terminal::exit::Failure;
use nalgebra::Vector3;

/// Ticks per second.
pub const RATE: f64 = 1000.0;
/// Sub-steps of a tick.
const SUBSTEPS: u32 = 50;

/// Joints with play, by index, and their radial clearances, m.
pub type Plays = Vec<(usize, f64)>;

/// What is run.
#[derive(Clone, Debug)]
pub struct ClosedLoop<'a> {
    /// The nominal arm.
    pub arm: &'a Arm,
    /// The play that it has.
    pub plays: &'a [(usize, f64)],
    /// The reference.
    pub path: &'a PathSpec,
    /// Name of the built-in controller.
    pub controller: &'a str,
    /// What the controller is told.
    pub task: &'a Task,
    /// Whether it sees the tool.
    pub tracked: bool,
    /// Time after which the deviation counts, s.
    pub after: f64,
}

/// One tick of a run, before the plant steps.
pub struct Tick<'a> {
    /// What the controller saw, and the tool, which it may not have seen.
    pub state: &'a State,
    /// The truth.
    pub system: &'a System,
}

/// What a run came to.
#[derive(Clone, Debug)]
pub struct Outcome {
    /// The tool's deviation.
    pub deviation: DeviationStatistics,
    /// The most that the motors did, as their encoders measure it.
    pub joint_use: JointUse,
    /// The most that they were commanded: the reference with its correction, and the torque.
    pub commanded: JointUse,
    /// Answers whose programme had no solution.
    pub failures: u64,
}

impl ClosedLoop<'_> {
    /// Runs it and hands every tick to `keep`.
    ///
    /// # Errors
    /// A path that the arm cannot follow, a controller that cannot start or has no answer, a motion that cannot be integrated.
    pub fn run(&self, mut keep: impl FnMut(&Tick<'_>)) -> Result<Outcome, Failure> {
        let path = Arc::new(JointPath::plan(self.arm, self.path, RATE).map_err(Failure::input)?);
        let play = with_play(self.arm, self.plays)?;
        let mut system = System::new(play, self.arm, 1.0 / RATE, SUBSTEPS).map_err(Failure::input)?;
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
            let desired = forward_kinematics(self.arm, &mut workspace, &state.reference.q[..n]);
            let tool = Vector3::new(state.tool[0], state.tool[1], state.tool[2]);
            outcome.deviation.add(tick as f64 / RATE, &(tool - desired.translation.vector));
            outcome.joint_use.add(&system);
            let mut answer = Answer::BLANK;
            let seen = if self.tracked { state } else { State { flags: 0, tool: [0.0; 7], ..state } };
            controller.answer(&seen, &mut answer);
            keep(&Tick { state: &state, system: &system });
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

/// The arm with play of `arm` with `plays`.
///
/// # Errors
/// A clearance that cannot be.
pub fn with_play(arm: &Arm, plays: &[(usize, f64)]) -> Result<ArmWithPlay, Failure> {
    let laws = plays.iter().map(|&(joint, c)| Ok((joint, Clearance::new(&ClearanceTable::new(c))?)));
    let laws: Vec<_> = laws.collect::<Result<_, freeplay_laws::LawError>>().map_err(Failure::input)?;
    ArmWithPlay::new(arm, &laws).map_err(Failure::input)
}

/// The task of a controller that believes `arm` to have `plays`, its model file in `folder`.
///
/// # Errors
/// A file that cannot be written.
pub fn task(
    arm: &Arm,
    plays: &[(usize, f64)],
    path: &PathSpec,
    options: toml::Table,
    folder: &Path,
) -> Result<Task, Failure> {
    let effect = |&(joint, clearance): &(usize, f64)| EffectTable {
        kind: Clearance::KIND.to_owned(),
        joint: Some(arm.joints()[joint].name.clone()),
        parameters: toml::Table::from_iter([("clearance".to_owned(), toml::Value::from(clearance))]),
        line: 0,
    };
    let file = ArmFile { arm: arm.clone(), effects: plays.iter().map(effect).collect(), ignored: Vec::new() };
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

/// Makes `state` that of `tick`, as the plant does.
fn observe(system: &mut System, path: &JointPath, tick: u64, state: &mut State) {
    let n = state.joints as usize;
    state.tick = tick;
    state.flags = State::FLAG_TOOL_TRACKED;
    system.play().gather(system.q(), &mut state.q[..n]);
    system.play().gather(system.v(), &mut state.qd[..n]);
    state.tau[..n].copy_from_slice(system.motor_torque());
    state.reference = reference(path, tick as f64 / RATE, n);
    state.reference_next = reference(path, (tick + 1) as f64 / RATE, n);
    let pose = system.tool();
    let (p, r) = (pose.translation.vector, pose.rotation.coords);
    state.tool = [p.x, p.y, p.z, r.x, r.y, r.z, r.w];
}
