//! Tracks a Cartesian path with the joints: exact inverse kinematics from point to point.
//!
//! At each point Newton's method starts from the Taylor polynomial of the last one and runs to rounding error, so the
//! motion stays on one branch. With the Jacobian J of the task (pose for six joints and more, else position), its
//! pseudo-inverse J⁺ and the tool's velocity ẋ and acceleration ẍ:
//! - `v = J⁺ ẋ`, the smallest joint velocity for the tool velocity (Whitney 1969, eq. 8);
//! - `a = dv/dt = J⁺ (ẍ − J̇ v − J J̇ᵀ λ) + J̇ᵀ λ` with `λ = (J⁺)ᵀ v`. For a square, regular J the terms in λ cancel
//!   and `a = J⁻¹ (ẍ − J̇ v)`; with joints to spare they keep `a` the derivative of `v` (Siciliano et al. 2009, §3.5).

use freeplay_arm::{Arm, Workspace, forward_kinematics, jacobian, tool_bias_acceleration};
use nalgebra::{DMatrix, DVector, Isometry3, Vector6};

use crate::planning::tool::ToolSample;

/// Least number of joints for tracking the tool's orientation, too.
pub(crate) const JOINTS_FOR_POSE: usize = 6;
/// Least number of joints for tracking a Cartesian path.
pub(crate) const FEWEST_JOINTS: usize = 3;

/// Newton's method stops after a step below this (rad or m): its convergence is quadratic, so that the remaining error is rounding.
const LAST_STEP: f64 = 1e-12;
const MOST_STEPS: usize = 30;
/// A longer step (rad or m) has left the branch.
const LONGEST_STEP: f64 = 0.5;
/// Largest error of the tool that counts as on the path, m or rad.
const ON_PATH: f64 = 1e-10;
/// Condition number of J above which the pseudo-inverse drops singular directions.
const ILL_CONDITIONED: f64 = 1e9;
/// Permitted relative error of the tool's speed.
const SPEED_MISSED: f64 = 1e-7;
/// Step of the finite difference of J along the motion, rad or m.
const DIFFERENCE: f64 = 1e-5;

/// Failures of the tracking.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Lost {
    /// Newton's method did not converge: the point is out of reach, or on another branch.
    Point,
    /// The arm cannot produce the tool's velocity in this posture.
    Velocity,
}

/// The posture on a path, with the state for the next step.
pub(crate) struct Tracker<'a> {
    arm: &'a Arm,
    workspace: Workspace,
    pub q: DVector<f64>,
    pub v: DVector<f64>,
    pub a: DVector<f64>,
    jerk: DVector<f64>,
    task: TaskJacobian,
}

/// The Jacobian of the task and its pseudo-inverse.
struct TaskJacobian {
    rows: usize,
    full: DMatrix<f64>,
    j: DMatrix<f64>,
    inverse: DMatrix<f64>,
    /// True if J is square and regular: the tool determines the posture.
    determined: bool,
}

