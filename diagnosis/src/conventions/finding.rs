//! What is found of the set-up.

use serde::Serialize;

use super::reading::Reading;

/// How sure a finding is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Certainty {
    /// The evidence is overwhelming, and the mended reading takes most of the residual away.
    Sure,
    /// Much of what was recorded stays unexplained by any reading: a question to the person.
    Likely,
}

/// One fault of the set-up: recording and model don't mean the same.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct SetupFinding {
    /// Its kind, such as `torque_unit`.
    pub kind: &'static str,
    /// The joint's name in the model; `None` where the whole recording is meant.
    pub joint: Option<String>,
    /// Its number: recorded over meant for units and signs, rad for zeros and for the angle of gravity, s for clocks.
    pub value: f64,
    /// The unit of `value`; `1` for a pure number.
    pub unit: &'static str,
    /// How sure it is.
    pub certainty: Certainty,
    /// What is wrong, in one or two sentences.
    pub statement: String,
    /// How to mend it.
    pub remedy: String,
    /// Gravity in the base frame that the recording shows, m/s².
    #[serde(skip_serializing_if = "Option::is_none")]
    pub gravity: Option<[f64; 3]>,
}

/// What comes of the question whether recording and model mean the same.
#[derive(Clone, Debug, PartialEq)]
pub struct Setup {
    /// The faults, in the order in which a person would mend them.
    pub findings: Vec<SetupFinding>,
    /// The recording as it is to be read: with every sure fault mended.
    pub reading: Reading,
    /// Why no reading makes recording and model meet, where a sure fault can't be mended.
    pub stop: Option<String>,
}

impl Setup {
    /// Whether something is surely wrong.
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
