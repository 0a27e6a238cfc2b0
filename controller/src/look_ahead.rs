//! State of the joints at the instant when the answer takes effect.
//!
//! While a controller computes on the state of tick k, the previous command is in force; the answer, a torque, starts at tick k + 1.
//! The nominal arm under the previous command gives the state there:
//!
//! `(M + T S) a = τ − h − S v,  v⁺ = v + a T,  q⁺ = q + v T + ½ a T²`
//!
//! M is the mass matrix, h the bias and τ the torque in force. S is diagonal: the friction torque of each drive divided by its
//! velocity. Friction thus acts at the new velocity and brings a joint to rest without reversing it, however steep its law is.
//!
//! During tick 0 no command is in force yet: the plant guides the joints along the reference, which also gives their state at tick 1.

use freeplay_arm::{Arm, Workspace, bias, crba};
use freeplay_laws::DriveFriction;
use freeplay_shm::State;
use nalgebra::{Cholesky, DMatrix, DVector};

/// Positions and velocities of the joints, rad and rad/s (m and m/s).
#[derive(Clone, Debug, PartialEq)]
pub struct JointState {
    /// Positions q.
    pub q: Vec<f64>,
    /// Velocities v.
    pub v: Vec<f64>,
}

/// One-tick prediction of one arm's joints, with its workspace.
pub struct LookAhead {
    workspace: Workspace,
    friction: Vec<DriveFriction>,
    period: f64,
    mass: DMatrix<f64>,
    right: DVector<f64>,
    predicted: JointState,
    /// The predicted tick.
    tick: Option<u64>,
}

impl LookAhead {
    /// Creates a prediction for `arm` and ticks of `period` seconds.
    pub fn new(arm: &Arm, period: f64) -> LookAhead {
        let n = arm.dof();
        LookAhead {
            workspace: Workspace::new(arm),
            friction: drive_frictions(arm),
            period,
            mass: DMatrix::zeros(n, n),
            right: DVector::zeros(n),
            predicted: JointState { q: vec![0.0; n], v: vec![0.0; n] },
            tick: None,
        }
    }

    /// The prediction for the tick `tick`, if there is one.
    pub fn expected(&self, tick: u64) -> Option<&JointState> {
        (self.tick == Some(tick)).then_some(&self.predicted)
    }

    /// Predicts the joints of `arm` one tick after `state`, under the command in force and the torques `external` of the surroundings,
    /// N·m (N). Returns `None` if the state is not finite.
    pub fn predict(&mut self, arm: &Arm, state: &State, external: &[f64]) -> Option<&JointState> {
        let n = arm.dof();
        self.tick = state.tick.checked_add(1);
        if state.tick == 0 {
            self.predicted.q.copy_from_slice(&state.reference_next.q[..n]);
            self.predicted.v.copy_from_slice(&state.reference_next.qd[..n]);
            return Some(&self.predicted);
        }
        self.step(arm, &state.q[..n], &state.qd[..n], &state.applied[..n], external)
    }

    fn step(
        &mut self,
        arm: &Arm,
        q: &[f64],
        v: &[f64],
        applied: &[f64],
        external: &[f64],
    ) -> Option<&JointState> {
        crba(arm, &mut self.workspace, q, &mut self.mass);
        bias(arm, &mut self.workspace, q, v, self.right.as_mut_slice());
        for (joint, friction) in self.friction.iter().enumerate() {
            let slope = resistance(friction, v[joint]);
            self.mass[(joint, joint)] += self.period * slope;
            self.right[joint] = applied[joint] + external[joint] - self.right[joint] - slope * v[joint];
        }
        let factor = Cholesky::new(std::mem::replace(&mut self.mass, DMatrix::zeros(0, 0)));
        let Some(factor) = factor else {
            // The factorisation consumed the matrix. This state has no answer, so an allocation does no harm.
            self.mass = DMatrix::zeros(arm.dof(), arm.dof());
            return None;
        };
        factor.solve_mut(&mut self.right);
        self.mass = factor.unpack_dirty();
        let period = self.period;
        for (joint, &a) in self.right.iter().enumerate() {
            self.predicted.q[joint] = q[joint] + (v[joint] + 0.5 * a * period) * period;
            self.predicted.v[joint] = v[joint] + a * period;
        }
        Some(&self.predicted)
    }
}

/// The friction of each drive according to the arm file.
pub fn drive_frictions(arm: &Arm) -> Vec<DriveFriction> {
    arm.joints().iter().map(|joint| DriveFriction::nominal(joint.friction)).collect()
}

/// Friction torque divided by velocity, N·m·s/rad, ≥ 0; at rest, its limit.
fn resistance(friction: &DriveFriction, v: f64) -> f64 {
    if v == 0.0 {
        friction.viscous + friction.coulomb / DriveFriction::SMOOTHING_SPEED
    } else {
        friction.resisting(v) / v
    }
}
