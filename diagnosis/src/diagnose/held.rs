//! Joints that something holds: each was told to move and stands.
//!
//! No motion tells what holds such a joint, and its torque tells nothing of any other law. It tells how much dry friction there is at least: Coulomb's
//! friction of a joint that stands is any torque between −F and F, so that F is no less than the greatest torque beyond what the rigid arm takes.

use std::collections::BTreeMap;

use freeplay_arm::EffectTable;
use freeplay_laws::{Kind as EffectKind, LawError, Placed, Range, holding};
use toml::Value;

use super::data::Data;
use super::gain::Compared;
use super::parts::Part;
use super::report::{Effect, Evidence, Parameter};
use super::rows::rests;
use super::stage::Stage;
use super::words;
use crate::residual::Kind;
use crate::rest::STILL;
use crate::statistics::UNMOVED;

/// Whether `joint` of `stage` stands throughout although it was told to move.
pub(crate) fn is_held(stage: &Stage, joint: usize) -> bool {
    let told = stage.ground.recording.q_ref.as_ref().and_then(|columns| columns.get(joint));
    let moves = |told: &Vec<f64>| {
        let told = told.iter().filter(|q| q.is_finite());
        let (least, most) = told.fold((f64::MAX, f64::MIN), |(a, b), q| (a.min(*q), b.max(*q)));
        most - least > STILL
    };
    rests(stage, joint) && told.is_some_and(moves)
}

/// What holds each joint that is held in all recordings beside the effects `found`: the effects that say so, with their shares in squares of the noise.
///
/// # Errors
/// See [`LawError`].
pub(crate) fn held(data: &Data, found: &[Placed], seed: u64) -> Result<Vec<(EffectTable, Effect)>, LawError> {
    let joints = 0..data.arm().dof();
    let joints: Vec<usize> =
        joints.filter(|&joint| data.stages.iter().all(|stage| is_held(stage, joint))).collect();
    if joints.is_empty() {
        return Ok(Vec::new());
    }
    let found: Vec<&Placed> = found.iter().collect();
    let mut left = Vec::new();
    for stage in &data.stages {
        left.extend(stage.left_with(&found)?);
    }
    let channel =
        |joint| data.stages[0].channels.iter().position(|channel| channel.kind == Kind::Torque(joint));
    let of_joints = joints.into_iter().filter_map(|joint| Some((joint, channel(joint)?)));
    Ok(of_joints.filter_map(|at| of_joint(data, at, &left, seed)).collect())
}

/// The same of a joint, whose torque is the channel number `of_stage` of each recording, where so much is `left` of every row.
fn of_joint(
    data: &Data,
    (joint, of_stage): (usize, usize),
    left: &[Vec<f64>],
    seed: u64,
) -> Option<(EffectTable, Effect)> {
    let noises = data.stages.iter().map(|stage| stage.ground.noises.channels[of_stage].deviation);
    let noise = noises.fold(0.0, f64::max);
    let (arm, channels) = (data.arm(), data.alike(of_stage));
    let nominal = arm.joints()[joint].friction.coulomb;
    let beyond = |c: usize| -> Vec<f64> {
        let friction = data.stages[c / data.per_stage()].channels[of_stage].friction.as_ref();
        let friction = |row: usize| friction.map_or(0.0, |friction| friction[row]);
        left[c].iter().enumerate().map(|(row, left)| left + friction(row)).collect()
    };
    let (mut before, mut after) = (vec![Vec::new(); left.len()], vec![Vec::new(); left.len()]);
    let mut weights = before.clone();
    let mut most = 0.0_f64;
    for &c in &channels {
        before[c] = beyond(c);
        let parts = &data.parts[c / data.per_stage()];
        let seen = before[c].iter().zip(parts).filter(|(_, part)| **part != Part::Test);
        most = seen.fold(most, |most, (beyond, _)| most.max(beyond.abs()));
        weights[c] =
            parts.iter().map(|part| if *part == Part::Test { noise.powi(-2) } else { 0.0 }).collect();
    }
    // The greatest of many rows is that of the greatest noise, too.
    let least = most - UNMOVED * noise - nominal;
    if least <= UNMOVED * noise {
        return None;
    }
    for &c in &channels {
        let holds = nominal + least;
        after[c] = before[c].iter().map(|beyond| beyond - beyond.clamp(-holds, holds)).collect();
    }
    let compared = Compared { before: &before, after: &after, weights: &weights };
    let gain = compared.gain(data, &channels, seed)?;
    let squares = |rows: &[Vec<f64>]| -> f64 {
        let of = |&c: &usize| rows[c].iter().zip(&weights[c]).map(|(x, w)| w * x * x).sum::<f64>();
        channels.iter().map(of).sum()
    };
    let log_odds = 0.5 * ((nominal + least) / noise).powi(2);
    let table = holding(&arm.joints()[joint].name, least);
    let kind = freeplay_laws::kind(&table.kind)?;
    let parameters = at_least(kind, &table, data, joint);
    let phrase = words::phrase(kind, &parameters);
    let statement = format!(
        "{} The joint was told to move and stands; a brake or something in its way holds it as well.",
        words::statement(&phrase, table.joint.as_deref())
    );
    let effect = Effect {
        kind: kind.name,
        joint: table.joint.clone(),
        statement,
        parameters,
        equation: kind.equation,
        source: kind.source,
        evidence: Evidence {
            log_odds,
            odds: words::odds(log_odds),
            share: squares(&before) - squares(&after),
            held_out_gain: gain,
            held_out: true,
            channels: vec![data.stages[0].channels[of_stage].name.clone()],
        },
        phrase,
    };
    Some((table, effect))
}

/// The numbers of `table`, each the least that it can be.
fn at_least(
    kind: &'static EffectKind,
    table: &EffectTable,
    data: &Data,
    joint: usize,
) -> BTreeMap<String, Parameter> {
    let parameter = |(name, value): (&String, &Value)| {
        let most = match kind.parameter(name)?.range {
            Range::Number { most, .. } => most,
            _ => return None,
        };
        let unit = kind.unit(name, Some(&data.arm().joints()[joint])).to_owned();
        Some((name.clone(), Parameter { value: value.clone(), unit, ci95: Some([value.as_float()?, most]) }))
    };
    table.parameters.iter().filter_map(parameter).collect()
}
