//! Forces on the tool during a window: generalised forces Jᵀ F on every coordinate of the arm with play (Khalil & Dombre 2002, §9).

use freeplay_arm::{Arm, Drive, Workspace, jacobian};
use freeplay_laws::ToolForce;
use nalgebra::{DMatrix, Vector3};

/// The forces, and their resultant in the current sub-step.
#[derive(Debug)]
pub(crate) struct ToolForces {
    forces: Vec<ToolForce>,
    now: Vector3<f64>,
    pushed: Vec<f64>,
    columns: DMatrix<f64>,
}

impl ToolForces {
    /// No force on an arm of `dof` coordinates.
    pub fn none(dof: usize) -> Self {
        Self {
            forces: Vec::new(),
            now: Vector3::zeros(),
            pushed: vec![0.0; dof],
            columns: DMatrix::zeros(6, dof),
        }
    }

    /// Adds forces.
    pub fn add(&mut self, forces: Vec<ToolForce>) {
        self.forces.extend(forces);
    }

    /// Adds the forces at the time `t`, s, to the torques in `drive`, with the arm at `q`.
    pub fn push(&mut self, t: f64, arm: &Arm, ws: &mut Workspace, q: &[f64], drive: &mut [Drive]) {
        if self.forces.is_empty() {
            return;
        }
        let acting = self.forces.iter().filter(|force| t >= force.start && t < force.end);
        self.now = acting.map(|force| force.force).sum();
        self.pushed.fill(0.0);
        if self.now == Vector3::zeros() {
            return;
        }
        jacobian(arm, ws, q, &mut self.columns);
        for (coordinate, pushed) in self.pushed.iter_mut().enumerate() {
            *pushed = self.columns.fixed_view::<3, 1>(0, coordinate).dot(&self.now);
            if let Drive::Torque(torque) = &mut drive[coordinate] {
                *torque += *pushed;
            }
        }
    }

    /// The generalised force on the coordinate `coordinate`, N·m or N.
    #[inline]
    pub fn generalised_force(&self, coordinate: usize) -> f64 {
        self.pushed[coordinate]
    }

    /// Power of the forces at the velocities `v`, W.
    pub fn power(&self, v: &[f64]) -> f64 {
        if self.forces.is_empty() { 0.0 } else { self.pushed.iter().zip(v).map(|(f, v)| f * v).sum() }
    }

    /// The force on the base: `carried`, the force across the first joint in its link's frame, minus the tool's share, N.
    pub fn without(&self, carried: Vector3<f64>, ws: &Workspace) -> Vector3<f64> {
        if self.now == Vector3::zeros() {
            return carried;
        }
        carried - ws.link_pose(0).rotation.inverse_transform_vector(&self.now)
    }
}
