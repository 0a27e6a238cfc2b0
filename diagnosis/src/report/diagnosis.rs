//! The result of a diagnosis: the verdict, and everything that a report needs to justify it.

use std::collections::BTreeMap;

use freeplay_laws::Trajectory;
use freeplay_model::ArmFile;
use serde::Serialize;

use crate::candidates::candidate::Untestable;
use crate::conventions::SetupFinding;
use crate::data::tolerance::Of;
use crate::evidence::gain::Gain;
use crate::report::settings::DiagnoseSettings;

/// The schema of [`Diagnosis`] as JSON.
pub const DIAGNOSIS_SCHEMA: &str = "freeplay.diagnosis/1";

/// The verdict of a diagnosis.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Verdict {
    /// The recording agrees with the model within its tolerances.
    NothingMissing,
    /// The model lacks one or more effects of the catalogue, and no others explain the data equally well.
    Named,
    /// The model lacks an effect, and two or more effects of the catalogue explain this motion equally well.
    OneOf,
    /// The model lacks something that no effect of the catalogue explains well enough.
    Unknown,
    /// The recording does not suffice to decide.
    InsufficientData,
    /// Recording and model disagree on a convention: units, signs, order, zeros, gravity or clocks. All other results hold for the corrected reading.
    Setup,
}

/// A location where model and machine differ.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Location {
    /// The joint; `None`: the arm as a whole.
    pub joint: Option<String>,
    /// The channels, by the names of their columns.
    pub channels: Vec<String>,
    /// Share of this location in the model error beyond the noise: 0 to 1.
    pub share: f64,
    /// The part of the motion, in words.
    #[serde(rename = "where")]
    pub when: String,
    /// Probability of such a residual if it were independent of the motion, corrected for the number of tests.
    pub p: f64,
}

/// A parameter with its 95 % interval.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Parameter {
    /// The value: a number, three numbers, or a word.
    pub value: toml::Value,
    /// Its unit; empty for words.
    pub unit: String,
    /// The interval; `None` for words and for parameters that the motion does not determine. An interval without an upper end ends at [`f64::MAX`].
    #[serde(skip_serializing_if = "Option::is_none")]
    pub ci95: Option<[f64; 2]>,
}

impl Parameter {
    /// Returns true if the recording only bounds the parameter from below: the value is that bound, and the interval has no upper end.
    pub fn is_least(&self) -> bool {
        self.ci95.is_some_and(|[_, high]| high == f64::MAX)
    }
}

/// The evidence for an effect.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Evidence {
    /// Log of the odds that the effect is present, given the other findings, by the fit part: natural logarithm, prior odds included.
    pub log_odds: f64,
    /// The odds in words.
    pub odds: &'static str,
    /// Share of this effect in the squared error that all findings together remove.
    pub share: f64,
    /// Share of the test part's error that the effect removes in the channels where it shows, given the other findings.
    pub held_out_gain: Gain,
    /// True if the test part can show the effect; otherwise the gain is that on the fit part.
    pub held_out: bool,
    /// Channels in which the effect shows, the clearest first.
    pub channels: Vec<String>,
}

/// An effect that is missing from the model.
#[derive(Clone, Debug, Serialize)]
pub struct Effect {
    /// Its kind, as in the catalogue.
    pub kind: &'static str,
    /// The joint; `None`: the arm as a whole.
    pub joint: Option<String>,
    /// Its parameters by name.
    pub parameters: BTreeMap<String, Parameter>,
    /// The law.
    pub equation: &'static str,
    /// Author, year.
    pub source: &'static str,
    /// Evidence for the effect.
    pub evidence: Evidence,
    /// The missing effect with its parameters, as part of a sentence.
    pub phrase: String,
    /// One plain sentence.
    pub statement: String,
}

impl Effect {
    /// Returns true if the recording only bounds a parameter of the effect from below.
    pub fn is_bound(&self) -> bool {
        self.parameters.values().any(Parameter::is_least)
    }
}

/// Another effect that the program compared with a named one.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Alternative {
    /// Its kind.
    pub kind: &'static str,
    /// The joint; `None`: the arm as a whole.
    pub joint: Option<String>,
    /// The named effect that it could replace.
    pub instead_of: String,
    /// Reason why it is not named.
    pub why_not: String,
    /// True if this recording does not distinguish it from the named effect.
    pub indistinguishable: bool,
    /// The measurement that would separate the two.
    pub what_would_separate: String,
    /// The log of the odds against it, natural logarithm.
    pub log_odds_against: f64,
}

