//! The joints' motion: it is on the Cartesian path everywhere, its derivatives are consistent, its branch is the expected one.

use crate::common;
use std::f64::consts::FRAC_PI_2;

use freeplay_arm::{Arm, Workspace, forward_kinematics, jacobian, tool_bias_acceleration};
use freeplay_path::{JointPath, PathKind, PathSpec, Size, ToolPath};
use nalgebra::{DMatrix, DVector, Vector3, Vector6};

const RATE: f64 = 1000.0;

/// Position, velocity and acceleration at `t`.
fn at(path: &JointPath, t: f64) -> [DVector<f64>; 3] {
    let [mut q, mut v, mut a] = [0, 1, 2].map(|_| DVector::zeros(path.dof()));
    path.at(t, q.as_mut_slice(), v.as_mut_slice(), a.as_mut_slice());
    [q, v, a]
}

/// Times over the whole motion, off the nodes, and close to the kinks of the squares.
fn probes(duration: f64) -> Vec<f64> {
    let spread = (0..1500).map(|k| (f64::from(k) + 0.377) / 1500.0 * duration);
    let quarter = duration / 4.0;
    let kinks = (0..4).flat_map(|k| [0.0, 0.004, 0.04, 0.96, 0.996].map(|b| (f64::from(k) + b) * quarter));
    spread
        .chain(kinks.flat_map(|t| [t - 3e-5, t, t + 3e-5]))
        .filter(|t| (0.0..duration).contains(t))
        .collect()
}

/// Largest deviations of the tool from its path in pose, velocity and acceleration (SI), over the first `rows` rows.
fn deviations(arm: &Arm, path: &JointPath, tool: &ToolPath, rows: usize) -> [f64; 3] {
    let (mut workspace, mut j) = (Workspace::new(arm), DMatrix::zeros(6, arm.dof()));
    let mut worst = [0.0_f64; 3];
    for t in probes(path.duration()) {
        let ([q, v, a], wanted) = (at(path, t), tool.at(t));
        let pose = forward_kinematics(arm, &mut workspace, q.as_slice());
        jacobian(arm, &mut workspace, q.as_slice(), &mut j);
        let bias = tool_bias_acceleration(arm, &mut workspace, q.as_slice(), v.as_slice());
        let turn = (wanted.pose.rotation * pose.rotation.inverse()).scaled_axis();
        let shift = wanted.pose.translation.vector - pose.translation.vector;
        let errors = [
            Vector6::new(shift.x, shift.y, shift.z, turn.x, turn.y, turn.z),
            wanted.velocity - &j * v,
            wanted.acceleration - (&j * a + bias),
        ];
        for (worst, error) in worst.iter_mut().zip(errors) {
            *worst = worst.max(error.rows(0, rows).amax());
        }
    }
    worst
}

#[test]
fn the_tool_stays_on_every_built_in_path_between_the_nodes_too() {
    let arm = common::paper_arm();
    for kind in [PathKind::Lissajous, PathKind::Circle, PathKind::Square] {
        let spec = PathSpec { kind, ..PathSpec::default() };
        let path = JointPath::plan(&arm, &spec, RATE).expect("the path is reachable");
        assert_eq!((path.ticks(), path.dof(), path.duration()), (6000, 6, 6.0));
        let tool = ToolPath::of(&spec).expect("a Cartesian kind");
        let worst = deviations(&arm, &path, &tool, 6);
        println!(
            "{kind:?}: pose {:.1e} (allowed 1e-12), velocity {:.1e} (1e-10), acceleration {:.1e} (1e-5)",
            worst[0], worst[1], worst[2]
        );
        assert!(worst[0] < 1e-12 && worst[1] < 1e-10 && worst[2] < 1e-5);
    }
}

