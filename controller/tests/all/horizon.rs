//! Tests of the compensation over several ticks: closed form, optimality conditions, a second solver, and named failures.

use crate::chain::chain;
use freeplay_arm::{Arm, Limits, Workspace, jacobian};
use freeplay_controller::compensation::{CompensationStatus, Compensator, Motion, Weights};
use freeplay_controller::correction_bounds::LEAST_SHARE;
use freeplay_controller::horizon::MOST_TICKS;
use freeplay_controller::sparse_programme::{Row, SparseProgramme};
use freeplay_controller::{Correction, Horizon, HorizonError, HorizonStatus};
use freeplay_model::paper_arm;
use nalgebra::{DMatrix, DVector, Vector3, Vector6};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

const SEED: u64 = 2310;
const PERIOD: f64 = 1e-3;
const LIMITS: Limits =
    Limits { lower: -1.0, upper: 1.0, velocity: 0.5, acceleration: 4.0, effort: f64::INFINITY };

/// Data of one tick ahead.
#[derive(Clone)]
struct Ahead {
    q: Vec<f64>,
    v: Vec<f64>,
    a: Vec<f64>,
    jacobian: DMatrix<f64>,
    deviation: Vector6<f64>,
}

impl Ahead {
    fn at(arm: &Arm, q: &[f64], deviation: Vector3<f64>) -> Ahead {
        let mut j = DMatrix::zeros(6, arm.dof());
        jacobian(arm, &mut Workspace::new(arm), q, &mut j);
        let rest = vec![0.0; arm.dof()];
        let deviation = Vector6::new(deviation.x, deviation.y, deviation.z, 0.0, 0.0, 0.0);
        Ahead { q: q.to_vec(), v: rest.clone(), a: rest, jacobian: j, deviation }
    }

    fn motion(&self) -> Motion<'_> {
        Motion { q: &self.q, v: &self.v, a: &self.a }
    }
}

fn push_all(horizon: &mut Horizon, first: u64, ahead: &[Ahead]) {
    for (tick, ahead) in (first..).zip(ahead) {
        horizon.push(tick, ahead.motion(), &ahead.jacobian, &ahead.deviation);
    }
}

/// P and q of the sum of costs, in SI; the weights scale the same with mm and mrad. The test builds them from difference matrices,
/// not from the bands of the horizon.
fn dense(
    weights: &Weights,
    ahead: &[Ahead],
    last: &DVector<f64>,
    before: &DVector<f64>,
) -> (DMatrix<f64>, DVector<f64>) {
    let (n, ticks) = (last.len(), ahead.len());
    let [x, y, z] = weights.position;
    let orientation = if n < 6 { 0.0 } else { weights.orientation };
    let w = DMatrix::from_diagonal(&DVector::from_vec(vec![x, y, z, orientation, orientation, orientation]));
    let identity = DMatrix::identity(n, n);
    let difference = |factors: [f64; 3]| {
        DMatrix::from_fn(ticks, ticks, |r, c| if c <= r && r - c < 3 { factors[r - c] } else { 0.0 })
            .kronecker(&identity)
    };
    let (change, bend) = (difference([1.0, -1.0, 0.0]), difference([1.0, -2.0, 1.0]));
    let (mut changes, mut bends) = (DVector::zeros(n * ticks), DVector::zeros(n * ticks));
    changes.rows_mut(0, n).copy_from(&-last);
    bends.rows_mut(0, n).copy_from(&(before - last * 2.0));
    if ticks > 1 {
        bends.rows_mut(n, n).copy_from(last);
    }
    let alpha = weights.acceleration / (1e3 * PERIOD * PERIOD).powi(2);
    let mut p = change.transpose() * &change * weights.change + bend.transpose() * &bend * alpha;
    let mut q = change.transpose() * changes * weights.change + bend.transpose() * bends * alpha;
    for (k, ahead) in ahead.iter().enumerate() {
        let weighted = ahead.jacobian.transpose() * &w;
        let mut block = p.view_mut((k * n, k * n), (n, n));
        block += &weighted * &ahead.jacobian;
        let mut rows = q.rows_mut(k * n, n);
        rows += weighted * ahead.deviation;
    }
    (p, q)
}

