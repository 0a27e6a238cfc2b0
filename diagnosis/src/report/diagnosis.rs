//! What a diagnosis says: the verdict, and all that a report needs to show why.

use std::collections::BTreeMap;

use freeplay_arm::ArmFile;
use freeplay_laws::Trajectory;
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
    /// The recording agrees with the model inside its tolerances.
    NothingMissing,
    /// One or more effects of the catalogue are missing from the model, and no others say it as well.
    Named,
    /// Something is missing, and two or more effects say it equally well in this motion.
    OneOf,
    /// Something is missing that no effect of the catalogue says well enough.
    Unknown,
    /// The recording can't tell.
    InsufficientData,
    /// Recording and model don't mean the same: units, signs, order, zeros, gravity, clocks. What else is said is said of the mended reading.
    Setup,
}

/// A place where model and machine differ.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Location {
    /// The joint; `None`: the arm as a whole.
    pub joint: Option<String>,
    /// The channels, by the names of their columns.
    pub channels: Vec<String>,
    /// Share of all that the model leaves unexplained beyond the noise that is here: 0 to 1.
    pub share: f64,
    /// In which part of the motion, in words.
    #[serde(rename = "where")]
    pub when: String,
    /// Chance that a residual that knows nothing of the motion looks like this, corrected for the number of looks.
    pub p: f64,
}

/// A parameter with its 95 % interval.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Parameter {
    /// The value: a number, three numbers, or a word.
    pub value: toml::Value,
    /// Its unit; empty for words.
    pub unit: String,
    /// The interval; `None` for words and for what the motion does not tell. One without an upper end ends at [`f64::MAX`].
    #[serde(skip_serializing_if = "Option::is_none")]
    pub ci95: Option<[f64; 2]>,
}

impl Parameter {
    /// Whether the recording bounds the number from below alone: the value is that bound, and the interval has no upper end.
    pub fn is_least(&self) -> bool {
        self.ci95.is_some_and(|[_, high]| high == f64::MAX)
    }
}

/// Why an effect is believed.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Evidence {
    /// The log of the odds that it is there beside the other findings, by the fit part: natural logarithm, prior odds included.
    pub log_odds: f64,
    /// The same in words.
    pub odds: &'static str,
    /// Share of all that the findings take away from the error, in squares, that this one takes away.
    pub share: f64,
    /// Share of the error that is gone on the test part where it shows, beside the other findings.
    pub held_out_gain: Gain,
    /// Whether the test part could show it; else the gain is that on the fit part.
    pub held_out: bool,
    /// Channels in which it shows, the one that shows it best first.
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
    /// Why it is believed.
    pub evidence: Evidence,
    /// What the model leaves out, with its numbers, as part of a sentence.
    pub phrase: String,
    /// One plain sentence.
    pub statement: String,
}

impl Effect {
    /// Whether the recording bounds a number of the effect from below alone.
    pub fn is_bound(&self) -> bool {
        self.parameters.values().any(Parameter::is_least)
    }
}

/// Another effect that was weighed in the place of a named one.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Alternative {
    /// Its kind.
    pub kind: &'static str,
    /// The joint; `None`: the arm as a whole.
    pub joint: Option<String>,
    /// The effect in whose place it was weighed.
    pub instead_of: String,
    /// Why it is not named.
    pub why_not: String,
    /// Whether this recording can't tell it from the effect in whose place it was weighed.
    pub indistinguishable: bool,
    /// What would separate the two.
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
    /// What the instruments alone leave.
    pub noise_floor: BTreeMap<String, Rmse>,
    /// The model as given.
    pub before: BTreeMap<String, Rmse>,
    /// The model that is given out: with the named effects, its parameters tuned inside their tolerances.
    pub after: BTreeMap<String, Rmse>,
    /// The model with its parameters tuned inside their tolerances, nothing added.
    pub retuned: BTreeMap<String, Rmse>,
    /// The model as given with the named effects, nothing tuned.
    pub after_as_given: BTreeMap<String, Rmse>,
    /// Tuned, with an unnamed correction.
    pub black_box: BTreeMap<String, Rmse>,
    /// Whether these data took no part in the fit and in the choice.
    pub held_out: bool,
    /// Which data they are, in words.
    pub test: String,
    /// Share of the error that naming takes away on held-out data, over all channels in which something was found.
    pub gain: Option<Gain>,
    /// The same by the unnamed correction.
    pub black_box_gain: Option<Gain>,
    /// Unit of each channel.
    pub units: BTreeMap<String, &'static str>,
}

/// How far a tolerance of the model was used.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Tuned {
    /// What was tuned.
    pub name: String,
    /// By how much, in standard deviations of its prior; a tolerance is 1.7 of them.
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
    /// The log of the odds that it is missing, alone; natural logarithm, prior odds included.
    pub alone: f64,
    /// The same beside the effects that were named.
    pub beside: f64,
}

