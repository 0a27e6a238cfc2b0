//! The least of a quadratic with lower bounds.

use nalgebra::{DMatrix, DVector};

/// The step d that makes gᵀd + ½ dᵀH d least with d ≥ `least` (all of them ≤ 0), H positive definite: coordinates at their bounds are held there, and let
/// go again where the slope points inwards (Nocedal & Wright 2006, Numerical Optimization, §16.5).
pub fn descend(hessian: &DMatrix<f64>, gradient: &DVector<f64>, least: &[f64]) -> DVector<f64> {
    let n = least.len();
    let mut held = vec![false; n];
    let mut d: DVector<f64> = DVector::zeros(n);
    // Each pass changes the held set; sets do not return in exact arithmetic, and rounding is caught by the count.
    for _ in 0..4 * n + 4 {
        let target = free_minimum(hessian, gradient, least, &held);
        let blocked = (0..n).filter(|&i| !held[i] && target[i] < least[i]);
        let share = |i: usize| -> f64 { if d[i] > target[i] { (d[i] - least[i]) / (d[i] - target[i]) } else { 1.0 } };
        match blocked.min_by(|&a, &b| share(a).total_cmp(&share(b))) {
            Some(first) => {
                let move_by = share(first).clamp(0.0, 1.0);
                d += (&target - &d) * move_by;
                d[first] = least[first];
                held[first] = true;
            }
            None => {
                d = target;
                let slope = hessian * &d + gradient;
                let inwards = (0..n).filter(|&i| held[i] && slope[i] < 0.0);
                match inwards.min_by(|&a, &b| slope[a].total_cmp(&slope[b])) {
                    Some(released) => held[released] = false,
                    None => break,
                }
            }
        }
    }
    d
}

/// The minimum with the held coordinates at their bounds.
fn free_minimum(h: &DMatrix<f64>, g: &DVector<f64>, least: &[f64], held: &[bool]) -> DVector<f64> {
    let n = least.len();
    let mut matrix = h.clone();
    let mut right = -g;
    for i in (0..n).filter(|&i| held[i]) {
        for j in 0..n {
            right[j] -= h[(j, i)] * least[i];
        }
    }
    for i in (0..n).filter(|&i| held[i]) {
        matrix.row_mut(i).fill(0.0);
        matrix.column_mut(i).fill(0.0);
        matrix[(i, i)] = 1.0;
        right[i] = least[i];
    }
    matrix.cholesky().map_or_else(|| DVector::zeros(n), |factor| factor.solve(&right))
}
