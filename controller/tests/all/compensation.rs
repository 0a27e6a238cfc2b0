//! Tests of the compensation of one tick: damped least squares inside the limits, the limits if they are active, and named
//! failures.

use crate::chain::chain;
use freeplay_arm::{Arm, Joint, Limits, Workspace, forward_kinematics, jacobian};
use freeplay_controller::compensation::{CompensationStatus, Compensator, Motion, Weights};
use freeplay_controller::correction_bounds::{LARGEST_CORRECTION, LEAST_SHARE};
use freeplay_model::paper_arm;
use nalgebra::{DMatrix, DVector, Vector3, Vector6};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

const SEED: u64 = 77;
const PERIOD: f64 = 1e-3;

fn jacobian_at(arm: &Arm, q: &[f64]) -> DMatrix<f64> {
    let mut out = DMatrix::zeros(6, arm.dof());
    jacobian(arm, &mut Workspace::new(arm), q, &mut out);
    out
}

/// −(JᵀWJ + ρ)⁻¹ (JᵀW r − ρ Δq₋₁), in SI: the weights scale with mm and mrad alike.
fn damped_least_squares(
    j: &DMatrix<f64>,
    weights: &Weights,
    r: &Vector6<f64>,
    last: &DVector<f64>,
) -> DVector<f64> {
    let orientation = if j.ncols() < 6 { 0.0 } else { weights.orientation };
    let [x, y, z] = weights.position;
    let w = DMatrix::from_diagonal(&DVector::from_vec(vec![x, y, z, orientation, orientation, orientation]));
    let p = j.transpose() * &w * j + DMatrix::identity(j.ncols(), j.ncols()) * weights.change;
    let q = j.transpose() * w * r - last * weights.change;
    -p.cholesky().unwrap().solve(&q)
}

#[test]
fn without_limits_it_is_damped_least_squares_for_one_to_eight_joints() {
    let mut random = ChaCha8Rng::seed_from_u64(SEED);
    let weights =
        Weights { position: [1.0, 2.0, 0.5], orientation: 0.02, change: 1e-2, ..Weights::default() };
    let (mut worst, mut least): (f64, f64) = (0.0, f64::INFINITY);
    for n in 1..=8 {
        let arm = chain(n, Limits::NONE);
        let mut compensator = Compensator::new(&arm, PERIOD, &weights).unwrap();
        let mut last = DVector::zeros(n);
        for _ in 0..20 {
            let q: Vec<f64> = (0..n).map(|_| random.random_range(-1.0..1.0)).collect();
            let (j, rest) = (jacobian_at(&arm, &q), vec![0.0; n]);
            let r = Vector6::from_fn(|i, _| if i < 3 { random.random_range(-6e-4..6e-4) } else { 0.0 });
            let expected = damped_least_squares(&j, &weights, &r, &last);
            let report = compensator.advance(Motion { q: &q, v: &rest, a: &rest }, &j, &r);
            assert_eq!(report.status, CompensationStatus::Free);
            let found = DVector::from_row_slice(compensator.correction());
            worst = worst.max((&found - &expected).amax());
            least = least.min(expected.amax());
            last = found;
        }
    }
    println!(
        "seed {SEED}: corrections of {least:.1e} rad and more, largest error {worst:.1e} rad (limit 1e-9)"
    );
    assert!(least > 1e-6, "a correction of nothing tests nothing");
    assert!(worst < 1e-9);
}

