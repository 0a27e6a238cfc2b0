//! The list of every sealed set that was ever drawn: a line when it is sealed, a line when it is scored.

use std::path::Path;

use freeplay_storage::LiveFile;
use serde_json::{Value, json};

use super::receipt::{Part, now};
use super::tally::Score;
use crate::exit::Failure;
use crate::files::{make_folder, unwritable};

/// Appends that `part` was sealed: before anybody knows how it will come out, so that no set can be forgotten.
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

/// Appends how the set came out whose seal had the hash `seal` in the chain.
///
/// # Errors
/// A file that can't be written.
pub fn scored(path: &Path, seal: &str, score: &Score) -> Result<(), Failure> {
    let goals: serde_json::Map<String, Value> = score
        .goals
        .iter()
        .filter(|goal| goal.of > 0)
        .map(|goal| (goal.quantity.to_owned(), json!([goal.reached, goal.ci95, goal.of])))
        .collect();
    append(path, &json!({ "scored": now(), "chain": seal, "outcomes": score.outcomes, "goals": goals }))
}

fn append(path: &Path, line: &Value) -> Result<(), Failure> {
    use std::io::Write;
    let failed = |error| unwritable(path, error);
    if let Some(folder) = path.parent() {
        make_folder(folder)?;
    }
    let mut file = LiveFile::append(path)?;
    file.write_all(format!("{line}\n").as_bytes()).and_then(|()| file.finish()).map_err(failed)
}
