//! `freeplay blind --verify`: recomputes every hash of a receipt.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write as _;
use std::path::Path;

use freeplay_terminal::exit::Failure;
use serde_json::{Value, json};

use super::analysis::{isolation, sealed};
use super::overlap::{Overlap, recorded};
use super::receipt::{Part, Program, Receipt, link};
use super::tally::Score;
use super::{canonical, hash, shard};

/// The result of one check.
#[derive(Debug, PartialEq, Eq)]
pub struct Check {
    /// The checked item.
    pub what: String,
    /// True if it is unchanged; `None` without anything to compare with.
    pub good: Option<bool>,
    /// The observation.
    pub found: String,
}

impl Check {
    /// A check that is good if `wrong` is empty; its observation is then `good`.
    pub fn new(what: &str, wrong: &[String], good: &str) -> Self {
        let found = match wrong {
            [] => good.to_owned(),
            some => some.join("; "),
        };
        Self { what: what.to_owned(), good: Some(wrong.is_empty()), found }
    }

    fn open(what: &str, found: String) -> Self {
        Self { what: what.to_owned(), good: None, found }
    }
}

/// Checks `receipt`, with the sealed folder `folder` if it still exists, against the program `this`.
///
/// # Errors
/// A sealed file that can't be read.
pub fn checks(receipt: &Receipt, folder: &Path, this: &Program) -> Result<Vec<Check>, Failure> {
    let mut all = vec![whole(receipt)?, parts(receipt)];
    for part in &receipt.parts {
        all.push(program(part, this));
        all.push(draw(part));
        all.push(truths(part, receipt));
        all.push(answers(part, receipt));
        all.push(chain(part, receipt));
    }
    all.push(recordings(receipt, folder)?);
    all.push(cases(receipt));
    all.push(score(receipt));
    Ok(all)
}

/// The first failed check that indicates more than another program version.
pub fn broken(checks: &[Check]) -> Option<&Check> {
    checks.iter().find(|check| check.good == Some(false) && check.what != "program")
}

/// The checks as text for a person.
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

/// Checks the hash over the whole file.
fn whole(receipt: &Receipt) -> Result<Check, Failure> {
    let now = receipt.hash()?;
    let changed = (now != receipt.sha256).then(|| {
        format!("the file states the hash {}, but its fields have {}", start(&receipt.sha256), start(&now))
    });
    Ok(Check::new("receipt", changed.as_slice(), &format!("{} covers every field", start(&now))))
}

/// Checks that there is a part, that no two parts contain the same case, and that they are in the order of their chains.
fn parts(receipt: &Receipt) -> Check {
    let parts = &receipt.parts;
    let mut wrong = Vec::new();
    if parts.is_empty() {
        wrong.push("missing: nothing binds the cases".to_owned());
    }
    if !parts.is_sorted_by_key(Part::chain) {
        wrong.push("they do not stand in the order of their chains".to_owned());
    }
    let mut overlap = Overlap::default();
    wrong.extend(parts.iter().filter_map(|part| overlap.add(part)));
    let shards = parts.iter().filter_map(|part| part.draw.as_ref());
    let shards: Vec<String> = shards.map(|d| format!("shard {} of {}", d.shard[0], d.shard[1])).collect();
    let shards = if shards.is_empty() { "sealed by someone else".to_owned() } else { shards.join(", ") };
    Check::new("parts", &wrong, &format!("{} ({shards})", parts.len()))
}

fn program(part: &Part, this: &Program) -> Check {
    let mut wrong = Vec::new();
    if part.program.sha256 != this.sha256 {
        let (then, now) = (start(&part.program.sha256), start(&this.sha256));
        wrong.push(format!("frozen was the program {then}, this one is {now}"));
    }
    if part.program.catalogue != this.catalogue {
        wrong.push("the catalogue of this program differs".to_owned());
    }
    Check::new("program", &wrong, &format!("{}, catalogue {}", start(&this.sha256), start(&this.catalogue)))
}

/// Checks that every case of the draw is sealed or listed as not made, under the name that follows from the key, and that none appears twice.
fn draw(part: &Part) -> Check {
    let Some(draw) = &part.draw else {
        return Check::open("draw", "someone else drew and sealed the cases".to_owned());
    };
    let mut wrong = shard::wrong(part, draw);
    let mut seen = BTreeMap::new();
    for (hash, name) in recorded(part) {
        if let Some(twin) = seen.insert(hash, name) {
            wrong.push(format!("cases {twin} and {name} are one recording"));
        }
    }
    let (sealed, not_made) = (part.sealed.len(), part.not_made.len());
    Check::new("draw", &wrong, &format!("seed {}: {sealed} sealed, {not_made} not made", draw.seed))
}

