//! Bounded least squares: the active set of Stark & Parker 1995, Computational Statistics 10:129 (BVLS), on normal equations.

use nalgebra::{Cholesky, DMatrix, DVector};

use crate::statistics::MOST_ROUNDS;

/// The x within `limits` that minimises ½xᵀAx − bᵀx, A positive definite; `None` if A is singular.
pub(crate) fn bounded(a: &DMatrix<f64>, b: &DVector<f64>, limits: &[[f64; 2]]) -> Option<DVector<f64>> {
    let n = limits.len();
    // Start from the free solution, clamped to the limits: most often that is the answer.
    let mut x = Cholesky::new(a.clone())?.solve(b);
    if (0..n).all(|k| inside(x[k], limits[k])) {
        return Some(x);
    }
    (0..n).for_each(|k| x[k] = x[k].clamp(limits[k][0], limits[k][1]));
    if let Some(found) = pivoted(a, b, limits, &x) {
        return Some(found);
    }
    let mut free: Vec<bool> = (0..n).map(|k| limits[k][0] < x[k] && x[k] < limits[k][1]).collect();
    // Each pass frees one variable or ends; an active set never returns, since the objective falls.
    for _ in 0..10 * n + 10 {
        descend(a, b, limits, &mut x, &mut free)?;
        let gradient = b - a * &x;
        let pull = |k: usize| {
            let inwards = if x[k] <= limits[k][0] { gradient[k] } else { -gradient[k] };
            inwards / a[(k, k)].sqrt()
        };
        let scale = (0..n).map(|k| (b[k] / a[(k, k)].sqrt()).abs()).fold(f64::MIN_POSITIVE, f64::max);
        let next = (0..n).filter(|&k| !free[k]).max_by(|&i, &j| pull(i).total_cmp(&pull(j)));
        match next.filter(|&k| pull(k) > 1e-12 * scale) {
            Some(k) => free[k] = true,
            None => break,
        }
    }
    Some(x)
}

/// The same by exchanging all variables on the wrong side at once (Portugal, Júdice & Vicente 1994, Math. Comput. 63:625), starting with those of `start` free
/// that lie within the limits; `None` if the method does not converge soon, since convergence is not guaranteed.
fn pivoted(
    a: &DMatrix<f64>,
    b: &DVector<f64>,
    limits: &[[f64; 2]],
    start: &DVector<f64>,
) -> Option<DVector<f64>> {
    let n = limits.len();
    let mut x = start.clone();
    let mut free: Vec<bool> = (0..n).map(|k| limits[k][0] < x[k] && x[k] < limits[k][1]).collect();
    for _ in 0..MOST_ROUNDS {
        let open: Vec<usize> = (0..n).filter(|&k| free[k]).collect();
        let mut held = x.clone();
        open.iter().for_each(|&k| held[k] = 0.0);
        let rest = b - a * held;
        let part = a.select_rows(&open).select_columns(&open);
        let solved = Cholesky::new(part)?.solve(&rest.select_rows(&open));
        open.iter().zip(solved.iter()).for_each(|(&k, value)| x[k] = *value);
        let gradient = b - a * &x;
        let mut is_done = true;
        for k in 0..n {
            let [least, most] = limits[k];
            let slack = 1e-12 * (b[k].abs() + a[(k, k)] * x[k].abs());
            if free[k] && !inside(x[k], limits[k]) {
                (x[k], free[k], is_done) = (x[k].clamp(least, most), false, false);
            } else if !free[k] && most > least {
                let inwards = if x[k] <= least { gradient[k] } else { -gradient[k] };
                if inwards > slack {
                    (free[k], is_done) = (true, false);
                }
            }
        }
        if is_done {
            return Some(x);
        }
    }
    None
}

fn inside(x: f64, [least, most]: [f64; 2]) -> bool {
    x >= least && x <= most
}

