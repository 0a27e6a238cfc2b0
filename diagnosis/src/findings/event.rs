//! Events: effects that begin or end at a time, as a diagnosis represents them.

use std::collections::BTreeMap;

use freeplay_arm::Arm;
use freeplay_model::EffectTable;

use crate::candidates::candidate::Candidate;
use crate::data::columns::{Column, sum_of};
use crate::evidence::gain::Gain;
use crate::report::diagnosis::{Alternative, Effect, Evidence, Parameter};
use crate::report::words;

/// An effect that begins or ends at a time, with its evidence from whitened rows.
#[derive(Clone, Debug)]
pub(crate) struct Event {
    /// The effect.
    pub candidate: Candidate,
    /// The coefficients of the effect.
    pub beta: Vec<f64>,
    /// The log odds for the event.
    pub log_odds: f64,
    /// The part of the log odds that does not come from the rows: the prior odds, and the volume.
    pub log_prior: f64,
    /// The parameters of the effect.
    pub parameters: BTreeMap<String, Parameter>,
    /// The reduction of the weighted squares by the event, and the channels with a reduction, largest first.
    pub removed: (f64, Vec<String>),
    /// The reduction of the error in the event's own rows.
    pub gain: Gain,
    /// Other effects with the same start and end.
    pub alternatives: Vec<Alternative>,
}

impl Event {
    /// The columns of the event and their coefficients: the sum of their products is its contribution to every row.
    pub fn columns(&self) -> impl Iterator<Item = (&Column, f64)> {
        self.candidate.columns.iter().zip(self.beta.iter().copied())
    }

    /// The finding, and the table of an arm file for it; its share is still in squares.
    pub fn finding(&self, arm: &Arm) -> (EffectTable, Effect) {
        let Self { candidate, parameters, .. } = self;
        let table = candidate.table(arm, &self.beta);
        let phrase = words::phrase(candidate.kind, parameters);
        let (share, channels) = self.removed.clone();
        let effect = Effect {
            kind: candidate.kind.name,
            joint: table.joint.clone(),
            statement: words::statement(&phrase, table.joint.as_deref()),
            parameters: parameters.clone(),
            equation: candidate.kind.equation,
            source: candidate.kind.source,
            evidence: Evidence {
                log_odds: self.log_odds,
                odds: words::odds(self.log_odds),
                share,
                held_out_gain: self.gain,
                held_out: false,
                channels,
            },
            phrase,
        };
        (table, effect)
    }
}

/// The contribution of all `events` to every row, with the shape of `rows`.
pub(crate) fn contribution_of(events: &[Event], rows: &[Vec<f64>]) -> Vec<Vec<f64>> {
    sum_of(events.iter().flat_map(Event::columns), rows)
}
