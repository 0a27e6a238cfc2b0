//! The correction of the joints along a motion: what the compensation says tick by tick, and its derivatives.

use freeplay_arm::{Arm, Workspace, jacobian};
use nalgebra::{DMatrix, DVector, Vector3, Vector6};

use crate::centred::Centred;
use crate::compensation::{CompensationReport, Compensator, Motion, Weights};
use crate::qp::QpError;

/// A correction at the start that is larger than this, rad (m), is not taken for one.
const LARGEST_START: f64 = 0.01;

/// The correction of one arm, planned two ticks ahead of the instant at which it is used.
///
/// After a start it goes over from where the joints stand to the compensation within a blend time, by a quintic.
pub struct Correction {
    compensator: Compensator,
    workspace: Workspace,
    jacobian: DMatrix<f64>,
    period: f64,
    blend: f64,
    /// Δq at which the blend starts, and what it moves the tool by.
    start: DVector<f64>,
    start_deviation: Vector6<f64>,
    /// Δq of a plan.
    planned: DVector<f64>,
    /// Ticks since the start.
    age: u64,
    /// Δq at the ticks j − 1 to j + 2.
    course: Centred,
}

impl Correction {
    /// For `arm`, ticks of `period` seconds, a blend of `blend` seconds and the compensation's `weights`.
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
            age: 0,
            course: Centred::new(n, period),
        })
    }

    /// Starts anew, at rest, from the distance of the joints `q` to the reference `desired`: so that one controller takes over from
    /// another without a jump. A distance of more than a centimetre (10 mrad) is a disturbance, not a correction.
    pub fn start(&mut self, q: &[f64], desired: &[f64]) {
        for (start, (q, desired)) in self.start.iter_mut().zip(q.iter().zip(desired)) {
            let distance = q - desired;
            *start = if distance.abs() <= LARGEST_START { distance } else { 0.0 };
        }
        self.begin();
    }

    /// Starts anew, at rest, from the newest correction, after ticks have been missed.
    pub fn resume(&mut self) {
        self.start.copy_from_slice(self.compensator.correction());
        self.begin();
    }

    fn begin(&mut self) {
        self.age = 0;
        self.course.rest(self.start.as_slice());
        self.compensator.restart(self.start.as_slice());
    }

    /// Moves on by one tick: plans the correction for the instant of `desired` (tick j + 2), at which the play of the joints moves the
    /// tool by `deviation`, base frame, m. [`Self::motion`] is then that of tick j.
    pub fn advance(
        &mut self,
        arm: &Arm,
        desired: Motion<'_>,
        deviation: &Vector3<f64>,
    ) -> CompensationReport {
        jacobian(arm, &mut self.workspace, desired.q, &mut self.jacobian);
        self.move_on(desired, Vector6::new(deviation.x, deviation.y, deviation.z, 0.0, 0.0, 0.0))
    }

    /// As [`Self::advance`], to the correction `planned` for that instant, rad (m), plus what takes out the deviation `beyond` it, base
    /// frame, m, as far as the limits let it.
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
        self.move_on(desired, deviation)
    }

    /// One tick of the blend and the compensation of `deviation` with the Jacobian at `desired`.
    fn move_on(&mut self, desired: Motion<'_>, deviation: Vector6<f64>) -> CompensationReport {
        self.age += 1;
        let share = quintic(self.age as f64 * self.period / self.blend);
        let mut target = deviation * share;
        if share < 1.0 {
            self.start_deviation.gemv(1.0, &self.jacobian, &self.start, 0.0);
            target -= self.start_deviation * (1.0 - share);
        }
        let report = self.compensator.advance(desired, &self.jacobian, &target);
        self.course.push(self.compensator.correction());
        report
    }

    /// The second derivative that is to be held from tick j to j + 1, rad/s² (m/s²).
    pub fn held(&self) -> &[f64] {
        self.course.held()
    }

    /// Δq with its first and second derivative at tick j, rad, rad/s, rad/s² (m).
    pub fn motion(&self) -> Motion<'_> {
        self.course.motion()
    }
}

/// The quintic from 0 at x = 0 to 1 at x = 1 with two derivatives zero at both ends.
fn quintic(x: f64) -> f64 {
    let x = x.clamp(0.0, 1.0);
    x * x * x * (10.0 + x * (6.0 * x - 15.0))
}
