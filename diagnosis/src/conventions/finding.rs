//! Findings on the set-up.

use serde::Serialize;

use super::reading::Reading;

/// Certainty of a finding.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Certainty {
    /// The evidence is overwhelming, and the corrected reading removes most of the residual.
    Sure,
    /// No reading explains much of the recording: a question to the user.
    Likely,
}

/// One fault of the set-up: a convention on which recording and model disagree.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct SetupFinding {
    /// Its kind, such as `torque_unit`.
    pub kind: &'static str,
    /// The joint's name in the model; `None` for a fault of the whole recording.
    pub joint: Option<String>,
    /// Its value: ratio of recorded to intended values for units and signs, rad for zeros and for the angle of gravity, s for clocks.
    pub value: f64,
    /// The unit of `value`; `1` for a pure number.
    pub unit: &'static str,
    /// Certainty of the finding.
    pub certainty: Certainty,
    /// The fault, in one or two sentences.
    pub statement: String,
    /// The correction.
    pub remedy: String,
    /// Gravity in the base frame according to the recording, m/s².
    #[serde(skip_serializing_if = "Option::is_none")]
    pub gravity: Option<[f64; 3]>,
}

/// The result of the comparison of conventions between recording and model.
#[derive(Clone, Debug, PartialEq)]
pub struct Setup {
    /// The faults, in the order in which a person would correct them.
    pub findings: Vec<SetupFinding>,
    /// The reading of the recording with every certain fault corrected.
    pub reading: Reading,
    /// Reason why no reading reconciles recording and model, if a certain fault can't be corrected.
    pub stop: Option<String>,
}

impl Setup {
    /// Returns true if a fault is certain.
    pub fn is_sure(&self) -> bool {
        self.findings.iter().any(|finding| finding.certainty == Certainty::Sure)
    }

    /// The statements and remedies, each once, in the order of the findings.
    pub fn sentences(&self) -> Vec<(Certainty, &str, &str)> {
        sentences(&self.findings)
    }
}

/// The statements and remedies of `findings`, each once.
pub fn sentences(findings: &[SetupFinding]) -> Vec<(Certainty, &str, &str)> {
    let mut all: Vec<(Certainty, &str, &str)> = Vec::new();
    for finding in findings {
        let sentence = (finding.certainty, finding.statement.as_str(), finding.remedy.as_str());
        if !all.contains(&sentence) {
            all.push(sentence);
        }
    }
    all
}
