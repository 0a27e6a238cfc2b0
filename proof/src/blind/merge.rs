//! `freeplay blind --merge`: merges the receipts of several parts.
//!
//! The module reads, checks and releases one receipt after the other: time grows with the cases, and memory with the data that the score needs of them.

use std::path::{Path, PathBuf};

use super::gathered::Gathered;
use super::judged::Judged;
use super::overlap::Overlap;
use super::receipt::{Part, Program, Receipt};
use super::verify::{broken, checks};
use freeplay_terminal::exit::Failure;

/// Several receipts merged into one.
pub struct Merged {
    /// Their parts, in the order of their chains.
    pub parts: Vec<Part>,
    /// The data of their cases for the score, in the order of their names.
    pub judged: Vec<Judged>,
    /// Their cases.
    pub cases: Gathered,
}

/// Merges the receipts in `folders`; their cases are collected below `out`.
///
/// # Errors
/// A receipt that does not verify; one made by another program than the first, or with a case of another one.
pub fn merged(folders: &[PathBuf], out: &Path) -> Result<Merged, Failure> {
    let this = Program::this()?;
    let mut all =
        Merged { parts: Vec::new(), judged: Vec::new(), cases: Gathered::new(out.join("gathered"))? };
    let mut overlap = Overlap::default();
    for folder in folders {
        let path = folder.join("receipt.json");
        let receipt = Receipt::read(&path)?;
        let wrong = |why: String| Failure::input(format!("{}: {why}", path.display()));
        // Another program may have made it; all hashes of truths, answers and score have to hold.
        if let Some(check) = broken(&checks(&receipt, &folder.join("sealed"), &this)?) {
            return Err(wrong(format!("{}: {}", check.what, check.found)));
        }
        if !receipt.parts.iter().all(Part::is_open) {
            return Err(wrong("its truth is not revealed yet; score it before".to_owned()));
        }
        // The parts of one receipt do not overlap, which verification has checked.
        let twice = receipt.parts.iter().filter_map(|part| overlap.add(part)).next();
        if all.parts.first().is_some_and(|first| receipt.parts[0].program != first.program) {
            return Err(wrong(
                "was made by another program or catalogue than the first: shards have to be of one"
                    .to_owned(),
            ));
        }
        if let Some(why) = twice {
            return Err(wrong(why));
        }
        all.add(receipt)?;
    }
    if all.parts.is_empty() {
        return Err(Failure::usage("--merge needs folders"));
    }
    all.parts.sort_by(|a, b| a.chain().cmp(b.chain()));
    all.judged.sort_by(|a, b| a.name.cmp(&b.name));
    Ok(all)
}

impl Merged {
    fn add(&mut self, receipt: Receipt) -> Result<(), Failure> {
        self.judged.extend(receipt.judged()?.into_iter().map(Judged::slim));
        for (name, record) in &receipt.cases {
            self.cases.add(name, record)?;
        }
        self.parts.extend(receipt.parts);
        Ok(())
    }
}
