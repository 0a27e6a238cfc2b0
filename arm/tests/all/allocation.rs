//! Nothing in the loop allocates: every function of the loop is called with allocations counted.

use crate::common::Random;
use freeplay_arm::{
    Drive, IkTask, Workspace, aba, bias, crba, forward_kinematics, gravity_torque, hybrid_aba,
    inverse_kinematics, jacobian, joint_reaction, kinetic_energy, potential_energy, rnea,
    tool_bias_acceleration,
};
use nalgebra::{DMatrix, Isometry3};

#[test]
fn loop_functions_do_not_allocate() {
    let counted = allocation_counter::measure(|| drop(std::hint::black_box(vec![0_u8; 16])));
    assert!(counted.count_total > 0, "the counter counts");

    let mut random = Random(7);
    let arm = random.arm(8);
    let n = arm.dof();
    let mut ws = Workspace::new(&arm);
    let (q, v, a) = (random.values(n, 2.0), random.values(n, 2.0), random.values(n, 2.0));
    let near: Vec<f64> = q.iter().map(|q| q + 1e-3).collect();
    let far = Isometry3::translation(100.0, 0.0, 0.0);
    let drive: Vec<Drive> =
        (0..n).map(|i| if i % 2 == 0 { Drive::Torque(v[i]) } else { Drive::Acceleration(a[i]) }).collect();
    let (mut out, mut tau) = (vec![0.0; n], vec![0.0; n]);
    let (mut m, mut j) = (DMatrix::zeros(n, n), DMatrix::zeros(6, n));
    let mut solved = 0;

    let counted = allocation_counter::measure(|| {
        rnea(&arm, &mut ws, &q, &v, &a, &mut tau);
        bias(&arm, &mut ws, &q, &v, &mut out);
        gravity_torque(&arm, &mut ws, &q, &mut out);
        crba(&arm, &mut ws, &q, &mut m);
        aba(&arm, &mut ws, &q, &v, &a, &mut out);
        hybrid_aba(&arm, &mut ws, &q, &v, &drive, &mut out, &mut tau);
        jacobian(&arm, &mut ws, &q, &mut j);
        std::hint::black_box(joint_reaction(&ws, 0));
        std::hint::black_box(tool_bias_acceleration(&arm, &mut ws, &q, &v));
        std::hint::black_box(kinetic_energy(&arm, &mut ws, &q, &v) + potential_energy(&arm, &mut ws, &q));
        let target = forward_kinematics(&arm, &mut ws, &q);
        std::hint::black_box(ws.link_pose(n - 1));
        solved +=
            usize::from(inverse_kinematics(&arm, &mut ws, &target, &near, &mut out, IkTask::Pose).is_ok());
        solved += usize::from(inverse_kinematics(&arm, &mut ws, &far, &near, &mut out, IkTask::Pose).is_ok());
    });
    assert_eq!(solved, 1, "one target is in reach, the other is not");
    println!("allocations in the loop: {}", counted.count_total);
    assert_eq!(counted.count_total, 0);
}
