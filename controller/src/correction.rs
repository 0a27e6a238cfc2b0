//! The correction of the joints along a motion: the output of the compensation tick by tick, and its derivatives.

use freeplay_arm::{Arm, Workspace, forward_kinematics, jacobian};
use nalgebra::{DMatrix, DVector, Vector3, Vector6};

use crate::centred::Centred;
use crate::compensation::{CompensationReport, CompensationStatus, Compensator, Motion, Weights};
use crate::correctable_deviation::correctable_deviation;
use crate::horizon::{Horizon, HorizonReport, HorizonStatus};
use crate::qp::QpError;

/// A joint error at the start larger than this, rad (m), does not count as a correction.
const LARGEST_START: f64 = 0.01;

/// The correction of one arm, planned two ticks ahead of the instant at which it is used.
///
/// After a start, the correction blends from the position of the joints to the compensation within a blend time, by a quintic.
pub struct Correction {
    compensator: Compensator,
    workspace: Workspace,
    jacobian: DMatrix<f64>,
    period: f64,
    blend: f64,
    /// Δq at the start of the blend, and the displacement of the tool by it.
    start: DVector<f64>,
    start_deviation: Vector6<f64>,
    /// Δq of a passage.
    planned: DVector<f64>,
    /// The joints with the newest correction.
    corrected: DVector<f64>,
    /// Ticks since the start.
    age: u64,
    /// Δq at the ticks j − 1 to j + 2.
    course: Centred,
}

impl Correction {
    /// Creates the correction for `arm`, ticks of `period` seconds, a blend of `blend` seconds and the compensation's `weights`.
    ///
    /// # Errors
    /// See [`QpError`].
    pub fn new(arm: &Arm, period: f64, blend: f64, weights: &Weights) -> Result<Correction, QpError> {
        let n = arm.dof();
        Ok(Correction {
            compensator: Compensator::new(arm, period, weights)?,
            workspace: Workspace::new(arm),
            jacobian: DMatrix::zeros(6, n),
            period,
            blend,
            start: DVector::zeros(n),
            start_deviation: Vector6::zeros(),
            planned: DVector::zeros(n),
            corrected: DVector::zeros(n),
            age: 0,
            course: Centred::new(n, period),
        })
    }

    /// Restarts, at rest, from the difference between the joints `q` and the reference `desired`, so that one controller takes over
    /// from another without a jump. A difference of more than a centimetre (10 mrad) is a disturbance, not a correction.
    pub fn start(&mut self, q: &[f64], desired: &[f64]) {
        for (start, (q, desired)) in self.start.iter_mut().zip(q.iter().zip(desired)) {
            let distance = q - desired;
            *start = if distance.abs() <= LARGEST_START { distance } else { 0.0 };
        }
        self.begin();
    }

    /// Restarts, at rest, from the newest correction, after missed ticks.
    pub fn resume(&mut self) {
        self.start.copy_from_slice(self.compensator.correction());
        self.begin();
    }

    fn begin(&mut self) {
        self.age = 0;
        self.course.rest(self.start.as_slice());
        self.compensator.restart(self.start.as_slice());
    }

    /// Advances by one tick. The function plans the correction for the instant of `desired` (tick j + 2), at which the play of the
    /// joints displaces the tool by `deviation`, base frame, m. [`Self::motion`] is then that of tick j.
    pub fn advance(
        &mut self,
        arm: &Arm,
        desired: Motion<'_>,
        deviation: &Vector3<f64>,
    ) -> CompensationReport {
        jacobian(arm, &mut self.workspace, desired.q, &mut self.jacobian);
        self.move_on(arm, desired, Vector6::new(deviation.x, deviation.y, deviation.z, 0.0, 0.0, 0.0))
    }

    /// Advances as [`Self::advance`] does, to the correction `planned` for that instant, rad (m), plus the correction of the deviation
    /// `beyond` it, base frame, m, as far as the limits permit.
    pub fn follow(
        &mut self,
        arm: &Arm,
        desired: Motion<'_>,
        planned: &[f64],
        beyond: &Vector3<f64>,
    ) -> CompensationReport {
        jacobian(arm, &mut self.workspace, desired.q, &mut self.jacobian);
        self.planned.copy_from_slice(planned);
        let mut deviation = Vector6::new(beyond.x, beyond.y, beyond.z, 0.0, 0.0, 0.0);
        deviation.gemv(-1.0, &self.jacobian, &self.planned, 1.0);
        self.move_on(arm, desired, deviation)
    }

