//! Rollouts against closed forms: a step, a ramp, a load held by friction, a stop; energy, order of convergence, no allocation.
use freeplay_arm::{Arm, Workspace, kinetic_energy};
use freeplay_servo::{
    Commands, Course, JointServo, ModelParameter, Rollout, ServoArm, Sliding, State, Unknown,
};

use crate::common::{INERTIA, LEVER, MASS, pendulum, stamps, two_links};

/// Positions of the pendulum with `servo`, initially at rest at zero, with commands `command` of time, at `count` stamps `step` apart.
fn motion(
    arm: &Arm,
    servo: JointServo,
    command: impl Fn(f64) -> f64,
    count: usize,
    step: f64,
    longest: f64,
) -> Vec<f64> {
    let stamps = stamps(count, step);
    let values: Vec<f64> = stamps.iter().map(|t| command(*t)).collect();
    let commands = [Commands::new(&stamps, &values)];
    let model = ServoArm::new(arm.clone(), vec![servo]);
    let start = State { q: vec![0.0], v: vec![0.0] };
    let mut out = vec![0.0; count];
    Rollout::new(&model, longest).run(&model, along(&commands, &stamps), &start, &mut out);
    out
}

/// The course of `commands` through `stamps` under the loads of the arm.
fn along<'a>(commands: &'a [Commands], stamps: &'a [f64]) -> Course<'a> {
    Course { commands, stamps, loads: &[] }
}

/// A link that its weight presses to one flank of a gap equals one whose encoder reads half of the gap at the joint's zero: k (c − q) = m g
/// l cos(q − j/2).
#[test]
fn a_gap_under_a_weight_is_a_zero_that_is_off_by_half_of_it() {
    let (stiffness, command, gap, gravity) = (8.0, 0.3, 0.1, 9.81);
    let servo = JointServo { damping: 0.4, ..JointServo::stiff(stiffness) };
    let stamps = stamps(400, 0.02);
    let commands = [Commands::new(&stamps, &vec![command; stamps.len()])];
    let rested = |parameter: ModelParameter, x: f64| {
        let mut model = ServoArm::new(pendulum(gravity), vec![servo]);
        let unknown = Unknown {
            joint: 0,
            parameter,
            expected: 0.0,
            deviation: 1.0,
            step: 0.0,
            is_torque: false,
            least: 0.0,
        };
        unknown.set(&mut model, x);
        assert!((unknown.of(&model) - x).abs() < 1e-15);
        let mut out = vec![0.0; stamps.len()];
        let start = State { q: vec![command], v: vec![0.0] };
        Rollout::new(&model, 0.001).run(&model, along(&commands, &stamps), &start, &mut out);
        out[stamps.len() - 1]
    };
    for (parameter, x) in [(ModelParameter::Gap, gap), (ModelParameter::Zero, 0.5 * gap)] {
        let q = rested(parameter, x);
        let off = stiffness * (command - q) - MASS * gravity * LEVER * (q - 0.5 * gap).cos();
        println!("{parameter:?}: rests at {q:.6} rad, torques differ by {off:.1e} N·m");
        assert!(off.abs() < 1e-6);
    }
}

/// Step response of k, d and I: the underdamped oscillator's closed form.
#[test]
fn a_step_is_that_of_mass_spring_and_damper_and_errors_fall_with_the_square_of_the_step() {
    let arm = pendulum(0.0);
    let (stiffness, damping) = (8.0, 0.25);
    let servo = JointServo { damping, ..JointServo::stiff(stiffness) };
    let (decay, natural) = (0.5 * damping / INERTIA, (stiffness / INERTIA).sqrt());
    let turning = (natural * natural - decay * decay).sqrt();
    let exact = |t: f64| {
        0.1 * (1.0 - (-decay * t).exp() * ((turning * t).cos() + decay / turning * (turning * t).sin()))
    };
    let error = |longest: f64| {
        let q = motion(&arm, servo, |_| 0.1, 101, 0.01, longest);
        q.iter().enumerate().map(|(row, q)| (q - exact(row as f64 * 0.01)).abs()).fold(0.0, f64::max)
    };
    let errors = [1e-3, 5e-4, 2.5e-4].map(error);
    println!("errors at 1, 0.5 and 0.25 ms: {errors:?}");
    assert!(errors[0] > 1e-7 && errors[0] < 1e-4);
    for pair in errors.windows(2) {
        let order = (pair[0] / pair[1]).log2();
        assert!((1.8..2.2).contains(&order), "order {order}");
    }
}

