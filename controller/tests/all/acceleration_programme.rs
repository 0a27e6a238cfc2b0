//! Tests of the acceleration programme: damped least squares if no row is active, the optimality conditions if some are, and its
//! rows against inverse dynamics and hand calculation of braking.

use freeplay_arm::{Arm, Joint, Limits, Workspace, jacobian, rnea};
use freeplay_controller::{
    AccelerationOptions, AccelerationProgramme, CompensationStatus, Motion, PinForce, Qp, Wanted,
};
use freeplay_laws::{ArmWithPlay, Clearance, ClearanceTable};
use freeplay_model::paper_arm;
use nalgebra::{DMatrix, DVector, Vector6};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

const SEED: u64 = 512;
const PERIOD: f64 = 1e-3;
const Q: [f64; 6] = [0.1, 0.4, 0.3, 0.2, 0.9, -0.3];
const REST: [f64; 6] = [0.0; 6];

fn limited(limits: impl Fn(Limits) -> Limits) -> Arm {
    let arm = paper_arm().arm;
    let joints =
        arm.joints().iter().map(|joint| Joint { limits: limits(joint.limits), ..joint.clone() }).collect();
    Arm::new("arm", joints, *arm.tool(), *arm.gravity()).unwrap()
}

fn with_play(arm: &Arm, joints: &[usize]) -> ArmWithPlay {
    let clearance = Clearance::new(&ClearanceTable::new(6e-4)).unwrap();
    ArmWithPlay::new(arm, &joints.iter().map(|&joint| (joint, clearance)).collect::<Vec<_>>()).unwrap()
}

fn jacobian_at(arm: &Arm, q: &[f64]) -> DMatrix<f64> {
    let mut out = DMatrix::zeros(6, arm.dof());
    jacobian(arm, &mut Workspace::new(arm), q, &mut out);
    out
}

/// Forces of the arm with play with the journals at rest in the centre, in its coordinates.
fn inverse_dynamics(play: &ArmWithPlay, q: &[f64], v: &[f64], a: &[f64]) -> Vec<f64> {
    let m = play.arm().dof();
    let spread = |nominal: &[f64]| {
        let mut extended = vec![0.0; m];
        play.spread(nominal, &mut extended);
        extended
    };
    let mut force = vec![0.0; m];
    rnea(play.arm(), &mut Workspace::new(play.arm()), &spread(q), &spread(v), &spread(a), &mut force);
    force
}

/// The direction of the journal of play `index` while the arm stands still: against its load.
fn normal(play: &ArmWithPlay, index: usize) -> [f64; 2] {
    let force = inverse_dynamics(play, &Q, &REST, &REST);
    let b = play.plays()[index].slides.map(|slide| force[slide]);
    b.map(|b_i| -b_i / b[0].hypot(b[1]))
}

#[test]
fn without_active_rows_it_is_damped_least_squares() {
    let arm = limited(|_| Limits::NONE);
    let play = with_play(&arm, &[4]);
    let options = AccelerationOptions { least_force: -1e4, turning: 1e4, ..AccelerationOptions::default() };
    let mut programme = AccelerationProgramme::new(&arm, &play, PERIOD, options).unwrap();
    let mut random = ChaCha8Rng::seed_from_u64(SEED);
    let (j, mut worst, n) = (jacobian_at(&arm, &Q), 0.0_f64, normal(&play, 0));
    let mut apart = 0.0_f64;
    for _ in 0..50 {
        let tool = Vector6::from_fn(|_, _| random.random_range(-5.0..5.0));
        let joints = DVector::from_fn(6, |_, _| random.random_range(-5.0..5.0));
        let wanted = Wanted { jacobian: &j, tool: &tool, joints: joints.as_slice() };
        let state = Motion { q: &Q, v: &REST, a: &REST };
        let report =
            programme.solve(state, Motion { q: &[0.0; 2], v: &[0.0; 2], a: &[0.0; 2] }, &n, &REST, &wanted);
        assert_eq!(report.status, CompensationStatus::Free, "no row is active: nothing to iterate for");
        let ((rows, bounds), (cost, linear)) = (programme.rows(), programme.cost());
        let mut solver = Qp::new(rows).unwrap();
        assert!(solver.solve(cost, linear, bounds).status.is_usable());
        let pairs = solver.solution().iter().zip(programme.solution());
        apart = pairs.fold(apart, |most, (solved, free)| most.max((solved - free).abs()));
        let w = DMatrix::from_diagonal(&DVector::from_row_slice(options.tool.as_slice()));
        let p = j.transpose() * &w * &j + DMatrix::identity(6, 6) * options.joints;
        let expected = p.cholesky().unwrap().solve(&(j.transpose() * w * tool + joints * options.joints));
        assert!(expected.amax() > 0.1, "accelerations of nothing test nothing");
        worst = worst.max((DVector::from_row_slice(programme.accelerations()) - expected).amax());
    }
    println!(
        "seed {SEED}: largest error {worst:.1e} rad/s² (limit 1e-9), Clarabel's solution {apart:.1e} apart (limit 1e-4)"
    );
    assert!(worst < 1e-9 && apart > 0.0 && apart < 1e-4);
}

