//! Programme of one tick on accelerations: it finds the joint accelerations nearest to the wanted ones within the limits of the drives.
//! They leave the joints able to brake and keep the journals in contact with their bearings.
//!
//! `min ½‖J a − r‖²_W + ε/2 ‖a − a_w‖² + γ/2 ‖s‖²` subject to
//!
//! - torque: `−τ_max ≤ M_r a + h_r ≤ τ_max`, with the friction of drives and contacts in h,
//! - acceleration, speed, position: one interval for each joint, from which it can always brake (Del Prete 2018, IEEE RA-L 3:281):
//!   `|a| ≤ a_max`, `|v + a T| ≤ v_max`, and after the tick the stopping distance with a_max ends within the range,
//! - contact: `−nᵀ b(a) ≥ F_min − s`, for each journal with the normal n (see [`PinForce`]),
//! - turning: `|tᵀ b(a)| ≤ κ (−nᵀ b(a)) + s`, `s ≥ 0`: the force stays within the angle atan κ of the normal, so that it turns no faster
//!   than the normal may turn.
//!
//! If no row is active, the minimiser is the damped least-squares solution, which the programme tries first. It calls the solver only if
//! that solution violates a row (one tick of 107 in a planned passage). Internally, accelerations are in 10 rad/s², torques in shares of
//! their limits, forces in 10 N.

use freeplay_arm::{Arm, Limits};
use freeplay_laws::ArmWithPlay;
use nalgebra::{DMatrix, Vector6};

use crate::compensation::{CompensationReport, CompensationStatus, Motion};
use crate::free_minimiser::FreeMinimiser;
use crate::pin_force::PinForce;
use crate::qp::{Qp, QpError};

/// Internal unit of acceleration, rad/s² (m/s²).
const ACCELERATION: f64 = 10.0;
/// Internal unit of force, N.
const FORCE: f64 = 10.0;
/// Rows of one journal: contact, turning in both directions, and its slack.
const JOURNAL_ROWS: usize = 4;
/// A bound that is never active.
const FAR: f64 = 1e3;

/// Weights of the cost and bounds of the contact rows of an [`AccelerationProgramme`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AccelerationOptions {
    /// W: weights of the tool's linear and angular acceleration.
    pub tool: Vector6<f64>,
    /// ε > 0: weight of the distance to the wanted accelerations of the joints.
    pub joints: f64,
    /// γ > 0: cost of a slack of 10 N relative to accelerations of 10 m/s².
    pub slack: f64,
    /// F_min, N: least force of a bearing on its journal.
    pub least_force: f64,
    /// κ: tangent of the largest angle between the force and the normal.
    pub turning: f64,
}

impl Default for AccelerationOptions {
    fn default() -> AccelerationOptions {
        let tool = Vector6::new(1.0, 1.0, 1.0, 0.01, 0.01, 0.01);
        AccelerationOptions { tool, joints: 0.01, slack: 100.0, least_force: 5.0, turning: 1.0 }
    }
}

/// Wanted accelerations.
pub struct Wanted<'a> {
    /// Jacobian J of the tool, 6×n.
    pub jacobian: &'a DMatrix<f64>,
    /// r: wanted acceleration of the tool minus J̇ v, m/s² and rad/s².
    pub tool: &'a Vector6<f64>,
    /// a_w: wanted accelerations of the joints, rad/s² (m/s²).
    pub joints: &'a [f64],
}

/// The programme of one arm with play.
pub struct AccelerationProgramme {
    qp: Qp,
    pin: PinForce,
    limits: Vec<Limits>,
    period: f64,
    options: AccelerationOptions,
    still: Vec<f64>,
    /// Forces at zero joint acceleration, in the coordinates of the arm with play.
    bias: Vec<f64>,
    weighted: DMatrix<f64>,
    cost: DMatrix<f64>,
    linear: Vec<f64>,
    rows: DMatrix<f64>,
    bounds: Vec<f64>,
    accelerations: Vec<f64>,
    free: FreeMinimiser,
    solution: Vec<f64>,
    multipliers: Vec<f64>,
}

impl AccelerationProgramme {
    /// Creates a programme for `arm`, ticks of `period` seconds, and the weights and bounds in `options`; `with_play` is `arm` with its
    /// plays.
    ///
    /// # Errors
    /// The solver refused the data; see [`QpError`].
    pub fn new(
        arm: &Arm,
        with_play: &ArmWithPlay,
        period: f64,
        options: AccelerationOptions,
    ) -> Result<AccelerationProgramme, QpError> {
        let (n, plays) = (arm.dof(), with_play.plays().len());
        let rows = pattern(n, plays);
        Ok(AccelerationProgramme {
            qp: Qp::new(&rows)?,
            pin: PinForce::new(with_play),
            limits: arm.joints().iter().map(|joint| joint.limits).collect(),
            period,
            options,
            still: vec![0.0; n],
            bias: vec![0.0; with_play.arm().dof()],
            weighted: DMatrix::zeros(6, n),
            cost: DMatrix::zeros(n + plays, n + plays),
            linear: vec![0.0; n + plays],
            bounds: vec![0.0; rows.nrows()],
            multipliers: vec![0.0; rows.nrows()],
            rows,
            accelerations: vec![0.0; n],
            free: FreeMinimiser::new(n + plays),
            solution: vec![0.0; n + plays],
        })
    }

