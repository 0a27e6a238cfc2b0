//! One run in this process: the arm with play under a built-in controller, torque mode, ideal sensors, tool tracked.
//!
//! The states are those that a plant would publish in lockstep; there is no shared memory and no gate in between.

use std::sync::Arc;

use freeplay_arm::{Arm, Workspace, forward_kinematics};
use freeplay_controller::{Answer, RunInfo, Task, built_in};
use freeplay_laws::{ArmWithPlay, Clearance, ClearanceTable};
use freeplay_path::{JointPath, PathSpec};
use freeplay_plant::{DeviationStatistics, Input, System};
use freeplay_shm::{CommandStatus, Mode, Pace, State};

use crate::exit::Failure;

/// Ticks per second.
pub const RATE: f64 = 1000.0;
/// Sub-steps of a tick.
const SUBSTEPS: u32 = 50;

/// What is simulated.
#[derive(Clone, Debug)]
pub struct RunSpec {
    /// For people.
    pub name: String,
    /// The reference.
    pub path: PathSpec,
    /// Radial clearance, m.
    pub clearance: f64,
    /// Name of the built-in controller.
    pub controller: &'static str,
}

/// One arm and the joint of it that has play.
#[derive(Clone, Debug)]
pub struct Subject {
    /// The nominal arm.
    pub arm: Arm,
    /// Index of the joint.
    pub joint: usize,
}

/// Simulates `spec` and hands every state to `keep`, with whether the journal is in free flight.
///
/// # Errors
/// A path that the arm cannot follow; a motion that cannot be integrated.
pub fn simulate(
    subject: &Subject,
    spec: &RunSpec,
    task: &Task,
    mut keep: impl FnMut(&State, bool),
) -> Result<DeviationStatistics, Failure> {
    let name = |error: &dyn std::fmt::Display| Failure::input(format!("{}: {error}", spec.name));
    let arm = &subject.arm;
    let path = Arc::new(JointPath::plan(arm, &spec.path, RATE).map_err(|error| name(&error))?);
    let clearance = Clearance::new(&ClearanceTable::new(spec.clearance)).map_err(|error| name(&error))?;
    let play = ArmWithPlay::new(arm, &[(subject.joint, clearance)]).map_err(|error| name(&error))?;
    let mut system = System::new(play, arm, 1.0 / RATE, SUBSTEPS).map_err(|error| name(&error))?;
    let n = arm.dof();
    let ticks = (path.duration() * RATE).round() as u64;
    let mut controller = built_in(spec.controller)
        .ok_or_else(|| Failure::internal(format!("no controller {}", spec.controller)))?;
    let period_ns = (1e9 / RATE) as u64;
    let run = RunInfo { joints: n, mode: Mode::Torque, pace: Pace::Lockstep, period_ns, ticks };
    controller.start(task, &run).map_err(|error| name(&error))?;
    let start = reference(&path, 0.0, n);
    system.start(&start.q[..n], &start.qd[..n]);
    let mut workspace = Workspace::new(arm);
    let mut deviation = DeviationStatistics::new(DeviationStatistics::START);
    let mut state = State::new(1, n);
    for tick in 0..ticks {
        observe(&mut system, &path, tick, &mut state);
        let desired = forward_kinematics(arm, &mut workspace, &state.reference.q[..n]).translation.vector;
        let tool = nalgebra::Vector3::new(state.tool[0], state.tool[1], state.tool[2]);
        deviation.add(tick as f64 / RATE, &(tool - desired));
        keep(&state, !system.bearings()[0].touching());
        let mut answer = Answer::BLANK;
        controller.answer(&state, &mut answer);
        if answer.status == CommandStatus::NoAnswer {
            return Err(Failure::internal(format!("{}: no answer at tick {tick}", spec.name)));
        }
        let input = Input { torque: &state.applied[..n], driven: &vec![tick == 0; n], motion: &*path };
        system.tick(&input).map_err(|error| name(&error))?;
        state.applied = answer.value;
    }
    Ok(deviation)
}

fn reference(path: &JointPath, time: f64, n: usize) -> freeplay_shm::Reference {
    let mut reference = freeplay_shm::Reference::REST;
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