fn truths(part: &Part, receipt: &Receipt) -> Check {
    let mut wrong = Vec::new();
    let other: Vec<&String> =
        part.commitments.keys().filter(|name| !part.sealed.contains_key(*name)).collect();
    if part.draw.is_some() {
        wrong.extend(other.iter().map(|name| format!("a commitment to {name}, which was not sealed")));
    }
    if !part.is_open() {
        let told = |(_, record): &(_, &super::receipt::Record)| {
            !record.truth.is_null() || !record.salt.is_empty() || record.outcome.is_some()
        };
        if part.records(&receipt.cases).any(|record| told(&record)) || !receipt.score.is_null() {
            wrong.push("a truth or a score without the stage reveal".to_owned());
        }
        if wrong.is_empty() {
            return Check::open("truth", "not revealed yet".to_owned());
        }
        return Check::new("truth", &wrong, "");
    }
    wrong.extend(part.records(&receipt.cases).filter_map(
        |(name, record)| match part.commitments.get(name) {
            Some(found) if hash::commits(found, &record.salt, &record.truth) => None,
            Some(_) => Some(format!("the truth of {name} is not the one committed to")),
            None if part.draw.is_some() => Some(format!("no commitment to the truth of {name}")),
            None => None,
        },
    ));
    if part.commitments.is_empty() && wrong.is_empty() && part.draw.is_none() {
        return Check::open("truth", "the folder came without commitments to its truth".to_owned());
    }
    let good = format!("{} cases as committed to before the analysis", part.commitments.len() - other.len());
    Check::new("truth", &wrong, &good)
}

/// Checks the files in the sealed folder, if it still exists.
fn recordings(receipt: &Receipt, folder: &Path) -> Result<Check, Failure> {
    let what = "recordings";
    let all: BTreeMap<_, _> = receipt.parts.iter().flat_map(|part| &part.sealed).collect();
    if !all.keys().any(|name| folder.join(name).is_dir()) {
        let found = format!("not in {}; their hashes stand in the receipt", folder.display());
        return Ok(Check::open(what, found));
    }
    let now = sealed(folder)?;
    let changed = all.iter().filter(|(name, files)| now.get(**name) != Some(**files));
    let mut wrong: Vec<String> = changed.map(|(name, _)| format!("{name} is not as it was sealed")).collect();
    let added = now.keys().filter(|name| !all.contains_key(name));
    wrong.extend(added.map(|name| format!("{name} was not sealed")));
    Ok(Check::new(what, &wrong, &format!("{} cases as sealed", all.len())))
}

fn answers(part: &Part, receipt: &Receipt) -> Check {
    let now = part.hash_of_answers(&receipt.cases);
    let mut wrong = Vec::new();
    if now != part.answers {
        wrong.push(format!(
            "the committed answers have the hash {}, but these answers have {}",
            start(&part.answers),
            start(&now)
        ));
    }
    if isolation(part.records(&receipt.cases).map(|(_, record)| &record.answer)) != part.isolation {
        wrong.push("the isolation is not the one that the analysts found".to_owned());
    }
    Check::new("answers", &wrong, &format!("{} as committed to before the reveal", start(&now)))
}

/// Checks the stages: their order, and the hash of each over its result and the stage before.
fn chain(part: &Part, receipt: &Receipt) -> Check {
    let brought = part.stage_results(&receipt.cases);
    let (mut before, mut wrong) = ("", Vec::new());
    for stage in &part.stages {
        let name = stage.name.as_str();
        if brought.get(name).is_none_or(|value| hash::of_json(name, value) != stage.brought) {
            wrong.push(format!("the content of stage {name} has changed"));
        }
        if stage.chain != link(before, name, &stage.at, &stage.brought) {
            wrong.push(format!("stage {name} does not follow from the one before"));
        }
        before = &stage.chain;
    }
    let order = ["freeze", "seed", "seal", "answer", "reveal"];
    let names: Vec<&str> = part.stages.iter().map(|stage| stage.name.as_str()).collect();
    let drawn = part.draw.is_some();
    let wanted = |name: &&str| match *name {
        "seed" => drawn,
        "reveal" => drawn || part.is_open(),
        _ => true,
    };
    let wanted: Vec<&str> = order.into_iter().filter(wanted).collect();
    if names != wanted {
        wrong.push(format!("stages {names:?}, where {wanted:?} are to be"));
    }
    Check::new("stages", &wrong, &format!("{}, chain {}", names.join(" → "), start(before)))
}

/// Checks that every case was sealed in a part, and that every sealed case is present.
fn cases(receipt: &Receipt) -> Check {
    let sealed: BTreeSet<&String> = receipt.parts.iter().flat_map(|part| part.sealed.keys()).collect();
    let there: BTreeSet<&String> = receipt.cases.keys().collect();
    let mut wrong: Vec<String> =
        sealed.difference(&there).map(|name| format!("{name} was sealed and is missing")).collect();
    wrong.extend(there.difference(&sealed).map(|name| format!("{name} was not sealed")));
    Check::new("cases", &wrong, &format!("{} of {} that were sealed", there.len(), sealed.len()))
}

fn score(receipt: &Receipt) -> Check {
    if !receipt.parts.is_empty() && !receipt.parts.iter().any(Part::is_open) {
        return Check::open("score", "none before the truth is revealed".to_owned());
    }
    let judged = match receipt.judged() {
        Ok(judged) => judged,
        Err(failure) => return Check::new("score", &[failure.to_string()], ""),
    };
    let mut wrong: Vec<String> = judged
        .iter()
        .filter(|case| receipt.cases[&case.name].outcome != Some(case.outcome))
        .map(|case| format!("{} is {}", case.name, case.outcome.name()))
        .collect();
    let now: Value = json!(Score::of(&judged));
    if let Some(pointer) = canonical::difference(&receipt.score, &now) {
        wrong.push(format!("the score does not follow from these answers: /score{pointer}"));
    }
    Check::new("score", &wrong, &format!("the scores of {} cases follow from their answers", judged.len()))
}

/// The beginning of a hash, for people.
pub fn start(hash: &str) -> &str {
    hash.get(..12).unwrap_or(hash)
}
