//! Held joints: each stands although its command moves.
//!
//! No motion shows the cause that holds such a joint, and its torque says nothing about other laws. It gives a lower bound of dry friction: the Coulomb
//! friction of a joint at rest is any torque between −F and F, so that F is at least the greatest torque beyond that of the rigid arm.

use std::collections::BTreeMap;

use freeplay_laws::{Kind as EffectKind, LawError, Placed, holding};
use freeplay_model::EffectTable;
use toml::Value;

use crate::data::instruments::rigid_torque_error;
use crate::data::linearised::LinearisedRecording;
use crate::data::parts::Part;
use crate::data::rows::is_held;
use crate::data::stacked::Data;
use crate::evidence::gain::Compared;
use crate::report::diagnosis::{Effect, Evidence, Parameter};
use crate::report::words;
use crate::signals::channel::Kind;
use crate::statistics::Moments;

/// The dry friction of each joint that is held in all recordings, beside the effects `found`: the effect and its table. The shares of these effects are squares
/// divided by those of the noise.
///
/// # Errors
/// See [`LawError`].
pub(crate) fn held_joints(
    data: &Data,
    found: &[Placed],
    seed: u64,
) -> Result<Vec<(EffectTable, Effect)>, LawError> {
    let joints = 0..data.arm().dof();
    let joints: Vec<usize> =
        joints.filter(|&joint| data.recordings.iter().all(|recording| is_held(recording, joint))).collect();
    if joints.is_empty() {
        return Ok(Vec::new());
    }
    let found: Vec<&Placed> = found.iter().collect();
    let mut residual = Vec::new();
    for recording in &data.recordings {
        residual.extend(recording.residual_with(&found)?);
    }
    let channel = |joint| data.recordings[0].number_of(Kind::Torque(joint));
    let of_joints = joints.into_iter().filter_map(|joint| Some((joint, channel(joint)?)));
    Ok(of_joints.filter_map(|at| of_joint(data, at, &residual, seed)).collect())
}

/// The dry friction of one such joint. Its torque is channel number `of_recording` of each recording, with the `residual`.
fn of_joint(
    data: &Data,
    (joint, of_recording): (usize, usize),
    residual: &[Vec<f64>],
    seed: u64,
) -> Option<(EffectTable, Effect)> {
    let (arm, channels) = (data.arm(), data.same_channel(of_recording));
    let nominal = arm.joints()[joint].friction.coulomb;
    let blank = || vec![Vec::new(); residual.len()];
    let (mut before, mut on_test, mut most, mut torque_errors) = (blank(), blank(), 0.0_f64, Vec::new());
    for &c in &channels {
        let (number, _) = data.place(c);
        let (recording, parts) = (&data.recordings[number], &data.parts[number]);
        before[c] = without_friction(recording, of_recording, &residual[c]);
        on_test[c] = parts.iter().map(|part| f64::from(u8::from(*part == Part::Test))).collect();
        let seen = before[c].iter().zip(parts).filter(|(_, part)| **part != Part::Test);
        most = seen.fold(most, |most, (beyond, _)| most.max(beyond.abs()));
        torque_errors.extend(rigid_torque_error(
            recording,
            joint,
            &recording.prepared.noises.channels[of_recording],
            seed,
        ));
    }
    // Of many rows, the one with the greatest torque also has the greatest reading error.
    let worst = torque_errors.iter().fold(0.0_f64, |worst, error| worst.max(error.abs()));
    let (least, noise) = (most - worst - nominal, Moments::of(&torque_errors).rms);
    if least <= worst {
        return None;
    }
    let holds = nominal + least;
    let held = |rows: &Vec<f64>| rows.iter().map(|beyond| beyond - beyond.clamp(-holds, holds)).collect();
    let after: Vec<Vec<f64>> = before.iter().map(held).collect();
    let compared = Compared { before: &before, after: &after, weights: &on_test };
    let (squares, names) = compared.removed(data, &channels);
    let log_odds = 0.5 * (least / noise).powi(2);
    let table = holding(&arm.joints()[joint].name, least);
    let kind = freeplay_laws::kind(&table.kind)?;
    let parameters = at_least(kind, &table, data, joint);
    let phrase = words::phrase(kind, &parameters);
    let effect = Effect {
        kind: kind.name,
        joint: table.joint.clone(),
        statement: format!(
            "{} The joint was commanded to move and stands still; a brake or an obstacle would hold it in the same way.",
            words::statement(&phrase, table.joint.as_deref())
        ),
        parameters,
        equation: kind.equation,
        source: kind.source,
        evidence: Evidence {
            log_odds,
            odds: words::odds(log_odds),
            share: squares / (noise * noise),
            held_out_gain: compared.gain(data, &channels, seed)?,
            held_out: true,
            channels: names,
        },
        phrase,
    };
    Some((table, effect))
}

/// The `residual` of torque channel number `channel` of `recording`, with the model's friction of the joint removed.
fn without_friction(recording: &LinearisedRecording, channel: usize, residual: &[f64]) -> Vec<f64> {
    match &recording.channels[channel].friction {
        Some(friction) => {
            residual.iter().zip(friction).map(|(residual, friction)| residual + friction).collect()
        }
        None => residual.to_vec(),
    }
}

/// The parameters of `table`, each as a lower bound.
fn at_least(
    kind: &'static EffectKind,
    table: &EffectTable,
    data: &Data,
    joint: usize,
) -> BTreeMap<String, Parameter> {
    let parameter = |(name, value): (&String, &Value)| {
        let unit = kind.unit(name, Some(&data.arm().joints()[joint])).to_owned();
        let ci95 = Some([value.as_float()?, f64::MAX]);
        Some((name.clone(), Parameter { value: value.clone(), unit, ci95 }))
    };
    table.parameters.iter().filter_map(parameter).collect()
}
