//! `freeplay blind --verify`: reading of the receipts, and output of the checks.

use std::path::{Path, PathBuf};

use serde_json::{Value, json};

use super::history;
use super::receipt::{Form, Program};
use super::verify::{Check, checks, text};
use freeplay_terminal::arguments::Format;
use freeplay_terminal::exit::{Exit, Failure};
use freeplay_terminal::output::{say, show};

/// Checks the receipts `paths`, also against the list `history` of all seals, if there is one.
///
/// # Errors
/// A file that can't be read or is no JSON.
pub fn verify(paths: &[PathBuf], history: Option<&Path>, format: Format) -> Result<Exit, Failure> {
    let this = Program::this()?;
    let mut all = Vec::new();
    for path in paths {
        all.push((path, of_file(path, history, &this)?));
    }
    match format {
        Format::Json => {
            let mut shown: Vec<Value> = all.iter().map(|(path, checks)| as_json(path, checks)).collect();
            // The output for one receipt is not a list, as in earlier versions.
            let shown = if shown.len() == 1 { shown.remove(0) } else { Value::Array(shown) };
            say(&format!("{shown:#}\n"))?;
        }
        Format::Text => {
            for (path, checks) in &all {
                let heading = if all.len() == 1 { String::new() } else { format!("{}\n", path.display()) };
                show(&(heading + &text(checks)))?;
            }
        }
    }
    let good = all.iter().all(|(_, checks)| are_good(checks));
    Ok(if good { Exit::Done } else { Exit::Verdict })
}

fn of_file(path: &Path, history: Option<&Path>, this: &Program) -> Result<Vec<Check>, Failure> {
    let receipt = match Form::of(path)? {
        Form::Wrong(why) => return Ok(vec![Check::new("form", &[why], "")]),
        Form::Receipt(receipt) => receipt,
    };
    let folder = path.parent().unwrap_or(Path::new("."));
    let drawn = receipt.parts.iter().all(|part| part.draw.is_some());
    let sealed = if drawn { folder.join("sealed") } else { folder.into() };
    let mut found = checks(&receipt, &sealed, this)?;
    if let Some(list) = history {
        found.push(history::check(list, &receipt)?);
    }
    Ok(found)
}

fn are_good(checks: &[Check]) -> bool {
    checks.iter().all(|check| check.good != Some(false))
}

fn as_json(path: &Path, checks: &[Check]) -> Value {
    let rows: Vec<Value> =
        checks.iter().map(|c| json!({ "what": c.what, "good": c.good, "found": c.found })).collect();
    json!({ "receipt": path, "good": are_good(checks), "checks": rows })
}
