//! What has no name: shapes of the motion that explain what the findings leave, asked for last.

use super::parts::Part;
use super::shapes::{Knots, Shapes};
use super::system::{Fit, System};
use super::weights::USUAL_SHARE;
use crate::residual::Kind;

/// A share of discrepancy this many times the usual one has 20 : 1 against it: the two-sided quantile of a normal at 95 %.
const UNUSUAL: f64 = 1.96;

/// Whether more is missing than `fit` names: laws are off by a share of a torque that is unusual for this machine, or something is left of a pose in which no
/// finding shows.
///
/// What is usual is pooled: the prior counts as one channel beside the machine's others. Where parts come apart and meet again, the laws don't say what
/// that does to the torques.
pub(crate) fn is_unexplained(system: &System, fit: &Fit) -> bool {
    let data = system.data;
    let members = || fit.members.iter().map(|&member| system.candidate(member));
    let shows = |c: usize| members().any(|candidate| candidate.channels.contains(&c));
    let shakes = members().any(|candidate| candidate.kind.shakes);
    let heard: Vec<usize> =
        (0..data.channels()).filter(|&c| system.weights.rows[c].effective() > 0.0).collect();
    let is_torque = |c: &usize| matches!(data.kind(*c), Kind::Torque(_));
    let torques: Vec<usize> = heard.iter().copied().filter(is_torque).collect();
    let square = |c: usize| system.weights.rows[c].share.powi(2);
    let all: f64 = torques.iter().map(|&c| square(c)).sum();
    let is_unusual = |c: usize| {
        let usual = (all - square(c) + USUAL_SHARE.powi(2)) / torques.len() as f64;
        square(c) > UNUSUAL.powi(2) * usual
    };
    let is_left = |c: usize| system.weights.rows[c].share > UNUSUAL * USUAL_SHARE;
    let poses = heard.iter().filter(|c| !is_torque(c));
    !shakes && torques.iter().any(|&c| is_unusual(c)) || poses.into_iter().any(|&c| is_left(c) && !shows(c))
}

/// What shapes without a name, fitted to the fit and the choice part of `residual`, say of every row.
pub(crate) fn said(system: &System, residual: &[Vec<f64>]) -> Vec<Vec<f64>> {
    let data = system.data;
    let knots = data.stages.first().map(Knots::of).unwrap_or_default();
    let masks: Vec<Vec<f64>> =
        (0..data.channels()).map(|c| data.mask(c, &[Part::Fit, Part::Choice])).collect();
    let mut said: Vec<Vec<f64>> = residual.iter().map(|rows| vec![0.0; rows.len()]).collect();
    for c in 0..data.per_stage() {
        let same: Vec<usize> = (c..data.channels()).step_by(data.per_stage()).collect();
        for (channel, rows) in Shapes::said(data, &same, &masks, residual, &knots) {
            said[channel] = rows;
        }
    }
    said
}