#[test]
fn the_sharp_square_runs_through_its_samples_and_overshoots_its_accelerations() {
    let arm = common::paper_arm();
    let sharp = PathSpec { kind: PathKind::SquareSharp, ..PathSpec::default() };
    let exact = PathSpec { kind: PathKind::Square, blend: Some(0.004), ..PathSpec::default() };
    let [sampled, exact] =
        [&sharp, &exact].map(|spec| JointPath::plan(&arm, spec, RATE).expect("the path is reachable"));
    let (mut at_samples, mut between) = (0.0_f64, 0.0_f64);
    for k in 0..24_000 {
        for (worst, offset) in [(&mut at_samples, 0.0), (&mut between, 0.5)] {
            let t = (f64::from(k) + offset) / 4000.0;
            *worst = worst.max((&at(&sampled, t)[0] - &at(&exact, t)[0]).amax());
        }
    }
    let overshoot = sampled.peak_acceleration()[0] / exact.peak_acceleration()[0];
    println!(
        "q at the samples {at_samples:.1e} rad, between {between:.1e} rad; peak acceleration {overshoot:.4} times"
    );
    assert!(at_samples < 1e-12 && between > 1e-9 && between < 1e-6);
    assert!(overshoot > 1.01 && overshoot < 1.3, "a cubic spline overshoots a step: {overshoot}");
}

/// The postures of the paper's arm with the tool pointing down, elbow up, by the law of cosines: the wrist is 0.115 m
/// above the tool, shoulder at (0.26, 0.675) m in the arm's plane, upper arm 0.68 m, forearm 0.67 m.
fn closed_form(tool: Vector3<f64>) -> [f64; 6] {
    let (upper, fore) = (0.68, 0.67);
    let (r, z) = (tool.x.hypot(tool.y) - 0.26, tool.z + 0.115 - 0.675);
    let q1 = tool.y.atan2(tool.x);
    let q3 = ((upper * upper + fore * fore - r * r - z * z) / (2.0 * upper * fore)).asin();
    let (along, across) = (upper - fore * q3.sin(), fore * q3.cos());
    let q2 = (along * r - across * z).atan2(across * r + along * z);
    [q1, q2, q3, 0.0, FRAC_PI_2 - q2 - q3, q1]
}

#[test]
fn the_branch_is_elbow_up_and_agrees_with_the_law_of_cosines() {
    let arm = common::paper_arm();
    for kind in [PathKind::Lissajous, PathKind::Circle, PathKind::Square] {
        let spec = PathSpec { kind, ..PathSpec::default() };
        let path = JointPath::plan(&arm, &spec, RATE).expect("the path is reachable");
        let tool = ToolPath::of(&spec).expect("a Cartesian kind");
        let worst = probes(6.0).into_iter().fold(0.0_f64, |worst, t| {
            let expected = DVector::from_row_slice(&closed_form(tool.at(t).pose.translation.vector));
            worst.max((&at(&path, t)[0] - expected).amax())
        });
        println!("{kind:?}: worst difference to the closed form {worst:.1e} rad, allowed 1e-12");
        assert!(worst < 1e-12);
    }
}

#[test]
fn a_start_posture_chooses_another_branch_of_the_same_path() {
    let arm = common::paper_arm();
    let spec = PathSpec::default();
    let usual = JointPath::plan(&arm, &spec, RATE).expect("the path is reachable");
    let q = usual.start().q;
    // The wrist flipped: joint 4 by half a turn, joint 5 mirrored, joint 6 back by half a turn.
    let start = vec![q[0] + 0.05, q[1] - 0.05, q[2], q[3] + 3.1, -q[4], q[5] - 3.1];
    let turned = JointPath::plan(&arm, &PathSpec { start: Some(start), ..spec.clone() }, RATE);
    let turned = turned.expect("the path is reachable on this branch");
    assert!((turned.start().q[4] + q[4]).abs() < 1e-12, "joint 5 is mirrored");
    let tool = ToolPath::of(&spec).expect("a Cartesian kind");
    let worst = deviations(&arm, &turned, &tool, 6);
    println!("pose {:.1e}, allowed 1e-12", worst[0]);
    assert!(worst[0] < 1e-12);
}