/// Error of a channel.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Rmse {
    /// Root of the mean square, in the unit of the channel.
    pub rmse: f64,
}

/// The errors on held-out data, by channel.
#[derive(Clone, Debug, Serialize)]
pub struct Fit {
    /// Noise of the instruments alone.
    pub noise_floor: BTreeMap<String, Rmse>,
    /// The model as given.
    pub before: BTreeMap<String, Rmse>,
    /// The resulting model: with the named effects, its parameters tuned within their tolerances.
    pub after: BTreeMap<String, Rmse>,
    /// The model with its parameters tuned within their tolerances, no effect added.
    pub retuned: BTreeMap<String, Rmse>,
    /// The model as given plus the named effects, nothing tuned.
    pub after_as_given: BTreeMap<String, Rmse>,
    /// The tuned model with an unnamed correction.
    pub black_box: BTreeMap<String, Rmse>,
    /// True if neither the fit nor the choice used these data.
    pub held_out: bool,
    /// The data of these errors, in words.
    pub test: String,
    /// Share of the held-out error that the named effects remove, over all channels with a finding.
    pub gain: Option<Gain>,
    /// Share of the held-out error that the unnamed correction removes.
    pub black_box_gain: Option<Gain>,
    /// Unit of each channel.
    pub units: BTreeMap<String, &'static str>,
}

/// Use of one tolerance of the model.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Tuned {
    /// The tuned parameter.
    pub name: String,
    /// Change in standard deviations of the parameter's prior; a tolerance is 1.7 of them.
    pub deviations: f64,
    /// The quantity of the machine that was tuned.
    #[serde(skip)]
    pub(crate) of: Of,
}

/// A row of the evidence: the best form of a kind at a place.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct EvidenceRow {
    /// Its kind.
    pub kind: &'static str,
    /// The joint; `None`: the arm as a whole.
    pub joint: Option<String>,
    /// Log of the odds for the effect without any other effect; natural logarithm, prior odds included.
    pub alone: f64,
    /// Log of the odds for the effect given the named effects.
    pub beside: f64,
}

/// Relative accuracy of a channel's model, findings included.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Discrepancy {
    /// Error of the model as a share of its own size.
    pub share: f64,
    /// Noise of the instruments, in the unit of the channel.
    pub noise: f64,
}

/// The result of a diagnosis.
#[derive(Clone, Debug, Serialize)]
pub struct Diagnosis {
    /// [`DIAGNOSIS_SCHEMA`].
    pub schema: &'static str,
    /// The verdict.
    pub verdict: Verdict,
    /// The verdict in plain words.
    pub statement: String,
    /// The faults of the set-up, the certain ones first: units, signs and other conventions on which recording and model disagree.
    pub setup: Vec<SetupFinding>,
    /// Where model and machine differ, most important first.
    pub location: Vec<Location>,
    /// The effects that the model lacks.
    pub effects: Vec<Effect>,
    /// The other effects that were compared.
    pub alternatives: Vec<Alternative>,
    /// The errors on held-out data.
    pub fit: Option<Fit>,
    /// Recommended next steps, one sentence each.
    pub next: Vec<String>,
    /// Effects that these recordings can't show.
    pub untestable: Vec<Untestable>,
    /// Peculiarities of the recordings, one sentence each.
    pub quality: Vec<String>,
    /// Every kind of effect at every location, in the order of its evidence.
    pub evidence: Vec<EvidenceRow>,
    /// Dependences of the tuned model's residual on the motion, strongest first.
    pub maps: Vec<Map>,
    /// Use of the tolerances of the model, given the named effects; the largest first.
    pub tuned: Vec<Tuned>,
    /// The unexplained residual of each channel, used as the noise of another recording.
    pub noise: BTreeMap<String, ChannelNoise>,
    /// Relative accuracy of each channel's model, findings included.
    pub discrepancy: BTreeMap<String, Discrepancy>,
    /// Seed of all random numbers.
    pub seed: u64,
    /// The recordings point by point, those of the fit first.
    #[serde(skip)]
    pub passages: Vec<Passage>,
    /// The corrected reading, as a mapping file; `None` if the recordings need no correction.
    #[serde(skip)]
    pub mapping: Option<String>,
    /// The model with the named effects.
    #[serde(skip)]
    pub model: ArmFile,
}

