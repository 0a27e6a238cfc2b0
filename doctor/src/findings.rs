//! What the facts of a machine mean for a run: one line an item, what to change in one line, and what the machine is fit for.

use clap::builder::styling::Style;
use freeplay_terminal::styles::{BAD, GOOD, UNDECIDED};
use serde::Serialize;

/// How good a finding is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Level {
    /// As it should be.
    Ok,
    /// It costs something.
    Warn,
    /// It makes the machine unfit for what [`Finding::spoils`] says.
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

    /// How the word looks in a terminal.
    pub fn style(self) -> Style {
        match self {
            Self::Ok => GOOD,
            Self::Warn => UNDECIDED,
            Self::Fail => BAD,
        }
    }
}

/// What a machine can be fit for; each asks for all that those before it ask for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Use {
    /// Runs at all, in lockstep.
    Lockstep,
    /// Medians of latencies in real time.
    Medians,
    /// Tails of latencies in real time: what is rare is then the program's, not the machine's.
    Tails,
}

/// One line.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Finding {
    /// What was looked at.
    pub item: &'static str,
    /// How good it is.
    pub level: Level,
    /// What was found.
    pub found: String,
    /// What to change, if anything.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub remedy: Option<String>,
    /// The least demanding use that a failure spoils.
    pub spoils: Use,
}

/// What the machine is fit for.
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
    /// From all findings.
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

/// All is well with `item`.
pub fn ok(item: &'static str, found: impl Into<String>) -> Finding {
    Finding { item, level: Level::Ok, found: found.into(), remedy: None, spoils: Use::Tails }
}

/// Something about `item` costs something, and `remedy` helps.
pub fn warn(item: &'static str, found: impl Into<String>, remedy: impl Into<String>) -> Finding {
    Finding { level: Level::Warn, remedy: Some(remedy.into()), ..ok(item, found) }
}

/// Something about `item` spoils the use `spoils`, and `remedy` helps.
pub fn fail(spoils: Use, item: &'static str, found: impl Into<String>, remedy: impl Into<String>) -> Finding {
    Finding { level: Level::Fail, spoils, ..warn(item, found, remedy) }
}
