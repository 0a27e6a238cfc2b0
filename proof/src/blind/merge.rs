//! `freeplay blind --merge`: the receipts of several parts as one.

use std::path::PathBuf;

use super::overlap::Overlap;
use super::receipt::{Part, Program, Receipt};
use super::verify::{broken, checks};
use freeplay_terminal::exit::Failure;

/// The receipts in `folders` as one, its parts in the order of their chains.
///
/// # Errors
/// A receipt that does not verify, by whichever program it was made; one of another program than the first, or with a case of another.
pub fn merged(folders: &[PathBuf]) -> Result<Receipt, Failure> {
    let this = Program::this()?;
    let mut all: Option<Receipt> = None;
    let mut overlap = Overlap::default();
    for folder in folders {
        let path = folder.join("receipt.json");
        let receipt = Receipt::read(&path)?;
        let wrong = |why: String| Failure::input(format!("{}: {why}", path.display()));
        // Another program may have made it; all that binds truths, answers and score has to hold.
        if let Some(check) = broken(&checks(&receipt, &folder.join("sealed"), &this)?) {
            return Err(wrong(format!("{}: {}", check.what, check.found)));
        }
        if !receipt.parts.iter().all(Part::is_open) {
            return Err(wrong("its truth is not revealed yet; score it before".to_owned()));
        }
        // The parts of one receipt do not overlap: that is one of its checks.
        let twice = receipt.parts.iter().filter_map(|part| overlap.add(part)).next();
        let Some(all) = &mut all else {
            all = Some(receipt);
            continue;
        };
        if receipt.parts[0].program != all.parts[0].program {
            return Err(wrong(
                "was made by another program or catalogue than the first: shards have to be of one"
                    .to_owned(),
            ));
        }
        if let Some(why) = twice {
            return Err(wrong(why));
        }
        all.parts.extend(receipt.parts);
        all.cases.extend(receipt.cases);
    }
    let mut all = all.ok_or_else(|| Failure::usage("--merge needs folders"))?;
    all.parts.sort_by(|a, b| a.chain().cmp(b.chain()));
    Ok(all)
}