impl Diagnosis {
    /// The effects in the order of the arm's joints; effects of the whole arm come last.
    pub fn along_the_arm(&self) -> Vec<&Effect> {
        let joints = self.model.arm.joints();
        let place =
            |effect: &&Effect| joints.iter().position(|joint| Some(&joint.name) == effect.joint.as_ref());
        let mut effects: Vec<&Effect> = self.effects.iter().collect();
        effects.sort_by_key(|effect| place(effect).unwrap_or(joints.len()));
        effects
    }
}

/// A conditional mean of a channel's residual: how it depends on one variable.
#[derive(Clone, Debug, Serialize)]
pub struct Map {
    /// The channel.
    pub channel: String,
    /// The variable on the horizontal axis, for people: `velocity of elbow`.
    pub variable: String,
    /// Unit of the variable.
    pub variable_unit: &'static str,
    /// Unit of the residual.
    pub unit: &'static str,
    /// Middle of each bin.
    pub at: Vec<f64>,
    /// Mean of the residual in each bin.
    pub mean: Vec<f64>,
    /// Share of the residual's variance that the means explain.
    pub explained: f64,
    /// Probability of such a map if the residual were independent of the variable: from circular shifts of the residual, corrected for all maps of all channels
    /// together (Holm 1979).
    pub p: f64,
}

/// A quantity of the motion that a residual may depend on.
#[derive(Clone, Debug, PartialEq)]
pub struct Variable {
    /// Its name, for people: `velocity of elbow`.
    pub name: String,
    /// Its unit.
    pub unit: &'static str,
    /// The quantity without the joint: `velocity`.
    pub quantity: &'static str,
    /// Index of the joint; `None` for the time.
    pub joint: Option<usize>,
    /// Its value at every point.
    pub values: Vec<f64>,
}

/// One recording of the fit or of the held-out data, after its preparation.
#[derive(Clone, Debug)]
pub struct Passage {
    /// The file of the recording.
    pub recording: String,
    /// True if the fit did not use it.
    pub held_out: bool,
    /// The motion; all columns here share its times.
    pub motion: Trajectory,
    /// Variables that residuals may depend on: the time, then those of each joint.
    pub variables: Vec<Variable>,
    /// The channels.
    pub traces: Vec<Trace>,
}

/// A channel over time, in its unit. NaN in rows without weight, such as the torque of a joint at rest.
#[derive(Clone, Debug)]
pub struct Trace {
    /// The channel, by the name of its column.
    pub channel: String,
    /// Its unit.
    pub unit: &'static str,
    /// The measured values, filtered.
    pub measured: Vec<f64>,
    /// Measured minus the model as given.
    pub before: Vec<f64>,
    /// Measured minus the model with its parameters tuned within their tolerances.
    pub retuned: Vec<f64>,
    /// Measured minus the tuned model with the named effects.
    pub after: Vec<f64>,
    /// Measured minus the tuned model with an unnamed correction instead of all effects.
    pub unnamed: Vec<f64>,
    /// Contribution of each named effect, in the order of the findings; empty if the effect does not act on the channel.
    pub laws: Vec<Vec<f64>>,
}

/// The residual of a channel that no finding explains.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct ChannelNoise {
    /// Its standard deviation, in the unit of the channel.
    pub deviation: f64,
    /// Number of independent samples per second.
    pub per_second: f64,
}

/// The diagnosis of recordings that do not suffice. `lack` holds the reason and the remedy.
pub(crate) fn insufficient(
    file: &ArmFile,
    settings: &DiagnoseSettings,
    quality: Vec<String>,
    lack: String,
) -> Diagnosis {
    let (why, advice) = lack.rsplit_once("; ").unwrap_or((&lack, "record another motion"));
    Diagnosis {
        schema: DIAGNOSIS_SCHEMA,
        verdict: Verdict::InsufficientData,
        statement: format!("These recordings do not suffice: {why}."),
        setup: Vec::new(),
        location: Vec::new(),
        effects: Vec::new(),
        alternatives: Vec::new(),
        fit: None,
        next: vec![advice.to_owned()],
        untestable: Vec::new(),
        quality,
        evidence: Vec::new(),
        maps: Vec::new(),
        tuned: Vec::new(),
        noise: BTreeMap::new(),
        discrepancy: BTreeMap::new(),
        seed: settings.seed,
        passages: Vec::new(),
        mapping: None,
        model: file.clone(),
    }
}
