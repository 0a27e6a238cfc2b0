//! Measured positions against positions simulated from the commands.

use freeplay_arm::JointKind;
use freeplay_laws::Placed;
use freeplay_model::ArmFile;
use freeplay_recording::{Group, Recording};
use freeplay_servo::{Rollout, ServoArm, Track, lag};

use super::tracks::{commands_alone, for_lags, longest_gap, rollout_step, track};
use crate::compare::comparison::{Comparison, SCHEMA, compare};
use crate::compare::notes;
use crate::compare::tally::ChannelTally;
use crate::conventions::examine;
use crate::error::ResidualError;
use crate::signals::channel::{Channel, Kind};
use crate::signals::motion::Settings;
use crate::signals::residual::{Residuals, check_joints};

/// Compares every measured channel of `recording` with the model: `file` with its `effects`. Torques, tool and link encoders are compared as in [`compare`]. If `file`
/// has servos, measured positions are compared with positions simulated from the commands. A recording of positions and commands alone is compared as in
/// [`compare_commands`]. Each group of residuals has its own times. The channels of all groups, one after the other, are those of the numbers.
///
/// # Errors
/// See [`ResidualError`].
pub fn compare_all(
    file: &ArmFile,
    effects: &[Placed],
    recording: &Recording,
    settings: &Settings,
) -> Result<(Comparison, Vec<Residuals>), ResidualError> {
    if commands_alone(recording) {
        let (comparison, residuals) = compare_commands(file, recording)?;
        return Ok((comparison, vec![residuals]));
    }
    let (mut comparison, residuals) = compare(&file.arm, effects, recording, settings)?;
    let mut all = vec![residuals];
    if recording.q_ref.is_some() && ServoArm::of(file)?.is_some() {
        let (positions, residuals) = compare_commands(file, recording)?;
        comparison.channels.extend(positions.channels);
        all.push(residuals);
    }
    Ok((comparison, all))
}

/// Compares the measured positions of `recording` with positions that the servos of `file` simulate from the commands, from the first sample to the last. If
/// `file` has no servos, the model is the commands, shifted by the delay that fits the measurement best. The comparison filters nothing.
///
/// # Errors
/// [`ResidualError::JointCount`], [`ResidualError::Stamps`] where no stretch without a gap is left, [`ResidualError::Effects`], [`ResidualError::NotFinite`].
pub fn compare_commands(
    file: &ArmFile,
    recording: &Recording,
) -> Result<(Comparison, Residuals), ResidualError> {
    check_joints(&file.arm, recording)?;
    let track = track(recording);
    let stretches = track.windows(longest_gap(&track), f64::INFINITY);
    let few = for_lags(&track);
    let lags: Vec<f64> = (0..file.arm.dof()).map(|joint| lag(std::slice::from_ref(&few), joint)).collect();
    let servos = ServoArm::of(file)?;
    let model = match &servos {
        Some(model) => simulated(model, &track),
        None => late(&track, &lags),
    };
    let rows: Vec<usize> = stretches.iter().cloned().flatten().collect();
    if rows.is_empty() {
        return Err(ResidualError::Stamps {
            origin: recording.origin.clone(),
            samples: recording.len(),
            duration_s: recording.duration(),
        });
    }
    let picked = |column: &[f64]| rows.iter().map(|row| column[*row]).collect::<Vec<f64>>();
    let channel = |joint: usize| {
        let measured = picked(&recording.q[joint]);
        let present: Vec<bool> = measured.iter().map(|q| q.is_finite()).collect();
        let is_whole = present.iter().all(|there| *there);
        Channel {
            name: Group::Position.column(joint),
            kind: Kind::Position(joint),
            unit: unit(file.arm.joints()[joint].kind),
            measured: measured.into_iter().map(|q| if q.is_finite() { q } else { 0.0 }).collect(),
            model: picked(&model[joint]),
            present: (!is_whole).then_some(present),
            friction: None,
        }
    };
    let mut channels: Vec<Channel> = (0..file.arm.dof()).map(channel).collect();
    if let Some(odd) = channels.iter().find(|channel| channel.model.iter().any(|q| !q.is_finite())) {
        return Err(ResidualError::NotFinite { origin: recording.origin.clone(), channel: odd.name.clone() });
    }
    channels.retain(|channel| !channel.is_missing());
    let errors = channels.iter().map(|channel| {
        let mut tally = ChannelTally::like(channel);
        tally.add(channel, None);
        let mut error = tally.error(&file.arm);
        if let Kind::Position(joint) = channel.kind {
            error.lag_s = Some(lags[joint]);
        }
        error
    });
    let comparison = Comparison {
        schema: SCHEMA,
        samples: rows.len(),
        rows: recording.len(),
        duration_s: recording.duration(),
        rate_hz: recording.rate_hz(),
        lowpass_hz: f64::INFINITY,
        compared_hz: recording.rate_hz(),
        channels: errors.collect(),
        setup: examine(&file.arm, recording).findings,
        notes: remarks(file, recording, servos.is_some()),
    };
    let mut begin = 0;
    let stretches = stretches.iter().map(|stretch| {
        begin += stretch.len();
        begin - stretch.len()..begin
    });
    let residuals = Residuals { t: picked(&recording.t), stretches: stretches.collect(), channels };
    Ok((comparison, residuals))
}

/// Unit of the positions of a joint.
pub fn unit(kind: JointKind) -> &'static str {
    match kind {
        JointKind::Revolute => "rad",
        JointKind::Prismatic => "m",
    }
}

/// Position of `model` along `track`, `[joint][row]`; each stretch without gaps starts from the measured position, and rows outside all stretches keep it.
pub fn simulated(model: &ServoArm, track: &Track) -> Vec<Vec<f64>> {
    let mut rollout = Rollout::new(model, rollout_step(track));
    let mut columns = track.measured.clone();
    let joints = columns.len();
    for rows in track.windows(longest_gap(track), f64::INFINITY) {
        let out = track.simulated(model, &mut rollout, &rows);
        for (joint, column) in columns.iter_mut().enumerate() {
            column[rows.clone()]
                .iter_mut()
                .zip(out[joint..].iter().step_by(joints))
                .for_each(|(q, s)| *q = *s);
        }
    }
    columns
}

/// The commands of `track`, delayed by `lags`, `[joint][row]`.
pub fn late(track: &Track, lags: &[f64]) -> Vec<Vec<f64>> {
    let column = |(commands, lag): (&freeplay_servo::Commands, &f64)| {
        track.stamps.iter().map(|t| commands.between(t - lag)).collect()
    };
    track.commands.iter().zip(lags).map(column).collect()
}

fn remarks(file: &ArmFile, recording: &Recording, has_servos: bool) -> Vec<String> {
    let mut notes = recording.notes.clone();
    notes.extend(notes::beyond_limits(&file.arm, recording));
    if !has_servos {
        notes.push(
            "the model does not have a servo at each joint: its position is the commanded one, with the delay that fits the measured one best; \
             diagnose finds the servos"
                .to_owned(),
        );
        return notes;
    }
    let unused = ServoArm::unused(file);
    if !unused.is_empty() {
        notes.push(format!("effects that are not simulated from commanded positions: {}", unused.join(", ")));
    }
    notes
}