/// Largest errors of central differences with step `h` of q against v, and of v against a, away from the kinks.
fn error_of_differences(path: &JointPath, h: f64) -> [f64; 2] {
    let fractions = [0.01, 0.02, 0.3, 0.5, 0.7, 0.98];
    let times = (0..4).flat_map(|side| fractions.map(|f| (f64::from(side) + f) * path.duration() / 4.0));
    times.fold([0.0; 2], |worst, t| {
        let ([q0, v0, _], [_, v, a], [q1, v1, _]) = (at(path, t - h), at(path, t), at(path, t + h));
        let errors = [((q1 - q0) / (2.0 * h) - v).amax(), ((v1 - v0) / (2.0 * h) - a).amax()];
        [worst[0].max(errors[0]), worst[1].max(errors[1])]
    })
}

#[test]
fn velocity_and_acceleration_are_the_derivatives_of_the_joints_position() {
    let mut spare = PathSpec { centre: [0.55, 0.0, 0.6], ..PathSpec::default() };
    spare.size = Some(Size::Axes([0.08, 0.12, 0.05]));
    let cases = [
        ("six joints, smooth", common::paper_arm(), PathSpec::default()),
        (
            "six joints, square",
            common::paper_arm(),
            PathSpec { kind: PathKind::Square, ..PathSpec::default() },
        ),
        ("seven joints, smooth", common::redundant(), spare),
    ];
    for (name, arm, spec) in cases {
        let path = JointPath::plan(&arm, &spec, RATE).expect("the path is reachable");
        let (coarse, fine) = (error_of_differences(&path, 8e-3), error_of_differences(&path, 2e-3));
        println!("{name}: differences of 8 ms err by {coarse:?}, of 2 ms by {fine:?}");
        println!("  ratios {:.2}, {:.2}; order 2 is 16", coarse[0] / fine[0], coarse[1] / fine[1]);
        for (coarse, fine) in coarse.iter().zip(fine) {
            assert!(*coarse > 1e-7, "the coarse difference must err, or nothing is tested");
            assert!((coarse / fine - 16.0).abs() < 1.0);
        }
    }
}

#[test]
fn laps_repeat_exactly_and_join_without_a_jump() {
    let arm = common::paper_arm();
    for kind in [PathKind::Lissajous, PathKind::Circle, PathKind::Square] {
        let spec = PathSpec { kind, laps: 3, period: 2.0, ..PathSpec::default() };
        let path = JointPath::plan(&arm, &spec, RATE).expect("the path is reachable");
        assert_eq!((path.duration(), path.ticks()), (6.0, 6000));
        for t in [0.0, 0.3, 1.25, 1.75] {
            assert_eq!(at(&path, t), at(&path, t + 2.0), "the second lap is the first");
            assert_eq!(at(&path, t), at(&path, t + 4.0), "and so is the third");
        }
        for seam in [2.0, 4.0] {
            let ([q0, v0, _], [q1, v1, _]) = (at(&path, seam - 1.1e-9), at(&path, seam));
            let jump = (q1 - q0 - &v1 * 1.1e-9).amax().max((v1 - v0).amax());
            println!("{kind:?}: jump at the seam {jump:.1e}, allowed 1e-7");
            assert!(jump < 1e-7);
        }
    }
}

#[test]
fn an_arm_with_a_joint_to_spare_follows_every_lap() {
    let arm = common::redundant();
    let mut spec =
        PathSpec { kind: PathKind::Circle, centre: [0.55, 0.0, 0.6], laps: 2, ..PathSpec::default() };
    spec.size = Some(Size::One(0.1));
    let path = JointPath::plan(&arm, &spec, RATE).expect("the path is reachable");
    let worst = deviations(&arm, &path, &ToolPath::of(&spec).expect("a Cartesian kind"), 6);
    println!(
        "pose {:.1e} (allowed 1e-12), velocity {:.1e} (1e-10), acceleration {:.1e} (1e-5)",
        worst[0], worst[1], worst[2]
    );
    assert!(worst[0] < 1e-12 && worst[1] < 1e-10 && worst[2] < 1e-5);
    let drift = (&at(&path, 6.0)[0] - &at(&path, 0.0)[0]).amax();
    println!("the posture drifts by {drift:.2e} rad in a lap");
    assert!(drift > 1e-6, "an arm that came back would not test the planning of the second lap");
}

