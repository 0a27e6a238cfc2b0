//! What a recording would show of an arm with effects, given the motion that its encoders read.

use std::ops::Range;

use freeplay_arm::{Arm, JointKind, Workspace, forward_kinematics, rnea};

use crate::effect::{ArmParts, Effect};
use crate::{DriveFriction, LawError, Placed};

/// A motion of all joints over time, as the motor-side encoders read it.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Trajectory {
    /// Time, s; evenly spaced within a stretch.
    pub t: Vec<f64>,
    /// Position, `[joint][point]`, rad (m).
    pub q: Vec<Vec<f64>>,
    /// Velocity, `[joint][point]`, rad/s (m/s).
    pub v: Vec<Vec<f64>>,
    /// Acceleration, `[joint][point]`, rad/s² (m/s²).
    pub a: Vec<Vec<f64>>,
    /// Stretches without gaps, as ranges of points. A law with a memory starts anew in each.
    pub stretches: Vec<Range<usize>>,
}

impl Trajectory {
    /// Number of points.
    pub fn len(&self) -> usize {
        self.t.len()
    }

    /// Whether there are no points.
    pub fn is_empty(&self) -> bool {
        self.t.is_empty()
    }

    /// Time between two points of `stretch`, s.
    pub fn step(&self, stretch: &Range<usize>) -> f64 {
        let points = stretch.len().saturating_sub(1).max(1);
        (self.t[stretch.end - 1] - self.t[stretch.start]) / points as f64
    }

    /// Position, velocity and acceleration of all joints at `point` into slices of one number per joint.
    pub fn at(&self, point: usize, q: &mut [f64], v: &mut [f64], a: &mut [f64]) {
        for joint in 0..self.q.len() {
            (q[joint], v[joint], a[joint]) =
                (self.q[joint][point], self.v[joint][point], self.a[joint][point]);
        }
    }
}

/// What effects see: the arm, its motion, and what the rigid arm makes of it.
#[derive(Debug)]
pub struct Scene<'a> {
    /// The arm, with the effects that change it.
    pub arm: &'a Arm,
    /// The motion that the encoders read.
    pub motion: &'a Trajectory,
    /// Torque that the rigid arm needs for that motion, `[joint][point]`, N·m (N): the load of the transmissions. It is the
    /// model's, never the measured one, which holds what is to be explained.
    pub load: Vec<Vec<f64>>,
}

impl<'a> Scene<'a> {
    /// The scene of `arm` moving along `motion`.
    pub fn new(arm: &'a Arm, motion: &'a Trajectory) -> Scene<'a> {
        Scene { arm, motion, load: rigid_torques(arm, motion, None) }
    }
}

/// What a model says in place of each measured channel.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Prediction {
    /// Joint torques, `[joint][point]`, N·m (N).
    pub torque: Vec<Vec<f64>>,
    /// The part of them that is the nominal friction of the drives.
    pub friction: Vec<Vec<f64>>,
    /// Tool position in the base frame, `[axis][point]`, m.
    pub tool: [Vec<f64>; 3],
    /// Link-side position of each joint, `[joint][point]`, rad (m).
    pub link: Vec<Vec<f64>>,
}

/// The low-pass that a measured column has gone through, applied to one column of the trajectory's points.
pub type LowPassed<'a> = dyn Fn(&[f64]) -> Vec<f64> + 'a;

/// What a recording of `motion` would show of `arm` with `effects`. Laws that jump go through `low_pass`, as the measurement did.
///
/// # Errors
/// [`LawError::Changed`] if an effect leaves no possible arm.
pub fn predict(
    arm: &Arm,
    effects: &[Placed],
    motion: &Trajectory,
    low_pass: &LowPassed,
) -> Result<Prediction, LawError> {
    let arm = &changed(arm, effects)?;
    let scene = Scene::new(arm, motion);
    let blank = || vec![vec![0.0; motion.len()]; arm.dof()];
    let mut shift = blank();
    gather(effects, low_pass, &mut shift, |effect, shift| effect.shift(&scene, shift));
    let shifted = shift.iter().flatten().any(|&shift| shift != 0.0);
    let mut torque = if shifted { rigid_torques(arm, motion, Some(&shift)) } else { scene.load.clone() };
    let friction = nominal_friction(&scene, low_pass);
    add(&mut torque, &friction);
    gather(effects, low_pass, &mut torque, |effect, torque| effect.torque(&scene, torque));
    let link: Vec<Vec<f64>> = motion.q.iter().zip(&shift).map(|(q, shift)| sum(q, shift)).collect();
    let mut tool = tool_positions(arm, &link);
    gather(effects, low_pass, &mut tool, |effect, tool| {
        if let Ok(tool) = tool.try_into() {
            effect.displace(&scene, tool);
        }
    });
    let [x, y, z] = <[Vec<f64>; 3]>::try_from(tool).unwrap_or_default();
    let mut prediction = Prediction { torque, friction, tool: [x, y, z], link };
    for placed in effects {
        placed.effect.measure(&scene, &mut prediction);
    }
    Ok(prediction)
}

/// `arm` with the effects that change it.
///
/// # Errors
/// [`LawError::Changed`] if an effect leaves no possible arm.
pub fn changed(arm: &Arm, effects: &[Placed]) -> Result<Arm, LawError> {
    let mut parts = ArmParts::of(arm);
    for placed in effects {
        placed.effect.arm(&mut parts)?;
    }
    parts.into_arm(arm.name())
}

/// Adds to `channels` what every effect has to say; what jumps is filtered first.
fn gather(
    effects: &[Placed],
    low_pass: &LowPassed,
    channels: &mut [Vec<f64>],
    speak: impl Fn(&dyn Effect, &mut [Vec<f64>]),
) {
    for placed in effects {
        let mut said: Vec<Vec<f64>> = channels.iter().map(|channel| vec![0.0; channel.len()]).collect();
        speak(placed.effect.as_ref(), &mut said);
        for (channel, said) in channels.iter_mut().zip(said) {
            if said.iter().all(|&x| x == 0.0) {
                continue;
            }
            let said = if placed.kind.rough { low_pass(&said) } else { said };
            channel.iter_mut().zip(said).for_each(|(channel, said)| *channel += said);
        }
    }
}

fn add(channels: &mut [Vec<f64>], others: &[Vec<f64>]) {
    for (channel, other) in channels.iter_mut().zip(others) {
        channel.iter_mut().zip(other).for_each(|(channel, other)| *channel += other);
    }
}

fn sum(a: &[f64], b: &[f64]) -> Vec<f64> {
    a.iter().zip(b).map(|(a, b)| a + b).collect()
}

/// Torque of the rigid arm along `motion`, with the links `shift` away from where the encoders have them, `[joint][point]`, N·m (N).
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

/// The friction that the arm file names for each joint; the jump of its sign goes through `low_pass`.
fn nominal_friction(scene: &Scene, low_pass: &LowPassed) -> Vec<Vec<f64>> {
    let joints = scene.arm.joints().iter().zip(&scene.motion.v);
    joints
        .map(|(joint, v)| {
            let nominal = DriveFriction::nominal(joint.friction);
            if nominal.coulomb == 0.0 {
                return v.iter().map(|v| nominal.resisting(*v)).collect();
            }
            let jump = DriveFriction { viscous: 0.0, ..nominal };
            let jump = low_pass(&v.iter().map(|v| jump.resisting(*v)).collect::<Vec<_>>());
            jump.iter().zip(v).map(|(jump, v)| jump + nominal.viscous * v).collect()
        })
        .collect()
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
