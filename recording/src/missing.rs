//! What a recording lacks here and there: rows that can't be used, columns without numbers, and the words for both.

use crate::error::ReadError;
use crate::names::{Group, ORIENTATION, TOOL};
use crate::place::Place;
use crate::recording::Recording;

/// Rows that are left out, by what they lack.
#[derive(Debug, Clone, Default)]
pub(crate) struct LeftOut {
    reasons: Vec<Reason>,
}

/// One thing that rows lack.
#[derive(Debug, Clone)]
struct Reason {
    /// The column that holds no number, or what is wrong with the row.
    what: String,
    rows: u64,
    first: Place,
}

impl LeftOut {
    /// Counts a row at `place` that lacks `what`.
    pub fn count(&mut self, what: &str, place: impl FnOnce() -> Place) {
        match self.reasons.iter_mut().find(|reason| reason.what == what) {
            Some(reason) => reason.rows += 1,
            None => self.reasons.push(Reason { what: what.to_owned(), rows: 1, first: place() }),
        }
    }

    /// All rows that are left out.
    pub fn rows(&self) -> u64 {
        self.reasons.iter().map(|reason| reason.rows).sum()
    }

    /// The error where no row is left; none if none was left out.
    pub fn nothing_left(&self) -> Option<ReadError> {
        let most = self.reasons.iter().max_by_key(|reason| reason.rows)?;
        Some(ReadError::NothingLeft { place: most.first.clone(), what: most.what.clone(), rows: self.rows() })
    }

    /// What was left out of `all` rows, in one sentence.
    pub fn in_words(&self, all: u64) -> Option<String> {
        let each = |reason: &Reason| format!("{} in {} (first {})", reason.what, reason.rows, reason.first);
        let each: Vec<String> = self.reasons.iter().map(each).collect();
        (!each.is_empty()).then(|| format!("{} of {all} rows are left out: {}", self.rows(), each.join(", ")))
    }
}

/// Which columns of the contract lack numbers, in one sentence; none if nothing is missing.
pub(crate) fn in_words(recording: &Recording) -> Option<String> {
    let samples = recording.len();
    let words = runs(recording).into_iter().map(|(first, last, count)| {
        let name = if first == last { first } else { format!("{first}…{last}") };
        if count == samples {
            format!("{name} throughout")
        } else {
            format!("{name} in {count} of {samples} samples")
        }
    });
    let words: Vec<String> = words.collect();
    (!words.is_empty()).then(|| format!("missing, and not used where missing: {}", words.join(", ")))
}

/// Neighbouring columns of one group that lack equally many samples: the first, the last, how many.
fn runs(recording: &Recording) -> Vec<(String, String, usize)> {
    let mut runs: Vec<(String, String, usize)> = Vec::new();
    for set in sets(recording) {
        let mut open = false;
        for (name, values) in set {
            let count = values.iter().filter(|value| value.is_nan()).count();
            match runs.last_mut().filter(|run| open && run.2 == count) {
                Some(run) => run.1 = name,
                None if count > 0 => runs.push((name.clone(), name, count)),
                None => {}
            }
            open = count > 0;
        }
    }
    runs
}

/// The columns of the contract that may lack numbers, set by set.
fn sets(recording: &Recording) -> Vec<Vec<(String, &[f64])>> {
    let groups = Group::ALL.into_iter().map(|group| recording.group(group));
    let tool = recording
        .tool
        .iter()
        .flat_map(|tool| TOOL.iter().map(ToString::to_string).zip(tool.iter().map(Vec::as_slice)));
    let orientation = recording
        .orientation
        .iter()
        .flat_map(|parts| ORIENTATION.iter().map(ToString::to_string).zip(parts.iter().map(Vec::as_slice)));
    groups.chain([tool.collect(), orientation.collect()]).collect()
}

/// Whether `column` holds no number at all.
pub(crate) fn is_missing(column: &[f64]) -> bool {
    column.iter().all(|value| value.is_nan())
}