fn vector(random: &mut ChaCha8Rng, n: usize, most: f64) -> DVector<f64> {
    DVector::from_fn(n, |_, _| random.random_range(-most..most))
}

#[test]
fn without_limits_it_is_the_dense_solution_of_the_same_normal_equations() {
    let mut random = ChaCha8Rng::seed_from_u64(SEED);
    let (mut worst, mut least, mut apart): (f64, f64, f64) = (0.0, f64::INFINITY, f64::INFINITY);
    for (n, ticks) in [(1, 1), (2, 1), (3, 2), (6, 3), (6, 20), (7, 12), (8, 5)] {
        let arm = chain(n, Limits::NONE);
        let weights = Weights {
            position: [1.0, 2.0, 0.5],
            orientation: 0.02,
            change: 1e-2,
            acceleration: 10f64.powf(random.random_range(-7.0..-4.0)),
        };
        let mut horizon = Horizon::new(&arm, PERIOD, &weights, ticks).unwrap();
        for round in 0..5 {
            let ahead: Vec<Ahead> = (0..ticks)
                .map(|_| {
                    let q = vector(&mut random, n, 1.0);
                    let r = vector(&mut random, 3, 6e-4);
                    Ahead::at(&arm, q.as_slice(), Vector3::new(r[0], r[1], r[2]))
                })
                .collect();
            let (last, before) = (vector(&mut random, n, 1e-3), vector(&mut random, n, 1e-3));
            push_all(&mut horizon, 100 * round, &ahead);
            let report = horizon.solve(last.as_slice(), before.as_slice());
            assert_eq!((report.status, report.iterations), (HorizonStatus::Free, 0));
            let (p, q) = dense(&weights, &ahead, &last, &before);
            let expected = p.lu().solve(&-q).unwrap();
            let found = DVector::from_row_slice(horizon.plan());
            worst = worst.max((&found - &expected).amax());
            least = least.min(expected.amax());
            if ticks > 1 {
                apart = apart.min((expected.rows(0, n) - expected.rows(n, n)).amax());
            }
        }
    }
    println!(
        "seed {SEED}: corrections of {least:.1e} rad and more, {apart:.1e} rad and more from tick to tick, largest error {worst:.1e} rad \
         (limit 1e-12)"
    );
    assert!(least > 1e-6 && apart > 1e-7, "a plan of nothing tests nothing");
    assert!(worst < 1e-12);
}

#[test]
fn one_tick_ahead_without_a_weight_on_accelerations_is_the_programme_of_one_tick() {
    let arm = chain(6, LIMITS);
    let weights = Weights { change: 1e-2, acceleration: 0.0, ..Weights::default() };
    let mut compensator = Compensator::new(&arm, PERIOD, &weights).unwrap();
    let mut horizon = Horizon::new(&arm, PERIOD, &weights, 1).unwrap();
    let (mut last, mut before) = (vec![0.0; 6], vec![0.0; 6]);
    let (mut free, mut solved) = ((0, 0.0_f64), (0, 0.0_f64));
    for tick in 0..400 {
        let jump = if tick % 100 > 70 { 5e-4 } else { 0.0 };
        let deviation = Vector3::new(0.0, jump, 2e-5 * (0.01 * tick as f64).sin());
        let ahead = Ahead::at(&arm, &[0.3; 6], deviation);
        let one = compensator.advance(ahead.motion(), &ahead.jacobian, &ahead.deviation);
        push_all(&mut horizon, tick, &[ahead]);
        let all = horizon.solve(&last, &before);
        let distance =
            (0..6).map(|i| (horizon.plan()[i] - compensator.correction()[i]).abs()).fold(0.0, f64::max);
        match (one.status, all.status) {
            (CompensationStatus::Free, HorizonStatus::Free) => free = (free.0 + 1, distance.max(free.1)),
            (CompensationStatus::Solved, HorizonStatus::Solved) => {
                solved = (solved.0 + 1, distance.max(solved.1));
            }
            other => panic!("tick {tick}: {other:?}"),
        }
        // Both continue from the same correction, so that the solver's tolerance does not accumulate.
        (before, last) = (last, compensator.correction().to_vec());
    }
    // Clarabel stops when the cost is within 1e-8 of the minimum, mrad²: a distance of √(2e-8/ρ) at most.
    let clarabel = 1e-3 * (2e-8 / weights.change).sqrt();
    println!(
        "{} ticks free, {:.1e} rad apart (limit 1e-13); {} with limits, {:.1e} rad apart (limit {clarabel:.1e})",
        free.0, free.1, solved.0, solved.1
    );
    assert!(free.0 > 50 && solved.0 > 50, "both ways are taken");
    assert!(free.1 < 1e-13 && solved.1 < clarabel);
}

