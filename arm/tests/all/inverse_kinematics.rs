//! Inverse kinematics: round trips, the branch of the seed, and reported failures.

use std::f64::consts::TAU;

use crate::common::{Random, close, distance};
use freeplay_arm::{
    Arm, IkError, IkTask, Workspace, forward_kinematics, inverse_kinematics, inverse_kinematics_global,
};
use freeplay_model::paper_arm;
use nalgebra::{Isometry3, Translation3, UnitQuaternion};

/// Distance of the tool at `q` from `target`, m and rad together.
fn miss(arm: &Arm, ws: &mut Workspace, q: &[f64], target: &Isometry3<f64>, task: IkTask) -> f64 {
    let tool = forward_kinematics(arm, ws, q);
    let position = (tool.translation.vector - target.translation.vector).norm();
    let turn = (tool.rotation * target.rotation.inverse()).imag().norm() * 2.0;
    if task == IkTask::Pose { position + turn } else { position }
}

/// The point of the smooth path at phase s in 0…1 with the tool pointing down.
fn on_path(s: f64) -> Isometry3<f64> {
    let theta = TAU * (10.0 * s.powi(3) - 15.0 * s.powi(4) + 6.0 * s.powi(5));
    let point =
        Translation3::new(0.95 + 0.15 * theta.cos(), 0.25 * theta.sin(), 0.95 + 0.05 * (2.0 * theta).sin());
    Isometry3::from_parts(point, UnitQuaternion::from_euler_angles(0.0, TAU / 4.0, 0.0))
}

#[test]
fn a_near_seed_leads_back_to_the_same_joints_in_a_few_steps() {
    let arm = paper_arm().arm;
    let mut ws = Workspace::new(&arm);
    let mut random = Random(3);
    let (mut worst_joint, mut worst_tool, mut most_steps) = (0.0_f64, 0.0_f64, 0);
    for _ in 0..200 {
        let mut q = random.values(6, 1.0);
        // Away from the singular wrist (q5 = 0) and the stretched arm.
        q[4] = 0.8 + 0.5 * random.next();
        q[2] = 0.2 + 0.5 * random.next();
        let target = forward_kinematics(&arm, &mut ws, &q);
        let seed: Vec<f64> = q.iter().map(|q| q + 0.01 * random.next()).collect();
        assert!(miss(&arm, &mut ws, &seed, &target, IkTask::Pose) > 1e-3, "the seed is off the target");
        let mut out = [0.0; 6];
        let report = inverse_kinematics(&arm, &mut ws, &target, &seed, &mut out, IkTask::Pose).unwrap();
        worst_joint = worst_joint.max(distance(&out, &q));
        worst_tool = worst_tool.max(miss(&arm, &mut ws, &out, &target, IkTask::Pose));
        most_steps = most_steps.max(report.iterations);
    }
    close("joints", worst_joint, 1e-10);
    close("tool", worst_tool, 3e-12);
    println!("steps: at most {most_steps}");
    assert!(most_steps <= 5);
}

#[test]
fn the_paths_of_the_paper_are_within_reach_limits_and_one_branch() {
    let arm = paper_arm().arm;
    let mut ws = Workspace::new(&arm);
    let mut q = [0.0; 6];
    let start = inverse_kinematics_global(&arm, &mut ws, &on_path(0.0), &mut q, IkTask::Pose).unwrap();
    println!("start {q:.4?}, {start:?}");
    let (mut largest_jump, mut most_steps, mut least_margin) = (0.0_f64, 0, f64::INFINITY);
    let start = q;
    for sample in 0..=3000 {
        let seed = q;
        let target = on_path(f64::from(sample) / 3000.0);
        let report = inverse_kinematics(&arm, &mut ws, &target, &seed, &mut q, IkTask::Pose).unwrap();
        largest_jump = largest_jump.max(distance(&q, &seed));
        most_steps = most_steps.max(report.iterations);
        least_margin = least_margin.min(report.limit_margin);
    }
    println!(
        "largest change per 2 ms: {largest_jump:.4} rad; at most {most_steps} steps; limit margin {least_margin:.3}"
    );
    assert!(largest_jump < 0.02, "no branch is changed");
    assert!(most_steps <= 4);
    assert!(least_margin > 0.02);
    close("the closed path closes in the joints", distance(&q, &start), 1e-10);
    for corner in [(0.15, -0.15), (0.15, 0.15), (-0.15, 0.15), (-0.15, -0.15)] {
        let point = Translation3::new(0.95 + corner.0, corner.1, 0.95);
        let target = Isometry3::from_parts(point, on_path(0.0).rotation);
        inverse_kinematics(&arm, &mut ws, &target, &start, &mut q, IkTask::Pose).unwrap();
    }
}

