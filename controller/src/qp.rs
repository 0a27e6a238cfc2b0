//! A small dense quadratic programme of fixed size, solved again every tick by Clarabel.
//!
//! `min ½ xᵀP x + qᵀx  subject to  A x ≤ b`, with P symmetric positive semi-definite. The sparsity pattern of A is fixed at
//! construction; P, q, b (and optionally the entries of A) are new for every solve. The solver is built once, and each solve
//! overwrites its data in place.
//!
//! Settings and their reasons (Clarabel 0.11): presolve is off, because otherwise the data could not be updated; iterative refinement
//! is off, which saves most time at this size; the limit is on the iterations instead of the time, because Clarabel's clock
//! accumulates over updates (its issue 233). Scale the problem so that variables and rows are of the order of one (mm, mrad).

use clarabel::algebra::CscMatrix;
use clarabel::solver::{DefaultSettings, DefaultSolver, IPSolver, SolverError, SolverStatus, SupportedConeT};
use nalgebra::DMatrix;
use thiserror::Error;

/// Most iterations of one solve; a programme of this size takes about ten.
pub const MAX_ITERATIONS: u32 = 25;

/// Errors when a programme is set up.
#[derive(Debug, Error)]
pub enum QpError {
    /// No variable or no row.
    #[error("a quadratic programme needs at least one variable and one row, not {variables} and {rows}")]
    Empty {
        /// Requested number of variables.
        variables: usize,
        /// Requested number of rows.
        rows: usize,
    },
    /// A coefficient of A is not a finite number.
    #[error("the coefficient of row {row}, variable {variable} is {value}, not a finite number")]
    NotFinite {
        /// Row of the coefficient.
        row: usize,
        /// Variable of the coefficient.
        variable: usize,
        /// Value of the coefficient.
        value: f64,
    },
    /// Clarabel refused the problem.
    #[error("the solver refused the problem: {0}")]
    Refused(#[from] SolverError),
}

/// Status of a solve; every outcome has a name.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum QpStatus {
    /// Solved to the full tolerance (1e-8).
    Solved,
    /// Solved to the reduced tolerance only (1e-4).
    AlmostSolved,
    /// No point satisfies all rows.
    Infeasible,
    /// The cost has no lower bound.
    Unbounded,
    /// [`MAX_ITERATIONS`] were not enough.
    IterationLimit,
    /// The factorisation failed or the steps became too short.
    NumericalFailure,
    /// P, q or b has an entry that is not finite; the solver was not called.
    BadData,
}

impl QpStatus {
    /// Returns true if [`Qp::solution`] is the minimiser, to at least the reduced tolerance.
    pub fn is_usable(self) -> bool {
        matches!(self, QpStatus::Solved | QpStatus::AlmostSolved)
    }
}

impl From<SolverStatus> for QpStatus {
    fn from(status: SolverStatus) -> QpStatus {
        match status {
            SolverStatus::Solved => QpStatus::Solved,
            SolverStatus::AlmostSolved => QpStatus::AlmostSolved,
            SolverStatus::PrimalInfeasible | SolverStatus::AlmostPrimalInfeasible => QpStatus::Infeasible,
            SolverStatus::DualInfeasible | SolverStatus::AlmostDualInfeasible => QpStatus::Unbounded,
            SolverStatus::MaxIterations | SolverStatus::MaxTime => QpStatus::IterationLimit,
            SolverStatus::NumericalError
            | SolverStatus::InsufficientProgress
            | SolverStatus::Unsolved
            | SolverStatus::CallbackTerminated => QpStatus::NumericalFailure,
        }
    }
}

/// Result of one solve.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct QpReport {
    /// Status of the solve.
    pub status: QpStatus,
    /// Iterations of the interior-point method.
    pub iterations: u32,
}

/// A programme with fixed sizes, and buffers for the data of the next solve.
pub struct Qp {
    solver: DefaultSolver<f64>,
    variables: usize,
    /// Upper triangle of P, column after column: the order of Clarabel's compressed columns.
    packed: Vec<f64>,
    linear: Vec<f64>,
    bounds: Vec<f64>,
    /// Row and column of each entry of A, column after column, and their values.
    pattern: Vec<(usize, usize)>,
    entries: Vec<f64>,
    rows_are_new: bool,
}

impl Qp {
    /// Sets up the programme with the rows A (m×n) and, until the first solve, P = 1, q = 0, b = 1.
    ///
    /// # Errors
    /// A without rows or columns, a coefficient that is not finite, or an error of Clarabel.
    pub fn new(rows: &DMatrix<f64>) -> Result<Qp, QpError> {
        let (m, n) = rows.shape();
        if m == 0 || n == 0 {
            return Err(QpError::Empty { variables: n, rows: m });
        }
        for variable in 0..n {
            for row in 0..m {
                let value = rows[(row, variable)];
                if !value.is_finite() {
                    return Err(QpError::NotFinite { row, variable, value });
                }
            }
        }
        let packed = packed_identity(n);
        let (linear, bounds) = (vec![0.0; n], vec![1.0; m]);
        let solver = DefaultSolver::new(
            &upper_triangle(n, &packed),
            &linear,
            &compressed(rows),
            &bounds,
            &[SupportedConeT::NonnegativeConeT(m)],
            settings(),
        )?;
        let pattern = pattern(rows);
        let entries = pattern.iter().map(|&at| rows[at]).collect();
        Ok(Qp { solver, variables: n, packed, linear, bounds, pattern, entries, rows_are_new: false })
    }

