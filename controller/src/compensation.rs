//! Compensation of one tick: the joint correction Δq that cancels a predicted deviation of the tool.
//!
//! `min ½‖J_p Δq + r_p‖²_W + ε/2 ‖J_w Δq + r_w‖² + ρ/2 ‖Δq − Δq₋₁‖²` subject to, for every joint,
//!
//! - position: `q_min ≤ q_d + Δq ≤ q_max`,
//! - speed: `|Δq − Δq₋₁| ≤ (v_max − |v_d|) T`,
//! - acceleration: `|a_d + (Δq − 2Δq₋₁ + Δq₋₂)/T²| ≤ a_max`.
//!
//! J is the Jacobian of the tool (linear rows J_p, angular rows J_w), r the deviation to compensate (linear m, angular rad, base frame); q_d, v_d, a_d are the
//! desired motion at the instant of Δq, and T is the period of the ticks. Each of the three limits is an interval for Δq. Their intersection is one interval a
//! joint, which gives two rows of the programme. Internal units are mm and mrad.
//!
//! The minimiser of the cost alone is the damped least-squares solution. If it satisfies every interval, it is also the minimiser of the programme (stationary,
//! feasible, all multipliers zero), and no iteration is needed: [`CompensationStatus::Free`]. Otherwise Clarabel solves the programme.
//!
//! A desired motion that uses a whole limit would forbid the correction even to come to rest. The bounds therefore leave at least
//! [`LEAST_SHARE`](crate::correction_bounds::LEAST_SHARE) of each limit to the correction. Near a position limit, the correction is no faster than it can brake
//! with that share. If the intervals do not intersect or the programme fails, the correction brakes to rest within the acceleration limit, and the report names
//! the cause.

use freeplay_arm::{Arm, Limits};
use nalgebra::{DMatrix, Vector6};
use serde::{Deserialize, Serialize};

use crate::correction_bounds::CorrectionBounds;
use crate::free_minimiser::FreeMinimiser;
use crate::qp::{Qp, QpError, QpStatus};

/// From SI to the units of the programme: mm and mrad.
pub(crate) const MILLI: f64 = 1e3;

/// The weights of the cost, in mm and mrad.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Weights {
    /// Diagonal of W, 1/mm²: weights of the remaining deviation along x, y, z of the base frame.
    pub position: [f64; 3],
    /// ε, 1/mrad²: weight of the change of the tool's orientation; not used for arms of fewer than six joints.
    pub orientation: f64,
    /// ρ, 1/mrad² (1/mm²): weight of the change of the correction from tick to tick; > 0, so that the minimiser is unique.
    pub change: f64,
    /// α, mm²/(rad/s²)²: weight of the acceleration of the correction in a horizon ([`crate::horizon`]); the programme of one tick does not use it.
    pub acceleration: f64,
}

impl Default for Weights {
    fn default() -> Weights {
        Weights { position: [1.0; 3], orientation: 0.01, change: 1e-5, acceleration: 1e-5 }
    }
}

impl Weights {
    /// Diagonal of the weights W, with ε for the angular rows, for an arm of `joints` joints.
    pub(crate) fn by_row(&self, joints: usize) -> Vector6<f64> {
        let [x, y, z] = self.position;
        let orientation = if joints < 6 { 0.0 } else { self.orientation };
        Vector6::new(x, y, z, orientation, orientation, orientation)
    }

    /// Returns the first fault of the weights, if there is one.
    pub fn fault(&self) -> Option<&'static str> {
        let fine = |weight: f64| weight.is_finite() && weight >= 0.0;
        if !(self.position.into_iter().all(fine) && fine(self.orientation) && fine(self.acceleration)) {
            Some(
                "weights.position, weights.orientation and weights.acceleration must be finite and not negative",
            )
        } else if !(self.change.is_finite() && self.change > 0.0) {
            Some("weights.change must be finite and above zero")
        } else {
            None
        }
    }
}