/// A limit: its entries by variable, its lower and its upper bound, mrad.
type Limit = (Vec<(usize, f64)>, f64, f64);

/// All limits, from their definition.
fn limit_rows(ahead: &[Ahead], last: &[f64], before: &[f64]) -> Vec<Limit> {
    let n = last.len();
    let mut rows = Vec::new();
    for (k, ahead) in ahead.iter().enumerate() {
        for j in 0..n {
            // The correction `back` ticks before: a variable, or one of the past corrections.
            let then = |back: usize| match k.checked_sub(back) {
                Some(k) => (Some(k * n + j), 0.0),
                None => (None, if back - k == 1 { last[j] } else { before[j] }),
            };
            let mut row = |factors: &[f64], lower: f64, upper: f64| {
                let (mut entries, mut known) = (Vec::new(), 0.0);
                for (back, factor) in factors.iter().enumerate() {
                    match then(back) {
                        (Some(variable), _) => entries.push((variable, *factor)),
                        (None, value) => known += factor * value,
                    }
                }
                rows.push((entries, 1e3 * (lower - known), 1e3 * (upper - known)));
            };
            let room = (LIMITS.velocity - ahead.v[j].abs()).max(LEAST_SHARE * LIMITS.velocity) * PERIOD;
            let up = (LIMITS.acceleration - ahead.a[j]).max(LEAST_SHARE * LIMITS.acceleration);
            let down = (LIMITS.acceleration + ahead.a[j]).max(LEAST_SHARE * LIMITS.acceleration);
            let [least, most] = [LIMITS.lower - ahead.q[j], LIMITS.upper - ahead.q[j]];
            row(&[1.0], least, most);
            if k == 0 {
                // After the first step the correction can still brake before the limit; s²/(2 b) + s/2 is the distance that it then
                // covers.
                let b = LEAST_SHARE * LIMITS.acceleration * PERIOD * PERIOD;
                let longest = |way: f64| (0.25 * b * b + 2.0 * way * b).sqrt() - 0.5 * b;
                row(&[1.0, -1.0], -room.min(longest(last[j] - least)), room.min(longest(most - last[j])));
            } else {
                row(&[1.0, -1.0], -room, room);
            }
            row(&[1.0, -2.0, 1.0], -down * PERIOD * PERIOD, up * PERIOD * PERIOD);
        }
    }
    rows
}

/// Cases with a deviation that jumps in the middle; one joint is near its limit and one at high speed.
fn hard_cases(arm: &Arm, ticks: usize, random: &mut ChaCha8Rng) -> Vec<Ahead> {
    let jump = random.random_range(3..ticks - 3);
    let r = vector(random, 3, 1.0).normalize() * 8e-5;
    let mut q = vector(random, 6, 0.5);
    q[1] = 1.0 - 3e-6;
    (0..ticks)
        .map(|k| {
            let side = if k < jump { 1.0 } else { -1.0 };
            let mut ahead = Ahead::at(arm, q.as_slice(), Vector3::new(r[0], r[1], r[2]) * side);
            (ahead.v[2], ahead.a[3]) = (0.498, 3.5);
            ahead
        })
        .collect()
}

