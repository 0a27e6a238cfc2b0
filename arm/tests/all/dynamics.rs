//! Independent algorithms against each other on random arms of 1 to 12 joints, revolute and prismatic mixed.

use crate::common::{Random, close, distance, size};
use freeplay_arm::{
    Drive, Workspace, aba, bias, crba, gravity_torque, hybrid_aba, joint_reaction, kinetic_energy,
    mass_and_bias, potential_energy, rnea,
};
use nalgebra::{DMatrix, DVector};

/// Runs `check` on three random arms of each size.
fn for_random_arms(mut check: impl FnMut(&mut Random, &freeplay_arm::Arm, &mut Workspace)) {
    for dof in 1..=12 {
        for sample in 0..3 {
            let mut random = Random(1000 * dof as u64 + sample);
            let arm = random.arm(dof);
            let mut ws = Workspace::new(&arm);
            check(&mut random, &arm, &mut ws);
        }
    }
}

#[test]
fn forward_dynamics_inverts_inverse_dynamics() {
    let (mut worst, mut least_moved) = (0.0_f64, f64::INFINITY);
    for_random_arms(|random, arm, ws| {
        let n = arm.dof();
        let (q, v, a) = (random.values(n, 3.0), random.values(n, 2.0), random.values(n, 5.0));
        let (mut tau, mut again) = (vec![0.0; n], vec![0.0; n]);
        rnea(arm, ws, &q, &v, &a, &mut tau);
        let zero = vec![0.0; n];
        let mut free = vec![0.0; n];
        aba(arm, ws, &q, &v, &zero, &mut free);
        least_moved = least_moved.min(distance(&free, &a));
        aba(arm, ws, &q, &v, &tau, &mut again);
        worst = worst.max(distance(&again, &a) / size(&a));
    });
    assert!(least_moved > 0.1, "the torques must matter: {least_moved}");
    close("aba(rnea(a)) = a", worst, 1e-10);
}

#[test]
fn mass_matrix_and_bias_make_up_inverse_dynamics() {
    let mut worst = 0.0_f64;
    for_random_arms(|random, arm, ws| {
        let n = arm.dof();
        let (q, v, a) = (random.values(n, 3.0), random.values(n, 2.0), random.values(n, 5.0));
        let (mut tau, mut h, mut m) = (vec![0.0; n], vec![0.0; n], DMatrix::zeros(n, n));
        rnea(arm, ws, &q, &v, &a, &mut tau);
        bias(arm, ws, &q, &v, &mut h);
        crba(arm, ws, &q, &mut m);
        assert!(distance(&tau, &h) > 1e-3, "the accelerations must matter");
        let sum = &m * DVector::from_vec(a) + DVector::from_vec(h);
        worst = worst.max(distance(sum.as_slice(), &tau) / size(&tau));
        assert_eq!(m, m.transpose());
        assert!(m.clone().cholesky().is_some(), "the mass matrix is positive definite");
    });
    close("M a + h = tau", worst, 1e-13);
}

#[test]
fn articulated_bodies_agree_with_cholesky_of_the_mass_matrix() {
    let mut worst = 0.0_f64;
    for_random_arms(|random, arm, ws| {
        let n = arm.dof();
        let (q, v, tau) = (random.values(n, 3.0), random.values(n, 2.0), random.values(n, 50.0));
        let (mut a, mut h, mut m) = (vec![0.0; n], vec![0.0; n], DMatrix::zeros(n, n));
        aba(arm, ws, &q, &v, &tau, &mut a);
        bias(arm, ws, &q, &v, &mut h);
        crba(arm, ws, &q, &mut m);
        let right = DVector::from_vec(tau) - DVector::from_vec(h);
        let solved = m.cholesky().unwrap().solve(&right);
        worst = worst.max(distance(solved.as_slice(), &a) / size(&a));
    });
    close("aba against CRBA + Cholesky", worst, 1e-10);
}

#[test]
fn mass_and_bias_together_are_the_two_alone() {
    for_random_arms(|random, arm, ws| {
        let n = arm.dof();
        let (q, v) = (random.values(n, 3.0), random.values(n, 2.0));
        let (mut h, mut m) = (vec![0.0; n], DMatrix::zeros(n, n));
        bias(arm, ws, &q, &v, &mut h);
        crba(arm, ws, &q, &mut m);
        let (mut both_h, mut both_m) = (vec![0.0; n], DMatrix::zeros(n, n));
        mass_and_bias(arm, ws, &q, &v, &mut both_m, &mut both_h);
        assert_eq!((both_m, both_h), (m, h));
    });
}

#[test]
fn hybrid_dynamics_agrees_with_both_pure_forms() {
    let (mut worst_a, mut worst_tau) = (0.0_f64, 0.0_f64);
    for_random_arms(|random, arm, ws| {
        let n = arm.dof();
        let (q, v, a) = (random.values(n, 3.0), random.values(n, 2.0), random.values(n, 5.0));
        let mut tau = vec![0.0; n];
        rnea(arm, ws, &q, &v, &a, &mut tau);
        for choice in 0..3 {
            let prescribed = |random: &mut Random| choice == 0 || (choice == 1 && random.next() < 0.0);
            let drive: Vec<Drive> = (0..n)
                .map(|i| if prescribed(random) { Drive::Acceleration(a[i]) } else { Drive::Torque(tau[i]) })
                .collect();
            let (mut a_out, mut tau_out) = (vec![f64::NAN; n], vec![f64::NAN; n]);
            hybrid_aba(arm, ws, &q, &v, &drive, &mut a_out, &mut tau_out);
            worst_a = worst_a.max(distance(&a_out, &a) / size(&a));
            worst_tau = worst_tau.max(distance(&tau_out, &tau) / size(&tau));
        }
    });
    close("hybrid accelerations", worst_a, 1e-10);
    close("hybrid torques", worst_tau, 1e-10);
}

