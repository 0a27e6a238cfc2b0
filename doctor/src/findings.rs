//! Consequences of the facts of a machine for a run: one line per item, one line for the remedy, and the fitness of the machine.

use clap::builder::styling::Style;
use freeplay_terminal::styles::{BAD, GOOD, UNDECIDED};
use serde::Serialize;

/// Severity of a finding.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Level {
    /// As it should be.
    Ok,
    /// It costs something.
    Warn,
    /// It makes the machine unfit for the use [`Finding::spoils`].
    Fail,
}

impl Level {
    /// The word in reports.
    pub fn word(self) -> &'static str {
        match self {
            Self::Ok => "ok",
            Self::Warn => "warn",
            Self::Fail => "fail",
        }
    }

    /// Terminal style of the word.
    pub fn style(self) -> Style {
        match self {
            Self::Ok => GOOD,
            Self::Warn => UNDECIDED,
            Self::Fail => BAD,
        }
    }
}

/// A use for which a machine can be fit; each has the requirements of those before it and further ones.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Use {
    /// Runs at all, in lockstep.
    Lockstep,
    /// Medians of latencies in real time.
    Medians,
    /// Tails of latencies in real time: rare delays then come from the program, not from the machine.
    Tails,
}

/// One line of the examination.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Finding {
    /// The examined item.
    pub item: &'static str,
    /// Its severity.
    pub level: Level,
    /// The observation.
    pub found: String,
    /// The remedy, if any.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub remedy: Option<String>,
    /// The least demanding use that a failure spoils.
    pub spoils: Use,
}

/// Fitness of the machine.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Verdict {
    /// Runs in lockstep.
    pub lockstep: bool,
    /// Medians in real time.
    pub medians: bool,
    /// Tails in real time.
    pub tails: bool,
    /// The same in words.
    pub words: String,
}

impl Verdict {
    /// Derives the verdict from all findings.
    pub fn of(findings: &[Finding]) -> Self {
        let fails = |up_to: Use| {
            findings.iter().any(|finding| finding.level == Level::Fail && finding.spoils <= up_to)
        };
        let [lockstep, medians, tails] =
            [Use::Lockstep, Use::Medians, Use::Tails].map(|wanted| !fails(wanted));
        let words = match (lockstep, medians, tails) {
            (false, ..) => "not fit for any run",
            (_, false, _) => "fit for lockstep; not for timing",
            (.., false) => "fit for lockstep and for medians; not for tails",
            _ => "fit for lockstep, medians and tails",
        };
        Self { lockstep, medians, tails, words: words.to_owned() }
    }
}

/// A finding that `item` is as it should be.
pub fn ok(item: &'static str, found: impl Into<String>) -> Finding {
    Finding { item, level: Level::Ok, found: found.into(), remedy: None, spoils: Use::Tails }
}

/// A finding that `item` costs something; `remedy` helps.
pub fn warn(item: &'static str, found: impl Into<String>, remedy: impl Into<String>) -> Finding {
    Finding { level: Level::Warn, remedy: Some(remedy.into()), ..ok(item, found) }
}

/// A finding that `item` spoils the use `spoils`; `remedy` helps.
pub fn fail(spoils: Use, item: &'static str, found: impl Into<String>, remedy: impl Into<String>) -> Finding {
    Finding { level: Level::Fail, spoils, ..warn(item, found, remedy) }
}
