//! Least squares with some coefficients inside bounds.

use nalgebra::{Cholesky, DMatrix, DVector, Dyn};

/// The least of ηᵀNη − 2bᵀη with some η inside their bounds.
pub(crate) struct Bounded {
    /// Numbers of those that are not held at a bound.
    pub free: Vec<usize>,
    /// The factor of their part of N.
    pub factor: Cholesky<f64, Dyn>,
    /// The coefficients.
    pub eta: DVector<f64>,
    /// By how much it is below zero.
    pub fall: f64,
}

/// Solves `normal` η = `right`; what goes beyond its limits is held there, and the rest is solved again.
pub(crate) fn bounded(normal: &DMatrix<f64>, right: &DVector<f64>, limits: &[[f64; 2]]) -> Option<Bounded> {
    let n = limits.len();
    let mut free: Vec<usize> = (0..n).collect();
    let mut eta = DVector::zeros(n);
    loop {
        let m = free.len();
        let held: Vec<usize> = (0..n).filter(|k| !free.contains(k)).collect();
        let part = DMatrix::from_fn(m, m, |i, j| normal[(free[i], free[j])]);
        let pull = |i: usize| held.iter().map(|&k| normal[(free[i], k)] * eta[k]).sum::<f64>();
        let factor = Cholesky::new(part)?;
        let solved = factor.solve(&DVector::from_fn(m, |i, _| right[free[i]] - pull(i)));
        free.iter().zip(solved.iter()).for_each(|(&k, x)| eta[k] = *x);
        let is_beyond = |k: &usize| {
            let [least, most] = limits[*k];
            let margin = 1e-9 * eta[*k].abs();
            eta[*k] < least - margin || eta[*k] > most + margin
        };
        let beyond: Vec<usize> = free.iter().copied().filter(is_beyond).collect();
        if beyond.is_empty() {
            let fall = 2.0 * right.dot(&eta) - eta.dot(&(normal * &eta));
            return Some(Bounded { free, factor, eta, fall });
        }
        for &k in &beyond {
            let [least, most] = limits[k];
            eta[k] = eta[k].clamp(least, most);
        }
        free.retain(|k| !beyond.contains(k));
    }
}