#[test]
fn the_pin_force_is_affine_in_the_accelerations_with_the_mass_matrix() {
    let play = with_play(&paper_arm().arm, &[2, 4]);
    let mut pin = PinForce::new(&play);
    let mut random = ChaCha8Rng::seed_from_u64(SEED);
    let (mut worst, mut least, mut moved) = (0.0_f64, f64::INFINITY, f64::INFINITY);
    for _ in 0..20 {
        let [q, v, a] = [1.0, 1.0, 10.0].map(|most| [(); 6].map(|()| random.random_range(-most..most)));
        let zeros = Motion { q: &[0.0; 4], v: &[0.0; 4], a: &[0.0; 4] };
        let bias = pin.forces(Motion { q: &q, v: &v, a: &REST }, zeros).to_vec();
        pin.update_mass();
        let expected = inverse_dynamics(&play, &q, &v, &a);
        for slide in play.plays().iter().flat_map(|play| play.slides) {
            let row: Vec<f64> = (0..6).map(|joint| pin.mass()[(slide, play.joint(joint))]).collect();
            let affine = bias[slide] + row.iter().zip(&a).map(|(m, a)| m * a).sum::<f64>();
            worst = worst.max((affine - expected[slide]).abs());
            least = least.min(row.iter().fold(0.0, |most: f64, m| most.max(m.abs())));
            moved = moved.min((expected[slide] - bias[slide]).abs());
        }
    }
    println!(
        "seed {SEED}: error {worst:.1e} N (limit 1e-9); rows of {least:.2} kg·m and more, forces moved by {moved:.2} N and more"
    );
    assert!(worst < 1e-9 && least > 0.1 && moved > 0.01);
}

#[test]
fn an_acceleration_that_would_lift_the_journal_is_held_back_and_is_optimal() {
    let arm = paper_arm().arm;
    let play = with_play(&arm, &[4]);
    let options = AccelerationOptions::default();
    let mut programme = AccelerationProgramme::new(&arm, &play, PERIOD, options).unwrap();
    let (j, n) = (jacobian_at(&arm, &Q), normal(&play, 0));
    // Downward acceleration, faster than the journal falls.
    let tool = Vector6::new(0.0, 0.0, -25.0, 0.0, 0.0, 0.0);
    let joints = j.clone().svd(true, true).solve(&tool, 1e-9).unwrap();
    let wanted = Wanted { jacobian: &j, tool: &tool, joints: joints.as_slice() };
    let push = |a: &[f64]| {
        let force = inverse_dynamics(&play, &Q, &REST, a);
        let [first, second] = play.plays()[0].slides;
        -(n[0] * force[first] + n[1] * force[second])
    };
    let state = Motion { q: &Q, v: &REST, a: &REST };
    let report =
        programme.solve(state, Motion { q: &[0.0; 2], v: &[0.0; 2], a: &[0.0; 2] }, &n, &REST, &wanted);
    assert_eq!(report.status, CompensationStatus::Solved);
    let (before, after) = (push(joints.as_slice()), push(programme.accelerations()));
    println!(
        "the bearing pushes with {after:.2} N (F_min {} N) instead of {before:.1} N",
        options.least_force
    );
    assert!(before < -10.0 && (after - options.least_force).abs() < 1.0);
    let (rows, bounds) = programme.rows();
    let (cost, linear) = programme.cost();
    let x = DVector::from_row_slice(programme.solution());
    let z = DVector::from_row_slice(programme.multipliers());
    let full = DMatrix::from_fn(x.len(), x.len(), |i, j| cost[(i.min(j), i.max(j))]);
    let gradient = full * &x + DVector::from_row_slice(linear) + rows.transpose() * &z;
    let room = DVector::from_row_slice(bounds) - rows * &x;
    let (stationary, complementary) = (gradient.amax(), room.component_mul(&z).amax());
    println!(
        "gradient {stationary:.1e}, complementarity {complementary:.1e} (limits 1e-5), least room {:.1e}, largest multiplier {:.2}",
        room.min(),
        z.amax()
    );
    assert!(stationary < 1e-5 && complementary < 1e-5 && room.min() > -1e-6 && z.min() > -1e-9);
    assert!(z.amax() > 0.01, "no row is active");
}

#[test]
fn torques_and_braking_bind() {
    let arm = limited(|limits| Limits { effort: 1.02 * limits.effort.min(150.0), ..limits });
    let play = with_play(&arm, &[4]);
    let mut programme =
        AccelerationProgramme::new(&arm, &play, PERIOD, AccelerationOptions::default()).unwrap();
    let (j, n, tool) = (jacobian_at(&arm, &Q), normal(&play, 0), Vector6::zeros());
    let limits = arm.joints()[4].limits;
    // Joint 5 moves towards its limit and must brake in time; the drives have little torque beyond gravity.
    let mut q = Q;
    let mut v = REST;
    (q[4], v[4]) = (limits.upper - 0.02, 2.5);
    let journals = Motion { q: &[0.0; 2], v: &[0.0; 2], a: &[0.0; 2] };
    let (mut torque, mut statuses) = (0.0_f64, Vec::new());
    for _ in 0..200 {
        let joints = [5.0, 5.0, 5.0, 5.0, 50.0, 5.0];
        let wanted = Wanted { jacobian: &j, tool: &tool, joints: &joints };
        let report = programme.solve(Motion { q: &q, v: &v, a: &REST }, journals, &n, &REST, &wanted);
        statuses.push(report.status);
        let a = programme.accelerations();
        let force = inverse_dynamics(&play, &q, &v, a);
        for (joint, of) in arm.joints().iter().enumerate() {
            torque = torque.max(force[play.joint(joint)].abs() / of.limits.effort);
        }
        q[4] += v[4] * PERIOD + 0.5 * a[4] * PERIOD * PERIOD;
        v[4] += a[4] * PERIOD;
    }
    println!(
        "joint 5 ends {:.1e} rad before its limit at {:.1e} rad/s; torques up to {torque:.4} of their limits",
        limits.upper - q[4],
        v[4]
    );
    assert!(statuses.iter().all(|status| *status == CompensationStatus::Solved), "{statuses:?}");
    assert!(q[4] <= limits.upper + 1e-6 && limits.upper - q[4] < 5e-3);
    assert!(torque <= 1.0 + 1e-5 && torque > 0.9);
}
