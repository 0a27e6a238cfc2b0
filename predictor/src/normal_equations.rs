//! The normal equations of a least-squares problem, and their damped solution.
//!
//! # Formula
//! For errors e(w) with Jacobian J = ∂e/∂w: H = JᵀJ (lower triangle only), g = Jᵀe, and the step of Levenberg (1944) and
//! Marquardt (1963) with MATLAB's unscaled damping, Δw = −(JᵀJ + μI)⁻¹ Jᵀe, by Cholesky factorisation (block by block, on one thread).

use crate::columns::{column, column_mut};
use nalgebra::{DMatrix, DVectorViewMut};

/// Columns of a block of the factorisation: enough for an efficient matrix product, and few enough that the column-by-column
/// factorisation of a block takes little time.
const BLOCK: usize = 32;

/// JᵀJ and Jᵀe, summed over all errors.
#[derive(Debug, Clone)]
pub struct NormalEquations {
    /// JᵀJ; only the lower triangle is valid.
    pub(crate) matrix: DMatrix<f64>,
    /// Jᵀe.
    pub(crate) gradient: Vec<f64>,
}

impl NormalEquations {
    /// Zero equations for `weights` unknowns.
    #[must_use]
    pub fn new(weights: usize) -> Self {
        Self { matrix: DMatrix::zeros(weights, weights), gradient: vec![0.0; weights] }
    }

    /// Number of unknowns.
    #[must_use]
    pub fn size(&self) -> usize {
        self.gradient.len()
    }

    /// Sets everything to zero.
    pub fn clear(&mut self) {
        self.matrix.fill(0.0);
        self.gradient.fill(0.0);
    }

    /// Adds one error and its derivatives with respect to each unknown; for small problems written by hand.
    pub fn add_row(&mut self, error: f64, jacobian: &[f64]) {
        for (j, &right) in jacobian.iter().enumerate() {
            self.gradient[j] += right * error;
            for (i, &left) in jacobian.iter().enumerate().skip(j) {
                self.matrix[(i, j)] += left * right;
            }
        }
    }

    /// Jᵀe.
    #[must_use]
    pub fn gradient(&self) -> &[f64] {
        &self.gradient
    }

    /// Element of JᵀJ.
    #[must_use]
    pub fn element(&self, row: usize, column: usize) -> f64 {
        self.matrix[(row.max(column), row.min(column))]
    }
}

/// Working memory for [`DampedSolver::step`].
pub struct DampedSolver {
    factor: DMatrix<f64>,
}

/// JᵀJ + μI is not positive definite in double precision: the damping is too small.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("the damped normal equations are not positive definite")]
pub struct NotPositiveDefinite;

impl DampedSolver {
    /// Creates a solver for `weights` unknowns.
    #[must_use]
    pub fn new(weights: usize) -> Self {
        Self { factor: DMatrix::zeros(weights, weights) }
    }

    /// Writes Δw = −(JᵀJ + μI)⁻¹ Jᵀe into `step`.
    ///
    /// # Errors
    /// If the damped matrix is not positive definite; `step` is then invalid.
    pub fn step(
        &mut self,
        equations: &NormalEquations,
        mu: f64,
        step: &mut [f64],
    ) -> Result<(), NotPositiveDefinite> {
        let size = equations.size();
        for j in 0..size {
            let source = &column(&equations.matrix, j)[j..];
            let target = &mut column_mut(&mut self.factor, j)[j..];
            target.copy_from_slice(source);
            target[0] += mu;
        }
        factorise(&mut self.factor)?;
        for (step, gradient) in step.iter_mut().zip(&equations.gradient) {
            *step = -gradient;
        }
        let mut step = DVectorViewMut::from_slice(step, size);
        let solved = self.factor.solve_lower_triangular_mut(&mut step)
            && self.factor.tr_solve_lower_triangular_mut(&mut step);
        if solved { Ok(()) } else { Err(NotPositiveDefinite) }
    }
}

/// Replaces the lower triangle of A by its Cholesky factor L, A = L Lᵀ; the part above the diagonal is invalid.
///
/// nalgebra's own factorisation goes column by column through the whole matrix, which takes several times as long for the 773 weights
/// of the usual network. Here one matrix product subtracts the contribution of the columns to the left from a block of columns; only
/// the block itself is then factored column by column (G. H. Golub, C. F. Van Loan, "Matrix Computations", 4th edition, 2013, section
/// 4.2.5).
fn factorise(matrix: &mut DMatrix<f64>) -> Result<(), NotPositiveDefinite> {
    let size = matrix.nrows();
    for start in (0..size).step_by(BLOCK) {
        let (height, width) = (size - start, BLOCK.min(size - start));
        let (left, mut right) = matrix.columns_range_pair_mut(..start, start..);
        let left = left.rows(start, height);
        let mut block = right.view_mut((start, 0), (height, width));
        block.gemm(-1.0, &left, &left.rows(0, width).transpose(), 1.0);
        for j in 0..width {
            let (known, mut rest) = block.columns_range_pair_mut(..j, j..);
            let mut column = rest.column_mut(0);
            let mut column = column.rows_mut(j, height - j);
            for done in known.column_iter() {
                column.axpy(-done[j], &done.rows(j, height - j), 1.0);
            }
            let pivot = column[0];
            if !(pivot > 0.0 && pivot.is_finite()) {
                return Err(NotPositiveDefinite);
            }
            column /= pivot.sqrt();
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{DMatrix, DVector};
    use rand::{RngExt, SeedableRng};

    #[test]
    fn the_step_equals_an_independent_factorisation() {
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(11);
        let (rows, size, mu) = (90, 40, 0.3);
        let jacobian = DMatrix::from_fn(rows, size, |_, _| rng.random_range(-1.0..1.0));
        let error = DVector::from_fn(rows, |_, _| rng.random_range(-1.0..1.0));
        let mut equations = NormalEquations::new(size);
        for i in 0..rows {
            let row: Vec<f64> = jacobian.row(i).iter().copied().collect();
            equations.add_row(error[i], &row);
        }
        let mut step = vec![0.0; size];
        DampedSolver::new(size).step(&equations, mu, &mut step).unwrap();
        // Stacked least squares min |[J; √μ I] Δw + [e; 0]| by singular values, without normal equations.
        let mut stacked = DMatrix::zeros(rows + size, size);
        stacked.rows_mut(0, rows).copy_from(&jacobian);
        stacked.rows_mut(rows, size).copy_from(&(DMatrix::identity(size, size) * mu.sqrt()));
        let mut right = DVector::zeros(rows + size);
        right.rows_mut(0, rows).copy_from(&-error);
        let expected = stacked.svd(true, true).solve(&right, 0.0).unwrap();
        let worst = expected.iter().zip(&step).fold(0.0_f64, |m, (a, b)| m.max((a - b).abs()));
        eprintln!("largest difference {worst:.1e} of steps up to {:.1e}", expected.amax());
        assert!(expected.amax() > 1.0e-2 && worst < 1.0e-12);
    }

    #[test]
    fn an_indefinite_matrix_is_reported() {
        let mut equations = NormalEquations::new(2);
        equations.add_row(1.0, &[1.0, 1.0]);
        let mut solver = DampedSolver::new(2);
        let mut step = [0.0; 2];
        assert_eq!(solver.step(&equations, 0.0, &mut step), Err(NotPositiveDefinite));
        assert!(solver.step(&equations, 1.0e-3, &mut step).is_ok());
        equations.add_row(f64::NAN, &[f64::NAN, 1.0]);
        assert_eq!(solver.step(&equations, 1.0, &mut step), Err(NotPositiveDefinite));
    }
}