/// Moves the `free` variables to their optimum, stopping at each bound on the way.
fn descend(
    a: &DMatrix<f64>,
    b: &DVector<f64>,
    limits: &[[f64; 2]],
    x: &mut DVector<f64>,
    free: &mut [bool],
) -> Option<()> {
    loop {
        let open: Vec<usize> = (0..x.len()).filter(|&k| free[k]).collect();
        if open.is_empty() {
            return Some(());
        }
        let part = DMatrix::from_fn(open.len(), open.len(), |i, j| a[(open[i], open[j])]);
        let held = |i: usize| -> f64 { (0..x.len()).filter(|&k| !free[k]).map(|k| a[(i, k)] * x[k]).sum() };
        let right = DVector::from_fn(open.len(), |i, _| b[open[i]] - held(open[i]));
        let best = Cholesky::new(part)?.solve(&right);
        // The longest step that stays within the limits.
        let reach = |(i, &k): (usize, &usize)| {
            let [least, most] = limits[k];
            let step = best[i] - x[k];
            let room = if step < 0.0 { least - x[k] } else { most - x[k] };
            if inside(best[i], limits[k]) { (1.0, k) } else { ((room / step).clamp(0.0, 1.0), k) }
        };
        let first = open.iter().enumerate().map(reach).min_by(|p, q| p.0.total_cmp(&q.0));
        let (step, meets) = first.unwrap_or((1.0, 0));
        open.iter().enumerate().for_each(|(i, &k)| x[k] += step * (best[i] - x[k]));
        if step >= 1.0 && inside(x[meets], limits[meets]) && open.iter().all(|&k| inside(x[k], limits[k])) {
            return Some(());
        }
        let [least, most] = limits[meets];
        x[meets] = if (x[meets] - least).abs() < (x[meets] - most).abs() { least } else { most };
        free[meets] = false;
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::{DMatrix, DVector};
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    use super::bounded;

    /// Every combination of free, lower and upper: the best within the limits.
    fn brute_force(a: &DMatrix<f64>, b: &DVector<f64>, limits: &[[f64; 2]]) -> f64 {
        let n = limits.len();
        let value = |x: &DVector<f64>| 0.5 * x.dot(&(a * x)) - b.dot(x);
        let mut best = f64::INFINITY;
        for code in 0..3_usize.pow(n as u32) {
            let state: Vec<usize> = (0..n).map(|k| code / 3_usize.pow(k as u32) % 3).collect();
            let mut x = DVector::from_fn(n, |k, _| limits[k][usize::from(state[k] == 1)]);
            let open: Vec<usize> = (0..n).filter(|&k| state[k] == 2).collect();
            let part = DMatrix::from_fn(open.len(), open.len(), |i, j| a[(open[i], open[j])]);
            let held =
                |i: usize| -> f64 { (0..n).filter(|k| !open.contains(k)).map(|k| a[(i, k)] * x[k]).sum() };
            let right = DVector::from_fn(open.len(), |i, _| b[open[i]] - held(open[i]));
            let solved = if open.is_empty() { right } else { part.lu().solve(&right).expect("regular") };
            open.iter().zip(solved.iter()).for_each(|(&k, s)| x[k] = *s);
            if (0..n).all(|k| x[k] >= limits[k][0] - 1e-12 && x[k] <= limits[k][1] + 1e-12) {
                best = best.min(value(&x));
            }
        }
        best
    }

    #[test]
    fn a_bound_is_left_again() {
        let a = DMatrix::from_row_slice(2, 2, &[1.0, 0.9, 0.9, 1.0]);
        let x = bounded(&a, &DVector::from_vec(vec![7.3, 6.0]), &[[-2.0, 2.0]; 2]).expect("regular");
        assert_eq!(x.as_slice(), [2.0, 2.0]);
    }

    #[test]
    fn bounded_least_squares_agrees_with_brute_force() {
        let mut rng = ChaCha8Rng::seed_from_u64(7);
        let mut worst = 0.0_f64;
        for _ in 0..400 {
            let n = 1 + rng.random_range(0..5_usize);
            let root = DMatrix::from_fn(n + 2, n, |_, _| rng.random_range(-1.0..1.0));
            let a = root.transpose() * &root + DMatrix::identity(n, n) * 1e-3;
            let b = DVector::from_fn(n, |_, _| rng.random_range(-3.0..3.0));
            let limits: Vec<[f64; 2]> =
                (0..n).map(|_| [-rng.random_range(0.0..1.0), rng.random_range(0.1..1.0)]).collect();
            let x = bounded(&a, &b, &limits).expect("regular");
            let value = 0.5 * x.dot(&(&a * &x)) - b.dot(&x);
            worst = worst.max(value - brute_force(&a, &b, &limits));
        }
        println!("at most {worst:.1e} above the least");
        assert!(worst < 1e-9);
    }
}