#[test]
fn arms_of_three_joints_follow_the_position() {
    let circle = PathSpec { kind: PathKind::Circle, size: Some(Size::One(0.1)), ..PathSpec::default() };
    let cases = [
        ("cylindrical", common::cylindrical(), PathSpec { centre: [0.6, 0.1, 0.3], ..PathSpec::default() }),
        // The tool cannot leave its plane, so that the Jacobian has rank 2: least squares, with one redundant joint.
        (
            "planar",
            common::planar(),
            PathSpec { centre: [0.7, 0.2, 0.0], start: Some(vec![-0.5, 0.9, 0.4]), ..circle },
        ),
    ];
    for (name, arm, spec) in cases {
        let path = JointPath::plan(&arm, &spec, RATE).expect("the path is reachable");
        let worst = deviations(&arm, &path, &ToolPath::of(&spec).expect("a Cartesian kind"), 3);
        println!(
            "{name}: position {:.1e} (allowed 1e-12), velocity {:.1e} (1e-10), acceleration {:.1e} (1e-5)",
            worst[0], worst[1], worst[2]
        );
        assert!(worst[0] < 1e-12 && worst[1] < 1e-10 && worst[2] < 1e-5);
    }
}

#[test]
fn the_swing_keeps_the_limits_of_any_arm_and_starts_at_rest() {
    for arm in [common::pendulum(), common::planar(), common::paper_arm(), common::redundant()] {
        let spec = PathSpec { kind: PathKind::JointSine, laps: 2, ..PathSpec::default() };
        let path = JointPath::plan(&arm, &spec, RATE).expect("any arm can swing");
        assert_eq!(path.duration(), 12.0);
        for t in [0.0, 6.0, 12.0] {
            let [_, v, a] = at(&path, t);
            assert!(v.amax() < 1e-12 && a.amax() < 1e-12, "each lap goes from rest to rest");
        }
        for (joint, (speed, bend)) in
            arm.joints().iter().zip(path.peak_velocity().iter().zip(path.peak_acceleration()))
        {
            assert!(*speed > 0.01 && *speed <= joint.limits.velocity && *bend <= joint.limits.acceleration);
        }
        let (coarse, fine) = (error_of_differences(&path, 8e-3), error_of_differences(&path, 2e-3));
        println!(
            "{} joints: ratios {:.2}, {:.2}; order 2 is 16",
            arm.dof(),
            coarse[0] / fine[0],
            coarse[1] / fine[1]
        );
        assert!(coarse.iter().zip(fine).all(|(c, f)| *c > 1e-7 && (c / f - 16.0).abs() < 1.5));
    }
    let about = PathSpec {
        kind: PathKind::JointSine,
        start: Some(vec![0.7]),
        size: Some(Size::One(0.1)),
        ..PathSpec::default()
    };
    let path = JointPath::plan(&common::pendulum(), &about, RATE).expect("the swing fits");
    let top = probes(6.0).into_iter().map(|t| at(&path, t)[0][0]).fold(f64::MIN, f64::max);
    assert!((top - 0.8).abs() < 1e-4, "it swings by 0.1 about 0.7: {top}");
}

#[test]
fn ticks_cover_the_motion() {
    let arm = common::pendulum();
    for (period, rate, ticks) in
        [(0.1, 1000.0, 100), (0.0301, 1000.0, 31), (6.0, 333.0, 1998), (0.01, 0.5, 1)]
    {
        let spec = PathSpec { kind: PathKind::JointSine, period, ..PathSpec::default() };
        assert_eq!(JointPath::plan(&arm, &spec, rate).expect("any arm can swing").ticks(), ticks);
    }
}