/// To what a channel follows the laws of its model, with the findings in it.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Discrepancy {
    /// The share of its own size by which the laws are off.
    pub share: f64,
    /// Noise of the instruments, in the unit of the channel.
    pub noise: f64,
}

/// What a diagnosis says.
#[derive(Clone, Debug, Serialize)]
pub struct Diagnosis {
    /// [`DIAGNOSIS_SCHEMA`].
    pub schema: &'static str,
    /// The verdict.
    pub verdict: Verdict,
    /// The verdict in plain words.
    pub statement: String,
    /// Whether recording and model mean the same: the faults of the set-up, those that are sure first.
    pub setup: Vec<SetupFinding>,
    /// Where model and machine differ, most important first.
    pub location: Vec<Location>,
    /// What is missing from the model.
    pub effects: Vec<Effect>,
    /// What else was weighed.
    pub alternatives: Vec<Alternative>,
    /// The errors on held-out data.
    pub fit: Option<Fit>,
    /// What to do next, one sentence each.
    pub next: Vec<String>,
    /// What these recordings can't show.
    pub untestable: Vec<Untestable>,
    /// What was met in the recordings, one sentence each.
    pub quality: Vec<String>,
    /// Every kind at every place, by what it explains.
    pub evidence: Vec<EvidenceRow>,
    /// How the residual of the tuned model depends on the motion, strongest first.
    pub maps: Vec<Map>,
    /// How far the tolerances of the model are used beside the named effects, farthest first.
    pub tuned: Vec<Tuned>,
    /// What is left in each channel that nothing explains: what another recording has to be weighed with.
    pub noise: BTreeMap<String, ChannelNoise>,
    /// To what each channel follows the laws of the model with the findings.
    pub discrepancy: BTreeMap<String, Discrepancy>,
    /// Seed of all random numbers.
    pub seed: u64,
    /// The recordings point by point, those of the fit first.
    #[serde(skip)]
    pub passages: Vec<Passage>,
    /// The mended reading, as a mapping file; `None` where the recordings are read as they stand.
    #[serde(skip)]
    pub mapping: Option<String>,
    /// The model with the named effects.
    #[serde(skip)]
    pub model: ArmFile,
}

impl Diagnosis {
    /// The effects in the order of the arm's joints, what sits on the whole arm last.
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
    /// What the residual is plotted over, for people: `velocity of elbow`.
    pub variable: String,
    /// Unit of the variable.
    pub variable_unit: &'static str,
    /// Unit of the residual.
    pub unit: &'static str,
    /// Middle of each bin.
    pub at: Vec<f64>,
    /// Mean of the residual in it.
    pub mean: Vec<f64>,
    /// Share of the residual's variance that the means explain.
    pub explained: f64,
    /// Chance that a residual that has nothing to do with the variable looks like this: circular shifts against it, all maps of all
    /// channels judged together (Holm 1979).
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

/// One recording of the fit, or of the held-out data, as it was worked on.
#[derive(Clone, Debug)]
pub struct Passage {
    /// The file that it comes from.
    pub recording: String,
    /// Whether it took no part in the fit.
    pub held_out: bool,
    /// The motion; its times are those of all columns here.
    pub motion: Trajectory,
    /// What residuals may depend on: the time, then the variables of each joint.
    pub variables: Vec<Variable>,
    /// The channels.
    pub traces: Vec<Trace>,
}

/// A channel over time, in its unit. NaN where its rows don't count: the torque of a joint that stands.
#[derive(Clone, Debug)]
pub struct Trace {
    /// The channel, by the name of its column.
    pub channel: String,
    /// Its unit.
    pub unit: &'static str,
    /// What was measured, treated.
    pub measured: Vec<f64>,
    /// Measured minus the model as given.
    pub before: Vec<f64>,
    /// Measured minus the model with its parameters tuned inside their tolerances.
    pub retuned: Vec<f64>,
    /// Measured minus the tuned model with the named effects.
    pub after: Vec<f64>,
    /// Measured minus the tuned model with an unnamed correction in the place of all effects.
    pub unnamed: Vec<f64>,
    /// What each named effect says here, in the order of the findings; empty where it says nothing.
    pub laws: Vec<Vec<f64>>,
}

/// What is left in a channel that no finding explains.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct ChannelNoise {
    /// Its standard deviation, in the unit of the channel.
    pub deviation: f64,
    /// How many samples a second are independent.
    pub per_second: f64,
}

/// The diagnosis of recordings that can't tell, because of `lack`: what is wrong; what to do.
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
        statement: format!("These recordings can't tell: {why}."),
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
