//! Arms and checks for several tests.

use freeplay_arm::{Arm, Inertia, Joint, JointFriction, JointKind, Limits};
use freeplay_laws::{ArmWithPlay, Clearance, ClearanceTable, Material};
use freeplay_plant::{Braking, Input, System};
use nalgebra::{Isometry3, Matrix3, Translation3, Vector3};

/// Checks `actual` against `expected` within `tolerance` (absolute) and prints the margin.
pub fn close(what: &str, actual: f64, expected: f64, tolerance: f64) {
    let error = (actual - expected).abs();
    println!("{what}: {actual} expected {expected}, error {error:.2e} of {tolerance:.1e}");
    assert!(error <= tolerance, "{what}: {actual} is not {expected} within {tolerance}");
}

/// Checks within a relative `tolerance`.
pub fn near(what: &str, actual: f64, expected: f64, tolerance: f64) {
    close(what, actual, expected, tolerance * expected.abs());
}

/// A revolute joint about y that carries a rod of `mass` and `length` along x; joint at `at` along the parent's x.
pub fn rod(name: &str, mass: f64, length: f64, at: f64) -> Joint {
    let across = mass * length * length / 12.0;
    Joint {
        name: name.to_owned(),
        kind: JointKind::Revolute,
        axis: Vector3::y_axis(),
        placement: Isometry3::from_parts(
            Translation3::new(at, 0.0, 0.0),
            nalgebra::UnitQuaternion::identity(),
        ),
        limits: Limits::NONE,
        friction: JointFriction::default(),
        rotor_inertia: 0.0,
        inertia: Inertia {
            mass,
            com: Vector3::new(0.5 * length, 0.0, 0.0),
            about_com: Matrix3::from_diagonal(&Vector3::new(1e-6, across, across)),
        },
    }
}

pub fn chain(joints: Vec<Joint>, gravity: f64) -> Arm {
    Arm::new("chain", joints, Isometry3::identity(), Vector3::new(0.0, 0.0, -gravity)).expect("a valid arm")
}

/// The steel bearing of the pendulum oracle.
pub fn steel(clearance: f64, friction: f64) -> Clearance {
    let material = Material { young: 207e9, poisson: 0.3 };
    Clearance::new(&ClearanceTable { material, friction, ..ClearanceTable::new(clearance) })
        .expect("in range")
}

pub fn paper(clearance: f64) -> Clearance {
    Clearance::new(&ClearanceTable::new(clearance)).expect("in range")
}

pub fn system(arm: &Arm, plays: &[(usize, Clearance)], period: f64, substeps: u32) -> System {
    let play = ArmWithPlay::new(arm, plays).expect("an arm with play");
    System::new(play, arm, period, substeps).expect("a step that resolves contacts")
}

/// Steps ticks without any motor torque.
pub fn let_go(system: &mut System, ticks: u64) {
    let joints = system.play().nominal_dof();
    let (torque, driven, brakes) = (vec![0.0; joints], vec![false; joints], Braking::new(vec![1.0; joints]));
    for _ in 0..ticks {
        system.tick(&Input { torque: &torque, driven: &driven, motion: &brakes }).expect("finite");
    }
}
