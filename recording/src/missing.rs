//! Missing data of a recording: unusable rows, columns without numbers, and the notes on both.

use crate::error::ReadError;
use crate::names::{Group, ORIENTATION, TOOL};
use crate::place::Place;
use crate::recording::Recording;

/// Dropped rows, by the missing value.
#[derive(Debug, Clone, Default)]
pub(crate) struct LeftOut {
    reasons: Vec<Reason>,
}

/// One reason for dropping rows.
#[derive(Debug, Clone)]
struct Reason {
    /// The column without a number, or the fault of the row.
    what: String,
    rows: u64,
    first: Place,
}

impl LeftOut {
    /// Counts a row at `place` with the fault `what`.
    pub fn count(&mut self, what: &str, place: impl FnOnce() -> Place) {
        match self.reasons.iter_mut().find(|reason| reason.what == what) {
            Some(reason) => reason.rows += 1,
            None => self.reasons.push(Reason { what: what.to_owned(), rows: 1, first: place() }),
        }
    }

    /// Number of dropped rows.
    pub fn rows(&self) -> u64 {
        self.reasons.iter().map(|reason| reason.rows).sum()
    }

    /// The error if no row remains; `None` if none was dropped.
    pub fn nothing_left(&self) -> Option<ReadError> {
        let most = self.reasons.iter().max_by_key(|reason| reason.rows)?;
        Some(ReadError::NothingLeft { place: most.first.clone(), what: most.what.clone(), rows: self.rows() })
    }

    /// The dropped rows of `all` rows, in one sentence.
    pub fn in_words(&self, all: u64) -> Option<String> {
        let each = |reason: &Reason| format!("{} in {} (first {})", reason.what, reason.rows, reason.first);
        let each: Vec<String> = self.reasons.iter().map(each).collect();
        (!each.is_empty()).then(|| format!("{} of {all} rows are left out: {}", self.rows(), each.join(", ")))
    }
}

/// The columns of the contract with missing numbers, in one sentence; `None` if none is missing.
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
    (!words.is_empty()).then(|| format!("missing values, which are not used: {}", words.join(", ")))
}

/// Neighbouring columns of one group that lack equally many samples: the first, the last, the number of samples.
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

/// The columns of the contract that may lack numbers, group by group.
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

/// True if `column` has no number at all.
pub(crate) fn is_missing(column: &[f64]) -> bool {
    column.iter().all(|value| value.is_nan())
}
