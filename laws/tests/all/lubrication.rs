//! The oil film against the reference numbers of the fact sheet, and for consistency.
use crate::common;
use freeplay_arm::JointKind::Revolute;
use freeplay_laws::{Film, Trajectory};

use crate::common::{close, effect, one_link};

/// μ 0.4 Pa·s, L 40 mm, R 10 mm, c 0.2 mm.
fn film() -> Film {
    Film::new(0.4, 0.040, 0.010, 2e-4)
}

/// w = 20 rad/s, ε = 0.5: the closed form at both sides of ε̇ = 0 and at ±1 and ±10 1/s.
#[test]
fn forces_agree_with_the_reference() {
    let at = |rate: f64| film().force(0.5, rate, 0.5 * 0.5 * 20.0);
    for (rate, radial, tangential, tolerance) in [
        (1e-3, -14.234, 38.70, 5e-3),
        (-1e-3, -14.211, 38.70, 2e-2),
        (1.0, -27.80, 44.31, 5e-3),
        (-1.0, -4.58, 33.08, 5e-3),
        (10.0, -198.6, 55.6, 5e-2),
        (-10.0, 33.6, 21.8, 5e-2),
    ] {
        let [r, t] = at(rate);
        close(&format!("F_r at {rate} 1/s"), r, radial, tolerance);
        close(&format!("F_t at {rate} 1/s"), t, tangential, tolerance);
    }
    let ([above, _], [below, _]) = (at(1e-12), at(-1e-12));
    close("continuous at standstill", above, below, 1e-8);
}

/// Steady rotation: F_t = 12π μ w ε (R/c)² R L/B.
#[test]
fn steady_tangential_force_is_exact() {
    for (eps, expected) in [(0.2, 30.17764), (0.5, 77.38877), (0.8, 152.31964)] {
        // The reference is the full Sommerfeld film, with positive and negative pressure; this film has the positive pressure only: half.
        let [_, tangential] = film().force(eps, 0.0, 0.5 * eps * 20.0);
        close(&format!("F_t at ε = {eps}"), 2.0 * tangential, expected, 1e-4);
    }
}

#[test]
fn rates_invert_forces() {
    let mut worst = 0.0_f64;
    for eps in [1e-3, 0.3, 0.7, 0.95, 0.999] {
        for angle in 0..24 {
            let (rate, slip) = ((0.2618 * f64::from(angle)).cos(), (0.2618 * f64::from(angle)).sin());
            let [r, t] = film().force(eps, rate, slip);
            let [rate_back, slip_back] = film().rates(eps, r, t);
            worst = worst.max((rate_back - rate).abs()).max((slip_back - slip).abs());
        }
    }
    println!("worst {worst:.1e} 1/s of 1, margin 1e-6");
    assert!(worst < 1e-6);
}

/// A film only takes energy from a journal that moves in a stationary bearing.
#[test]
fn the_film_dissipates() {
    for i in 0..200 {
        let x = f64::from(i);
        let offset = [1.3e-4 * (0.7 * x).sin(), 1.2e-4 * (1.1 * x).cos()];
        let velocity = [1e-3 * (1.7 * x).cos(), 1e-3 * (2.3 * x).sin()];
        let force = film().push(offset, velocity, 0.0);
        let power = force[0] * velocity[0] + force[1] * velocity[1];
        assert!(power < 0.0, "power {power:e} W at {offset:?}, {velocity:?}");
    }
}

/// Under a steady load the journal of a turning joint comes to rest where the film alone carries the load.
#[test]
fn a_turning_journal_finds_its_equilibrium() {
    let (force, turning) = ([3.0, -20.0], 15.0);
    let offset = (0..600).fold([0.0, 0.0], |offset, _| film().carried(offset, force, turning, 0.1));
    let [x, z] = film().push(offset, [0.0, 0.0], turning);
    println!("rests at {offset:?} m");
    close("force along 1", x, force[0], 1e-3);
    close("force along 2", z, force[1], 1e-3);
    // The journal moves to the loaded side, and ahead in the sense of rotation.
    assert!(offset[0].hypot(offset[1]) < 2e-4 && offset[1] > 0.0);
}

/// Half the step gives nearly the same position: the integration has converged.
#[test]
fn the_drift_is_converged() {
    let film = film();
    let whole = film.carried([5e-5, 0.0], [3.0, -20.0], 2.0, 0.2);
    let parts = (0..20).fold([5e-5, 0.0], |offset, _| film.carried(offset, [3.0, -20.0], 2.0, 0.01));
    let off = (whole[0] - parts[0]).hypot(whole[1] - parts[1]);
    println!("off by {off:.1e} m of 2e-4, margin 1e-6");
    assert!(off < 1e-6);
}

/// With thin oil the load presses the journal to the wall, as in a dry joint; with thick oil the journal hardly moves.
#[test]
fn thin_oil_is_a_dry_joint() {
    let arm = one_link(Revolute, 2.0);
    let points = 400;
    let t: Vec<f64> = (0..points).map(|i| 0.01 * f64::from(i)).collect();
    let q = vec![t.iter().map(|t| 0.3 * t.sin()).collect::<Vec<f64>>()];
    let v = vec![t.iter().map(|t| 0.3 * t.cos()).collect()];
    let a = vec![t.iter().map(|t| -0.3 * t.sin()).collect()];
    let motion = Trajectory { stretches: std::iter::once(0..t.len()).collect(), t, q, v, a };
    let last = |kind: &str, text: &str| {
        let shown = common::added(&arm, &[effect(&arm, kind, Some(0), text)], &motion);
        [0, 1, 2].map(|axis| *shown.tool[axis].last().unwrap())
    };
    let dry = last("joint_clearance", "clearance = 2e-4\nfriction = 0.0");
    let thin = last("lubricated_clearance", "clearance = 2e-4\nviscosity = 1e-6");
    for axis in 0..3 {
        close("thin oil against dry", thin[axis], dry[axis], 2e-6);
    }
}
