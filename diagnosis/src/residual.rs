//! Measured against model, channel by channel.

use std::ops::Range;

use freeplay_arm::{Arm, JointKind, Workspace, forward_kinematics, rnea};
use freeplay_laws::DriveFriction;
use freeplay_recording::{Group, Recording};

use crate::error::ResidualError;
use crate::motion::{Motion, Treatment};
use crate::statistics::Moments;

/// What a channel measures, and what the model says in its place.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Kind {
    /// Torque of the joint with this index: measured, against inverse dynamics of the measured motion plus nominal friction.
    Torque(usize),
    /// Tool position along x, y or z (0 to 2): tracked, against forward kinematics of the measured joint positions.
    Tool(usize),
    /// Link-side encoder of the joint with this index, against the motor-side position.
    Link(usize),
}

/// One channel: what was measured and what the model says, point by point.
#[derive(Debug, Clone, PartialEq)]
pub struct Channel {
    /// Name of its column in the recording.
    pub name: String,
    /// What it measures.
    pub kind: Kind,
    /// Unit of all its numbers: `N*m` or `N`, `m`, `rad`.
    pub unit: &'static str,
    /// Measured, treated.
    pub measured: Vec<f64>,
    /// The model's answer to the measured motion, nominal friction included.
    pub model: Vec<f64>,
    /// The nominal friction in it; torque channels of a joint for which the model names friction.
    pub friction: Option<Vec<f64>>,
}

impl Channel {
    /// Measured minus model at every point.
    pub fn residual(&self) -> Vec<f64> {
        self.measured.iter().zip(&self.model).map(|(measured, model)| measured - model).collect()
    }

    /// Measured minus model without its friction; `None` if the channel has none.
    pub fn residual_without_friction(&self) -> Option<Vec<f64>> {
        let friction = self.friction.as_ref()?;
        Some(self.residual().iter().zip(friction).map(|(residual, friction)| residual + friction).collect())
    }
}

/// All channels of a recording that a model can predict, on one treated grid.
#[derive(Debug, Clone, PartialEq)]
pub struct Residuals {
    /// Time, s.
    pub t: Vec<f64>,
    /// Stretches without gaps, as ranges of points.
    pub stretches: Vec<Range<usize>>,
    /// Torques by joint, then the tool's x, y, z, then link encoders by joint; those that were recorded.
    pub channels: Vec<Channel>,
}

/// The residuals of `recording` against `arm`. `motion` is the motion of `recording` under `treatment`.
///
/// # Errors
/// [`ResidualError::JointCount`], [`ResidualError::NothingToCompare`], [`ResidualError::NotFinite`].
pub fn residuals(
    arm: &Arm,
    recording: &Recording,
    treatment: &Treatment,
    motion: &Motion,
) -> Result<Residuals, ResidualError> {
    check_joints(arm, recording)?;
    let mut channels = torque_channels(arm, recording, treatment, motion);
    channels.extend(tool_channels(arm, recording, treatment, motion));
    channels.extend(link_channels(arm, recording, treatment, motion));
    if channels.is_empty() {
        return Err(ResidualError::NothingToCompare { origin: recording.origin.clone(), joints: arm.dof() });
    }
    if let Some(odd) = channels.iter().find(|channel| !Moments::of(&channel.residual()).rms.is_finite()) {
        return Err(ResidualError::NotFinite { origin: recording.origin.clone(), channel: odd.name.clone() });
    }
    Ok(Residuals { t: motion.t.clone(), stretches: motion.stretches.clone(), channels })
}

/// The model and the recording have the same number of joints.
pub(crate) fn check_joints(arm: &Arm, recording: &Recording) -> Result<(), ResidualError> {
    if arm.dof() == recording.joints() {
        return Ok(());
    }
    Err(ResidualError::JointCount {
        origin: recording.origin.clone(),
        expected: arm.dof(),
        found: recording.joints(),
        names: arm.joints().iter().map(|joint| joint.name.as_str()).collect::<Vec<_>>().join(", "),
    })
}

