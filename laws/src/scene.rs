//! The scene of effects: the arm, its motion, and the quantities predicted from them.

use std::cell::OnceCell;

use freeplay_arm::{Arm, Inertia, JointKind, Workspace, crba, forward_kinematics, jacobian, rnea};
use nalgebra::{DMatrix, Isometry3};

use crate::arm_parts::ArmParts;
use crate::bearing_course::BearingCourse;
use crate::trajectory::Trajectory;
use crate::{DriveFriction, LawError};

/// The inputs of effects: the arm, its motion, and the torques of the rigid arm.
#[derive(Clone, Debug)]
pub struct Scene<'a> {
    /// The arm, with the effects that change it.
    pub arm: Arm,
    /// The motion that the encoders read.
    pub motion: &'a Trajectory,
    /// Torque of the rigid arm for that motion without its rotors, `[joint][point]`, N·m (N): the load of the transmissions. It comes from
    /// the model, never from the measurement, which contains the effects to be explained.
    pub load: Vec<Vec<f64>>,
    tool_sensitivity: OnceCell<Vec<[Vec<f64>; 3]>>,
    carrying: OnceCell<Vec<Vec<f64>>>,
    inertia: OnceCell<Vec<Vec<f64>>>,
    yielding: Vec<OnceCell<Vec<f64>>>,
    signs: Vec<OnceCell<Vec<f64>>>,
    bearings: Vec<OnceCell<Option<BearingCourse>>>,
}

impl<'a> Scene<'a> {
    /// The scene of `arm` moving along `motion`.
    pub fn new(arm: Arm, motion: &'a Trajectory) -> Scene<'a> {
        let mut load = rigid_torques(&arm, motion, None);
        for (load, torque) in load.iter_mut().zip(rotor_torques(&arm, motion)) {
            load.iter_mut().zip(torque).for_each(|(load, torque)| *load -= torque);
        }
        let (tool_sensitivity, carrying, inertia) = (OnceCell::new(), OnceCell::new(), OnceCell::new());
        let by_joint = vec![OnceCell::new(); arm.dof()];
        let (yielding, signs, bearings) = (by_joint.clone(), by_joint, vec![OnceCell::new(); arm.dof()]);
        Scene { arm, motion, load, tool_sensitivity, carrying, inertia, yielding, signs, bearings }
    }
}

impl Scene<'_> {
    /// Displacement of the tool per unit of each joint along the motion, `[joint][axis][point]`, m/rad (m/m); computed once.
    pub fn tool_sensitivity(&self) -> &[[Vec<f64>; 3]] {
        self.tool_sensitivity.get_or_init(|| tool_sensitivity(&self.arm, &self.motion.q))
    }

    /// Inertia that each joint moves beyond its rotor along the motion, `[joint][point]`, kg·m² (kg); computed once.
    pub fn inertia(&self) -> &[Vec<f64>] {
        self.inertia.get_or_init(|| inertia(&self.arm, &self.motion.q))
    }

    /// Derivative of the torque of `joint` by its own position along the motion, N·m/rad (N/m); computed once.
    pub fn position_derivative(&self, joint: usize) -> &[f64] {
        self.yielding[joint].get_or_init(|| slopes(&self.arm, self.motion, &[], joint).swap_remove(joint))
    }

    /// Sign of the velocity of `joint` along the motion, −1 to 1: see [`DriveFriction::sign`]; computed once.
    pub(crate) fn signs(&self, joint: usize) -> &[f64] {
        self.signs[joint]
            .get_or_init(|| self.motion.v[joint].iter().map(|v| DriveFriction::sign(*v)).collect())
    }

    /// The load of the bearing of `joint` along the motion, if the joint can have play; computed once.
    pub(crate) fn bearing(&self, joint: usize) -> Option<&BearingCourse> {
        self.bearings[joint].get_or_init(|| BearingCourse::new(&self.arm, joint, self.motion)).as_ref()
    }

    /// Torques of 1 kg at the tool's origin, weight and inertia, `[joint][point]`, N·m/kg (N/kg); computed once.
    ///
    /// # Errors
    /// [`LawError::Changed`] if the arm with this mass is impossible.
    pub fn carrying(&self) -> Result<&[Vec<f64>], LawError> {
        if let Some(carrying) = self.carrying.get() {
            return Ok(carrying);
        }
        let mut with = Scene::new(loaded(&self.arm, 1.0)?, self.motion).load;
        for (with, without) in with.iter_mut().zip(&self.load) {
            with.iter_mut().zip(without).for_each(|(with, without)| *with -= without);
        }
        Ok(self.carrying.get_or_init(|| with))
    }
}

/// `arm` with a point of `mass`, kg, at its tool's origin.
///
/// # Errors
/// [`LawError::Changed`] if the arm with this mass is impossible.
pub(crate) fn loaded(arm: &Arm, mass: f64) -> Result<Arm, LawError> {
    let mut parts = ArmParts::of(arm);
    let point = Inertia { mass, com: parts.tool.translation.vector, ..Inertia::zero() };
    if let Some(last) = parts.joints.last_mut() {
        last.inertia = last.inertia.joined_with(&point, &Isometry3::identity());
    }
    parts.into_arm(arm.name())
}

