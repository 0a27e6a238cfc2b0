//! What has no name: shapes of the motion that explain what the findings leave, asked for last.

use super::data::Data;
use super::parts::Part;
use super::search::AS_GOOD;
use super::shapes::{Knots, Shapes};
use super::system::{Fit, System};
use super::weights::USUAL_SHARE;
use crate::residual::Kind;

/// A share of discrepancy this many times the usual one has 20 : 1 against it: the two-sided quantile of a normal at 95 %.
const UNUSUAL: f64 = 1.96;

/// By how much shapes without a name make rows more probable to which neither they nor the findings were fitted, by channel of a recording: log of the
/// odds.
pub(crate) struct Nameless {
    gains: Vec<f64>,
}

impl Nameless {
    /// Asks what `fit` leaves.
    pub fn of(system: &System, fit: &Fit) -> Self {
        let left = system.left(fit);
        let choice = system.weights.on(system.data, &[Part::Choice]);
        let said = said_by(system, &left, &[Part::Fit]);
        let per_stage = system.data.per_stage();
        let mut gains = vec![0.0; per_stage];
        for c in 0..system.data.channels() {
            let rest: Vec<f64> = left[c].iter().zip(&said[c]).map(|(x, said)| x - said).collect();
            gains[c % per_stage] += choice.rows[c].score(&rest) - choice.rows[c].score(&left[c]);
        }
        Self { gains }
    }
}

/// Whether more is missing than `fit` names: a torque is off by a share of itself that laws are seldom off by, and either no finding shows there or shapes
/// without a name say what is left of it.
pub(crate) fn is_unexplained(system: &System, fit: &Fit, nameless: &Nameless) -> bool {
    let data = system.data;
    let is_off = |c: usize| {
        let share = system.weights.rows[c].share;
        matches!(data.kind(c), Kind::Torque(_)) && share > UNUSUAL * USUAL_SHARE
    };
    let shows = |c: usize| fit.members.iter().any(|&member| system.candidate(member).channels.contains(&c));
    (0..data.channels()).any(|c| {
        system.weights.rows[c].effective() > 0.0
            && is_off(c)
            && (!shows(c) || nameless.gains[c % data.per_stage()] > AS_GOOD)
    })
}

/// What shapes without a name, fitted to the fit and the choice part of `residual`, say of every row.
pub(crate) fn said(system: &System, residual: &[Vec<f64>]) -> Vec<Vec<f64>> {
    said_by(system, residual, &[Part::Fit, Part::Choice])
}

fn said_by(system: &System, residual: &[Vec<f64>], parts: &[Part]) -> Vec<Vec<f64>> {
    let data: &Data = system.data;
    let knots = data.stages.first().map(Knots::of).unwrap_or_default();
    let masks: Vec<Vec<f64>> = (0..data.channels()).map(|c| data.mask(c, parts)).collect();
    let mut said: Vec<Vec<f64>> = residual.iter().map(|rows| vec![0.0; rows.len()]).collect();
    for c in 0..data.per_stage() {
        let same: Vec<usize> = (c..data.channels()).step_by(data.per_stage()).collect();
        for (channel, rows) in Shapes::said(data, &same, &masks, residual, &knots) {
            said[channel] = rows;
        }
    }
    said
}
