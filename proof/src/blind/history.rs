//! The list of all sealed sets ever drawn: a line at the seal, a line at the score.

use std::path::Path;

use freeplay_storage::LiveFile;
use freeplay_terminal::exit::Failure;
use freeplay_terminal::files::{make_folder, read_text, unwritable};
use serde_json::{Value, json};

use super::receipt::{Part, Receipt, now};
use super::strict;
use super::tally::Score;
use super::verify::{Check, start};

/// Appends the seal of `part` before its result is known, so that no set can be omitted.
///
/// # Errors
/// A file that can't be written.
pub fn sealed(path: &Path, part: &Part) -> Result<(), Failure> {
    append(
        path,
        &json!({
            "sealed": now(), "cases": part.sealed.len(), "draw": part.draw,
            "program": part.program.sha256, "catalogue": part.program.catalogue,
            "chain": part.stages.last().map(|stage| &stage.chain),
        }),
    )
}

/// Appends the score of the set whose seal had the hash `seal` in the chain, and whose receipt has the hash `receipt`.
///
/// # Errors
/// A file that can't be written.
pub fn scored(path: &Path, seal: &str, receipt: &str, score: &Score) -> Result<(), Failure> {
    let goals: serde_json::Map<String, Value> = score
        .goals
        .iter()
        .filter(|goal| goal.of > 0)
        .map(|goal| (goal.quantity.to_owned(), json!([goal.reached, goal.ci95, goal.of])))
        .collect();
    append(
        path,
        &json!({ "scored": now(), "chain": seal, "receipt": receipt, "outcomes": score.outcomes, "goals": goals }),
    )
}

/// Checks that the list `path` has the seal of each part of `receipt`: a forged receipt with other truths or cases has another seal.
///
/// # Errors
/// A list that can't be read.
pub fn check(path: &Path, receipt: &Receipt) -> Result<Check, Failure> {
    let text = read_text(path)?;
    let lines: Vec<Value> = text.lines().filter_map(|line| strict::parse(line).ok()).collect();
    let noted = |part: &&Part| {
        lines
            .iter()
            .any(|line| line["sealed"].is_string() && line["chain"].as_str() == Some(part.seal_hash()))
    };
    let strange = receipt.parts.iter().filter(|part| !noted(part));
    let wrong: Vec<String> =
        strange.map(|part| format!("no line for the seal {}", start(part.seal_hash()))).collect();
    Ok(Check::new("history", &wrong, "every seal was noted when it was made"))
}

fn append(path: &Path, line: &Value) -> Result<(), Failure> {
    use std::io::Write;
    let failed = |error| unwritable(path, error);
    if let Some(folder) = path.parent() {
        make_folder(folder)?;
    }
    let mut file = LiveFile::open_to_append(path)?;
    file.write_all(format!("{line}\n").as_bytes()).and_then(|()| file.finish()).map_err(failed)
}