#[test]
fn the_correction_takes_the_deviation_out_and_keeps_the_orientation() {
    let arm = paper_arm().arm;
    let q = [0.1, 0.4, 0.3, 0.2, 0.9, -0.3];
    let rest = [0.0; 6];
    let arm = Arm::new(
        "free",
        arm.joints().iter().map(|joint| Joint { limits: Limits::NONE, ..joint.clone() }).collect(),
        *arm.tool(),
        *arm.gravity(),
    )
    .unwrap();
    let mut compensator = Compensator::new(&arm, PERIOD, &Weights::default()).unwrap();
    let deviation = Vector3::new(1e-4, -5e-5, -6e-4);
    let r = Vector6::new(deviation.x, deviation.y, deviation.z, 0.0, 0.0, 0.0);
    let j = jacobian_at(&arm, &q);
    for _ in 0..3 {
        compensator.advance(Motion { q: &q, v: &rest, a: &rest }, &j, &r);
    }
    let corrected: Vec<f64> = q.iter().zip(compensator.correction()).map(|(q, d)| q + d).collect();
    let mut workspace = Workspace::new(&arm);
    let before = forward_kinematics(&arm, &mut workspace, &q);
    let after = forward_kinematics(&arm, &mut workspace, &corrected);
    let remaining = (after.translation.vector + deviation - before.translation.vector).norm();
    let turned = before.rotation.angle_to(&after.rotation);
    println!(
        "of {:.3e} m remain {remaining:.1e} m (limit 2e-6), turned by {turned:.1e} rad (limit 2e-5)",
        deviation.norm()
    );
    assert!(remaining < 2e-6 && turned < 2e-5);
}

#[test]
fn position_speed_and_acceleration_limits_are_kept() {
    let limits = Limits { lower: -1.0, upper: 1.0, velocity: 0.5, acceleration: 4.0, effort: f64::INFINITY };
    let mut random = ChaCha8Rng::seed_from_u64(SEED);
    let n = 6;
    let arm = chain(n, limits);
    let mut compensator = Compensator::new(&arm, PERIOD, &Weights::default()).unwrap();
    let q = [0.99999, -0.99999, 0.3, 0.2, 0.4, 0.1];
    let (v, a) = ([0.1, -0.2, 0.45, 0.0, 0.3, 0.1], [1.0, 0.0, -3.0, 3.9, 0.0, 2.0]);
    let (mut last, mut before) = (vec![0.0; n], vec![0.0; n]);
    let (mut outside, mut touched) = (f64::NEG_INFINITY, [0; 3]);
    let j = jacobian_at(&arm, &q);
    for _ in 0..400 {
        let r = Vector6::from_fn(|i, _| if i < 3 { random.random_range(-2e-3..2e-3) } else { 0.0 });
        let report = compensator.advance(Motion { q: &q, v: &v, a: &a }, &j, &r);
        assert!(report.status.is_minimiser());
        for i in 0..n {
            let now = compensator.correction()[i];
            let share = |limit: f64, used: f64| (limit - used.abs()).max(LEAST_SHARE * limit);
            let excess = [
                (q[i] + now).abs() - 1.0,
                (now - last[i]).abs() - share(0.5, v[i]) * PERIOD,
                ((now - 2.0 * last[i] + before[i]) / PERIOD / PERIOD + a[i]).abs() * PERIOD * PERIOD
                    - 4.0 * PERIOD * PERIOD,
            ];
            for (touched, excess) in touched.iter_mut().zip(excess) {
                outside = outside.max(excess);
                *touched += usize::from(excess.abs() < 1e-8);
            }
            (before[i], last[i]) = (last[i], now);
        }
    }
    println!(
        "largest excess {outside:.1e} rad (limit 1e-8); limits touched: position {}, speed {}, acceleration {}",
        touched[0], touched[1], touched[2]
    );
    // The interior-point method ends near a bound, within its tolerance, not exactly on it.
    assert!(outside < 1e-8);
    assert!(touched[2] > 100, "the limits never bind: {touched:?}");
}