#[test]
fn where_limits_bind_it_meets_the_optimality_conditions_and_another_solver() {
    let mut random = ChaCha8Rng::seed_from_u64(SEED);
    let (arm, ticks) = (chain(6, LIMITS), 12);
    let weights = Weights { acceleration: 1e-5, ..Weights::default() };
    let mut horizon = Horizon::new(&arm, PERIOD, &weights, ticks).unwrap();
    let mut bound = [0; 3];
    let (mut slope, mut outside, mut slack, mut other) = (0.0_f64, 0.0_f64, 0.0_f64, 0.0_f64);
    let mut weakest = f64::INFINITY;
    for round in 0..30 {
        let ahead = hard_cases(&arm, ticks, &mut random);
        let last = vector(&mut random, 6, 1e-6);
        let before = &last + vector(&mut random, 6, 1e-7);
        let rows = limit_rows(&ahead, last.as_slice(), before.as_slice());
        let (p, q) = dense(&weights, &ahead, &last, &before);
        let q = q * 1e3;
        let value = |x: &DVector<f64>, entries: &[(usize, f64)]| {
            entries.iter().map(|&(i, factor)| factor * x[i]).sum::<f64>()
        };
        let free = p.clone().lu().solve(&-&q).unwrap();
        let excess = rows.iter().map(|(entries, lower, upper)| {
            let value = value(&free, entries);
            (value - upper).max(lower - value)
        });
        assert!(excess.fold(f64::NEG_INFINITY, f64::max) > 1e-6, "round {round}: no limit would be broken");
        push_all(&mut horizon, 100 * round, &ahead);
        let report = horizon.solve(last.as_slice(), before.as_slice());
        assert_eq!(report.status, HorizonStatus::Solved, "round {round}");
        let x = DVector::from_row_slice(horizon.plan()) * 1e3;
        let mut gradient = &p * &x + &q;
        for (row, active) in horizon.active() {
            let limit = if active.side > 0.0 { row.upper } else { row.lower };
            for (&place, factor) in row.places.iter().zip(&row.factors) {
                gradient[place] += active.multiplier * active.side * factor;
            }
            slack = slack.max((row.of(x.as_slice()) - limit).abs());
            weakest = weakest.min(active.multiplier);
        }
        slope = slope.max(gradient.amax() / (1.0 + q.amax()));
        for (index, (entries, lower, upper)) in rows.iter().enumerate() {
            let value = value(&x, entries);
            outside = outside.max(value - upper).max(lower - value);
            bound[index % 3] += usize::from((value - upper).max(lower - value) > -1e-9);
        }
        let cost = |x: &DVector<f64>| 0.5 * x.dot(&(&p * x)) + q.dot(x);
        other = other.max((cost(&by_clarabel(&p, &q, &rows)) / cost(&x) - 1.0).abs());
    }
    println!(
        "seed {SEED}: rows that bind: position {}, speed {}, acceleration {}; slope {slope:.1e} (limit 1e-12), outside {outside:.1e} mrad \
         (limit 1e-12), slack {slack:.1e} mrad (limit 1e-12), least multiplier {weakest:.1e} (limit 0), cost \
         beside Clarabel's {other:.1e} (limit 1e-5)",
        bound[0], bound[1], bound[2]
    );
    assert!(bound.iter().all(|count| *count > 30), "each kind of limit binds: {bound:?}");
    assert!(slope < 1e-12 && outside < 1e-12 && slack < 1e-12 && weakest >= 0.0);
    assert!(other < 1e-5);
}

/// Solves the same programme by Clarabel, in µrad, so that its tolerance is small compared with the cost; mrad.
fn by_clarabel(p: &DMatrix<f64>, q: &DVector<f64>, rows: &[Limit]) -> DVector<f64> {
    let mut programme = SparseProgramme::new(q.len());
    // A sum of squares with the matrix P: the rows of its Cholesky factor.
    let factor = p.clone().cholesky().unwrap().l().transpose();
    for row in factor.row_iter() {
        let entries: Vec<_> = row.iter().copied().enumerate().filter(|(_, value)| *value != 0.0).collect();
        programme.add_square(1.0, 0.0, &entries);
    }
    q.iter().enumerate().for_each(|(variable, slope)| programme.add_linear(variable, 1e3 * slope));
    for (entries, lower, upper) in rows {
        programme.at_most(Row { entries: entries.clone(), bound: 1e3 * upper });
        let negative = entries.iter().map(|&(i, factor)| (i, -factor)).collect();
        programme.at_most(Row { entries: negative, bound: -1e3 * lower });
    }
    DVector::from_vec(programme.solve().unwrap().unwrap()) * 1e-3
}

