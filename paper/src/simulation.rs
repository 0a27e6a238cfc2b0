//! A simulation of the paper's arm in this process, without plant and controller processes.
//!
//! Either the joints follow the path exactly, or every tick applies τ = RNEA(q, v, q̈_d + 2ζω(q̇_d − v) + ω²(q_d − q)) of the six-joint model, ω = 50 rad/s, ζ
//! = 1, at once and holds it for the tick, like the independent reference.

use std::sync::Arc;

use freeplay_arm::{Arm, Workspace, forward_kinematics, rnea};
use freeplay_harness::scenario::Drive;
use freeplay_laws::{ArmWithPlay, Clearance, ClearanceTable};
use freeplay_model::paper_arm;
use freeplay_path::{JointPath, PathSpec};
use freeplay_plant::{Input, System};
use freeplay_terminal::exit::Failure;
use nalgebra::Vector3;

/// Joint with play, by index.
pub const JOINT: usize = 4;
/// Length of a tick of the reference runs, s.
pub const TICK: f64 = 1e-3;

/// Set-up of a simulation.
#[derive(Clone, Debug)]
pub struct Scene {
    /// Drive of the joints.
    pub drive: Drive,
    /// The reference path.
    pub path: PathSpec,
    /// The play of joint 5; `None` for a perfect joint.
    pub play: Option<ClearanceTable>,
    /// Gravity along −z, m/s².
    pub gravity: f64,
    /// Length of a tick, s.
    pub tick: f64,
    /// Sub-steps of a tick.
    pub substeps: u32,
}

/// A running simulation of a scene.
pub struct Simulation {
    arm: Arm,
    path: Arc<JointPath>,
    system: System,
    nominal: Workspace,
    driven: Vec<bool>,
    desired: [Vec<f64>; 3],
    measured: [Vec<f64>; 2],
    torque: Vec<f64>,
}

impl Simulation {
    /// The arm at the start of its path, the journal centred in its bearing, everything at rest.
    ///
    /// # Errors
    /// An invalid path, clearance or step.
    pub fn new(scene: &Scene) -> Result<Self, Failure> {
        let arm = paper_arm().arm.with_gravity(Vector3::new(0.0, 0.0, -scene.gravity));
        let path = Arc::new(JointPath::plan(&arm, &scene.path, 1.0 / TICK).map_err(Failure::input)?);
        let clearance = scene.play.as_ref().map(Clearance::new).transpose().map_err(Failure::input)?;
        let plays: Vec<_> = clearance.into_iter().map(|clearance| (JOINT, clearance)).collect();
        let play = ArmWithPlay::new(&arm, &plays).map_err(Failure::input)?;
        let mut system = System::new(play, &arm, scene.tick, scene.substeps).map_err(Failure::input)?;
        let dof = arm.dof();
        let mut desired = [vec![0.0; dof], vec![0.0; dof], vec![0.0; dof]];
        let [q, v, a] = &mut desired;
        path.at(0.0, q, v, a);
        system.start(q, v);
        Ok(Self {
            nominal: Workspace::new(&arm),
            driven: vec![scene.drive == Drive::Driven; dof],
            measured: [vec![0.0; dof], vec![0.0; dof]],
            torque: vec![0.0; dof],
            arm,
            path,
            system,
            desired,
        })
    }

    /// The arm with play in its present state.
    pub fn system(&self) -> &System {
        &self.system
    }

    /// The same, mutable, to read and reset its peaks.
    pub fn system_mut(&mut self) -> &mut System {
        &mut self.system
    }

    /// Length of the motion, s.
    pub fn duration(&self) -> f64 {
        self.path.duration()
    }

    /// Desired positions, velocities and accelerations of the joints on the path, as of the last [`Self::desired_tool`].
    pub fn desired(&self) -> &[Vec<f64>; 3] {
        &self.desired
    }

    /// Present tool position of the perfect arm, m.
    pub fn desired_tool(&mut self) -> Vector3<f64> {
        let [q, v, a] = &mut self.desired;
        self.path.at(self.system.time(), q, v, a);
        forward_kinematics(&self.arm, &mut self.nominal, q).translation.vector
    }

    /// The true tool position minus [`Self::desired_tool`], m.
    pub fn deviation(&mut self) -> Vector3<f64> {
        let desired = self.desired_tool();
        self.system.tool().translation.vector - desired
    }

    /// Simulates one tick; the desired motion must be up to date, see [`Self::desired_tool`].
    ///
    /// # Errors
    /// A motion that can no longer be integrated.
    pub fn tick(&mut self) -> Result<(), Failure> {
        if self.driven.contains(&false) {
            self.compute_torque();
        }
        let input = Input { torque: &self.torque, driven: &self.driven, motion: &*self.path };
        self.system.tick(&input).map_err(Failure::internal)
    }

    /// Computed torque with the perfect six-joint model, without delay.
    fn compute_torque(&mut self) {
        const OMEGA: f64 = 50.0;
        let [desired_q, desired_v, desired_a] = &self.desired;
        let [q, v] = &mut self.measured;
        self.system.play().gather(self.system.q(), q);
        self.system.play().gather(self.system.v(), v);
        let a: Vec<f64> = (0..q.len())
            .map(|j| {
                desired_a[j] + 2.0 * OMEGA * (desired_v[j] - v[j]) + OMEGA * OMEGA * (desired_q[j] - q[j])
            })
            .collect();
        rnea(&self.arm, &mut self.nominal, q, v, &a, &mut self.torque);
    }
}
