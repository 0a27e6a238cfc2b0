//! What happened at a time, as a diagnosis knows it.

use std::collections::BTreeMap;

use freeplay_arm::{Arm, EffectTable};

use crate::candidates::candidate::Candidate;
use crate::data::columns::{Column, sum_of};
use crate::evidence::gain::Gain;
use crate::report::diagnosis::{Alternative, Effect, Evidence, Parameter};
use crate::report::words;

/// Something that happened at a time: found and weighed among rows as they differ from their past.
#[derive(Clone, Debug)]
pub(crate) struct Event {
    /// What it is.
    pub candidate: Candidate,
    /// Its coefficients.
    pub beta: Vec<f64>,
    /// The log odds for it.
    pub log_odds: f64,
    /// The part of the log odds that the rows don't bring: the odds before the data, and the volume.
    pub log_prior: f64,
    /// Its parameters.
    pub parameters: BTreeMap<String, Parameter>,
    /// The weighed squares that it takes away, and the channels in which it does, most first.
    pub removed: (f64, Vec<String>),
    /// How much of the error of its own rows it takes away.
    pub gain: Gain,
    /// What else may have happened from the same beginning to the same end.
    pub alternatives: Vec<Alternative>,
}

impl Event {
    /// Its columns and their coefficients: the sum of their products is what it says of every row.
    pub fn columns(&self) -> impl Iterator<Item = (&Column, f64)> {
        self.candidate.columns.iter().zip(self.beta.iter().copied())
    }

    /// The finding, and the table of an arm file that says it; its share is still in squares.
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

/// What all `events` say of every row, as many as `rows` are.
pub(crate) fn said_by(events: &[Event], rows: &[Vec<f64>]) -> Vec<Vec<f64>> {
    sum_of(events.iter().flat_map(Event::columns), rows)
}