    /// The accelerations of the newest solution, rad/s² (m/s²).
    pub fn accelerations(&self) -> &[f64] {
        &self.accelerations
    }

    /// The multipliers of the rows at the newest solution; see [`Qp::multipliers`]. All are zero if the report says `Free`.
    pub fn multipliers(&self) -> &[f64] {
        &self.multipliers
    }

    /// The rows A and the bounds b of the newest programme, `A x ≤ b`, for checks of a solution.
    pub fn rows(&self) -> (&DMatrix<f64>, &[f64]) {
        (&self.rows, &self.bounds)
    }

    /// The cost P and q of the newest programme.
    pub fn cost(&self) -> (&DMatrix<f64>, &[f64]) {
        (&self.cost, &self.linear)
    }

    /// The newest solution x: accelerations in 10 rad/s², slacks in 10 N.
    pub fn solution(&self) -> &[f64] {
        &self.solution
    }

    /// Solves the programme for the joints at `joints` (its accelerations are ignored) and the journal motion `journals`. `normals` are
    /// the normals of the contacts (two numbers each), and `friction` the torques of drives and contacts on the joints, N·m. The result
    /// is [`Self::accelerations`]; if there is no solution, these are the wanted accelerations, and the report names the cause.
    pub fn solve(
        &mut self,
        joints: Motion<'_>,
        journals: Motion<'_>,
        normals: &[f64],
        friction: &[f64],
        wanted: &Wanted<'_>,
    ) -> CompensationReport {
        let still = Motion { a: &self.still, ..joints };
        self.bias.copy_from_slice(self.pin.forces(still, journals));
        self.accelerations.copy_from_slice(wanted.joints);
        if let Some(joint) = self.fill_intervals(joints) {
            return CompensationReport { status: CompensationStatus::LimitsConflict(joint), iterations: 0 };
        }
        self.fill_forces(normals, friction);
        self.fill_cost(wanted);
        let report = self.minimise();
        if matches!(report.status, CompensationStatus::Free | CompensationStatus::Solved) {
            for (a, solved) in self.accelerations.iter_mut().zip(&self.solution) {
                *a = ACCELERATION * solved;
            }
        }
        report
    }

    /// The minimiser of the filled programme.
    fn minimise(&mut self) -> CompensationReport {
        if let Some(free) = self.free.find(&self.cost, &self.linear)
            && keeps(&self.rows, &self.bounds, free)
        {
            self.solution.copy_from_slice(free);
            self.multipliers.fill(0.0);
            return CompensationReport { status: CompensationStatus::Free, iterations: 0 };
        }
        self.qp.set_rows(&self.rows);
        let report = self.qp.solve(&self.cost, &self.linear, &self.bounds);
        if !report.status.is_usable() {
            let status = CompensationStatus::Failed(report.status);
            return CompensationReport { status, iterations: report.iterations };
        }
        self.solution.copy_from_slice(self.qp.solution());
        self.multipliers.copy_from_slice(self.qp.multipliers());
        CompensationReport { status: CompensationStatus::Solved, iterations: report.iterations }
    }

    /// P = JᵀWJ + ε and q = −JᵀW r − ε a_w, in units of accelerations; γ for the slacks.
    fn fill_cost(&mut self, wanted: &Wanted<'_>) {
        let n = self.limits.len();
        for (mut weighted, column) in self.weighted.column_iter_mut().zip(wanted.jacobian.column_iter()) {
            for row in 0..6 {
                weighted[row] = self.options.tool[row] * column[row];
            }
        }
        for j in 0..n {
            for i in 0..=j {
                self.cost[(i, j)] = wanted.jacobian.column(i).dot(&self.weighted.column(j));
            }
            self.cost[(j, j)] += self.options.joints;
            let pulled = self.weighted.column(j).dot(wanted.tool) + self.options.joints * wanted.joints[j];
            self.linear[j] = -pulled / ACCELERATION;
        }
        for slack in n..self.cost.ncols() {
            self.cost[(slack, slack)] = self.options.slack;
        }
    }