#[test]
fn nothing_is_iterated_where_no_limit_binds_and_only_there() {
    let limits = Limits { lower: -1.0, upper: 1.0, velocity: 0.5, acceleration: 4.0, effort: f64::INFINITY };
    let (weights, q, rest) = (Weights { change: 1e-2, ..Weights::default() }, [0.3; 6], [0.0; 6]);
    let arm = chain(6, limits);
    let mut compensator = Compensator::new(&arm, PERIOD, &weights).unwrap();
    let j = jacobian_at(&arm, &q);
    let (mut r, mut last) = (Vector6::zeros(), DVector::zeros(6));
    let (mut free, mut apart, mut nearest) = ([0; 2], 0.0_f64, f64::INFINITY);
    for tick in 0..600 {
        // A slow wave, which the limits permit, and an occasional jump, which they do not.
        r[2] = 2e-5 * (0.01 * f64::from(tick)).sin() + if tick % 200 > 150 { 5e-4 } else { 0.0 };
        let alone = damped_least_squares(&j, &weights, &r, &last);
        let report = compensator.advance(Motion { q: &q, v: &rest, a: &rest }, &j, &r);
        last = DVector::from_row_slice(compensator.correction());
        let distance = (&last - alone).amax();
        match report.status {
            CompensationStatus::Free => apart = apart.max(distance),
            CompensationStatus::Solved => nearest = nearest.min(distance),
            other => panic!("tick {tick}: {other:?}"),
        }
        assert_eq!(report.status == CompensationStatus::Free, report.iterations == 0);
        free[usize::from(report.iterations > 0)] += 1;
    }
    println!(
        "of 600 ticks {} free, at most {apart:.1e} rad from damped least squares (limit 1e-12), {} iterated, {nearest:.1e} rad \
         and more from it (limit 1e-9)",
        free[0], free[1]
    );
    assert!(free.iter().all(|count| *count > 50), "both ways are taken: {free:?}");
    assert!(apart < 1e-12 && nearest > 1e-9);
}

#[test]
fn what_cannot_be_kept_is_named_and_the_correction_brakes() {
    let limits = Limits { lower: -1.0, upper: 1.0, velocity: 2.0, acceleration: 10.0, effort: f64::INFINITY };
    let arm = chain(6, limits);
    let mut compensator = Compensator::new(&arm, PERIOD, &Weights::default()).unwrap();
    let (inside, beyond, rest) = ([0.1; 6], [0.1, 0.1, 1.2, 0.1, 0.1, 0.1], [0.0; 6]);
    let j = jacobian_at(&arm, &inside);
    let r = Vector6::new(1e-3, 0.0, 0.0, 0.0, 0.0, 0.0);
    let mut advance = |q: &[f64; 6], a: &[f64; 6], r: &Vector6<f64>| {
        let before = compensator.correction().to_vec();
        let status = compensator.advance(Motion { q, v: &rest, a }, &j, r).status;
        let step: Vec<f64> =
            compensator.correction().iter().zip(before).map(|(now, then)| now - then).collect();
        (status, DVector::from_vec(step).amax())
    };
    for _ in 0..5 {
        assert!(advance(&inside, &rest, &r).0.is_minimiser());
    }
    let mut last = advance(&inside, &rest, &r).1;
    assert!(last > 1e-6, "the correction must move to have something to brake: {last:e}");
    for (name, q, a, r) in [
        ("beyond a limit", &beyond, &rest, &r),
        ("not a number", &[f64::NAN; 6], &rest, &r),
        ("acceleration not a number", &inside, &[f64::NAN; 6], &r),
        ("deviation not a number", &inside, &rest, &Vector6::repeat(f64::NAN)),
    ] {
        let (status, step) = advance(q, a, r);
        println!("{name}: {status:?}, step {last:.2e} -> {step:.2e}");
        assert!(!status.is_minimiser(), "{name}");
        assert!(step < last, "{name}: the correction does not brake");
        last = step;
    }
    for _ in 0..10 {
        last = advance(&beyond, &rest, &r).1;
    }
    assert_eq!(last, 0.0, "the correction comes to rest");
    assert!(advance(&inside, &rest, &r).0.is_minimiser(), "and goes on when it can");
}

#[test]
fn no_correction_is_larger_than_the_largest() {
    let arm = chain(6, Limits::NONE);
    let mut compensator = Compensator::new(&arm, PERIOD, &Weights::default()).unwrap();
    let rest = [0.0; 6];
    let j = jacobian_at(&arm, &[0.3; 6]);
    compensator.advance(Motion { q: &rest, v: &rest, a: &rest }, &j, &Vector6::repeat(1.0));
    let largest = DVector::from_row_slice(compensator.correction()).amax();
    println!("a deviation of a metre: correction {largest} rad");
    assert!(largest <= LARGEST_CORRECTION + 1e-9 && largest > 0.09);
}
