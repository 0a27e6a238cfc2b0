//! Compensation over several ticks at once: the corrections Δq₁ … Δq_N of the joints that cancel the predicted deviations of the coming ticks
//! with small accelerations.
//!
//! `min Σₖ ½‖Jₖ Δqₖ + rₖ‖²_W + ρ/2 ‖Δqₖ − Δqₖ₋₁‖² + α/2 ‖(Δqₖ − 2Δqₖ₋₁ + Δqₖ₋₂)/T²‖²` subject, for every joint and every k, to the
//! limits of [`CorrectionBounds`]: position, speed and acceleration. The controller uses only Δq₁; the rest is the plan behind it. With N = 1
//! and α = 0 the programme equals that of one tick ([`crate::compensation`]).
//!
//! Without limits, and for a constant Jacobian, Δq is −J⁺r through the zero-phase filter 1/(1 + α′ω⁴) (Whittaker 1923, "On a new method of
//! graduation", Proc. Edinburgh Math. Soc. 41); r₁ … r_N give it the future values. P is banded: the block of a tick is coupled with those of
//! the next two. The solver factorises P once a tick. If the minimiser of the cost satisfies all rows, it is the solution
//! ([`HorizonStatus::Free`]). Otherwise [`DualActiveSet`] adds the violated rows, with the same factor.
//!
//! Internal units are mm and mrad.

use std::ops::Range;

use clarabel::algebra::CscMatrix;
use clarabel::qdldl::{QDLDLError, QDLDLFactorisation, QDLDLSettings};
use freeplay_arm::{Arm, Limits};
use nalgebra::{DMatrix, Vector6};
use thiserror::Error;

use crate::compensation::{MILLI, Motion, Weights, weighted_normal_matrix};
use crate::correction_bounds::CorrectionBounds;
use crate::dual_active_set::{Active, ActiveSetFault, DualActiveSet, Row};

/// Most ticks of a horizon.
pub const MOST_TICKS: usize = 60;
/// Largest number of active rows; a tick has time for no more.
const MOST_ROWS: usize = 60;
/// Largest number of changes of the active set.
const MOST_CHANGES: u32 = 100;

/// Errors when a horizon is set up.
#[derive(Debug, Error)]
pub enum HorizonError {
    /// The horizon is empty or too long.
    #[error("a horizon of {0} ticks: give 1 to {MOST_TICKS}")]
    Ticks(usize),
    /// The factorisation refused the sparsity pattern of P.
    #[error("the factorisation refused the horizon: {0}")]
    Refused(#[from] QDLDLError),
}

/// Status of a solve; every outcome has a name.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum HorizonStatus {
    /// No limit is active at any tick: the plan is the minimiser of the cost alone.
    Free,
    /// Limits are active; the plan is the minimiser that satisfies them.
    Solved,
    /// No correction satisfies all limits of this joint (index) at the first tick.
    LimitsConflict(usize),
    /// No plan satisfies all limits.
    Infeasible,
    /// More limits are active than a tick has time for.
    IterationLimit,
    /// P is not positive definite, or contains NaN.
    NumericalFailure,
    /// A deviation or a limit is NaN.
    BadData,
}

impl HorizonStatus {
    /// Returns true if [`Horizon::plan`] is the minimiser of the programme.
    pub fn is_minimiser(self) -> bool {
        matches!(self, HorizonStatus::Free | HorizonStatus::Solved)
    }
}

impl From<ActiveSetFault> for HorizonStatus {
    fn from(fault: ActiveSetFault) -> HorizonStatus {
        match fault {
            ActiveSetFault::Infeasible => HorizonStatus::Infeasible,
            ActiveSetFault::Limit => HorizonStatus::IterationLimit,
            ActiveSetFault::NotFinite => HorizonStatus::BadData,
        }
    }
}

/// Result of one solve.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct HorizonReport {
    /// Status.
    pub status: HorizonStatus,
    /// Number of changes of the active set; 0 if no limit is active.
    pub iterations: u32,
}

/// Data of one tick of the horizon.
struct Instant {
    jacobian: DMatrix<f64>,
    /// W J and JᵀWJ.
    weighted: DMatrix<f64>,
    cost: DMatrix<f64>,
    /// The predicted deviation, and r, the part of it to compensate; m and rad.
    deviation: Vector6<f64>,
    target: Vector6<f64>,
    rooms: Vec<CorrectionBounds>,
}

impl Instant {
    fn new(n: usize) -> Instant {
        Instant {
            jacobian: DMatrix::zeros(6, n),
            weighted: DMatrix::zeros(6, n),
            cost: DMatrix::zeros(n, n),
            deviation: Vector6::zeros(),
            target: Vector6::zeros(),
            rooms: vec![CorrectionBounds::NONE; n],
        }
    }
}

