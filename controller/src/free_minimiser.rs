//! The minimiser of a programme's cost alone. If it satisfies the programme's rows, it is also the minimiser of the programme, and no
//! solver is needed: a Cholesky factorisation of six or seven variables takes a microsecond, an interior-point solve a hundred times
//! that.

use nalgebra::{Cholesky, DMatrix, DVector};

/// Largest entry of P x + q, relative to 1 + ‖q‖, for which x counts as a minimiser of the cost; Clarabel's own tolerance is 1e-8.
const STATIONARY: f64 = 1e-9;

/// Workspace for the minimiser of ½ xᵀP x + qᵀx and for the factor of P.
pub struct FreeMinimiser {
    factor: DMatrix<f64>,
    at: DVector<f64>,
}

impl FreeMinimiser {
    /// Creates a workspace for `variables` variables.
    pub fn new(variables: usize) -> FreeMinimiser {
        FreeMinimiser { factor: DMatrix::zeros(variables, variables), at: DVector::zeros(variables) }
    }

    /// The minimiser for P (`cost`; only its upper triangle is used) and q (`linear`). Returns `None` if P is not positive definite, if
    /// it is too ill-conditioned for a zero gradient, or if an entry is NaN; the solver then names the fault.
    pub fn find(&mut self, cost: &DMatrix<f64>, linear: &[f64]) -> Option<&[f64]> {
        let n = linear.len();
        for column in 0..n {
            for row in column..n {
                self.factor[(row, column)] = cost[(column, row)];
            }
            self.at[column] = -linear[column];
        }
        let Some(factor) = Cholesky::new(std::mem::replace(&mut self.factor, DMatrix::zeros(0, 0))) else {
            // The factorisation consumed the matrix.
            self.factor = DMatrix::zeros(n, n);
            return None;
        };
        factor.solve_mut(&mut self.at);
        self.factor = factor.unpack_dirty();
        let largest = linear.iter().fold(0.0_f64, |most, q| most.max(q.abs()));
        let is_stationary = (0..n).all(|i| {
            let upper = |column: usize| cost[(i.min(column), i.max(column))];
            let slope = (0..n).map(|j| upper(j) * self.at[j]).sum::<f64>() + linear[i];
            slope.abs() <= STATIONARY * (1.0 + largest)
        });
        is_stationary.then_some(self.at.as_slice())
    }
}