/// The arm's own terms may stay constant over ten steps of the servo: the motion of two heavy links is the same to a hundredth of an
/// encoder step of 1 mrad.
#[test]
fn the_terms_of_the_arm_need_no_steps_as_short_as_those_of_its_servos() {
    let arm = two_links(9.81);
    let times = stamps(500, 0.02);
    let commands = [0.9, 1.7].map(|rate| {
        let values: Vec<f64> = times.iter().map(|t| 0.4 * (rate * t).sin() + 0.1 * (5.0 * t).sin()).collect();
        Commands::new(&times, &values)
    });
    let servo = JointServo { damping: 0.9, coulomb: 0.3, delay: 0.013, ..JointServo::stiff(12.0) };
    let model = ServoArm::new(arm.clone(), vec![servo; 2]);
    let start = State { q: vec![0.0; 2], v: vec![0.0; 2] };
    let [fine, coarse] = [0.001, 0.01].map(|longest| {
        let mut out = vec![0.0; 2 * times.len()];
        Rollout::new(&model, longest).run(&model, along(&commands, &times), &start, &mut out);
        out
    });
    let squares: f64 = fine.iter().zip(&coarse).map(|(a, b)| (a - b).powi(2)).sum();
    let rms = (squares / fine.len() as f64).sqrt();
    println!("10 ms against 1 ms: {:.4} mrad rms", 1e3 * rms);
    assert!(rms < 1e-4);
}

/// Friction holds a smaller load for ever, to the last bit.
#[test]
fn a_joint_held_by_friction_does_not_creep() {
    let arm = pendulum(9.81);
    let load = MASS * LEVER * 9.81;
    for stiction in [0.0, 0.02] {
        let coulomb = 1.001 * load - stiction;
        let servo = JointServo { coulomb, stiction, damping: 0.1, ..JointServo::stiff(10.0) };
        let q = motion(&arm, servo, |_| 0.0, 3001, 0.02, 0.01);
        assert!(q.iter().all(|q| *q == 0.0), "{:?}", q.last());
        let less = JointServo { coulomb: 0.99 * load - stiction, ..servo };
        let q = motion(&arm, less, |_| 0.0, 3001, 0.02, 0.01);
        println!("with too little friction it sinks to {:?}", q.last());
        assert!(q[3000] < -1e-4, "the test has a load that friction matters for");
    }
}

/// A slow ramp: the joint waits until k u exceeds the friction, then follows with the error (F + d v)/k.
#[test]
fn a_ramp_breaks_away_at_the_friction_and_follows_by_friction_and_damping() {
    let arm = pendulum(0.0);
    let (stiffness, damping, coulomb, speed) = (10.0, 0.6, 0.3, 0.2);
    let servo = JointServo { damping, coulomb, ..JointServo::stiff(stiffness) };
    let q = motion(&arm, servo, |t| speed * t, 1501, 0.002, 0.002);
    let onset = q.iter().position(|q| *q > 0.0).unwrap() as f64 * 0.002;
    println!("onset at {onset:.3} s, {:.3} by the law", coulomb / stiffness / speed);
    assert!((onset - coulomb / stiffness / speed).abs() < 0.005);
    let left = speed * 3.0 - q[1500];
    let expected = (coulomb + damping * speed) / stiffness + 0.001 * speed;
    assert!((left - expected).abs() < 2e-5, "{left} against {expected}");
}

/// Delay and hold: nothing moves before a command of 0.1 s takes effect, and the delay is accurate to a fraction of a step.
#[test]
fn a_delay_acts_to_a_fraction_of_a_step() {
    let arm = pendulum(0.0);
    let at = |delay: f64| {
        let servo = JointServo { damping: 0.5, delay, ..JointServo::stiff(10.0) };
        motion(&arm, servo, |t| if t > 0.095 { 0.1 } else { 0.0 }, 30, 0.02, 0.01)
    };
    let q = at(0.033);
    assert!(q[6] == 0.0 && q[7] > 0.0, "{:?}", &q[4..9]);
    let [early, middle, late] = [0.033, 0.036, 0.039].map(|delay| at(delay)[9]);
    assert!(early > middle && middle > late);
    assert!((early - 2.0 * middle + late).abs() < 0.1 * (early - late), "{early} {middle} {late}");
}

/// Limits: the torque limit bounds the lifted load, the speed limit the speed; a dead band leaves a position error, a stop holds the joint.
#[test]
fn limits_dead_band_and_stop_hold() {
    let lifted = |servo: JointServo| motion(&pendulum(9.81), servo, |_| 0.5, 501, 0.02, 0.01)[500];
    let damped = JointServo { damping: 1.0, ..JointServo::stiff(20.0) };
    let load = |q: f64| MASS * LEVER * 9.81 * q.cos();
    let q = lifted(damped);
    assert!((20.0 * (0.5 - q) - load(q)).abs() < 1e-6, "the droop is load over stiffness: {q}");
    assert!(lifted(JointServo { torque_limit: 0.9 * load(0.0), ..damped }) < -0.1, "it sinks");
    let free =
        |servo: JointServo, command: fn(f64) -> f64| motion(&pendulum(0.0), servo, command, 501, 0.02, 0.01);
    let q = free(JointServo { deadband: 0.05, damping: 3.0, ..damped }, |_| 0.5)[500];
    assert!((q - 0.45).abs() < 1e-6, "{q}");
    let q = free(JointServo { speed_limit: 0.1, ..damped }, |t| if t < 0.1 { 0.0 } else { 0.5 });
    assert!(((q[200] - q[100]) / 2.0 - 0.1).abs() < 1e-6, "{} to {}", q[100], q[200]);
    let q =
        free(JointServo { stops: [f64::NEG_INFINITY, 0.3], ..damped }, |t| if t < 5.0 { 0.5 } else { -0.1 });
    assert!((q[200] - 0.3).abs() < 1e-12 && q.iter().all(|q| *q < 0.3 + 1e-12), "{}", q[200]);
    assert!((q[500] + 0.1).abs() < 1e-6, "and lets it go");
}