/// The programme of one arm over a fixed number of ticks.
pub struct Horizon {
    limits: Vec<Limits>,
    period: f64,
    row_weights: Vector6<f64>,
    /// ρ, and α/T⁴ in 1/mrad².
    change: f64,
    acceleration_weight: f64,
    /// The ticks ahead: the first is that of Δq₁.
    instants: Vec<Instant>,
    /// Tick of the last instant, if all are known.
    newest: Option<u64>,
    factor: QDLDLFactorisation<f64>,
    /// The upper triangle of P, in the order of [`pattern`], and the indices of its entries in the factorisation.
    packed: Vec<f64>,
    places: Vec<usize>,
    rows: Vec<Row>,
    active_set: DualActiveSet,
    /// Δq₁ … Δq_N.
    plan: Vec<f64>,
}

impl Horizon {
    /// Creates a horizon of `ticks` ticks of `period` seconds for `arm` with its limits.
    ///
    /// # Errors
    /// See [`HorizonError`].
    pub fn new(arm: &Arm, period: f64, weights: &Weights, ticks: usize) -> Result<Horizon, HorizonError> {
        if !(1..=MOST_TICKS).contains(&ticks) {
            return Err(HorizonError::Ticks(ticks));
        }
        let n = arm.dof();
        let (starts, row_of) = pattern(n, ticks);
        let entries = row_of.len();
        let matrix = CscMatrix::new(n * ticks, n * ticks, starts, row_of, vec![1.0; entries]);
        // In chronological order P is banded, and its factor is banded, too.
        let settings = QDLDLSettings {
            perm: Some((0..n * ticks).collect()),
            logical: true,
            regularize_enable: false,
            ..QDLDLSettings::default()
        };
        Ok(Horizon {
            limits: arm.joints().iter().map(|joint| joint.limits).collect(),
            period,
            row_weights: weights.by_row(n),
            change: weights.change,
            acceleration_weight: weights.acceleration / (MILLI * period * period).powi(2),
            instants: (0..ticks).map(|_| Instant::new(n)).collect(),
            newest: None,
            factor: QDLDLFactorisation::new(&matrix, Some(settings))?,
            packed: vec![0.0; entries],
            places: (0..entries).collect(),
            rows: rows(n, ticks),
            active_set: DualActiveSet::new(n * ticks, MOST_ROWS, MOST_CHANGES),
            plan: vec![0.0; n * ticks],
        })
    }

    /// The ticks to push, in order, before Δq₁ is the correction at the tick `first`. It is one tick if the last solve was for the tick
    /// before.
    pub fn missing(&self, first: u64) -> Range<u64> {
        let end = first.saturating_add(self.instants.len() as u64);
        match self.newest {
            Some(newest) if newest >= first && newest < end => newest + 1..end,
            _ => first..end,
        }
    }

    /// Adds the data of `tick`, which follows the last one: the `desired` motion, the Jacobian of the tool (6×n) and the predicted deviation
    /// (linear m, angular rad, base frame).
    pub fn push(
        &mut self,
        tick: u64,
        desired: Motion<'_>,
        jacobian: &DMatrix<f64>,
        deviation: &Vector6<f64>,
    ) {
        self.instants.rotate_left(1);
        let Some(instant) = self.instants.last_mut() else { return };
        instant.jacobian.copy_from(jacobian);
        (instant.deviation, instant.target) = (*deviation, *deviation);
        weighted_normal_matrix(&self.row_weights, jacobian, &mut instant.weighted, &mut instant.cost);
        for (joint, (room, limits)) in instant.rooms.iter_mut().zip(&self.limits).enumerate() {
            *room = CorrectionBounds::of(
                limits,
                [desired.q, desired.v, desired.a].map(|all| all[joint]),
                self.period,
            );
        }
        self.newest = Some(tick);
    }

    /// Sets the deviation r to compensate at each tick. `target` computes it from the index of the tick (0 is that of Δq₁), its Jacobian and
    /// its predicted deviation. Without this call, r is the predicted deviation.
    pub fn aim(&mut self, mut target: impl FnMut(usize, &DMatrix<f64>, &Vector6<f64>) -> Vector6<f64>) {
        for (k, instant) in self.instants.iter_mut().enumerate() {
            instant.target = target(k, &instant.jacobian, &instant.deviation);
        }
    }

    /// The correction Δq₁ of the last solve, rad (m).
    pub fn correction(&self) -> &[f64] {
        &self.plan[..self.limits.len()]
    }

    /// Δq₁ … Δq_N, one after the other, rad (m). They are valid if the status was that of a minimiser.
    pub fn plan(&self) -> &[f64] {
        &self.plan
    }

    /// The active limits with their multipliers; indices in the order of [`Self::plan`], values in mrad (mm).
    pub fn active(&self) -> impl Iterator<Item = (&Row, &Active)> {
        self.active_set.active().iter().map(|active| (&self.rows[active.row], active))
    }

    /// Solves the programme. Δq₀ = `last` and Δq₋₁ = `before` are the corrections of the last tick and of the one before, rad (m).
    pub fn solve(&mut self, last: &[f64], before: &[f64]) -> HorizonReport {
        self.active_set.clear();
        let ended = self.minimise(last, before);
        self.plan.iter_mut().for_each(|correction| *correction /= MILLI);
        let iterations = self.active_set.changes();
        let status = match ended {
            Err(status) => status,
            Ok(()) if iterations == 0 => HorizonStatus::Free,
            Ok(()) => HorizonStatus::Solved,
        };
        HorizonReport { status, iterations }
    }

