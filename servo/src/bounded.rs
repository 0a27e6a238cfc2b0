//! The minimum of a quadratic function with lower bounds.

use nalgebra::{DMatrix, DVector};

/// The step d that minimises gᵀd + ½ dᵀH d subject to d ≥ `least` (all of them ≤ 0), H positive definite: the active-set method holds
/// coordinates at their bounds, and releases them where the gradient points inwards (Nocedal & Wright 2006, Numerical Optimization, §16.5).
pub fn descend(hessian: &DMatrix<f64>, gradient: &DVector<f64>, least: &[f64]) -> DVector<f64> {
    let n = least.len();
    let mut held = vec![false; n];
    let mut d: DVector<f64> = DVector::zeros(n);
    // Each pass changes the held set; sets do not return in exact arithmetic, and the count bounds the effect of rounding.
    for _ in 0..4 * n + 4 {
        let target = free_minimum(hessian, gradient, least, &held);
        let blocked = (0..n).filter(|&i| !held[i] && target[i] < least[i]);
        let share =
            |i: usize| -> f64 { if d[i] > target[i] { (d[i] - least[i]) / (d[i] - target[i]) } else { 1.0 } };
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

#[cfg(test)]
mod tests {
    use nalgebra::{DMatrix, DVector};

    use super::descend;

    /// Of H = [[1, .9], [.9, 1]] and the gradient −b with b = (7.3, 6), upper bounds of 2: with both signs reversed they are lower bounds.
    /// The optimum is at (2, 2); clamping one coordinate after the other without release would end at (2, −2) or beyond the bound.
    #[test]
    fn a_coordinate_at_its_bound_is_let_go_again() {
        let h = DMatrix::from_row_slice(2, 2, &[1.0, 0.9, 0.9, 1.0]);
        let d = descend(&h, &DVector::from_vec(vec![7.3, 6.0]), &[-2.0, -2.0]);
        assert!((d[0] + 2.0).abs() < 1e-12 && (d[1] + 2.0).abs() < 1e-12, "{d}");
        let free = descend(&h, &DVector::from_vec(vec![0.5, -0.3]), &[-20.0, -20.0]);
        assert!((&h * &free - DVector::from_vec(vec![-0.5, 0.3])).amax() < 1e-12);
    }

    /// The optimum satisfies its conditions: zero gradient in free coordinates, no inward descent at a bound.
    #[test]
    fn the_conditions_of_an_optimum_hold() {
        let h = DMatrix::from_fn(4, 4, |i, j| if i == j { 2.0 } else { 0.9 - 0.1 * (i + j) as f64 });
        let least = [-0.3, 0.0, -0.1, -5.0];
        let mut held = 0;
        for case in 0..50 {
            let g = DVector::from_fn(4, |i, _| f64::from((case * 13 + i as i32 * 29) % 23) - 11.0);
            let d = descend(&h, &g, &least);
            let slope = &h * &d + &g;
            for i in 0..4 {
                assert!(d[i] >= least[i] - 1e-12);
                let is_held = d[i] <= least[i] + 1e-12;
                held += usize::from(is_held);
                assert!(
                    if is_held { slope[i] > -1e-9 } else { slope[i].abs() < 1e-9 },
                    "{case}: {d} {slope}"
                );
            }
        }
        assert!(held > 20);
    }
}