    /// Overwrites the rows A (m×n). An entry that was zero at construction stays zero.
    ///
    /// # Panics
    /// If the shape differs from that of the programme: a mistake of the caller that the first call reveals.
    pub fn set_rows(&mut self, rows: &DMatrix<f64>) {
        assert_eq!(rows.shape(), (self.bounds.len(), self.variables), "shape of A");
        for (slot, &(row, column)) in self.entries.iter_mut().zip(&self.pattern) {
            *slot = rows[(row, column)];
        }
        self.rows_are_new = true;
    }

    /// Number of variables n.
    pub fn variables(&self) -> usize {
        self.variables
    }

    /// Number of rows m.
    pub fn rows(&self) -> usize {
        self.bounds.len()
    }

    /// Solves the programme with the cost P (n×n; only its upper triangle is used) and `linear` q (n), and the right-hand sides
    /// `bounds` b (m).
    ///
    /// # Panics
    /// If a shape differs from that of the programme: a mistake of the caller that the first call reveals.
    pub fn solve(&mut self, cost: &DMatrix<f64>, linear: &[f64], bounds: &[f64]) -> QpReport {
        assert_eq!(cost.shape(), (self.variables, self.variables), "shape of P");
        let mut next = 0;
        for column in 0..self.variables {
            for row in 0..=column {
                self.packed[next] = cost[(row, column)];
                next += 1;
            }
        }
        self.linear.copy_from_slice(linear);
        self.bounds.copy_from_slice(bounds);
        let finite = |values: &[f64]| values.iter().all(|value| value.is_finite());
        let data = [&self.packed, &self.linear, &self.bounds, &self.entries];
        if !data.into_iter().all(|values| finite(values)) {
            return QpReport { status: QpStatus::BadData, iterations: 0 };
        }
        let mut updated = self
            .solver
            .update_P(&self.packed)
            .and_then(|()| self.solver.update_q(&self.linear))
            .and_then(|()| self.solver.update_b(&self.bounds));
        if std::mem::take(&mut self.rows_are_new) {
            updated = updated.and_then(|()| self.solver.update_A(&self.entries));
        }
        updated.expect("presolve is off and the pattern never changes, so data can always be updated");
        self.solver.solve();
        QpReport { status: self.solver.solution.status.into(), iterations: self.solver.solution.iterations }
    }

    /// The minimiser x of the last solve, if its status was usable.
    pub fn solution(&self) -> &[f64] {
        &self.solver.solution.x
    }

    /// The multipliers z ≥ 0 of the rows: `P x + q + Aᵀz = 0` and `zᵢ (b − A x)ᵢ = 0` at the minimiser.
    pub fn multipliers(&self) -> &[f64] {
        &self.solver.solution.z
    }
}

fn settings() -> DefaultSettings<f64> {
    DefaultSettings {
        verbose: false,
        max_iter: MAX_ITERATIONS,
        presolve_enable: false,
        iterative_refinement_enable: false,
        input_sparse_dropzeros: false,
        ..DefaultSettings::default()
    }
}

fn packed_identity(n: usize) -> Vec<f64> {
    (0..n).flat_map(|column| (0..=column).map(move |row| if row == column { 1.0 } else { 0.0 })).collect()
}

/// The full upper triangle as compressed columns; zero entries stay in the pattern.
fn upper_triangle(n: usize, packed: &[f64]) -> CscMatrix<f64> {
    let starts = (0..=n).map(|column| column * (column + 1) / 2).collect();
    let row_of = (0..n).flat_map(|column| 0..=column).collect();
    CscMatrix::new(n, n, starts, row_of, packed.to_vec())
}

/// Row and column of each nonzero entry, column after column: the order of Clarabel's compressed columns.
fn pattern(dense: &DMatrix<f64>) -> Vec<(usize, usize)> {
    let (rows, columns) = dense.shape();
    let all = (0..columns).flat_map(|column| (0..rows).map(move |row| (row, column)));
    all.filter(|&at| dense[at] != 0.0).collect()
}

/// A dense matrix as compressed columns, without its zeros.
fn compressed(dense: &DMatrix<f64>) -> CscMatrix<f64> {
    let (mut starts, mut row_of, mut values) = (vec![0], Vec::new(), Vec::new());
    for column in dense.column_iter() {
        for (row, &value) in column.iter().enumerate() {
            if value != 0.0 {
                row_of.push(row);
                values.push(value);
            }
        }
        starts.push(values.len());
    }
    CscMatrix::new(dense.nrows(), dense.ncols(), starts, row_of, values)
}