    fn minimise(&mut self, last: &[f64], before: &[f64]) -> Result<(), HorizonStatus> {
        self.fill_rows(last, before)?;
        self.fill_cost();
        self.fill_linear(last, before);
        self.factor.update_values(&self.places, &self.packed);
        self.factor.refactor().map_err(|_| HorizonStatus::NumericalFailure)?;
        if self.factor.positive_inertia() < self.plan.len() {
            return Err(HorizonStatus::NumericalFailure);
        }
        let factor = &mut self.factor;
        factor.solve(&mut self.plan);
        Ok(self.active_set.minimise(&self.rows, |vector| factor.solve(vector), &mut self.plan)?)
    }

    /// The upper triangle of P in the order of [`pattern`].
    fn fill_cost(&mut self) {
        let (n, ticks) = (self.limits.len(), self.instants.len());
        let mut packed = self.packed.iter_mut();
        let mut put = |value: f64| packed.next().into_iter().for_each(|slot| *slot = value);
        for (k, instant) in self.instants.iter().enumerate() {
            // Number of acceleration and change terms of later ticks that contain this tick, at most two.
            let after = (ticks - 1 - k).min(2) as f64;
            let (next, second) = (after.min(1.0), (after - 1.0).max(0.0));
            for j in 0..n {
                if k > 1 {
                    put(self.acceleration_weight);
                }
                if k > 0 {
                    put(-2.0 * self.acceleration_weight * (1.0 + next) - self.change);
                }
                for i in 0..j {
                    put(instant.cost[(i, j)]);
                }
                let own = self.acceleration_weight * (1.0 + 4.0 * next + second) + self.change * (1.0 + next);
                put(instant.cost[(j, j)] + own);
            }
        }
    }

    /// Writes −q into the buffer of the plan.
    fn fill_linear(&mut self, last: &[f64], before: &[f64]) {
        let (n, ticks) = (self.limits.len(), self.instants.len());
        for (k, instant) in self.instants.iter().enumerate() {
            for (j, weighted) in instant.weighted.column_iter().enumerate() {
                self.plan[k * n + j] = -MILLI * weighted.dot(&instant.target);
            }
        }
        for j in 0..n {
            let (last, before) = (MILLI * last[j], MILLI * before[j]);
            self.plan[j] += self.change * last + self.acceleration_weight * (2.0 * last - before);
            if ticks > 1 {
                self.plan[j] += 2.0 * self.acceleration_weight * last;
                self.plan[n + j] -= self.acceleration_weight * last;
            }
        }
    }

    /// The bounds of the rows, in the order of [`rows`].
    fn fill_rows(&mut self, last: &[f64], before: &[f64]) -> Result<(), HorizonStatus> {
        let mut rows = self.rows.iter_mut();
        let mut next = |bounds: [f64; 2]| {
            rows.next()
                .into_iter()
                .for_each(|row| [row.lower, row.upper] = bounds.map(|bound| MILLI * bound));
        };
        for (k, instant) in self.instants.iter().enumerate() {
            for (joint, room) in instant.rooms.iter().enumerate() {
                if k == 0 {
                    let (lower, upper) = room.interval(last[joint], before[joint]);
                    if lower.is_nan() || upper.is_nan() || lower > upper {
                        return Err(HorizonStatus::LimitsConflict(joint));
                    }
                    next([lower, upper]);
                    continue;
                }
                let known = if k == 1 { last[joint] } else { 0.0 };
                next(room.place);
                next([-room.change, room.change]);
                next(room.second_difference.map(|bound| bound - known));
            }
        }
        Ok(())
    }
}

/// The sparsity pattern of P's upper triangle as compressed columns. Each variable is coupled with the same joint two ticks and one tick
/// before, and with the joints of the same tick.
fn pattern(n: usize, ticks: usize) -> (Vec<usize>, Vec<usize>) {
    let (mut starts, mut row_of) = (vec![0], Vec::new());
    for k in 0..ticks {
        for j in 0..n {
            if k >= 2 {
                row_of.push((k - 2) * n + j);
            }
            if k >= 1 {
                row_of.push((k - 1) * n + j);
            }
            row_of.extend(k * n..=k * n + j);
            starts.push(row_of.len());
        }
    }
    (starts, row_of)
}

/// The rows without their bounds: one interval a joint for the first tick; position, change and second difference for the others.
fn rows(n: usize, ticks: usize) -> Vec<Row> {
    let mut rows = Vec::new();
    for k in 0..ticks {
        for j in 0..n {
            let at = |back: usize| k.saturating_sub(back) * n + j;
            let places = [at(0), at(1), at(2)];
            let mut row = |factors: [f64; 3]| rows.push(Row { places, factors, lower: 0.0, upper: 0.0 });
            row([1.0, 0.0, 0.0]);
            if k > 0 {
                row([1.0, -1.0, 0.0]);
                row([1.0, -2.0, if k > 1 { 1.0 } else { 0.0 }]);
            }
        }
    }
    rows
}
