//! The load of one joint's bearing along a whole motion, and the effect of its journal on the tool and the drives.

use freeplay_arm::Arm;
use nalgebra::Vector3;

use crate::columns::Columns;
use crate::{BearingLoad, Clearance, ClearanceTable, Trajectory};

/// One bearing along a motion, one number per point; the two coordinates across the joint's axis are those of [`ArmWithPlay`].
#[derive(Clone, Debug)]
pub(crate) struct BearingCourse {
    /// Mass of all links beyond the joint, kg.
    pub mass: f64,
    /// Force that the bearing carries while its journal rests, N.
    pub force: Vec<[f64; 2]>,
    /// Displacement of the tool per displacement of the journal, m/m, base frame.
    pub tool: Vec<[Vector3<f64>; 2]>,
    /// Additional torque of the drives per displacement of the journal, `[joint][point]`, N·m (N) per m.
    pub torque: Vec<Vec<[f64; 2]>>,
}

impl BearingCourse {
    /// The bearing of `joint` of `arm` along `motion`; `None` if that joint cannot have play.
    pub fn new(arm: &Arm, joint: usize, motion: &Trajectory) -> Option<BearingCourse> {
        // With the journal at the centre, the width of the play has no effect.
        let clearance = Clearance::new(&ClearanceTable::new(1e-4)).ok()?;
        let mut bearing = BearingLoad::new(arm, joint, clearance).ok()?;
        let mut course = BearingCourse {
            mass: arm.joints()[joint..].iter().map(|joint| joint.inertia.mass).sum(),
            force: Vec::with_capacity(motion.len()),
            tool: Vec::with_capacity(motion.len()),
            torque: vec![Vec::with_capacity(motion.len()); arm.dof()],
        };
        let mut change = [vec![0.0; arm.dof()], vec![0.0; arm.dof()]];
        for point in 0..motion.len() {
            let [q, v, a] = &mut bearing.motion;
            motion.at(point, q, v, a);
            course.force.push(bearing.force());
            course.tool.push([bearing.moved([1.0, 0.0]), bearing.moved([0.0, 1.0])]);
            for (change, way) in change.iter_mut().zip([[1.0, 0.0], [0.0, 1.0]]) {
                // The torque is a lever times a force, and so linear in the displacement.
                change.fill(0.0);
                bearing.add_torques(way, 1.0, change);
                bearing.add_torques([0.0; 2], -1.0, change);
            }
            for (joint, torque) in course.torque.iter_mut().enumerate() {
                torque.push([change[0][joint], change[1][joint]]);
            }
        }
        Some(course)
    }

    /// Displaces the `tool`, `[axis][point]`, for the journal at `place`, m along the two slides.
    pub fn carry(&self, point: usize, place: [f64; 2], tool: &mut Columns) {
        let [first, second] = self.tool[point];
        let moved = first * place[0] + second * place[1];
        moved.iter().enumerate().for_each(|(axis, moved)| tool[axis][point] += moved);
    }

    /// Adds the torque for the journal at `place` to the drives' `torque`, `[joint][point]`.
    pub fn burden(&self, point: usize, place: [f64; 2], torque: &mut Columns) {
        for (joint, per_metre) in self.torque.iter().enumerate() {
            let [first, second] = per_metre[point];
            torque[joint][point] += first * place[0] + second * place[1];
        }
    }
}