/// Torque of the rigid arm along `motion`, with the links displaced by `shift` from the encoder positions, `[joint][point]`, N·m (N).
pub fn rigid_torques(arm: &Arm, motion: &Trajectory, shift: Option<&[Vec<f64>]>) -> Vec<Vec<f64>> {
    let dof = arm.dof();
    let mut ws = Workspace::new(arm);
    let (mut q, mut v, mut a, mut tau) = (vec![0.0; dof], vec![0.0; dof], vec![0.0; dof], vec![0.0; dof]);
    let mut torques = vec![Vec::with_capacity(motion.len()); dof];
    for point in 0..motion.len() {
        motion.at(point, &mut q, &mut v, &mut a);
        for (q, shift) in q.iter_mut().zip(shift.into_iter().flatten()) {
            *q += shift[point];
        }
        rnea(arm, &mut ws, &q, &v, &a, &mut tau);
        for (torques, tau) in torques.iter_mut().zip(&tau) {
            torques.push(*tau);
        }
    }
    torques
}

/// Torque for the acceleration of the rotors in the file of `arm` along `motion`, `[joint][point]`, N·m (N).
pub fn rotor_torques(arm: &Arm, motion: &Trajectory) -> Vec<Vec<f64>> {
    let joints = arm.joints().iter().zip(&motion.a);
    joints.map(|(joint, a)| a.iter().map(|a| joint.rotor_inertia * a).collect()).collect()
}

/// Inertia that each joint moves beyond its rotor at each point of the joint positions `q`, `[joint][point]`, kg·m² (kg): the diagonal of the
/// mass matrix without rotors.
fn inertia(arm: &Arm, q: &[Vec<f64>]) -> Vec<Vec<f64>> {
    let (dof, points) = (arm.dof(), q.first().map_or(0, Vec::len));
    let (mut ws, mut mass) = (Workspace::new(arm), DMatrix::zeros(dof, dof));
    let (mut here, mut inertia) = (vec![0.0; dof], vec![Vec::with_capacity(points); dof]);
    for point in 0..points {
        here.iter_mut().zip(q).for_each(|(here, q)| *here = q[point]);
        crba(arm, &mut ws, &here, &mut mass);
        for (joint, inertia) in inertia.iter_mut().enumerate() {
            inertia.push(mass[(joint, joint)] - arm.joints()[joint].rotor_inertia);
        }
    }
    inertia
}

/// Tool position at each point of the joint positions `q`, `[axis][point]`, m.
pub fn tool_positions(arm: &Arm, q: &[Vec<f64>]) -> Vec<Vec<f64>> {
    let mut ws = Workspace::new(arm);
    let points = q.first().map_or(0, Vec::len);
    let mut tool: Vec<Vec<f64>> = (0..3).map(|_| Vec::with_capacity(points)).collect();
    let mut here = vec![0.0; q.len()];
    for point in 0..points {
        here.iter_mut().zip(q).for_each(|(here, q)| *here = q[point]);
        let pose = forward_kinematics(arm, &mut ws, &here);
        for (axis, tool) in tool.iter_mut().enumerate() {
            tool.push(pose.translation.vector[axis]);
        }
    }
    tool
}

/// Unit of a joint's torque.
pub fn torque_unit(kind: JointKind) -> &'static str {
    match kind {
        JointKind::Revolute => "N*m",
        JointKind::Prismatic => "N",
    }
}

/// Displacement of the tool per unit of each joint, `[joint][axis][point]`, m/rad (m/m): the upper half of the Jacobian at `q`.
pub fn tool_sensitivity(arm: &Arm, q: &[Vec<f64>]) -> Vec<[Vec<f64>; 3]> {
    let points = q.first().map_or(0, Vec::len);
    let (mut ws, mut columns) = (Workspace::new(arm), DMatrix::zeros(6, arm.dof()));
    let mut sensitivity =
        vec![[const { Vec::new() }; 3].map(|_: Vec<f64>| Vec::with_capacity(points)); arm.dof()];
    let mut here = vec![0.0; q.len()];
    for point in 0..points {
        here.iter_mut().zip(q).for_each(|(here, q)| *here = q[point]);
        jacobian(arm, &mut ws, &here, &mut columns);
        for (joint, tool) in sensitivity.iter_mut().enumerate() {
            for (axis, tool) in tool.iter_mut().enumerate() {
                tool.push(columns[(axis, joint)]);
            }
        }
    }
    sensitivity
}

/// Derivative of the rigid arm's torques by each joint's position, `[moved joint][joint][point]`, N·m/rad, by central differences about the
/// positions displaced by `shift` from the motion's.
pub fn torque_sensitivity(arm: &Arm, motion: &Trajectory, shift: &[Vec<f64>]) -> Vec<Vec<Vec<f64>>> {
    (0..arm.dof()).map(|joint| slopes(arm, motion, shift, joint)).collect()
}

/// The same for the position of `joint` alone, `[joint][point]`; an empty `shift` means zero.
fn slopes(arm: &Arm, motion: &Trajectory, shift: &[Vec<f64>], joint: usize) -> Vec<Vec<f64>> {
    /// Rounding and curvature errors together are about 1e-9 of the torque.
    const STEP: f64 = 1e-4;
    let moved = |by: f64| {
        let nothing = || vec![vec![0.0; motion.len()]; arm.dof()];
        let mut shift = if shift.is_empty() { nothing() } else { shift.to_vec() };
        shift[joint].iter_mut().for_each(|shift| *shift += by);
        rigid_torques(arm, motion, Some(&shift))
    };
    let difference = |(ahead, behind): (Vec<f64>, Vec<f64>)| -> Vec<f64> {
        ahead.iter().zip(behind).map(|(ahead, behind)| (ahead - behind) / (2.0 * STEP)).collect()
    };
    moved(STEP).into_iter().zip(moved(-STEP)).map(difference).collect()
}