#[test]
fn reaction_is_the_same_after_forward_and_inverse_dynamics() {
    let mut worst = 0.0_f64;
    for_random_arms(|random, arm, ws| {
        let n = arm.dof();
        let (q, v, a) = (random.values(n, 3.0), random.values(n, 2.0), random.values(n, 5.0));
        let mut tau = vec![0.0; n];
        rnea(arm, ws, &q, &v, &a, &mut tau);
        let inverse: Vec<_> = (0..n).map(|i| joint_reaction(ws, i)).collect();
        let mut again = vec![0.0; n];
        aba(arm, ws, &q, &v, &tau, &mut again);
        for (i, (force, moment)) in inverse.iter().enumerate() {
            let (f, m) = joint_reaction(ws, i);
            assert!(force.norm() > 1.0, "the link carries something");
            worst = worst.max(((f - force).norm() + (m - moment).norm()) / (force.norm() + moment.norm()));
        }
    });
    close("reaction after aba and after rnea", worst, 1e-10);
}

#[test]
fn gravity_torque_is_the_bias_at_rest() {
    let mut worst = 0.0_f64;
    for_random_arms(|random, arm, ws| {
        let n = arm.dof();
        let q = random.values(n, 3.0);
        let (mut g, mut h) = (vec![0.0; n], vec![0.0; n]);
        gravity_torque(arm, ws, &q, &mut g);
        let reaction = joint_reaction(ws, 0);
        bias(arm, ws, &q, &vec![0.0; n], &mut h);
        assert!(size(&g) > 0.1);
        worst = worst.max(distance(&g, &h) / size(&h));
        worst = worst.max((reaction.0 - joint_reaction(ws, 0).0).norm() / reaction.0.norm());
    });
    close("gravity torque", worst, 1e-13);
}

#[test]
fn kinetic_energy_is_half_v_m_v() {
    let mut worst = 0.0_f64;
    for_random_arms(|random, arm, ws| {
        let n = arm.dof();
        let (q, v) = (random.values(n, 3.0), random.values(n, 2.0));
        let mut m = DMatrix::zeros(n, n);
        crba(arm, ws, &q, &mut m);
        let vector = DVector::from_vec(v.clone());
        let half = 0.5 * vector.dot(&(&m * &vector));
        let energy = kinetic_energy(arm, ws, &q, &v);
        assert!(energy > 1e-3);
        worst = worst.max((energy - half).abs() / half);
    });
    close("kinetic energy", worst, 1e-13);
}

/// Momentum ∂T/∂v and force ∂(T − U)/∂q of each joint at `q`, `v`, by central differences of the energies.
fn lagrange(arm: &freeplay_arm::Arm, ws: &mut Workspace, q: &[f64], v: &[f64]) -> [Vec<f64>; 2] {
    let step = 1e-4;
    let difference = |values: &[f64], joint: usize, energy: &mut dyn FnMut(&[f64]) -> f64| {
        let mut moved = values.to_vec();
        moved[joint] = values[joint] + step;
        let above = energy(&moved);
        moved[joint] = values[joint] - step;
        (above - energy(&moved)) / (2.0 * step)
    };
    let momentum =
        (0..q.len()).map(|i| difference(v, i, &mut |v| kinetic_energy(arm, ws, q, v))).collect::<Vec<_>>();
    let force = (0..q.len())
        .map(|i| difference(q, i, &mut |q| kinetic_energy(arm, ws, q, v) - potential_energy(arm, ws, q)))
        .collect();
    [momentum, force]
}

#[test]
fn rotors_obey_the_equations_of_lagrange_and_show_on_their_own_joint_alone() {
    let (mut worst, mut own, step, mut rotors) = (0.0_f64, 0.0_f64, 1e-4, 0);
    for_random_arms(|random, arm, ws| {
        let n = arm.dof();
        let (q, v, a) = (random.values(n, 2.0), random.values(n, 1.0), random.values(n, 2.0));
        let mut tau = vec![0.0; n];
        rnea(arm, ws, &q, &v, &a, &mut tau);
        let at = |time: f64| -> [Vec<f64>; 2] {
            let moved = |i: usize| q[i] + time * (v[i] + 0.5 * time * a[i]);
            [(0..n).map(moved).collect(), (0..n).map(|i| v[i] + time * a[i]).collect()]
        };
        let [[q0, v0], [q1, v1]] = [at(-step), at(step)];
        let [before, after] = [lagrange(arm, ws, &q0, &v0), lagrange(arm, ws, &q1, &v1)];
        let [_, force] = lagrange(arm, ws, &q, &v);
        let from_energy: Vec<f64> =
            (0..n).map(|i| (after[0][i] - before[0][i]) / (2.0 * step) - force[i]).collect();
        worst = worst.max(distance(&from_energy, &tau) / size(&tau));
        let bare =
            arm.joints().iter().map(|joint| freeplay_arm::Joint { rotor_inertia: 0.0, ..joint.clone() });
        let bare = freeplay_arm::Arm::new("bare", bare.collect(), *arm.tool(), *arm.gravity()).unwrap();
        let mut without = vec![0.0; n];
        rnea(&bare, ws, &q, &v, &a, &mut without);
        for (i, joint) in arm.joints().iter().enumerate() {
            rotors += usize::from(joint.rotor_inertia > 0.0);
            own = own.max((tau[i] - without[i] - joint.rotor_inertia * a[i]).abs() / size(&tau));
        }
    });
    assert!(rotors > 10, "some joints have rotors: {rotors}");
    close("rnea against differences of the energies", worst, 1e-5);
    close("a rotor of inertia I adds I a", own, 1e-14);
}