#[test]
fn a_deviation_that_steps_in_the_future_moves_the_correction_before_and_within_the_limits() {
    let (arm, ticks) = (chain(6, LIMITS), 24);
    let weights = Weights { acceleration: 1e-5, ..Weights::default() };
    let deviation = |tick: u64| Vector3::new(0.0, 0.0, if tick < 200 { 0.0 } else { 2e-4 });
    let mut seeing = Horizon::new(&arm, PERIOD, &weights, ticks).unwrap();
    let mut blind = Compensator::new(&arm, PERIOD, &weights).unwrap();
    let (mut last, mut before) = (vec![0.0; 6], vec![0.0; 6]);
    let (mut bound, mut largest) = (0, 0.0_f64);
    let mut left = [[0.0_f64; 2]; 2];
    for tick in 0..400 {
        for next in seeing.missing(tick) {
            let ahead = Ahead::at(&arm, &[0.3; 6], deviation(next));
            seeing.push(next, ahead.motion(), &ahead.jacobian, &ahead.deviation);
        }
        let now = Ahead::at(&arm, &[0.3; 6], deviation(tick));
        blind.advance(now.motion(), &now.jacobian, &now.deviation);
        let report = seeing.solve(&last, &before);
        assert!(report.status.is_minimiser(), "tick {tick}: {report:?}");
        bound += usize::from(report.status == HorizonStatus::Solved);
        let found = seeing.correction().to_vec();
        for i in 0..6 {
            largest = largest.max((found[i] - 2.0 * last[i] + before[i]).abs() / PERIOD / PERIOD);
        }
        let remains = |correction: &[f64]| {
            (now.jacobian.fixed_rows::<3>(0) * DVector::from_row_slice(correction) + deviation(tick)).norm()
        };
        for (left, correction) in left.iter_mut().zip([&found[..], blind.correction()]) {
            let part = &mut left[usize::from(tick >= 200)];
            *part = part.max(remains(correction));
        }
        (before, last) = (last, found);
    }
    let [[seeing_before, seeing_after], [blind_before, blind_after]] = left;
    println!(
        "left of a step of 200 µm: {:.1} µm before and {:.1} µm after it with a horizon, {:.1} and {:.1} µm without; limits bind in {bound} ticks, \
         acceleration {largest:.6} rad/s² (limit 4)",
        1e6 * seeing_before,
        1e6 * seeing_after,
        1e6 * blind_before,
        1e6 * blind_after
    );
    assert!(bound > 5, "limits bind: {bound}");
    assert!(largest < 4.0 + 1e-5);
    assert!(seeing_before > 1e-5 && blind_before < 1e-6, "only the horizon moves before the step");
    assert!(seeing_after < 0.8 * blind_after, "and has less to do after it");
}