/// Without friction and damping the midpoint rule conserves the energy of an oscillator; with them the energy only falls.
#[test]
fn energy_is_kept_or_falls() {
    let arm = two_links(0.0);
    let times = stamps(500, 0.01);
    let commands = [0, 1].map(|_| Commands::new(&times, &vec![0.0; times.len()]));
    let energies = |joint: JointServo, spread: f64| {
        let model = ServoArm::new(arm.clone(), vec![joint; 2]);
        let mut rollout = Rollout::new(&model, 0.001);
        let mut state = State { q: vec![spread, -0.5 * spread], v: vec![0.0, 0.0] };
        let mut workspace = Workspace::new(&arm);
        times
            .windows(2)
            .map(|pair| {
                state = rollout.after(&model, along(&commands, pair), &state);
                let spring: f64 = state.q.iter().map(|q| 0.5 * joint.stiffness * q * q).sum();
                spring + kinetic_energy(&arm, &mut workspace, &state.q, &state.v)
            })
            .collect::<Vec<f64>>()
    };
    let free = energies(JointServo::stiff(5.0), 0.02);
    let drift = free.iter().map(|e| (e / free[0] - 1.0).abs()).fold(0.0, f64::max);
    println!("energy drifts by {drift:e}");
    assert!(drift < 2e-3);
    let rubbing = energies(JointServo { coulomb: 0.02, damping: 0.02, ..JointServo::stiff(5.0) }, 0.2);
    assert!(rubbing.windows(2).all(|pair| pair[1] <= pair[0] * (1.0 + 1e-9)), "energy grows");
    assert!(rubbing[498] < 0.1 * rubbing[0]);
}

/// The solution of three coupled joints is the best over all combinations of signs.
#[test]
fn the_solver_finds_what_enumeration_finds() {
    let a = [2.0, 0.8, -0.3, 0.8, 1.5, 0.4, -0.3, 0.4, 1.0];
    let bounds = [[-0.2, f64::INFINITY], [f64::NEG_INFINITY, 0.1], [f64::NEG_INFINITY, f64::INFINITY]];
    let value = |b: &[f64; 3], friction: &[f64; 3], w: &[f64]| {
        let quadratic: f64 = (0..9).map(|i| 0.5 * a[i] * w[i / 3] * w[i % 3]).sum();
        quadratic + (0..3).map(|i| friction[i] * w[i].abs() - b[i] * w[i]).sum::<f64>()
    };
    let mut system = Sliding::new(3);
    system.matrix_mut().copy_from_slice(&a);
    let (mut resting, mut sliding, mut stopped) = (0, 0, 0);
    for case in 0..200_u32 {
        let number = |k: u32| f64::from((case * 7 + k * 31) % 101) / 25.0 - 2.0;
        let b = [number(1), number(2), number(3)];
        let friction = [number(4).abs(), number(5).abs(), number(6).abs()];
        let mut w = [0.0; 3];
        system.solve(&b, &friction, &bounds, &mut w);
        resting += w.iter().filter(|w| **w == 0.0).count();
        sliding += w.iter().filter(|w| **w != 0.0).count();
        stopped += usize::from(w[0] == -0.2 || w[1] == 0.1);
        let best = value(&b, &friction, &w);
        for other in 0..27 {
            let step = [other % 3, other / 3 % 3, other / 9].map(|digit| f64::from(digit) - 1.0);
            let moved: Vec<f64> = w.iter().zip(step).map(|(w, step)| w + 1e-4 * step).collect();
            let is_inside = moved.iter().zip(&bounds).all(|(w, [low, high])| low <= w && w <= high);
            assert!(!is_inside || value(&b, &friction, &moved) >= best - 1e-12, "case {case}");
        }
    }
    println!("{resting} at rest, {sliding} sliding, {stopped} times a stop");
    assert!(resting > 100 && sliding > 100 && stopped > 20);
}

#[test]
fn a_rollout_allocates_nothing() {
    let arm = two_links(9.81);
    let times = stamps(200, 0.02);
    let values: Vec<f64> = times.iter().map(|t| (3.0 * t).sin()).collect();
    let commands = [0, 1].map(|_| Commands::new(&times, &values));
    let servo =
        JointServo { damping: 0.5, coulomb: 0.1, stiction: 0.05, delay: 0.013, ..JointServo::stiff(20.0) };
    let model = ServoArm::new(arm.clone(), vec![servo; 2]);
    let start = State { q: vec![0.0; 2], v: vec![0.0; 2] };
    let mut rollout = Rollout::new(&model, 0.01);
    let mut out = vec![0.0; 400];
    let counted =
        allocation_counter::measure(|| rollout.run(&model, along(&commands, &times), &start, &mut out));
    assert_eq!(counted.count_total, 0);
    assert!(out[398].abs() > 1e-3, "it moves");
}
