//! A controller of one's own, to copy: gravity compensation and a PD law on each joint.
//!
//! Build it with `cargo build --release -p freeplay-controller --example minimal` and let a run use it:
//! `freeplay run --controller target/release/examples/minimal`. In a crate of your own, depend on `freeplay-controller`,
//! `freeplay-arm` and `freeplay-shm`.

use std::process::ExitCode;

use freeplay_arm::{Arm, Workspace, crba, gravity_torque};
use freeplay_controller::{Answer, Controller, ControllerError, Gains, Model, RunInfo, Task, serve};
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
        let arm = Model::load(task, run)?.arm;
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

fn main() -> ExitCode {
    serve(PdGravity::default())
}