/// The desired motion of the joints at one instant: rad, rad/s, rad/s² (m for prismatic joints).
#[derive(Clone, Copy, Debug)]
pub struct Motion<'a> {
    /// Positions q_d.
    pub q: &'a [f64],
    /// Velocities v_d.
    pub v: &'a [f64],
    /// Accelerations a_d.
    pub a: &'a [f64],
}

/// Status of one compensation.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CompensationStatus {
    /// No limit is active: the minimiser of the cost alone satisfies all limits. No iteration was needed.
    Free,
    /// The solver iterated; the correction is the minimiser.
    Solved,
    /// The limits of this joint (index) contradict each other; the correction brakes to rest.
    LimitsConflict(usize),
    /// The programme failed with this status; the correction brakes to rest.
    Failed(QpStatus),
}

impl CompensationStatus {
    /// Returns true if the correction is the minimiser of the programme.
    pub fn is_minimiser(self) -> bool {
        matches!(self, CompensationStatus::Free | CompensationStatus::Solved)
    }
}

/// Result of one compensation.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct CompensationReport {
    /// Status.
    pub status: CompensationStatus,
    /// Iterations of the solver; 0 if it was not called.
    pub iterations: u32,
}

/// The compensation programme of one arm with the corrections of the last two ticks.
pub struct Compensator {
    qp: Qp,
    limits: Vec<Limits>,
    period: f64,
    row_weights: Vector6<f64>,
    change: f64,
    /// Δq₋₁ and Δq₋₂, SI.
    last: Vec<f64>,
    before: Vec<f64>,
    // The following buffers are in mm and mrad.
    weighted: DMatrix<f64>,
    cost: DMatrix<f64>,
    linear: Vec<f64>,
    bounds: Vec<f64>,
    free: FreeMinimiser,
}

impl Compensator {
    /// Creates a compensator for `arm` with its limits and ticks of `period` seconds. It starts without a correction.
    ///
    /// # Errors
    /// The solver refused the data; see [`QpError`].
    pub fn new(arm: &Arm, period: f64, weights: &Weights) -> Result<Compensator, QpError> {
        let n = arm.dof();
        let rows = DMatrix::from_fn(2 * n, n, |row, column| match (row % n == column, row < n) {
            (false, _) => 0.0,
            (true, true) => 1.0,
            (true, false) => -1.0,
        });
        Ok(Compensator {
            qp: Qp::new(&rows)?,
            limits: arm.joints().iter().map(|joint| joint.limits).collect(),
            period,
            row_weights: weights.by_row(n),
            change: weights.change,
            last: vec![0.0; n],
            before: vec![0.0; n],
            weighted: DMatrix::zeros(6, n),
            cost: DMatrix::zeros(n, n),
            linear: vec![0.0; n],
            free: FreeMinimiser::new(n),
            bounds: vec![0.0; 2 * n],
        })
    }

    /// The newest correction Δq, rad (m).
    pub fn correction(&self) -> &[f64] {
        &self.last
    }

    /// The corrections of the last tick and of the one before, rad (m).
    pub(crate) fn past(&self) -> [&[f64]; 2] {
        [&self.last, &self.before]
    }

    /// Advances by one tick to the correction `found`, rad (m), which satisfies the limits.
    pub(crate) fn accept(&mut self, found: &[f64]) {
        self.before.copy_from_slice(&self.last);
        self.last.copy_from_slice(found);
    }

    /// Sets the correction to `at`, at rest.
    pub fn restart(&mut self, at: &[f64]) {
        self.last.copy_from_slice(at);
        self.before.copy_from_slice(at);
    }

