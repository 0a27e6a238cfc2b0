//! Rigid-body dynamics of the paper's arm with two slides (8 coordinates).
//! Reference values (one 2-core machine): Pinocchio 4.1 ABA 1.68, RNEA 0.94, CRBA 0.62 us; MuJoCo 4.0 forward dynamics 1.02 us.

mod common;

use freeplay_arm::{Drive, Workspace, aba, crba, forward_kinematics, hybrid_aba, rnea};
use freeplay_laws::{ArmWithPlay, Clearance, ClearanceTable};
use freeplay_model::paper_arm;
use nalgebra::DMatrix;

fn main() {
    common::machine();
    let arm = paper_arm().arm;
    let clearance = Clearance::new(&ClearanceTable::new(0.6e-3)).expect("in range");
    let play = ArmWithPlay::new(&arm, &[(4, clearance)]).expect("an arm with play");
    let arm = play.arm();
    let mut ws = Workspace::new(arm);
    let q = [0.3, -0.4, 0.5, 0.2, 1e-4, -3e-4, 0.9, -0.7];
    let v = [0.1, 0.2, -0.3, 0.4, 1e-3, 2e-3, -0.5, 0.6];
    let tau = [10.0, -140.0, -100.0, 1.0, 5.0, -20.0, 0.5, 0.1];
    let (mut a, mut out) = ([0.0; 8], [0.0; 8]);
    let mut m = DMatrix::zeros(8, 8);
    let drive: Vec<Drive> = tau.iter().map(|&torque| Drive::Torque(torque)).collect();
    common::measure("ABA, 8 dof", "(Pinocchio 1.68, MuJoCo 1.02)", 20_000, 50, || {
        aba(arm, &mut ws, &q, &v, &tau, &mut a)
    });
    common::measure("hybrid ABA, 8 dof", "", 20_000, 50, || {
        hybrid_aba(arm, &mut ws, &q, &v, &drive, &mut a, &mut out)
    });
    common::measure("RNEA, 8 dof", "(Pinocchio 0.94)", 20_000, 50, || {
        rnea(arm, &mut ws, &q, &v, &tau, &mut out)
    });
    common::measure("CRBA, 8 dof", "(Pinocchio 0.62)", 20_000, 50, || crba(arm, &mut ws, &q, &mut m));
    common::measure("forward kinematics, 8 dof", "", 20_000, 50, || {
        forward_kinematics(arm, &mut ws, &q);
    });
}