#[test]
fn what_has_no_solution_is_named_and_taken_out_by_the_programme_of_one_tick() {
    let (arm, ticks) = (chain(6, LIMITS), 40);
    let weights = Weights { acceleration: 1e-6, ..Weights::default() };
    let plain = || vec![Ahead::at(&arm, &[0.3; 6], Vector3::new(0.0, 0.0, 1e-6)); ticks];
    let with = |change: &dyn Fn(&mut Vec<Ahead>)| {
        let mut ahead = plain();
        change(&mut ahead);
        ahead
    };
    let cases = [
        ("sound", with(&|_| {}), HorizonStatus::Free),
        ("beyond a limit now", with(&|ahead| ahead[0].q[2] = 1.2), HorizonStatus::LimitsConflict(2)),
        ("beyond a limit soon", with(&|ahead| ahead[4].q[2] = 1.2), HorizonStatus::Infeasible),
        ("not a number now", with(&|ahead| ahead[0].v[1] = f64::NAN), HorizonStatus::LimitsConflict(1)),
        ("not a number soon", with(&|ahead| ahead[5].v[1] = f64::NAN), HorizonStatus::BadData),
        ("deviation", with(&|ahead| ahead[5].deviation[1] = f64::NAN), HorizonStatus::BadData),
        ("jacobian", with(&|ahead| ahead[5].jacobian[(1, 1)] = f64::NAN), HorizonStatus::NumericalFailure),
        (
            "too many rows",
            with(&|ahead| {
                for (k, ahead) in ahead.iter_mut().enumerate() {
                    ahead.deviation *= if k % 8 < 4 { 1e4 } else { -1e4 };
                }
            }),
            HorizonStatus::IterationLimit,
        ),
    ];
    for (name, ahead, expected) in cases {
        let mut one = Correction::new(&arm, PERIOD, 1e-3, &weights).unwrap();
        let mut many = Correction::new(&arm, PERIOD, 1e-3, &weights).unwrap();
        let mut horizon = Horizon::new(&arm, PERIOD, &weights, ticks).unwrap();
        one.start(&ahead[0].q, &ahead[0].q);
        many.start(&ahead[0].q, &ahead[0].q);
        push_all(&mut horizon, 7, &ahead);
        let found = many.look_ahead(&arm, ahead[0].motion(), &mut horizon, &Vector3::zeros());
        println!("{name}: {found:?}");
        match found {
            Ok(report) => {
                assert_eq!(
                    (expected, report.status),
                    (HorizonStatus::Free, CompensationStatus::Free),
                    "{name}"
                );
            }
            Err(report) => {
                assert_eq!(report.status, expected, "{name}");
                let averaged = Vector3::new(1e-6, 0.0, 0.0);
                let reports =
                    [&mut one, &mut many].map(|all| all.advance(&arm, ahead[0].motion(), &averaged));
                assert_eq!(reports[0], reports[1], "{name}: what failed left a trace");
                assert_eq!(one.motion().q, many.motion().q, "{name}");
            }
        }
    }
    for (ticks, refused) in [(0, true), (1, false), (MOST_TICKS, false), (MOST_TICKS + 1, true)] {
        let made = Horizon::new(&arm, PERIOD, &weights, ticks);
        assert_eq!(matches!(made, Err(HorizonError::Ticks(found)) if found == ticks), refused);
    }
}

#[test]
fn the_same_ticks_give_the_same_plan_bit_for_bit() {
    let mut random = ChaCha8Rng::seed_from_u64(SEED);
    let (arm, ticks) = (chain(6, LIMITS), 12);
    let weights = Weights { acceleration: 1e-5, ..Weights::default() };
    let (mut worn, mut bound) = (Horizon::new(&arm, PERIOD, &weights, ticks).unwrap(), 0);
    for round in 0..20 {
        let ahead = hard_cases(&arm, ticks, &mut random);
        let mut fresh = Horizon::new(&arm, PERIOD, &weights, ticks).unwrap();
        let bits = |horizon: &mut Horizon| {
            push_all(horizon, 50 * round, &ahead);
            let report = horizon.solve(&[0.0; 6], &[0.0; 6]);
            (report, horizon.plan().iter().map(|x| x.to_bits()).collect::<Vec<_>>())
        };
        let (one, two) = (bits(&mut worn), bits(&mut fresh));
        assert_eq!(one, two, "round {round}: what was solved before shows");
        bound += usize::from(one.0.status == HorizonStatus::Solved);
    }
    assert!(bound > 10, "limits bind: {bound}");
}

#[test]
fn solving_allocates_nothing() {
    let mut random = ChaCha8Rng::seed_from_u64(SEED);
    let (arm, ticks) = (paper_arm().arm, 20);
    let mut horizon = Horizon::new(&arm, PERIOD, &Weights::default(), ticks).unwrap();
    for (scale, free) in [(30.0, false), (0.01, true)] {
        let mut ahead = hard_cases(&arm, ticks, &mut random);
        ahead.iter_mut().for_each(|ahead| ahead.deviation *= scale);
        let mut report = None;
        let count = allocation_counter::measure(|| {
            push_all(&mut horizon, 0, &ahead);
            report = Some(horizon.solve(&[0.0; 6], &[0.0; 6]));
        })
        .count_total;
        println!("{report:?}: {count} allocations");
        assert_eq!(count, 0);
        assert_eq!(report.unwrap().iterations == 0, free);
    }
}
