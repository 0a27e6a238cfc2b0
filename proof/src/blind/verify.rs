//! `freeplay blind --verify`: every hash of a receipt computed anew.

use std::fmt::Write as _;
use std::path::Path;

use freeplay_terminal::exit::Failure;
use serde_json::json;

use super::analysis::sealed;
use super::hash;
use super::receipt::{Part, Program, Receipt, link};
use super::tally::Score;

/// One thing that was looked at.
#[derive(Debug, PartialEq, Eq)]
pub struct Check {
    /// What it is.
    pub what: String,
    /// Whether it is as it was; `None`: there is nothing to compare with.
    pub good: Option<bool>,
    /// What was found.
    pub found: String,
}

impl Check {
    fn new(what: &str, wrong: &[String], good: &str) -> Self {
        let found = match wrong {
            [] => good.to_owned(),
            some => some.join("; "),
        };
        Self { what: what.to_owned(), good: Some(wrong.is_empty()), found }
    }
}

/// Checks `receipt`, whose sealed folder, if it is still there, is `folder`.
///
/// # Errors
/// A program or a sealed file that can't be read.
pub fn checks(receipt: &Receipt, folder: &Path) -> Result<Vec<Check>, Failure> {
    let this = Program::this()?;
    let mut all = Vec::new();
    for part in &receipt.parts {
        all.push(program(part, &this));
        all.push(truths(part, receipt));
        all.push(files(part, folder)?);
        all.push(answers(part, receipt));
        all.push(chain(part, receipt));
    }
    all.push(score(receipt));
    Ok(all)
}

/// The checks as a person reads them.
pub fn text(checks: &[Check]) -> String {
    let mut text = String::new();
    for check in checks {
        let sign = match check.good {
            Some(true) => " ok  ",
            Some(false) => " FAIL",
            None => " –   ",
        };
        let _ = writeln!(text, "{sign} {:10} {}", check.what, check.found);
    }
    text
}

fn program(part: &Part, this: &Program) -> Check {
    let mut wrong = Vec::new();
    if part.program.sha256 != this.sha256 {
        let (then, now) = (start(&part.program.sha256), start(&this.sha256));
        wrong.push(format!("frozen was the program {then}, this one is {now}"));
    }
    if part.program.catalogue != this.catalogue {
        wrong.push("the catalogue of this program is another one".to_owned());
    }
    Check::new("program", &wrong, &format!("{}, catalogue {}", start(&this.sha256), start(&this.catalogue)))
}

fn truths(part: &Part, receipt: &Receipt) -> Check {
    let wrong: Vec<String> = part
        .records(&receipt.cases)
        .filter_map(|(name, record)| match part.commitments.get(name) {
            Some(commitment) if *commitment == hash::commitment(&record.salt, &record.truth) => None,
            Some(_) => Some(format!("the truth of {name} is not the one committed to")),
            None if part.draw.is_some() => Some(format!("no commitment to the truth of {name}")),
            None => None,
        })
        .collect();
    if part.commitments.is_empty() && wrong.is_empty() {
        let found = "the folder came without commitments to its truth".to_owned();
        return Check { what: "truth".to_owned(), good: None, found };
    }
    Check::new(
        "truth",
        &wrong,
        &format!("{} cases as committed to before the analysis", part.commitments.len()),
    )
}

fn files(part: &Part, folder: &Path) -> Result<Check, Failure> {
    let what = "recordings";
    if !part.sealed.keys().any(|name| folder.join(name).is_dir()) {
        let found = format!("not in {}; their hashes stand in the receipt", folder.display());
        return Ok(Check { what: what.to_owned(), good: None, found });
    }
    let now = sealed(folder)?;
    let wrong: Vec<String> = part
        .sealed
        .iter()
        .filter(|(name, files)| now.get(*name) != Some(files))
        .map(|(name, _)| format!("{name} is not as it was sealed"))
        .collect();
    Ok(Check::new(what, &wrong, &format!("{} cases as sealed", part.sealed.len())))
}

fn answers(part: &Part, receipt: &Receipt) -> Check {
    let now = part.hash_of_answers(&receipt.cases);
    let mut wrong = Vec::new();
    if now != part.answers {
        wrong.push(format!("committed to were {}, here are {}", start(&part.answers), start(&now)));
    }
    Check::new("answers", &wrong, &format!("{} as committed to before the reveal", start(&now)))
}

/// The stages in their order, each bound to what it brought and to the one before.
fn chain(part: &Part, receipt: &Receipt) -> Check {
    let brought = part.brought(&receipt.cases);
    let (mut before, mut wrong) = ("", Vec::new());
    for stage in &part.stages {
        if brought.get(stage.name.as_str()).is_none_or(|value| hash::of_json(value) != stage.brought) {
            wrong.push(format!("what stage {} brought is not what it was", stage.name));
        }
        if stage.chain != link(before, &stage.name, &stage.at, &stage.brought) {
            wrong.push(format!("stage {} does not follow from the one before", stage.name));
        }
        before = &stage.chain;
    }
    let order = ["freeze", "seed", "seal", "answer", "reveal"];
    let names: Vec<&str> = part.stages.iter().map(|stage| stage.name.as_str()).collect();
    let wanted: Vec<&str> = order.into_iter().filter(|name| *name != "seed" || part.draw.is_some()).collect();
    if names != wanted {
        wrong.push(format!("stages {names:?}, where {wanted:?} are to be"));
    }
    Check::new("stages", &wrong, &format!("{}, chain {}", names.join(" → "), start(before)))
}

fn score(receipt: &Receipt) -> Check {
    let judged = match receipt.judged() {
        Ok(judged) => judged,
        Err(failure) => return Check::new("score", &[failure.to_string()], ""),
    };
    let mut wrong: Vec<String> = judged
        .iter()
        .filter(|case| receipt.cases[&case.name].outcome != Some(case.outcome))
        .map(|case| format!("{} is {}", case.name, case.outcome.name()))
        .collect();
    // As text: a number read back from a file is the same, not of the same type.
    let (now, then) = (json!(Score::of(&judged)).to_string(), receipt.score.to_string());
    if now != then {
        wrong.push("the score is not the one that these answers have".to_owned());
    }
    Check::new("score", &wrong, &format!("{} cases score as they are said to", judged.len()))
}

/// The beginning of a hash, for people.
pub fn start(hash: &str) -> &str {
    hash.get(..12).unwrap_or(hash)
}