#[test]
fn redundant_and_small_arms_reach_random_targets() {
    for (dof, task) in [
        (7, IkTask::Pose),
        (8, IkTask::Pose),
        (10, IkTask::Pose),
        (3, IkTask::Position),
        (5, IkTask::Position),
    ] {
        let (mut worst, mut most_steps, mut solved) = (0.0_f64, 0, 0);
        for sample in 0..40 {
            let mut random = Random(100 * dof as u64 + sample);
            let arm = random.arm(dof);
            let mut ws = Workspace::new(&arm);
            let q = random.values(dof, 2.0);
            let target = forward_kinematics(&arm, &mut ws, &q);
            let seed: Vec<f64> = q.iter().map(|q| q + 0.05 * random.next()).collect();
            let mut out = vec![0.0; dof];
            // A random arm of three joints can be singular at the target; the error then reports it.
            match inverse_kinematics(&arm, &mut ws, &target, &seed, &mut out, task) {
                Ok(report) => {
                    solved += 1;
                    worst = worst.max(miss(&arm, &mut ws, &out, &target, task));
                    most_steps = most_steps.max(report.iterations);
                }
                Err(error) => println!("{dof} joints, sample {sample}: {error}"),
            }
        }
        println!("{dof} joints: {solved} of 40 solved, at most {most_steps} steps");
        assert!(solved >= 39);
        close(&format!("{dof} joints, tool"), worst, 3e-12);
    }
}

#[test]
fn the_global_search_finds_reachable_poses_inside_the_limits_and_repeats_itself() {
    let arm = paper_arm().arm;
    let mut ws = Workspace::new(&arm);
    let mut random = Random(11);
    let mut found = 0;
    for _ in 0..20 {
        let q: Vec<f64> = arm
            .joints()
            .iter()
            .map(|j| {
                0.5 * (j.limits.lower + j.limits.upper)
                    + 0.35 * (j.limits.upper - j.limits.lower) * random.next()
            })
            .collect();
        let target = forward_kinematics(&arm, &mut ws, &q);
        let (mut out, mut again) = ([0.0; 6], [0.0; 6]);
        let report = inverse_kinematics_global(&arm, &mut ws, &target, &mut out, IkTask::Pose);
        let Ok(report) = report else { continue };
        found += 1;
        assert!(miss(&arm, &mut ws, &out, &target, IkTask::Pose) < 3e-12);
        assert!(report.limit_margin >= 0.0);
        let second = inverse_kinematics_global(&arm, &mut ws, &target, &mut again, IkTask::Pose).unwrap();
        assert_eq!((report, out), (second, again));
    }
    println!("{found} of 20 reachable poses found");
    assert_eq!(found, 20);
}

#[test]
fn what_cannot_be_solved_is_refused_with_the_reason() {
    let arm = paper_arm().arm;
    let mut ws = Workspace::new(&arm);
    let mut out = [0.0; 6];
    let seed = [0.0, 0.2, 0.3, 0.1, 0.6, 0.1];

    let far = Isometry3::translation(3.0, 0.0, 1.0);
    let error = inverse_kinematics(&arm, &mut ws, &far, &seed, &mut out, IkTask::Position).unwrap_err();
    println!("{error}");
    assert!(
        matches!(error, IkError::Unreachable { position_error, .. } if position_error > 1.0 && position_error < 2.0)
    );
    assert!(inverse_kinematics_global(&arm, &mut ws, &far, &mut out, IkTask::Position).is_err());

    let mut beyond = seed;
    beyond[4] = 2.6;
    let target = forward_kinematics(&arm, &mut ws, &beyond);
    let error = inverse_kinematics(&arm, &mut ws, &target, &beyond, &mut out, IkTask::Pose).unwrap_err();
    println!("{error}");
    assert!(matches!(error, IkError::OutsideLimits { joint: 4, .. }));

    let not_a_number = Isometry3::translation(f64::NAN, 0.0, 0.0);
    let error = inverse_kinematics(&arm, &mut ws, &not_a_number, &seed, &mut out, IkTask::Pose).unwrap_err();
    assert_eq!(error, IkError::NotFinite);

    // Numbers that overflow on the way lead to an error, not to a panic or a hang.
    let absurd = Isometry3::translation(1e308, -1e308, 1e308);
    assert!(inverse_kinematics(&arm, &mut ws, &absurd, &seed, &mut out, IkTask::Pose).is_err());
    let slides = Random(8).arm(5);
    let (mut ws, mut out) = (Workspace::new(&slides), [0.0; 5]);
    assert!(inverse_kinematics(&slides, &mut ws, &absurd, &[1.7e308; 5], &mut out, IkTask::Pose).is_err());
}

/// With the wrist stretched the solver still reaches the pose; the report says that it is singular there.
#[test]
fn a_singular_pose_is_reached_and_reported() {
    let arm = paper_arm().arm;
    let mut ws = Workspace::new(&arm);
    let q = [0.2, 0.3, 0.1, 0.4, 0.0, 0.3];
    let target = forward_kinematics(&arm, &mut ws, &q);
    let seed = q.map(|q| q + 0.02);
    let mut out = [0.0; 6];
    match inverse_kinematics(&arm, &mut ws, &target, &seed, &mut out, IkTask::Pose) {
        Ok(report) => {
            println!("{report:?}");
            assert!(report.conditioning < 1e-3);
            assert!(miss(&arm, &mut ws, &out, &target, IkTask::Pose) < 3e-12);
        }
        Err(error) => {
            println!("{error}");
            assert!(matches!(error, IkError::Singular { .. }));
        }
    }
}