impl<'a> Tracker<'a> {
    /// Starts at `posture`, which should already reach the first point of the path.
    pub fn new(arm: &'a Arm, posture: &[f64]) -> Tracker<'a> {
        let dof = arm.dof();
        let rows = if dof >= JOINTS_FOR_POSE { 6 } else { 3 };
        let zero = DVector::zeros(dof);
        Tracker {
            arm,
            workspace: Workspace::new(arm),
            q: DVector::from_column_slice(posture),
            v: zero.clone(),
            a: zero.clone(),
            jerk: zero,
            task: TaskJacobian {
                rows,
                full: DMatrix::zeros(6, dof),
                j: DMatrix::zeros(rows, dof),
                inverse: DMatrix::zeros(dof, rows),
                determined: false,
            },
        }
    }

    /// The tracking arm.
    pub fn arm(&self) -> &Arm {
        self.arm
    }

    /// Moves the joints from their present positions to `target`; call it at the first point of each smooth piece.
    pub fn place(&mut self, target: &ToolSample) -> Result<(), Lost> {
        let guess = self.q.clone();
        self.correct(guess, target)?;
        self.jerk.fill(0.0);
        Ok(())
    }

    /// Steps the joints on to `target`, `h` seconds after the last point.
    pub fn step(&mut self, target: &ToolSample, h: f64) -> Result<(), Lost> {
        let guess = &self.q + (&self.v + (&self.a + &self.jerk * (h / 3.0)) * (h / 2.0)) * h;
        let before = self.a.clone();
        self.correct(guess, target)?;
        self.jerk = (&self.a - before) / h;
        Ok(())
    }

    fn correct(&mut self, guess: DVector<f64>, target: &ToolSample) -> Result<(), Lost> {
        self.q = self.newton(guess, &target.pose).ok_or(Lost::Point)?;
        let rows = self.task.rows;
        let velocity = target.velocity.rows(0, rows);
        self.v = &self.task.inverse * velocity;
        let missed = (&self.task.j * &self.v - velocity).amax();
        if missed > SPEED_MISSED * velocity.amax() || !self.v.iter().all(|x| x.is_finite()) {
            return Err(Lost::Velocity);
        }
        let bias =
            tool_bias_acceleration(self.arm, &mut self.workspace, self.q.as_slice(), self.v.as_slice());
        let wanted = (target.acceleration - bias).rows(0, rows).into_owned();
        self.a =
            if self.task.determined { &self.task.inverse * wanted } else { self.spare_acceleration(&wanted) };
        Ok(())
    }

    /// Newton's method on the tool's pose error; leaves the task's Jacobian at the returned posture.
    fn newton(&mut self, mut q: DVector<f64>, target: &Isometry3<f64>) -> Option<DVector<f64>> {
        for _ in 0..MOST_STEPS {
            let pose = forward_kinematics(self.arm, &mut self.workspace, q.as_slice());
            self.task.update(self.arm, &mut self.workspace, q.as_slice());
            let error = pose_error(target, &pose);
            let error = error.rows(0, self.task.rows);
            let step = &self.task.inverse * error;
            if !step.iter().all(|x| x.abs() <= LONGEST_STEP) {
                return None;
            }
            q += &step;
            if step.amax() <= LAST_STEP {
                return (error.amax() <= ON_PATH).then_some(q);
            }
        }
        None
    }

    fn spare_acceleration(&mut self, wanted: &DVector<f64>) -> DVector<f64> {
        let rate = self.jacobian_rate();
        let lambda = self.task.inverse.tr_mul(&self.v);
        let spare = rate.tr_mul(&lambda);
        &self.task.inverse * (wanted - &self.task.j * &spare) + spare
    }

    /// J̇ along the motion, by a central difference.
    fn jacobian_rate(&mut self) -> DMatrix<f64> {
        let speed = self.v.amax();
        let mut rate = DMatrix::zeros(self.task.rows, self.arm.dof());
        if speed == 0.0 {
            return rate;
        }
        let h = DIFFERENCE / speed;
        for sign in [1.0, -1.0] {
            let q = &self.q + &self.v * (sign * h);
            jacobian(self.arm, &mut self.workspace, q.as_slice(), &mut self.task.full);
            rate += self.task.full.rows(0, self.task.rows) * (sign / (2.0 * h));
        }
        rate
    }
}

impl TaskJacobian {
    fn update(&mut self, arm: &Arm, workspace: &mut Workspace, q: &[f64]) {
        jacobian(arm, workspace, q, &mut self.full);
        self.j.copy_from(&self.full.rows(0, self.rows));
        self.determined = false;
        let regular = |inverse: &DMatrix<f64>, j: &DMatrix<f64>| inverse.norm() * j.norm() < ILL_CONDITIONED;
        if self.j.is_square() {
            if let Some(inverse) = self.j.clone().try_inverse()
                && regular(&inverse, &self.j)
            {
                (self.inverse, self.determined) = (inverse, true);
                return;
            }
        } else if let Some(gram) = (&self.j * self.j.transpose()).cholesky() {
            let inverse = gram.solve(&self.j).transpose();
            // The Gram matrix squares the condition number: it is reliable only up to the square root of the bound.
            if inverse.norm() * self.j.norm() < ILL_CONDITIONED.sqrt() {
                self.inverse = inverse;
                return;
            }
        }
        let cut = self.j.norm() / ILL_CONDITIONED;
        self.inverse =
            self.j.clone().pseudo_inverse(cut).unwrap_or_else(|_| DMatrix::zeros(q.len(), self.rows));
    }
}

/// Translation (m) and rotation vector (rad), in the base frame, that carry `pose` to `target`.
pub(crate) fn pose_error(target: &Isometry3<f64>, pose: &Isometry3<f64>) -> Vector6<f64> {
    let shift = target.translation.vector - pose.translation.vector;
    let turn = (target.rotation * pose.rotation.inverse()).scaled_axis();
    Vector6::new(shift.x, shift.y, shift.z, turn.x, turn.y, turn.z)
}
