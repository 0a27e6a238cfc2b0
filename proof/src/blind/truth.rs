//! The concealed truth of a case, as in a truth file.

use serde::Deserialize;
use serde_json::Value;

use super::answer::{Answer, Hypothesis, Named};

/// The concealed truth of a case. Only the field `effects` is required.
#[derive(Clone, Debug, Default, Deserialize)]
#[serde(default)]
pub struct Truth {
    /// The concealed effects; empty for a negative control.
    pub effects: Vec<Concealed>,
    /// The machine's name.
    pub machine: String,
    /// Level of the noise.
    pub noise: String,
    /// Seed of the case.
    pub seed: Value,
    /// Length of each recording, s.
    pub duration: f64,
    /// Number of joints.
    pub joints: usize,
}

/// One concealed effect.
#[derive(Clone, Debug, Default, Deserialize)]
#[serde(default)]
pub struct Concealed {
    /// Its kind.
    pub kind: String,
    /// Its joint; `None`: the arm as a whole.
    pub joint: Option<String>,
    /// Its parameters, SI.
    pub parameters: Value,
    /// Parameters with hardly any trace of their own: not scored.
    pub weak: Vec<String>,
    /// Other names that count as right.
    pub equivalents: Vec<Equivalent>,
    /// False: physics outside the catalogue.
    #[serde(default = "yes")]
    pub catalogued: bool,
    /// `slight`, `clear`, `strong`.
    pub severity: String,
    /// Root mean square of its trace over that of noise and tolerances.
    pub signal_to_floor: f64,
    /// The channel where that is largest.
    pub channel: String,
}

fn yes() -> bool {
    true
}

/// Another name for an effect.
#[derive(Clone, Debug, Default, Deserialize)]
#[serde(default)]
pub struct Equivalent {
    /// Kinds that together are the same.
    pub kinds: Vec<String>,
    /// Their joint.
    pub joint: Option<String>,
}

/// Identity of a concealed effect: kind, joint, and the kinds and joints of its equivalents.
pub type TruthKey<'a> = (&'a str, Option<&'a str>, Vec<(&'a [String], Option<&'a str>)>);

/// Sort of a case by its concealed effects.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Sort {
    /// No effect.
    Negative,
    /// One effect of the catalogue.
    Single,
    /// Two or more effects of the catalogue.
    Double,
    /// Physics outside the catalogue.
    Outside,
}

impl Sort {
    /// Every sort.
    pub const ALL: [Sort; 4] = [Sort::Negative, Sort::Single, Sort::Double, Sort::Outside];

    /// Its name.
    pub fn name(self) -> &'static str {
        match self {
            Sort::Negative => "nothing concealed",
            Sort::Single => "one effect",
            Sort::Double => "two effects",
            Sort::Outside => "not in the catalogue",
        }
    }
}

impl Truth {
    /// The sort of the case.
    pub fn sort(&self) -> Sort {
        match self.effects.as_slice() {
            [] => Sort::Negative,
            effects if effects.iter().any(|effect| !effect.catalogued) => Sort::Outside,
            [_] => Sort::Single,
            _ => Sort::Double,
        }
    }

    /// The concealed effects, in a few words.
    pub fn words(&self) -> String {
        match self.effects.as_slice() {
            [] => "nothing".to_owned(),
            effects => {
                effects.iter().map(|e| at(&e.kind, e.joint.as_deref())).collect::<Vec<_>>().join(" + ")
            }
        }
    }
}

/// `kind of joint`.
pub fn at(kind: &str, joint: Option<&str>) -> String {
    joint.map_or_else(|| kind.to_owned(), |joint| format!("{kind} of {joint}"))
}

impl Concealed {
    /// True if the effect has this kind and joint.
    pub fn is(&self, kind: &str, joint: Option<&str>) -> bool {
        self.kind == kind && self.joint.as_deref() == joint
    }

    /// Two truths with the same key have the same right answers.
    pub fn key(&self) -> TruthKey<'_> {
        let same = self.equivalents.iter().map(|other| (other.kinds.as_slice(), other.joint.as_deref()));
        (self.kind.as_str(), self.joint.as_deref(), same.collect())
    }

    /// True if `row` is this effect, or an equivalent of it.
    pub fn names(&self, row: &Hypothesis) -> bool {
        let same = |other: &Equivalent| other.joint == row.joint && other.kinds.contains(&row.kind);
        self.is(&row.kind, row.joint.as_deref()) || self.equivalents.iter().any(same)
    }

    /// Indices of the named effects that state it: one with its name, or those of an equivalent; empty if it is not stated.
    pub fn stated_by(&self, effects: &[Named]) -> Vec<usize> {
        let place = |kind: &str, joint: &Option<String>| {
            effects.iter().position(|e| e.kind == kind && e.joint == *joint)
        };
        if let Some(index) = place(&self.kind, &self.joint) {
            return vec![index];
        }
        let mut all = self.equivalents.iter().map(|other| {
            other.kinds.iter().map(|kind| place(kind, &other.joint)).collect::<Option<Vec<_>>>()
        });
        all.find_map(|found| found).unwrap_or_default()
    }

    /// True if the answer considers it possible: names it, or cannot distinguish it from a named effect.
    pub fn is_among(&self, answer: &Answer) -> bool {
        let rival = |kind: &str, joint: &Option<String>| {
            answer.rivals.iter().any(|r| r.indistinguishable && r.kind == kind && r.joint == *joint)
        };
        !self.stated_by(&answer.effects).is_empty()
            || rival(&self.kind, &self.joint)
            || self.equivalents.iter().any(|e| e.kinds.len() == 1 && rival(&e.kinds[0], &e.joint))
    }
}
