//! The quadratic programme against closed forms, its optimality conditions and an independent method.

use freeplay_controller::qp::{Qp, QpError, QpStatus};
use nalgebra::{DMatrix, DVector};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

const SEED: u64 = 20180;

/// A box of intervals as rows: x ≤ upper, −x ≤ −lower.
fn box_rows(n: usize) -> DMatrix<f64> {
    DMatrix::from_fn(
        2 * n,
        n,
        |row, column| if row % n != column { 0.0 } else { 1.0 - 2.0 * (row / n) as f64 },
    )
}

fn box_bounds(lower: &DVector<f64>, upper: &DVector<f64>) -> Vec<f64> {
    upper.iter().copied().chain(lower.iter().map(|value| -value)).collect()
}

/// P = BᵀB + 0.01 with entries of B in −1…1, q in −2…2.
fn random_cost(n: usize, random: &mut ChaCha8Rng) -> (DMatrix<f64>, DVector<f64>) {
    let b = DMatrix::from_fn(6, n, |_, _| random.random_range(-1.0..1.0));
    let p = b.transpose() * &b + DMatrix::identity(n, n) * 0.01;
    (p, DVector::from_fn(n, |_, _| random.random_range(-2.0..2.0)))
}

/// Minimiser over a box by cyclic exact minimisation, one variable at a time, clipped: converges for positive definite P.
fn projected(p: &DMatrix<f64>, q: &DVector<f64>, lower: &DVector<f64>, upper: &DVector<f64>) -> DVector<f64> {
    let mut x = DVector::zeros(q.len());
    for _ in 0..20_000 {
        for i in 0..q.len() {
            let rest = p.row(i).dot(&x.transpose()) - p[(i, i)] * x[i] + q[i];
            x[i] = (-rest / p[(i, i)]).clamp(lower[i], upper[i]);
        }
    }
    x
}

#[test]
fn without_active_rows_the_solution_is_that_of_the_linear_system() {
    let mut random = ChaCha8Rng::seed_from_u64(SEED);
    let mut worst: f64 = 0.0;
    for n in 1..=8 {
        let mut qp = Qp::new(&box_rows(n)).unwrap();
        for _ in 0..50 {
            let (p, q) = random_cost(n, &mut random);
            let exact = p.clone().cholesky().unwrap().solve(&-&q);
            assert!(exact.amax() > 1e-2, "the case is vacuous: {exact}");
            let wide = DVector::repeat(n, 2.0 * exact.amax() + 1.0);
            let report = qp.solve(&p, q.as_slice(), &box_bounds(&-&wide, &wide));
            assert_eq!(report.status, QpStatus::Solved);
            worst =
                worst.max((DVector::from_row_slice(qp.solution()) - &exact).amax() / exact.amax().max(1.0));
        }
    }
    println!("seed {SEED}: largest relative distance to the closed form {worst:.1e} (limit 1e-5)");
    assert!(worst < 1e-5);
}

#[test]
fn active_boxes_agree_with_a_projected_method_and_the_optimality_conditions() {
    let mut random = ChaCha8Rng::seed_from_u64(SEED);
    let (mut distance, mut stationarity, mut complementarity, mut outside): (f64, f64, f64, f64) =
        Default::default();
    let mut active = 0;
    for n in 1..=8 {
        let mut qp = Qp::new(&box_rows(n)).unwrap();
        for _ in 0..20 {
            let (p, q) = random_cost(n, &mut random);
            let lower = DVector::from_fn(n, |_, _| -random.random_range(0.05..1.0));
            let upper = DVector::from_fn(n, |_, _| random.random_range(0.05..1.0));
            let bounds = box_bounds(&lower, &upper);
            assert_eq!(qp.solve(&p, q.as_slice(), &bounds).status, QpStatus::Solved);
            let x = DVector::from_row_slice(qp.solution());
            let z = DVector::from_row_slice(qp.multipliers());
            let slack = DVector::from_row_slice(&bounds) - box_rows(n) * &x;
            let expected = projected(&p, &q, &lower, &upper);
            active += (0..n).filter(|&i| expected[i] == lower[i] || expected[i] == upper[i]).count();
            distance = distance.max((&x - &expected).amax());
            stationarity = stationarity.max((&p * &x + &q + box_rows(n).transpose() * &z).amax());
            complementarity = complementarity.max(z.component_mul(&slack).amax());
            outside = outside.max(-slack.min()).max(-z.min());
        }
    }
    println!(
        "seed {SEED}, {active} active bounds: distance {distance:.1e} (limit 1e-5), stationarity {stationarity:.1e}, \
         complementarity {complementarity:.1e}, outside {outside:.1e} (limits 1e-7)"
    );
    assert!(active > 200, "too few active bounds to test anything: {active}");
    assert!(distance < 1e-5 && stationarity < 1e-7 && complementarity < 1e-7 && outside < 1e-7);
}

#[test]
fn failures_have_their_names_and_do_not_stay() {
    let rows = box_rows(2);
    let mut qp = Qp::new(&rows).unwrap();
    let (p, q) = (DMatrix::identity(2, 2), [1.0, -1.0]);
    let open = [1e3; 4];
    for round in 0..3 {
        let (status, bounds, cost, linear) = match round {
            0 => (QpStatus::Infeasible, [1.0, 1.0, -2.0, -2.0], p.clone(), q),
            1 => (QpStatus::BadData, open, p.clone() * f64::NAN, q),
            _ => (QpStatus::BadData, open, p.clone(), [f64::INFINITY, 0.0]),
        };
        assert_eq!(qp.solve(&cost, &linear, &bounds).status, status);
        let again = qp.solve(&p, &q, &open);
        println!("{status:?}, then {:?} after {} iterations", again.status, again.iterations);
        assert_eq!(again.status, QpStatus::Solved);
        assert!((qp.solution()[0] + 1.0).abs() < 1e-6);
    }
    let mut one_sided = Qp::new(&DMatrix::from_element(1, 2, 1.0)).unwrap();
    assert_eq!(
        one_sided.solve(&DMatrix::zeros(2, 2), &[1.0, 1.0], &[1.0]).status,
        QpStatus::Unbounded,
        "min x + y with x + y ≤ 1"
    );
}

#[test]
fn rows_that_make_no_sense_are_refused() {
    assert!(matches!(Qp::new(&DMatrix::zeros(0, 3)), Err(QpError::Empty { variables: 3, rows: 0 })));
    let mut rows = box_rows(2);
    rows[(3, 1)] = f64::NAN;
    assert!(matches!(Qp::new(&rows), Err(QpError::NotFinite { row: 3, variable: 1, .. })));
}
