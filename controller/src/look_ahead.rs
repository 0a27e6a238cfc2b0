//! Where the joints will be when the answer takes effect.
//!
//! While a controller computes on the state of tick k, the command given before is in force; its answer, a torque, starts at tick
//! k + 1. The nominal arm with that command gives the state there:
//!
//! `(M + T S) a = τ − h − S v,  v⁺ = v + a T,  q⁺ = q + v T + ½ a T²`
//!
//! with M the mass matrix, h the bias and τ the torque in force. S is diagonal, the friction torque of each drive over its velocity:
//! so friction is taken at the new velocity and brings a joint to rest but never turns it around, however steep its law is.
//!
//! During tick 0 no command can be in force yet: the plant guides the joints along the reference, where they will be at tick 1.

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

/// The prediction of one arm's joints by one tick, with its workspace.
pub struct LookAhead {
    workspace: Workspace,
    friction: Vec<DriveFriction>,
    period: f64,
    mass: DMatrix<f64>,
    right: DVector<f64>,
    predicted: JointState,
    /// The tick that is predicted.
    tick: Option<u64>,
}

impl LookAhead {
    /// For `arm` and ticks of `period` seconds.
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

    /// What was predicted of the tick `tick`, if it was.
    pub fn expected(&self, tick: u64) -> Option<&JointState> {
        (self.tick == Some(tick)).then_some(&self.predicted)
    }

    /// The joints of `arm` one tick after `state`, under the command in force and the torques `external` of the surroundings, N·m (N).
    /// `None` if the state is not finite.
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
            // The factorisation took the matrix with it; this state has no answer, so that allocating does no harm.
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

/// The friction of each drive that the arm file names.
pub fn drive_frictions(arm: &Arm) -> Vec<DriveFriction> {
    arm.joints().iter().map(|joint| DriveFriction::nominal(joint.friction)).collect()
}

/// Friction torque over velocity, N·m·s/rad, ≥ 0; at rest its limit.
fn resistance(friction: &DriveFriction, v: f64) -> f64 {
    if v == 0.0 {
        friction.viscous + friction.coulomb / DriveFriction::SMOOTHING
    } else {
        friction.resisting(v) / v
    }
}
