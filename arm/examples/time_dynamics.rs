//! Computation times of the dynamics for the arm with eight joints, in batches so that reading the clock does not count.
//!
//! `cargo run --release -p freeplay-arm --example time_dynamics`

use std::hint::black_box;
use std::time::Instant;

use freeplay_arm::{
    Arm, ArmError, Drive, IkTask, Inertia, Joint, JointFriction, JointKind, Limits, Workspace, aba, crba,
    forward_kinematics, hybrid_aba, inverse_kinematics, rnea,
};
use freeplay_model::paper_arm;
use nalgebra::{DMatrix, Isometry3, Vector3};

const BATCH: usize = 200;
const BATCHES: usize = 5000;

fn main() -> Result<(), ArmError> {
    let arm = arm_with_slides()?;
    let n = arm.dof();
    let mut ws = Workspace::new(&arm);
    let q: Vec<f64> = (0..n).map(|i| 0.3 * (i as f64 + 1.0).sin()).collect();
    let v: Vec<f64> = (0..n).map(|i| 0.7 * (i as f64 + 2.0).cos()).collect();
    let drive: Vec<Drive> = (0..n)
        .map(|i| if i == 4 || i == 5 { Drive::Torque(1.0) } else { Drive::Acceleration(v[i]) })
        .collect();
    let (mut out, mut tau, mut m) = (vec![0.0; n], vec![0.0; n], DMatrix::zeros(n, n));

    println!("{n} joints, {BATCHES} batches of {BATCH} calls, µs per call");
    time("forward_kinematics", || {
        black_box(forward_kinematics(&arm, &mut ws, black_box(&q)));
    });
    time("rnea", || rnea(&arm, &mut ws, black_box(&q), &v, &v, &mut out));
    time("crba", || crba(&arm, &mut ws, black_box(&q), &mut m));
    time("aba", || aba(&arm, &mut ws, black_box(&q), &v, &v, &mut out));
    time("hybrid_aba, slides free", || {
        hybrid_aba(&arm, &mut ws, black_box(&q), &v, &drive, &mut out, &mut tau)
    });

    let arm = paper_arm().arm;
    let mut ws = Workspace::new(&arm);
    let (near, mut q) = ([0.0, 0.331, 0.06, 0.001, 1.18, 0.002], [0.0; 6]);
    let target = forward_kinematics(&arm, &mut ws, &[0.0, 0.33, 0.06, 0.0, 1.18, 0.0]);
    time("inverse_kinematics, 6", || {
        black_box(inverse_kinematics(&arm, &mut ws, black_box(&target), &near, &mut q, IkTask::Pose).is_ok());
    });
    Ok(())
}

/// The paper's arm with the two slides of a clearance joint 5.
fn arm_with_slides() -> Result<Arm, ArmError> {
    let slide = |name: &str, axis| Joint {
        name: name.to_owned(),
        kind: JointKind::Prismatic,
        axis,
        placement: Isometry3::identity(),
        limits: Limits::NONE,
        friction: JointFriction::default(),
        rotor_inertia: 0.0,
        inertia: Inertia::zero(),
    };
    let with_x = paper_arm().arm.with_joint_inserted_before(4, slide("px", Vector3::x_axis()))?;
    with_x.with_joint_inserted_before(5, slide("pz", Vector3::z_axis()))
}

fn time(what: &str, mut call: impl FnMut()) {
    let mut times: Vec<f64> = (0..BATCHES)
        .map(|_| {
            let start = Instant::now();
            for _ in 0..BATCH {
                call();
            }
            start.elapsed().as_secs_f64() * 1e6 / BATCH as f64
        })
        .collect();
    times.sort_by(f64::total_cmp);
    let at = |share: f64| times[(share * (times.len() - 1) as f64) as usize];
    println!("{what:<24} best {:.3}  p50 {:.3}  p99 {:.3}", at(0.0), at(0.5), at(0.99));
}
