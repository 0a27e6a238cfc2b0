//! Tests of the one-tick prediction of the joints against finer integration, and of friction that stops a joint without reversing
//! it.

use freeplay_arm::{Arm, Joint, JointFriction, Workspace, aba, rnea};
use freeplay_controller::look_ahead::{LookAhead, drive_frictions};
use freeplay_model::paper_arm;
use freeplay_shm::State;

/// The paper's arm with the same friction in every drive.
fn arm(viscous: f64, coulomb: f64) -> Arm {
    let arm = paper_arm().arm;
    let joints = arm
        .joints()
        .iter()
        .map(|joint| Joint { friction: JointFriction { viscous, coulomb }, ..joint.clone() })
        .collect();
    Arm::new("with friction", joints, *arm.tool(), *arm.gravity()).unwrap()
}

fn state(q: [f64; 6], v: [f64; 6], torque: &[f64]) -> State {
    let mut state = State::new(1, 6);
    state.tick = 1;
    state.q[..6].copy_from_slice(&q);
    state.qd[..6].copy_from_slice(&v);
    state.applied[..6].copy_from_slice(torque);
    state
}

/// The state after `period`, computed with many small midpoint steps.
fn fine(arm: &Arm, q: [f64; 6], v: [f64; 6], torque: &[f64], period: f64) -> ([f64; 6], [f64; 6]) {
    let (friction, mut workspace) = (drive_frictions(arm), Workspace::new(arm));
    let steps = 2000;
    let h = period / f64::from(steps);
    let mut slope = |q: &[f64; 6], v: &[f64; 6]| {
        let mut net = [0.0; 6];
        for i in 0..6 {
            net[i] = torque[i] - friction[i].resisting(v[i]);
        }
        let mut a = [0.0; 6];
        aba(arm, &mut workspace, q, v, &net, &mut a);
        a
    };
    let (mut q, mut v) = (q, v);
    for _ in 0..steps {
        let a = slope(&q, &v);
        let half_q = std::array::from_fn(|i| q[i] + 0.5 * h * v[i]);
        let half_v = std::array::from_fn(|i| v[i] + 0.5 * h * a[i]);
        let a = slope(&half_q, &half_v);
        for i in 0..6 {
            q[i] += h * half_v[i];
            v[i] += h * a[i];
        }
    }
    (q, v)
}

const Q: [f64; 6] = [0.2, 0.5, 0.3, -0.4, 0.8, 0.1];
const V: [f64; 6] = [0.5, -0.4, 0.3, 0.8, -0.6, 1.0];
const TORQUE: [f64; 6] = [20.0, -150.0, -130.0, 0.5, -1.0, 0.05];

#[test]
fn the_error_falls_with_the_square_of_the_period() {
    for (name, arm) in [("no friction", arm(0.0, 0.0)), ("friction", arm(0.02, 0.01))] {
        let error = |period: f64| {
            let mut look_ahead = LookAhead::new(&arm, period);
            let ahead = look_ahead.predict(&arm, &state(Q, V, &TORQUE), &[0.0; 6]).unwrap().clone();
            let (_, v) = fine(&arm, Q, V, &TORQUE, period);
            (0..6).map(|i| (ahead.v[i] - v[i]).abs()).fold(0.0, f64::max)
        };
        let (coarse, half) = (error(1e-3), error(5e-4));
        let order = (coarse / half).log2();
        println!(
            "{name}: velocity error {coarse:.1e} rad/s at 1 ms, {half:.1e} at 0.5 ms, order {order:.2} (1.8 to 2.2)"
        );
        assert!((1.8..2.2).contains(&order));
    }
}

#[test]
fn a_joint_held_by_friction_stays_and_a_balanced_one_keeps_its_speed() {
    let arm = arm(0.0, 5.0);
    let (mut look_ahead, mut workspace) = (LookAhead::new(&arm, 1e-3), Workspace::new(&arm));
    let mut torque = [0.0; 6];
    rnea(&arm, &mut workspace, &Q, &[0.0; 6], &[0.0; 6], &mut torque);
    // Half the breakaway torque; without friction, joint 6 would reach 4 rad/s after a tick.
    torque.iter_mut().for_each(|torque| *torque += 2.5);
    let ahead = look_ahead.predict(&arm, &state(Q, [0.0; 6], &torque), &[0.0; 6]).unwrap();
    let creep = ahead.v.iter().fold(0.0, |most: f64, v| most.max(v.abs()));
    println!(
        "held joints creep at {creep:.1e} rad/s (limit 1e-3, the speed over which friction is smoothed)"
    );
    assert!(creep < 1e-3);

    let v = [5e-3, -2e-3, 0.3, 0.01, -0.5, 4e-4];
    rnea(&arm, &mut workspace, &Q, &v, &[0.0; 6], &mut torque);
    for (torque, (friction, v)) in torque.iter_mut().zip(drive_frictions(&arm).iter().zip(v)) {
        *torque += friction.resisting(v);
    }
    let ahead = look_ahead.predict(&arm, &state(Q, v, &torque), &[0.0; 6]).unwrap();
    let change = (0..6).map(|i| (ahead.v[i] - v[i]).abs()).fold(0.0, f64::max);
    println!("balanced joints change by {change:.1e} rad/s (limit 1e-12)");
    assert!(change < 1e-12);
}

#[test]
fn during_tick_0_the_joints_are_on_the_reference() {
    let arm = arm(0.0, 0.0);
    let mut look_ahead = LookAhead::new(&arm, 1e-3);
    let mut state = state(Q, V, &[0.0; 6]);
    state.tick = 0;
    state.reference_next.q[2] = 0.31;
    state.reference_next.qd[2] = 0.5;
    let ahead = look_ahead.predict(&arm, &state, &[0.0; 6]).unwrap();
    assert_eq!((ahead.q[2], ahead.v[2]), (0.31, 0.5));
}

#[test]
fn a_state_that_is_not_finite_has_no_future_and_does_no_harm() {
    let arm = arm(0.0, 0.0);
    let mut look_ahead = LookAhead::new(&arm, 1e-3);
    let good = state(Q, V, &TORQUE);
    let before = look_ahead.predict(&arm, &good, &[0.0; 6]).unwrap().clone();
    let mut bad = good;
    bad.q[1] = f64::NAN;
    assert!(look_ahead.predict(&arm, &bad, &[0.0; 6]).is_none());
    assert_eq!(look_ahead.predict(&arm, &good, &[0.0; 6]).unwrap(), &before);
}