fn torque_channels(arm: &Arm, recording: &Recording, treatment: &Treatment, motion: &Motion) -> Vec<Channel> {
    let Some(torques) = &recording.tau else { return Vec::new() };
    let rigid = rigid_torques(arm, motion);
    let joints = arm.joints().iter().enumerate().zip(rigid).zip(torques);
    joints
        .map(|(((index, joint), mut model), measured)| {
            let friction = friction(arm, index, recording, treatment, motion);
            for (model, friction) in model.iter_mut().zip(friction.iter().flatten()) {
                *model += friction;
            }
            Channel {
                name: Group::Torque.column(index),
                kind: Kind::Torque(index),
                unit: match joint.kind {
                    JointKind::Revolute => "N*m",
                    JointKind::Prismatic => "N",
                },
                measured: treatment.smooth(recording, measured),
                model,
                friction,
            }
        })
        .collect()
}

/// Inverse dynamics of the rigid arm along `motion`, `[joint][point]`, N·m or N.
pub fn rigid_torques(arm: &Arm, motion: &Motion) -> Vec<Vec<f64>> {
    let dof = arm.dof();
    let mut ws = Workspace::new(arm);
    let (mut q, mut v, mut a, mut tau) = (vec![0.0; dof], vec![0.0; dof], vec![0.0; dof], vec![0.0; dof]);
    let mut torques = vec![Vec::with_capacity(motion.len()); dof];
    for point in 0..motion.len() {
        motion.at(point, &mut q, &mut v, &mut a);
        rnea(arm, &mut ws, &q, &v, &a, &mut tau);
        for (torques, tau) in torques.iter_mut().zip(&tau) {
            torques.push(*tau);
        }
    }
    torques
}

/// The nominal friction that the model names for joint `index`: viscous·v + coulomb·sign v, the jump of the sign filtered as the
/// measured torque is.
fn friction(
    arm: &Arm,
    index: usize,
    recording: &Recording,
    treatment: &Treatment,
    motion: &Motion,
) -> Option<Vec<f64>> {
    let nominal = DriveFriction::nominal(arm.joints()[index].friction);
    if nominal.viscous == 0.0 && nominal.coulomb == 0.0 {
        return None;
    }
    let smooth = DriveFriction { coulomb: 0.0, ..nominal };
    let mut friction: Vec<f64> = motion.v[index].iter().map(|v| smooth.resisting(*v)).collect();
    if nominal.coulomb > 0.0 {
        let jump = DriveFriction { viscous: 0.0, ..nominal };
        let jump = treatment.smooth_law_of_velocity(recording, &recording.q[index], |v| jump.resisting(v));
        for (friction, jump) in friction.iter_mut().zip(jump) {
            *friction += jump;
        }
    }
    Some(friction)
}

fn tool_channels(arm: &Arm, recording: &Recording, treatment: &Treatment, motion: &Motion) -> Vec<Channel> {
    let Some(tracked) = &recording.tool else { return Vec::new() };
    let dof = arm.dof();
    let mut ws = Workspace::new(arm);
    let (mut q, mut v, mut a) = (vec![0.0; dof], vec![0.0; dof], vec![0.0; dof]);
    let mut model = [const { Vec::new() }; 3];
    for point in 0..motion.len() {
        motion.at(point, &mut q, &mut v, &mut a);
        let pose = forward_kinematics(arm, &mut ws, &q);
        for (axis, model) in model.iter_mut().enumerate() {
            model.push(pose.translation.vector[axis]);
        }
    }
    let axes = ["x", "y", "z"].into_iter().enumerate().zip(tracked).zip(model);
    axes.map(|(((axis, name), measured), model)| Channel {
        name: name.to_owned(),
        kind: Kind::Tool(axis),
        unit: "m",
        measured: treatment.smooth(recording, measured),
        model,
        friction: None,
    })
    .collect()
}

fn link_channels(arm: &Arm, recording: &Recording, treatment: &Treatment, motion: &Motion) -> Vec<Channel> {
    let links = recording.q_link.iter().enumerate();
    links
        .filter_map(|(index, link)| {
            Some(Channel {
                name: Group::Link.column(index),
                kind: Kind::Link(index),
                unit: match arm.joints()[index].kind {
                    JointKind::Revolute => "rad",
                    JointKind::Prismatic => "m",
                },
                measured: treatment.smooth(recording, link.as_ref()?),
                model: motion.q[index].clone(),
                friction: None,
            })
        })
        .collect()
}