    /// Advances by one tick. The function computes the correction for the instant of `desired`, with the tool Jacobian `jacobian` (6×n) and the deviation
    /// `deviation` (linear m, angular rad, base frame). The result is [`Self::correction`].
    pub fn advance(
        &mut self,
        desired: Motion<'_>,
        jacobian: &DMatrix<f64>,
        deviation: &Vector6<f64>,
    ) -> CompensationReport {
        if let Some(joint) = self.fill_bounds(desired) {
            self.hold_braking();
            return CompensationReport { status: CompensationStatus::LimitsConflict(joint), iterations: 0 };
        }
        self.fill_cost(jacobian, deviation);
        let n = self.limits.len();
        let bounds = &self.bounds;
        let kept = |free: &&[f64]| (0..n).all(|i| free[i] <= bounds[i] && -free[i] <= bounds[n + i]);
        if let Some(free) = self.free.find(&self.cost, &self.linear).filter(kept) {
            accept(&mut self.last, &mut self.before, free);
            return CompensationReport { status: CompensationStatus::Free, iterations: 0 };
        }
        let report = self.qp.solve(&self.cost, &self.linear, &self.bounds);
        let iterations = report.iterations;
        if !report.status.is_usable() {
            self.hold_braking();
            return CompensationReport { status: CompensationStatus::Failed(report.status), iterations };
        }
        accept(&mut self.last, &mut self.before, self.qp.solution());
        CompensationReport { status: CompensationStatus::Solved, iterations }
    }

    /// P = JᵀWJ + ρ, q = JᵀW r − ρ Δq₋₁, with ε in the angular rows of W.
    fn fill_cost(&mut self, jacobian: &DMatrix<f64>, deviation: &Vector6<f64>) {
        weighted_normal_matrix(&self.row_weights, jacobian, &mut self.weighted, &mut self.cost);
        for (j, weighted) in self.weighted.column_iter().enumerate() {
            self.cost[(j, j)] += self.change;
            self.linear[j] = MILLI * (weighted.dot(deviation) - self.change * self.last[j]);
        }
    }

    /// Writes each joint's interval into the bounds. Returns the index of the first joint whose interval is empty, if there is one.
    fn fill_bounds(&mut self, desired: Motion<'_>) -> Option<usize> {
        let n = self.limits.len();
        for joint in 0..n {
            let room = CorrectionBounds::of(
                &self.limits[joint],
                [desired.q, desired.v, desired.a].map(|all| all[joint]),
                self.period,
            );
            let (lower, upper) = room.interval(self.last[joint], self.before[joint]);
            // A desired motion of NaN gives bounds of NaN, which count as a conflict, too.
            if lower.is_nan() || upper.is_nan() || lower > upper {
                return Some(joint);
            }
            self.bounds[joint] = MILLI * upper;
            self.bounds[n + joint] = -MILLI * lower;
        }
        None
    }

    /// Brings the correction to rest as fast as the acceleration limits allow, ignoring the desired motion.
    fn hold_braking(&mut self) {
        for (joint, limits) in self.limits.iter().enumerate() {
            let rate = self.last[joint] - self.before[joint];
            let braking = limits.acceleration * self.period * self.period;
            self.before[joint] = self.last[joint];
            self.last[joint] += rate.signum() * (rate.abs() - braking).max(0.0);
        }
    }
}

/// Writes W J and the upper triangle of JᵀWJ; `rows` is the diagonal of W.
pub(crate) fn weighted_normal_matrix(
    rows: &Vector6<f64>,
    jacobian: &DMatrix<f64>,
    weighted: &mut DMatrix<f64>,
    cost: &mut DMatrix<f64>,
) {
    for (mut weighted, column) in weighted.column_iter_mut().zip(jacobian.column_iter()) {
        for row in 0..6 {
            weighted[row] = rows[row] * column[row];
        }
    }
    for (j, weighted) in weighted.column_iter().enumerate() {
        for (i, column) in jacobian.column_iter().enumerate().take(j + 1) {
            cost[(i, j)] = column.dot(&weighted);
        }
    }
}

/// Advances to the correction `found`, mrad (mm).
fn accept(last: &mut [f64], before: &mut [f64], found: &[f64]) {
    before.copy_from_slice(last);
    last.iter_mut().zip(found).for_each(|(last, found)| *last = found / MILLI);
}