    /// Advances as [`Self::advance`] does, with `horizon` instead of the programme of one tick. The horizon contains the ticks from
    /// that of `desired` on; the function adds `beyond`, base frame, m, to each of its deviations.
    ///
    /// # Errors
    /// The report of a horizon without a minimiser. The correction then stays as it was.
    pub fn look_ahead(
        &mut self,
        arm: &Arm,
        desired: Motion<'_>,
        horizon: &mut Horizon,
        beyond: &Vector3<f64>,
    ) -> Result<CompensationReport, HorizonReport> {
        jacobian(arm, &mut self.workspace, desired.q, &mut self.jacobian);
        let more = self.nonlinear_displacement(arm, desired.q) + beyond;
        let more = correctable_deviation(&self.jacobian, more);
        horizon.aim(|k, jacobian, deviation| {
            let share = quintic((self.age + 1 + k as u64) as f64 * self.period / self.blend);
            let mut target = *deviation;
            let mut position = target.fixed_rows_mut::<3>(0);
            position += more;
            target *= share;
            if share < 1.0 {
                target.gemv(share - 1.0, jacobian, &self.start, 1.0);
            }
            target
        });
        let [last, before] = self.compensator.past();
        let HorizonReport { status, iterations } = horizon.solve(last, before);
        let status = match status {
            HorizonStatus::Free => CompensationStatus::Free,
            HorizonStatus::Solved => CompensationStatus::Solved,
            _ => return Err(HorizonReport { status, iterations }),
        };
        self.age += 1;
        self.compensator.accept(horizon.correction());
        self.course.push(self.compensator.correction());
        Ok(CompensationReport { status, iterations })
    }

    /// Computes one tick of the blend and the compensation of `deviation`, with the Jacobian at `desired`.
    fn move_on(&mut self, arm: &Arm, desired: Motion<'_>, deviation: Vector6<f64>) -> CompensationReport {
        let nonlinear = self.nonlinear_displacement(arm, desired.q);
        self.age += 1;
        let share = quintic(self.age as f64 * self.period / self.blend);
        let mut target = deviation * share;
        if share < 1.0 {
            self.start_deviation.gemv(1.0, &self.jacobian, &self.start, 0.0);
            target -= self.start_deviation * (1.0 - share);
        }
        let mut position = target.fixed_rows_mut::<3>(0);
        position += nonlinear * share;
        let asked = correctable_deviation(&self.jacobian, position.clone_owned());
        position.copy_from(&asked);
        let report = self.compensator.advance(desired, &self.jacobian, &target);
        self.course.push(self.compensator.correction());
        report
    }

    /// Nonlinear part of the tool displacement by the newest correction, beyond the Jacobian at the joints `q`, m: half a micrometre
    /// for a correction of 0.6 mm. It changes slowly, so the value of the newest correction serves for the next.
    fn nonlinear_displacement(&mut self, arm: &Arm, q: &[f64]) -> Vector3<f64> {
        let newest = self.compensator.correction();
        for (corrected, (q, correction)) in self.corrected.iter_mut().zip(q.iter().zip(newest)) {
            *corrected = q + correction;
        }
        self.planned.copy_from_slice(newest);
        let straight = self.jacobian.fixed_rows::<3>(0) * &self.planned;
        let from = forward_kinematics(arm, &mut self.workspace, q).translation.vector;
        let to = forward_kinematics(arm, &mut self.workspace, self.corrected.as_slice()).translation.vector;
        to - from - straight
    }

    /// The second derivative to hold from tick j to j + 1, rad/s² (m/s²).
    pub fn held(&self) -> &[f64] {
        self.course.held()
    }

    /// Δq with its first and second derivative at tick j, rad, rad/s, rad/s² (m).
    pub fn motion(&self) -> Motion<'_> {
        self.course.motion()
    }
}

/// The quintic from 0 at x = 0 to 1 at x = 1; its first and second derivatives are zero at both ends.
fn quintic(x: f64) -> f64 {
    let x = x.clamp(0.0, 1.0);
    x * x * x * (10.0 + x * (6.0 * x - 15.0))
}

#[cfg(test)]
mod tests {
    use super::{Correction, Motion, Vector3, Weights, forward_kinematics};
    use freeplay_arm::Workspace;
    use freeplay_model::paper_arm;

    #[test]
    fn a_deviation_is_taken_out_beyond_the_first_order() {
        let arm = paper_arm().arm;
        let (q, still) = ([0.1, 0.2, 0.3, 0.0, 1.1, 0.0], [0.0; 6]);
        let desired = Motion { q: &q, v: &still, a: &still };
        let deviation = Vector3::new(0.2e-3, -0.1e-3, -0.6e-3);
        let mut correction = Correction::new(&arm, 1e-3, 1e-3, &Weights::default()).expect("a correction");
        correction.start(&q, &q);
        for _ in 0..2000 {
            correction.advance(&arm, desired, &deviation);
        }
        let mut workspace = Workspace::new(&arm);
        let mut tool = |q: &[f64]| forward_kinematics(&arm, &mut workspace, q).translation.vector;
        let moved: Vec<f64> =
            q.iter().zip(correction.motion().q).map(|(q, correction)| q + correction).collect();
        let left = (tool(&moved) - tool(&q) + deviation).norm();
        let second_order = correction.nonlinear_displacement(&arm, &q).norm();
        println!("left {left:.2e} m of a second-order share of {second_order:.2e} m");
        assert!(second_order > 1e-7 && left < 0.02 * second_order);
    }
}
