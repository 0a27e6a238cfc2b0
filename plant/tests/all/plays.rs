//! Several joints with play, play in any joint, and the limits of the loop.

use crate::common::{close, let_go, paper, system};
use freeplay_arm::{Workspace, rnea};
use freeplay_model::paper_arm;
use freeplay_path::{JointPath, PathSpec};
use freeplay_plant::{Input, System};

fn start(system: &mut System, path: &JointPath) {
    let (mut q, mut v, mut a) = (vec![0.0; 6], vec![0.0; 6], vec![0.0; 6]);
    path.at(0.0, &mut q, &mut v, &mut a);
    system.start(&q, &v);
}

fn drive(system: &mut System, path: &JointPath, ticks: u64) {
    for _ in 0..ticks {
        system.tick(&Input { torque: &[0.0; 6], driven: &[true; 6], motion: path }).expect("finite");
    }
}

#[test]
fn every_revolute_joint_can_have_play_and_several_at_once() {
    let arm = paper_arm().arm;
    let path = JointPath::plan(&arm, &PathSpec::default(), 1000.0).expect("the smooth path");
    let sets: Vec<Vec<usize>> =
        (0..6).map(|joint| vec![joint]).chain([vec![3, 4], vec![1, 2, 3, 4]]).collect();
    for joints in sets {
        let plays: Vec<_> = joints.iter().map(|&joint| (joint, paper(0.3e-3))).collect();
        let mut system = system(&arm, &plays, 1e-3, 100);
        start(&mut system, &path);
        drive(&mut system, &path, 60);
        for (play, tally) in system.play().plays().iter().zip(system.tallies()) {
            let fractions = tally.fractions();
            close("fractions add up", fractions.iter().sum(), 1.0, 1e-12);
            let [first, second] = play.slides;
            let eccentricity = system.q()[first].hypot(system.q()[second]);
            println!(
                "joints {joints:?}, joint {}: {fractions:?}, eccentricity {eccentricity:.6}",
                play.joint
            );
            assert!(eccentricity < 0.3e-3 + 60e-6, "the journal stays in its bearing");
        }
        let ledger = system.ledger();
        assert!(ledger.residual().abs() < 0.1 * ledger.damping.abs().max(1e-3), "{joints:?}: {ledger:?}");
    }
}

#[test]
fn two_plays_with_nothing_heavy_between_them_are_refused() {
    // The paper's arm has no mass after joint 1: with play in joints 1 and 2 the massless body would have infinite acceleration.
    let arm = paper_arm().arm;
    let error = freeplay_laws::ArmWithPlay::new(&arm, &[(0, paper(0.3e-3)), (1, paper(0.3e-3))])
        .expect_err("refused");
    println!("{error}");
    assert!(error.to_string().contains("joint_1"), "{error}");
}

#[test]
fn prescribed_joints_need_the_torque_of_inverse_dynamics() {
    let arm = paper_arm().arm;
    let path = JointPath::plan(&arm, &PathSpec::default(), 1000.0).expect("the smooth path");
    let mut system = system(&arm, &[], 1e-3, 1);
    start(&mut system, &path);
    drive(&mut system, &path, 1000);
    let (mut q, mut v, mut a, mut tau) = (vec![0.0; 6], vec![0.0; 6], vec![0.0; 6], vec![0.0; 6]);
    path.at(0.9995, &mut q, &mut v, &mut a);
    rnea(&arm, &mut Workspace::new(&arm), &q, &v, &a, &mut tau);
    for (ours, expected) in system.motor_torque().iter().zip(&tau) {
        close("torque", *ours, *expected, 1e-9);
    }
}

#[test]
fn nothing_is_allocated_while_stepping() {
    let arm = paper_arm().arm;
    let path = JointPath::plan(&arm, &PathSpec::default(), 1000.0).expect("the smooth path");
    let mut system = system(&arm, &[(3, paper(0.2e-3)), (4, paper(0.6e-3))], 1e-3, 50);
    start(&mut system, &path);
    let counted = allocation_counter::measure(|| {
        drive(&mut system, &path, 30);
        let _ = (system.tool(), system.take_peaks());
    });
    println!("{} allocations", counted.count_total);
    assert_eq!(counted.count_total, 0);
}

#[test]
fn two_equal_runs_are_equal_to_the_bit() {
    let arm = paper_arm().arm;
    let run = || {
        let mut system = system(&arm, &[(4, paper(0.6e-3))], 1e-3, 50);
        system.start(&[0.1, 0.2, -0.3, 0.4, 0.5, -0.6], &[0.0; 6]);
        let_go(&mut system, 100);
        system.q().iter().map(|value| value.to_bits()).collect::<Vec<_>>()
    };
    assert_eq!(run(), run());
}
