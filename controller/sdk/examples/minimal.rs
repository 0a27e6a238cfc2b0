//! A template for a controller of your own: gravity compensation and a PD law on each joint.
//!
//! Build it with `cargo build --release -p freeplay-controller-sdk --example minimal` and let a run use it:
//! `freeplay run --controller target/release/examples/minimal`. A crate of your own depends on `freeplay-controller-sdk` and
//! `freeplay-shm`, and on `freeplay-arm` and `freeplay-model` if it needs the dynamics of a model file.

use std::error::Error;
use std::path::Path;
use std::process::ExitCode;

use freeplay_arm::{Arm, Workspace, crba, gravity_torque};
use freeplay_controller_sdk::{
    Answer, Controller, ControllerError, Gains, PAPER_MODEL, RunInfo, Task, serve,
};
use freeplay_model::{load, paper_arm};
use freeplay_shm::State;
use nalgebra::DMatrix;

#[derive(Default)]
struct PdGravity {
    ready: Option<(Arm, Workspace, DMatrix<f64>, Gains)>,
}

impl Controller for PdGravity {
    fn name(&self) -> &str {
        "pd-gravity"
    }

    fn start(&mut self, task: &Task, run: &RunInfo) -> Result<(), ControllerError> {
        let arm = model(task).map_err(ControllerError::Custom)?;
        task.check(arm.dof(), run)?;
        let (workspace, mass) = (Workspace::new(&arm), DMatrix::zeros(arm.dof(), arm.dof()));
        self.ready = Some((arm, workspace, mass, task.gains));
        Ok(())
    }

    fn answer(&mut self, state: &State, answer: &mut Answer) {
        let Some((arm, workspace, mass, gains)) = &mut self.ready else { return answer.give_up() };
        let (n, desired) = (arm.dof(), &state.reference_next);
        gravity_torque(arm, workspace, &state.q[..n], &mut answer.value[..n]);
        crba(arm, workspace, &state.q[..n], mass);
        let (omega, zeta) = (gains.natural_frequency, gains.damping_ratio);
        for joint in 0..n {
            let feedback = omega * omega * (desired.q[joint] - state.q[joint])
                + 2.0 * zeta * omega * (desired.qd[joint] - state.qd[joint]);
            answer.value[joint] += mass[(joint, joint)] * feedback;
        }
    }
}

/// The arm that the task names, under the task's gravity.
fn model(task: &Task) -> Result<Arm, Box<dyn Error + Send + Sync>> {
    let file = if task.model == PAPER_MODEL { paper_arm() } else { load(Path::new(&task.model))? };
    Ok(match task.gravity {
        Some(gravity) => file.arm.with_gravity(gravity.into()),
        None => file.arm,
    })
}

fn main() -> ExitCode {
    serve(PdGravity::default())
}
