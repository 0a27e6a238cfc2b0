//! Nameless effects: shapes of the motion that explain the residual of the findings, tested last.

use crate::data::columns::sum_of;
use crate::data::parts::Part;
use crate::data::shapes::{CommonShapes, Knots, Shapes};
use crate::data::stacked::Data;
use crate::data::weights::{LEAST_SHARE, USUAL_SHARE, Weights};
use crate::evidence::gain::Compared;
use crate::evidence::system::{Fit, System};
use crate::signals::channel::Kind;
use crate::statistics::{Moments, half_width, is_strong_evidence};

/// Returns true if `fit` leaves unnamed effects in the rows with `weights`: the laws have a relative error that is unusual for this machine, or a pose without
/// a finding has a residual.
///
/// The findings have the usual relative error, too. Where parts separate and meet again, the laws don't describe the torques of the impact.
pub(crate) fn is_unexplained(system: &System, fit: &Fit, weights: &Weights) -> bool {
    let data = system.data;
    let residual = system.residual(fit);
    let members = || fit.members.iter().map(|&member| system.candidate(member));
    let shows = |c: usize| members().any(|candidate| candidate.channels.contains(&c));
    let shakes = members().any(|candidate| candidate.kind.shakes);
    let is_torque = |c: usize| matches!(data.kind(c), Kind::Torque(_));
    let unusual = half_width();
    let signal = sum_of(system.columns(&fit.members).zip(fit.beta.iter().copied()), &residual);
    let said = |c: usize| Moments::of(&signal[c]).rms / system.weights.rows[c].scale.max(f64::MIN_POSITIVE);
    let active = (0..data.channels()).filter(|&c| weights.rows[c].effective() > 0.0);
    let off = active.map(|c| (c, weights.rows[c].best(&residual[c], 0.0).0.max(LEAST_SHARE)));
    let (torques, poses): (Vec<_>, Vec<_>) = off.partition(|(c, _)| is_torque(*c));
    let all: f64 = torques.iter().map(|(_, share)| share.ln()).sum();
    let is_unusual = |&(c, share): &(usize, f64)| {
        let usual = ((all - share.ln() + USUAL_SHARE.ln()) / torques.len() as f64).exp();
        is_strong_evidence(weights.rows[c].beyond(&residual[c], unusual * usual.hypot(USUAL_SHARE * said(c))))
    };
    let is_left = |&(c, _): &(usize, f64)| {
        is_strong_evidence(weights.rows[c].beyond(&residual[c], unusual * USUAL_SHARE))
    };
    !shakes && torques.iter().any(is_unusual) || poses.iter().any(|pose| is_left(pose) && !shows(pose.0))
}

/// Upper bound of the gain in log evidence by laws with one channel each, for the `residual`: half of the weighted squares that nameless shapes, without a
/// price here, remove in each channel.
pub(crate) fn most_in_single_channels(system: &System, residual: &[Vec<f64>]) -> f64 {
    let data = system.data;
    let knots = data.recordings.first().map(Knots::of).unwrap_or_default();
    let beside = |(c, residual): (usize, &Vec<f64>)| {
        Shapes::new(data, c, &data.active_mask(c), &knots).residual(residual)
    };
    let after: Vec<Vec<f64>> = residual.iter().enumerate().map(beside).collect();
    let compared = Compared { before: residual, after: &after, weights: &system.weights.by_row() };
    let channels: Vec<usize> = (0..data.channels()).collect();
    0.5 * compared.removed(data, &channels).0
}

/// A range of positions of a joint.
#[derive(Clone, Copy, Debug)]
pub(crate) struct JointRange {
    /// Index of the joint.
    pub joint: usize,
    /// Least and greatest position, rad or m.
    pub range: [f64; 2],
}

impl JointRange {
    /// True if both ranges belong to the same joint and overlap.
    pub fn meets(&self, other: &Self) -> bool {
        self.joint == other.joint && self.range[0] <= other.range[1] && other.range[0] <= self.range[1]
    }
}

/// Nameless shapes in all torques, on the rows of the search.
pub(crate) struct NamelessTorques(Vec<CommonShapes>);

impl NamelessTorques {
    /// The shapes of `data`. Each of `places` that is not `None` has shapes of its own.
    pub fn new(data: &Data, places: &[Option<JointRange>]) -> Self {
        let mut knots = data.recordings.first().map(Knots::of).unwrap_or_default();
        for (number, place) in places.iter().enumerate() {
            place.iter().for_each(|place| knots[place.joint].add_place(number, place.range));
        }
        let masks: Vec<Vec<f64>> = (0..data.channels()).map(|c| data.mask(c, &data.active_parts)).collect();
        let torques = (0..data.channels_per_recording()).filter(|&c| matches!(data.kind(c), Kind::Torque(_)));
        Self(torques.map(|c| CommonShapes::new(data, data.same_channel(c), &masks, &knots)).collect())
    }

    /// Log of the probability of the torques `residual` under these shapes, including those of `places`.
    pub fn evidence(&self, residual: &[Vec<f64>], places: &[usize]) -> f64 {
        self.0.iter().map(|shapes| shapes.evidence(residual, places)).sum()
    }
}

/// Prediction of nameless shapes, fitted to the fit and the choice part of `residual`, for every row.
pub(crate) fn nameless_prediction(system: &System, residual: &[Vec<f64>]) -> Vec<Vec<f64>> {
    let data = system.data;
    let knots = data.recordings.first().map(Knots::of).unwrap_or_default();
    let masks: Vec<Vec<f64>> =
        (0..data.channels()).map(|c| data.mask(c, &[Part::Fit, Part::Choice])).collect();
    let mut said: Vec<Vec<f64>> = residual.iter().map(|rows| vec![0.0; rows.len()]).collect();
    for c in 0..data.channels_per_recording() {
        let shapes = CommonShapes::new(data, data.same_channel(c), &masks, &knots);
        for (channel, rows) in shapes.prediction(data, residual, &knots) {
            said[channel] = rows;
        }
    }
    said
}
