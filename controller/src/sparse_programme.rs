//! A sparse quadratic programme, assembled entry by entry and solved once by Clarabel. It serves plans made before a run; it
//! allocates.
//!
//! `min ½ xᵀP x + qᵀx  subject to  E x = f,  A x ≤ b`, with P symmetric positive semi-definite.

use std::collections::BTreeMap;

use clarabel::algebra::CscMatrix;
use clarabel::solver::{DefaultSettings, DefaultSolver, IPSolver, SupportedConeT};

use crate::qp::{QpError, QpStatus};

/// Most iterations of one solve.
const MAX_ITERATIONS: u32 = 50;

/// Tolerance of the solution; it may be coarse, because the programmes are steps of an iteration.
const TOLERANCE: f64 = 1e-6;

/// One row: coefficients by variable, and the right-hand side.
#[derive(Clone, Debug, Default)]
pub struct Row {
    /// Coefficients; entries of the same variable add up.
    pub entries: Vec<(usize, f64)>,
    /// The right-hand side.
    pub bound: f64,
}

/// A programme during its assembly.
#[derive(Clone, Debug)]
pub struct SparseProgramme {
    /// Upper triangle of P by (column, row).
    cost: BTreeMap<(usize, usize), f64>,
    linear: Vec<f64>,
    equalities: Vec<Row>,
    inequalities: Vec<Row>,
}

impl SparseProgramme {
    /// Creates a programme of `variables` variables without cost or rows.
    pub fn new(variables: usize) -> SparseProgramme {
        SparseProgramme {
            cost: BTreeMap::new(),
            linear: vec![0.0; variables],
            equalities: Vec::new(),
            inequalities: Vec::new(),
        }
    }

    /// Adds `weight`/2 (residual + Σ entries · x)² to the cost.
    pub fn add_square(&mut self, weight: f64, residual: f64, entries: &[(usize, f64)]) {
        for (index, &(i, first)) in entries.iter().enumerate() {
            self.linear[i] += weight * residual * first;
            for &(j, second) in &entries[index..] {
                *self.cost.entry((i.max(j), i.min(j))).or_insert(0.0) += weight * first * second;
            }
        }
    }

    /// Adds `slope` · x to the cost of one `variable`.
    pub fn add_linear(&mut self, variable: usize, slope: f64) {
        self.linear[variable] += slope;
    }

    /// Adds the constraint Σ entries · x = bound.
    pub fn equal(&mut self, row: Row) {
        self.equalities.push(row);
    }

    /// Adds the constraint Σ entries · x ≤ bound.
    pub fn at_most(&mut self, row: Row) {
        self.inequalities.push(row);
    }

    /// The minimiser.
    ///
    /// # Errors
    /// `Ok(Err(status))` gives the status of a solve without a minimiser; `Err` means that Clarabel refused the data.
    pub fn solve(self) -> Result<Result<Vec<f64>, QpStatus>, QpError> {
        let n = self.linear.len();
        let cones = [
            SupportedConeT::ZeroConeT(self.equalities.len()),
            SupportedConeT::NonnegativeConeT(self.inequalities.len()),
        ];
        let (mut places, mut bounds) = (BTreeMap::new(), Vec::new());
        for (index, row) in self.equalities.iter().chain(&self.inequalities).enumerate() {
            for &(column, value) in &row.entries {
                *places.entry((column, index)).or_insert(0.0) += value;
            }
            bounds.push(row.bound);
        }
        let all = [self.linear.as_slice(), &bounds].concat();
        let values = self.cost.values().chain(places.values()).chain(&all);
        if !values.copied().all(f64::is_finite) {
            return Ok(Err(QpStatus::BadData));
        }
        let settings = DefaultSettings {
            verbose: false,
            max_iter: MAX_ITERATIONS,
            tol_gap_abs: TOLERANCE,
            tol_gap_rel: TOLERANCE,
            tol_feas: TOLERANCE,
            ..DefaultSettings::default()
        };
        let (cost, rows) = (compressed(n, n, &self.cost), compressed(bounds.len(), n, &places));
        let mut solver = DefaultSolver::new(&cost, &self.linear, &rows, &bounds, &cones, settings)?;
        solver.solve();
        let status = QpStatus::from(solver.solution.status);
        Ok(if status.is_usable() { Ok(solver.solution.x) } else { Err(status) })
    }
}

/// Entries by (column, row) as compressed columns.
fn compressed(rows: usize, columns: usize, entries: &BTreeMap<(usize, usize), f64>) -> CscMatrix<f64> {
    let mut starts = vec![0; columns + 1];
    for &(column, _) in entries.keys() {
        starts[column + 1] += 1;
    }
    for column in 0..columns {
        starts[column + 1] += starts[column];
    }
    let row_of = entries.keys().map(|&(_, row)| row).collect();
    CscMatrix::new(rows, columns, starts, row_of, entries.values().copied().collect())
}
