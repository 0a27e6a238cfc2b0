//! Residuals: measured minus model, channel by channel.

use std::ops::Range;

use freeplay_arm::{Arm, JointKind};
use freeplay_laws::{
    Baseline, Change, Columns, Placed, Prediction, Trajectory, rigid_torques, tool_positions, torque_unit,
};
use freeplay_recording::{Group, Recording};

use crate::error::ResidualError;
use crate::signals::channel::{Channel, Kind};
use crate::signals::initial_state::predicted_with_initial_states;
use crate::signals::missing::masked;
use crate::signals::motion::Treatment;
use crate::signals::rest::clamp_at_rest;
use crate::statistics::{Moments, difference};

/// All channels of a recording that a model can predict, on one grid after the treatment.
#[derive(Debug, Clone, PartialEq)]
pub struct Residuals {
    /// Time, s.
    pub t: Vec<f64>,
    /// Stretches without gaps, as ranges of points.
    pub stretches: Vec<Range<usize>>,
    /// Torques by joint, then the tool's x, y, z, then link encoders by joint; only the recorded ones.
    pub channels: Vec<Channel>,
}

/// The residuals of `recording` against `arm` with its `effects`, both under `treatment`. The model is evaluated on every point of the grid and
/// treated like the measured columns, so that laws with jumps or with a memory see the whole motion. For a joint at rest, dry friction takes the
/// possible value nearest to the measured torque.
///
/// # Errors
/// [`ResidualError::JointCount`], [`ResidualError::Effects`], [`ResidualError::NothingToCompare`], [`ResidualError::NotFinite`].
pub fn residuals(
    arm: &Arm,
    effects: &[Placed],
    recording: &Recording,
    treatment: &Treatment,
) -> Result<Residuals, ResidualError> {
    check_joints(arm, recording)?;
    let whole = treatment.whole_motion(recording);
    let sharpening = Sharpening::of(arm, recording, treatment, &whole);
    let mut residuals = residuals_along(arm, effects, recording, treatment, &whole, &sharpening)?;
    clamp_at_rest(arm, effects, recording, treatment, (&whole, &sharpening), &mut residuals)?;
    Ok(residuals)
}

/// [`residuals`] for the treated motion `whole` of `recording`, with the correction `sharpening` of the model along it.
pub(crate) fn residuals_along(
    arm: &Arm,
    effects: &[Placed],
    recording: &Recording,
    treatment: &Treatment,
    whole: &Trajectory,
    sharpening: &Sharpening,
) -> Result<Residuals, ResidualError> {
    let low_pass = |column: &[f64]| treatment.low_pass(column);
    let machine =
        |effects: &[_]| Baseline::with_hidden(arm, effects, whole, &low_pass, Some(&sharpening.more));
    let left = |prediction: &Prediction, kind: Kind| {
        let column = kind.measured(recording)?;
        let off = difference(&treatment.smooth(recording, column), &treatment.keep(kind.of(prediction)));
        Some(masked(off, treatment.present(recording, column).as_deref()))
    };
    let effects: Vec<&Placed> = effects.iter().collect();
    let prediction = predicted_with_initial_states(&effects, machine, left)?;
    let channels = channels(arm, recording, treatment, &prediction);
    if channels.iter().all(Channel::is_missing) {
        return Err(ResidualError::NothingToCompare { origin: recording.origin.clone(), joints: arm.dof() });
    }
    if let Some(odd) = channels.iter().find(|channel| !Moments::of(&channel.residual()).rms.is_finite()) {
        return Err(ResidualError::NotFinite { origin: recording.origin.clone(), channel: odd.name.clone() });
    }
    Ok(Residuals { t: treatment.times(), stretches: treatment.stretches(), channels })
}

/// The error of the rigid arm's prediction along a treated motion: products of positions, speeds and accelerations change faster than the low-pass
/// transmits. On all grid points.
pub(crate) struct Sharpening {
    /// The treated torque and tool position of the arm, minus those along the treated motion.
    pub more: Change,
    /// The part of the arm's torques above the low-pass, `[joint][point]`.
    pub unresolved: Vec<Vec<f64>>,
}

impl Sharpening {
    /// The correction for `arm` along `recording`, whose treated motion is `whole`.
    pub fn of(arm: &Arm, recording: &Recording, treatment: &Treatment, whole: &Trajectory) -> Self {
        let fine = treatment.fine_motion(recording);
        let torques = rigid_torques(arm, &fine, None);
        let low: Vec<Vec<f64>> = torques.iter().map(|torque| treatment.low_pass(torque)).collect();
        let torque =
            low.iter().zip(rigid_torques(arm, whole, None)).map(|(low, smooth)| difference(low, &smooth));
        let tools = tool_positions(arm, &fine.q).into_iter().zip(tool_positions(arm, &whole.q));
        let tool = tools.map(|(fine, smooth)| difference(&treatment.low_pass(&fine), &smooth));
        let more = Change {
            torque: torque.collect::<Vec<_>>().into(),
            tool: tool.collect::<Vec<_>>().into(),
            link: Columns::zero(arm.dof(), whole.len()),
        };
        let unresolved = torques.iter().zip(&low).map(|(torque, low)| difference(torque, low)).collect();
        Self { more, unresolved }
    }
}

/// Checks that the model and the recording have the same number of joints.
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

/// Torques by joint, the tool's x, y, z, link encoders by joint; only the recorded ones.
fn channels(arm: &Arm, recording: &Recording, treatment: &Treatment, model: &Prediction) -> Vec<Channel> {
    let channel = |name: String, kind: Kind, unit: &'static str, measured: &[f64], model: &[f64]| Channel {
        name,
        kind,
        unit,
        measured: treatment.smooth(recording, measured),
        model: treatment.keep(model),
        present: treatment.present(recording, measured),
        friction: None,
    };
    let mut channels = Vec::new();
    for (index, measured) in recording.tau.iter().flatten().enumerate() {
        let joint = &arm.joints()[index];
        let named = joint.friction.viscous != 0.0 || joint.friction.coulomb != 0.0;
        channels.push(Channel {
            friction: named.then(|| treatment.keep(&model.friction[index])),
            ..channel(
                Group::Torque.column(index),
                Kind::Torque(index),
                torque_unit(joint.kind),
                measured,
                &model.torque[index],
            )
        });
    }
    for (axis, measured) in recording.tool.iter().flatten().enumerate() {
        let name = ["x", "y", "z"][axis].to_owned();
        channels.push(channel(name, Kind::Tool(axis), "m", measured, &model.tool[axis]));
    }
    for (index, measured) in recording.q_link.iter().enumerate() {
        let unit = match arm.joints()[index].kind {
            JointKind::Revolute => "rad",
            JointKind::Prismatic => "m",
        };
        if let Some(measured) = measured {
            let name = Group::Link.column(index);
            channels.push(channel(name, Kind::Link(index), unit, measured, &model.link[index]));
        }
    }
    channels
}
