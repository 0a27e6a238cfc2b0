//! Deflections under the arm's weight load the drives: at rest by the derivative of the elastic energy, V = −½ Σ load · deflection, by each
//! joint's position.
use freeplay_arm::{Arm, Workspace, joint_reaction, rnea};
use nalgebra::Vector3;

use crate::common::{added, close, effect, samples};

/// The arm at rest at `q` with the reactions of its joints.
fn at_rest(arm: &Arm, q: &[f64]) -> Workspace {
    let mut ws = Workspace::new(arm);
    let none = vec![0.0; arm.dof()];
    rnea(arm, &mut ws, q, &none, &none, &mut none.clone());
    ws
}

/// Force and moment that the links beyond exert on `joint`, base frame.
fn pressure(ws: &Workspace, joint: usize) -> (Vector3<f64>, Vector3<f64>) {
    let (force, moment) = joint_reaction(ws, joint);
    let rotation = ws.link_pose(joint).rotation;
    (-(rotation * force), -(rotation * moment))
}

/// The derivatives of `energy` at `q` by central differences.
fn slopes(q: &[f64], energy: impl Fn(&[f64]) -> f64) -> Vec<f64> {
    const STEP: f64 = 1e-4;
    let at = |joint: usize, step: f64| {
        let mut q = q.to_vec();
        q[joint] += step;
        energy(&q)
    };
    (0..q.len()).map(|joint| (at(joint, STEP) - at(joint, -STEP)) / (2.0 * STEP)).collect()
}

/// At ten poses of the six axes of the paper's arm, the torque of `kind` in each drive equals the negative gradient of `energy`.
fn asks_for_the_slope(kind: &str, joint: Option<usize>, text: &str, energy: impl Fn(&Arm, &[f64]) -> f64) {
    let arm = freeplay_model::paper_arm().arm;
    let mut greatest = 0.0_f64;
    for pose in 0..10 {
        let q: Vec<f64> =
            (0..arm.dof()).map(|joint| 1.5 * (2.3 * pose as f64 + 1.7 * joint as f64).sin()).collect();
        let mut still = samples(&q[..1], &[0.0]);
        for place in &q[1..] {
            still.q.push(vec![*place]);
            still.v.push(vec![0.0]);
            still.a.push(vec![0.0]);
        }
        let shown = added(&arm, &[effect(&arm, kind, joint, text)], &still);
        for (joint, slope) in slopes(&q, |q| energy(&arm, q)).into_iter().enumerate() {
            close(&format!("{kind}, joint {}", joint + 1), shown.torque[joint][0], slope, 1e-7);
            greatest = greatest.max(slope.abs());
        }
    }
    assert!(greatest > 0.01, "nothing to compare: {greatest}");
}

#[test]
fn a_mount_that_gives() {
    let (cx, cy) = (1e-5, 3e-5);
    asks_for_the_slope("mount_compliance", None, "compliance_x = 1e-5\ncompliance_y = 3e-5", |arm, q| {
        let ws = at_rest(arm, q);
        let (force, moment) = pressure(&ws, 0);
        let moment = moment + ws.link_pose(0).translation.vector.cross(&force);
        -0.5 * (cx * moment.x * moment.x + cy * moment.y * moment.y)
    });
}

/// A cantilever's energy by Castigliano: with the moment Q(x) in it, V = −∫ Q²/(2EI) dx, by Simpson's rule, which is exact on either side
/// of the weight.
#[test]
fn a_link_that_bends() {
    let k = 1e5;
    for bending in [1, 2] {
        asks_for_the_slope("link_flexure", Some(bending), "stiffness = 1e5", |arm, q| {
            let ws = at_rest(arm, q);
            let [here, next] = [bending, bending + 1].map(|joint| ws.link_pose(joint));
            let way = next.translation.vector - here.translation.vector;
            let length = way.norm();
            let along = way / length;
            let (force, moment) = pressure(&ws, bending + 1);
            let weight = pressure(&ws, bending).0 - force;
            let place = (here.rotation * arm.joints()[bending].inertia.com).dot(&along).clamp(0.0, length);
            // The moment across the link at x from the load at the end and, up to its centre of mass, from the link itself.
            let square = |x: f64| {
                let own = weight * (place - x).max(0.0);
                let pressed = moment + along.cross(&(force * (length - x) + own));
                (pressed - along * along.dot(&pressed)).norm_squared()
            };
            let simpson = |from: f64, to: f64| {
                (square(from) + 4.0 * square(0.5 * (from + to)) + square(to)) * (to - from) / 6.0
            };
            let stiffness = k * length.powi(3) / 3.0;
            -0.5 * (simpson(0.0, place) + simpson(place, length)) / stiffness
        });
    }
}
