//! The normal equations of a least-squares problem, and their damped solution.
//!
//! # Formula
//! For errors e(w) with Jacobian J = ∂e/∂w: H = JᵀJ (lower triangle only), g = Jᵀe, and the step of Levenberg (1944) and
//! Marquardt (1963) with MATLAB's unscaled damping, Δw = −(JᵀJ + μI)⁻¹ Jᵀe, by Cholesky factorisation (faer, one thread).

use faer::dyn_stack::{MemBuffer, MemStack};
use faer::linalg::cholesky::llt::factor::{LltRegularization, cholesky_in_place, cholesky_in_place_scratch};
use faer::linalg::cholesky::llt::solve::solve_in_place;
use faer::{Mat, MatMut, Par};

/// JᵀJ and Jᵀe, summed over all errors.
#[derive(Debug, Clone)]
pub struct NormalEquations {
    /// JᵀJ; only the lower triangle is meaningful.
    pub(crate) matrix: Mat<f64>,
    /// Jᵀe.
    pub(crate) gradient: Vec<f64>,
}

impl NormalEquations {
    /// Zero equations for `weights` unknowns.
    #[must_use]
    pub fn new(weights: usize) -> Self {
        Self { matrix: Mat::zeros(weights, weights), gradient: vec![0.0; weights] }
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

    /// Adds one error and its derivatives by each unknown: for small problems written by hand.
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
    factor: Mat<f64>,
    memory: MemBuffer,
}

/// JᵀJ + μI is not positive definite in double precision: the damping is too small.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("the damped normal equations are not positive definite")]
pub struct NotPositiveDefinite;

impl DampedSolver {
    /// A solver for `weights` unknowns.
    #[must_use]
    pub fn new(weights: usize) -> Self {
        let needed = cholesky_in_place_scratch::<f64>(weights, Par::Seq, Default::default());
        Self { factor: Mat::zeros(weights, weights), memory: MemBuffer::new(needed) }
    }

    /// Writes Δw = −(JᵀJ + μI)⁻¹ Jᵀe into `step`.
    ///
    /// # Errors
    /// When the damped matrix is not positive definite; `step` is then meaningless.
    pub fn step(
        &mut self,
        equations: &NormalEquations,
        mu: f64,
        step: &mut [f64],
    ) -> Result<(), NotPositiveDefinite> {
        let size = equations.size();
        for j in 0..size {
            let source = &equations.matrix.col_as_slice(j)[j..];
            let column = &mut self.factor.col_as_slice_mut(j)[j..];
            column.copy_from_slice(source);
            column[0] += mu;
        }
        let (stack, par) = (MemStack::new(&mut self.memory), Par::Seq);
        let plain = LltRegularization::default();
        cholesky_in_place(self.factor.as_mut(), plain, par, stack, Default::default())
            .map_err(|_| NotPositiveDefinite)?;
        for (step, gradient) in step.iter_mut().zip(&equations.gradient) {
            *step = -gradient;
        }
        let column = MatMut::from_column_major_slice_mut(step, size, 1);
        solve_in_place(self.factor.as_ref(), column, par, MemStack::new(&mut self.memory));
        Ok(())
    }
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
        // Stacked least squares min |[J; √μ I] Δw + [e; 0]| by singular values: no normal equations.
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
