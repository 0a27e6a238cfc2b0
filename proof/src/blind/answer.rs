//! The answer of an analyst for one case.

use std::collections::BTreeMap;

use freeplay_diagnosis::{Diagnosis, NAMED_FROM, Rmse};
use serde::{Deserialize, Serialize};
use serde_json::Value;

use super::sandbox::Isolation;

/// The answer for one case.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Answer {
    /// As in `diagnosis.json`; `failed` if the analyst gave no answer.
    pub verdict: String,
    /// The verdict in plain words; for a failure its reason.
    pub statement: String,
    /// The effects that are named.
    pub effects: Vec<Named>,
    /// The alternatives that the diagnosis considered.
    pub rivals: Vec<Rival>,
    /// Places where model and machine differ: joint, channels, share.
    pub location: Vec<Place>,
    /// Every kind at every place: its score for the recordings alone and beside the named effects, and the threshold.
    pub hypotheses: Vec<Hypothesis>,
    /// Errors on held-out data by channel.
    pub fit: BTreeMap<String, Errors>,
    /// Processor time of the analyst, s.
    pub cpu_seconds: f64,
    /// Isolation of the analyst from the truth.
    pub isolation: Isolation,
}

/// A named effect.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Named {
    /// Its kind.
    pub kind: String,
    /// Its joint; `None`: the arm as a whole.
    pub joint: Option<String>,
    /// Its parameters.
    pub parameters: BTreeMap<String, Estimate>,
    /// Twice the log of the likelihood ratio.
    pub score: f64,
    /// The score required for a name.
    pub threshold: f64,
    /// Reduction of the held-out error, as a share, and its 95 % interval.
    pub gain: [f64; 3],
    /// Channels that show it.
    pub channels: Vec<String>,
}

/// A parameter as estimated.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Estimate {
    /// A number, three numbers, or a word.
    pub value: Value,
    /// Its 95 % interval.
    pub ci95: Option<[f64; 2]>,
}

/// An alternative to a named effect.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Rival {
    /// Its kind.
    pub kind: String,
    /// Its joint; `None`: the arm as a whole.
    pub joint: Option<String>,
    /// True if the recordings cannot distinguish it from the named effect.
    pub indistinguishable: bool,
    /// Log of the odds of the named effect against it.
    pub log_odds_against: f64,
}

/// A place where model and machine differ.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Place {
    /// The joint; `None`: the arm as a whole.
    pub joint: Option<String>,
    /// The channels.
    pub channels: Vec<String>,
    /// Share of the unexplained residual.
    pub share: f64,
}

/// A kind at a place.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Hypothesis {
    /// Its kind.
    pub kind: String,
    /// Its joint; `None`: the arm as a whole.
    pub joint: Option<String>,
    /// Twice the log of the likelihood ratio against the tuned model, alone.
    pub alone: f64,
    /// The same in addition to the named effects.
    pub beside: f64,
    /// The score required for a name.
    pub threshold: f64,
}

/// Errors of one channel on held-out data, root mean square.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Errors {
    /// The error of a perfect model.
    pub floor: f64,
    /// The model as given.
    pub before: f64,
    /// With the named effects, as the model is written.
    pub after: f64,
    /// With the named effects, tuned inside the tolerances.
    pub after_tuned: f64,
    /// No effect added, tuned inside the tolerances.
    pub tuned: f64,
    /// Tuned, with an unnamed correction.
    pub black_box: f64,
}

impl Answer {
    /// A missing answer, with the reason `why`.
    pub fn failed(why: String) -> Self {
        Self { verdict: "failed".to_owned(), statement: why, ..Self::default() }
    }

    /// The answer of `diagnosis`.
    pub fn of(diagnosis: &Diagnosis) -> Self {
        let verdict = serde_json::to_value(diagnosis.verdict).unwrap_or_default();
        let effects = diagnosis.effects.iter().map(|effect| Named {
            kind: effect.kind.to_owned(),
            joint: effect.joint.clone(),
            parameters: effect
                .parameters
                .iter()
                .map(|(name, p)| {
                    let value = serde_json::to_value(&p.value).unwrap_or_default();
                    (name.clone(), Estimate { value, ci95: p.ci95 })
                })
                .collect(),
            score: short(effect.evidence.log_odds),
            threshold: short(NAMED_FROM),
            gain: {
                let gain = effect.evidence.held_out_gain;
                [gain.value, gain.ci95[0], gain.ci95[1]].map(short)
            },
            channels: effect.evidence.channels.clone(),
        });
        let rivals = diagnosis.alternatives.iter().map(|other| Rival {
            kind: other.kind.to_owned(),
            joint: other.joint.clone(),
            indistinguishable: other.indistinguishable,
            log_odds_against: short(other.log_odds_against),
        });
        let location = diagnosis.location.iter().map(|place| Place {
            joint: place.joint.clone(),
            channels: place.channels.clone(),
            share: short(place.share),
        });
        let hypotheses = diagnosis.evidence.iter().map(|row| Hypothesis {
            kind: row.kind.to_owned(),
            joint: row.joint.clone(),
            alone: short(row.alone),
            beside: short(row.beside),
            threshold: short(NAMED_FROM),
        });
        Self {
            verdict: verdict.as_str().unwrap_or_default().to_owned(),
            statement: diagnosis.statement.clone(),
            effects: effects.collect(),
            rivals: rivals.collect(),
            location: location.collect(),
            hypotheses: hypotheses.collect(),
            fit: errors(diagnosis),
            ..Self::default()
        }
    }

    /// True if the answer is that nothing is missing, or that the data are insufficient.
    pub fn is_silent(&self) -> bool {
        matches!(self.verdict.as_str(), "nothing_missing" | "insufficient_data")
    }

    /// Posterior probability of the single named effect: one over the sum of the odds of all alternatives, itself included. `None` for any other number of
    /// named effects.
    pub fn confidence(&self) -> Option<f64> {
        let odds: f64 = self.rivals.iter().map(|rival| (-rival.log_odds_against).exp()).sum();
        (self.verdict == "named" && self.effects.len() == 1).then(|| 1.0 / (1.0 + odds))
    }
}

fn errors(diagnosis: &Diagnosis) -> BTreeMap<String, Errors> {
    let Some(fit) = &diagnosis.fit else { return BTreeMap::new() };
    let of = |table: &BTreeMap<String, Rmse>, channel| {
        table.get(channel).map_or(f64::NAN, |error| short(error.rmse))
    };
    let channels = fit.before.keys().map(|channel| {
        let errors = Errors {
            floor: of(&fit.noise_floor, channel),
            before: of(&fit.before, channel),
            after: of(&fit.after_as_given, channel),
            after_tuned: of(&fit.after, channel),
            tuned: of(&fit.retuned, channel),
            black_box: of(&fit.black_box, channel),
        };
        (channel.clone(), errors)
    });
    channels.filter(|(_, errors)| errors.is_finite()).collect()
}

impl Errors {
    /// JSON has no other numbers.
    fn is_finite(&self) -> bool {
        [self.floor, self.before, self.after, self.after_tuned, self.tuned, self.black_box]
            .iter()
            .all(|error| error.is_finite())
    }
}

/// `x` with five significant digits, which keeps receipts short; 0 for NaN or infinity.
fn short(x: f64) -> f64 {
    if x.is_finite() { format!("{x:.4e}").parse().unwrap_or(0.0) } else { 0.0 }
}