    /// Fills the rows of the joint intervals. Returns the first joint whose interval is empty, if there is one.
    fn fill_intervals(&mut self, joints: Motion<'_>) -> Option<usize> {
        let n = self.limits.len();
        for (joint, limits) in self.limits.iter().enumerate() {
            let (lower, upper) = interval(limits, joints.q[joint], joints.v[joint], self.period);
            if lower.is_nan() || upper.is_nan() || lower > upper {
                return Some(joint);
            }
            self.bounds[2 * n + joint] = (upper / ACCELERATION).min(FAR);
            self.bounds[3 * n + joint] = (-lower / ACCELERATION).min(FAR);
        }
        None
    }

    /// Fills the rows of torques, contacts and turning, whose coefficients depend on the posture.
    fn fill_forces(&mut self, normals: &[f64], friction: &[f64]) {
        let n = self.limits.len();
        self.pin.update_mass();
        let (arm, mass) = (self.pin.arm(), self.pin.mass());
        for (joint, limits) in self.limits.iter().enumerate() {
            let at = arm.joint(joint);
            // A drive without a limit has rows of zeros.
            let share = 1.0 / limits.effort;
            for column in 0..n {
                let torque = ACCELERATION * mass[(at, arm.joint(column))] * share;
                self.rows[(joint, column)] = torque;
                self.rows[(n + joint, column)] = -torque;
            }
            let torque = (self.bias[at] - friction[joint]) * share;
            self.bounds[joint] = 1.0 - torque;
            self.bounds[n + joint] = 1.0 + torque;
        }
        for (index, (play, normal)) in arm.plays().iter().zip(normals.chunks_exact(2)).enumerate() {
            let first = 4 * n + JOURNAL_ROWS * index;
            let (normal, tangent) = ([normal[0], normal[1]], [normal[1], -normal[0]]);
            let turning = |side: f64| [0, 1].map(|i| side * tangent[i] + self.options.turning * normal[i]);
            let rows = [(normal, self.options.least_force), (turning(1.0), 0.0), (turning(-1.0), 0.0)];
            for (row, (direction, least)) in rows.into_iter().enumerate() {
                let along = |of: &dyn Fn(usize) -> f64| {
                    direction[0] * of(play.slides[0]) + direction[1] * of(play.slides[1])
                };
                for column in 0..n {
                    let force = along(&|slide| mass[(slide, arm.joint(column))]);
                    self.rows[(first + row, column)] = ACCELERATION * force / FORCE;
                }
                self.bounds[first + row] = -(least + along(&|slide| self.bias[slide])) / FORCE;
            }
            self.bounds[first + 3] = 0.0;
        }
    }
}

/// Returns true if `x` satisfies the rows A x ≤ b.
fn keeps(rows: &DMatrix<f64>, bounds: &[f64], x: &[f64]) -> bool {
    let along = |row: usize| x.iter().enumerate().map(|(column, x)| rows[(row, column)] * x).sum::<f64>();
    bounds.iter().enumerate().all(|(row, &bound)| along(row) <= bound)
}

/// Sparsity pattern with the rows of torque (upper, lower), interval (upper, lower) and journals: an entry at every position that may be
/// nonzero.
fn pattern(n: usize, plays: usize) -> DMatrix<f64> {
    DMatrix::from_fn(4 * n + JOURNAL_ROWS * plays, n + plays, |row, column| {
        if row < 2 * n {
            return if column < n { 1.0 } else { 0.0 };
        }
        if row < 4 * n {
            let sign = if row < 3 * n { 1.0 } else { -1.0 };
            return if row % n == column { sign } else { 0.0 };
        }
        let (play, kind) = ((row - 4 * n) / JOURNAL_ROWS, (row - 4 * n) % JOURNAL_ROWS);
        match (column < n, kind < 3) {
            (true, true) => 1.0,
            (true, false) => 0.0,
            (false, _) if column - n == play => -1.0,
            (false, _) => 0.0,
        }
    })
}

/// Interval of accelerations of a joint at `q`, `v` that leave it able to brake before its limits of position and speed, rad/s² (m/s²).
fn interval(limits: &Limits, q: f64, v: f64, period: f64) -> (f64, f64) {
    let greatest = |far: f64, q: f64, v: f64| {
        let most = limits.acceleration;
        let speed = (limits.velocity - v) / period;
        let wanted = speed.min(before_the_end(far - q, v, most, period));
        // A joint that is too fast or too far brakes with its full acceleration.
        wanted.clamp(-most, most)
    };
    (-greatest(-limits.lower, -q, -v), greatest(limits.upper, q, v))
}

/// The greatest acceleration for one tick such that braking with `most` then ends within `distance`. With w = v + a T it satisfies `(v +
/// w) T/2 + w²/(2 most) = distance`.
fn before_the_end(distance: f64, v: f64, most: f64, period: f64) -> f64 {
    let left = distance - 0.5 * v * period;
    if most.is_infinite() {
        return (2.0 * left / period - v) / period;
    }
    let root = (0.25 * period * period + 2.0 * left / most).max(0.0).sqrt();
    (most * (root - 0.5 * period) - v) / period
}
