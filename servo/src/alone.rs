//! Each joint of a track alone, under the load from the measured motion of the others.

use freeplay_arm::{Arm, Workspace, crba, rnea};
use nalgebra::{DMatrix, Matrix3, Vector3};

use crate::joint_load::Load;
use crate::track::{REACH, Track};

impl Track {
    /// Each joint of `arm` as a track of its own, under the load from the measured motion of all joints. A rollout then simulates one joint
    /// without the others, at a fraction of the cost, and errors of the other servos do not affect it.
    pub fn by_joint(&self, arm: &Arm) -> Vec<Track> {
        let (rows, joints) = (self.stamps.len(), self.measured.len());
        let motions: Vec<Vec<[f64; 3]>> = (0..joints).map(|joint| self.motion(joint)).collect();
        let mut workspace = Workspace::new(arm);
        let mut mass = DMatrix::zeros(joints, joints);
        let mut torque = vec![0.0; joints];
        let mut loads = vec![Vec::with_capacity(rows); joints];
        for row in 0..rows {
            let of = |order: usize| motions.iter().map(|motion| motion[row][order]).collect::<Vec<f64>>();
            let [q, v, a] = [0, 1, 2].map(of);
            crba(arm, &mut workspace, &q, &mut mass);
            rnea(arm, &mut workspace, &q, &v, &a, &mut torque);
            for (joint, loads) in loads.iter_mut().enumerate() {
                let inertia = mass[(joint, joint)];
                loads.push(Load { inertia, torque: torque[joint] - inertia * a[joint] });
            }
        }
        let alone = |(joint, loads): (usize, Vec<Load>)| Track {
            stamps: self.stamps.clone(),
            measured: vec![self.measured[joint].clone()],
            commands: vec![self.commands[joint].clone()],
            loads,
        };
        loads.into_iter().enumerate().map(alone).collect()
    }

    /// Position, velocity and acceleration of `joint` in each row: a parabola through the rows about it. Without a measurement, its command
    /// at rest.
    fn motion(&self, joint: usize) -> Vec<[f64; 3]> {
        let (rows, q) = (self.stamps.len(), &self.measured[joint]);
        let of_row = |row: usize| {
            let t = self.stamps[row];
            let near = row.saturating_sub(REACH)..(row + REACH + 1).min(rows);
            let measured = near.filter(|row| q[*row].is_finite());
            let points: Vec<(f64, f64)> = measured.map(|row| (self.stamps[row] - t, q[row])).collect();
            parabola(&points).unwrap_or([self.commands[joint].held(t), 0.0, 0.0])
        };
        (0..rows).map(of_row).collect()
    }
}

/// Value, slope and curvature at zero of the least-squares parabola through `points`; `None` for fewer than three points.
fn parabola(points: &[(f64, f64)]) -> Option<[f64; 3]> {
    if points.len() < 3 {
        return None;
    }
    let mut matrix = Matrix3::zeros();
    let mut right = Vector3::zeros();
    for (t, q) in points {
        let columns = Vector3::new(1.0, *t, 0.5 * t * t);
        matrix += columns * columns.transpose();
        right += columns * *q;
    }
    matrix.try_inverse().map(|inverse| (inverse * right).into())
}

#[cfg(test)]
mod tests {
    use super::parabola;

    #[test]
    fn a_parabola_is_found_exactly() {
        let points = [-0.2, -0.1, 0.0, 0.15].map(|t| (t, 3.0 - 2.0 * t + 2.5 * t * t));
        let found = parabola(&points).expect("three points and more");
        for (found, exact) in found.iter().zip([3.0, -2.0, 5.0]) {
            assert!((found - exact).abs() < 1e-9, "{found} {exact}");
        }
        assert!(parabola(&points[..2]).is_none());
    }
}
