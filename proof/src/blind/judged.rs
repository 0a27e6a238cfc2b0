//! A case with its answer and the score of the answer.

use super::answer::{Answer, Errors};
use super::sandbox::Isolation;
use super::score::{Outcome, ParameterScore, outcome, parameter_scores};
use super::truth::{Sort, Truth};

/// A channel whose error exceeds the floor by no more than this factor has no error to close.
const NOTHING_TO_CLOSE: f64 = 1.05;

/// A case with its answer and the score of the answer.
#[derive(Clone, Debug)]
pub struct Judged {
    /// Name of its folder.
    pub name: String,
    /// The concealed truth.
    pub truth: Truth,
    /// The answer.
    pub answer: Answer,
    /// Result of the comparison.
    pub outcome: Outcome,
    /// Scores of the parameters of correctly named effects.
    pub hits: Vec<ParameterScore>,
}

impl Judged {
    /// Judges `answer` by `truth`.
    pub fn new(name: &str, truth: Truth, answer: Answer) -> Self {
        let hits = truth.effects.iter().flat_map(|concealed| parameter_scores(concealed, &answer)).collect();
        Self { name: name.to_owned(), outcome: outcome(&truth, &answer), truth, answer, hits }
    }

    /// Removes data that only the analysis of a failure needs: of a right answer, all hypotheses but the true ones, and the isolation of the analyst.
    pub fn slim(mut self) -> Self {
        self.answer.isolation = Isolation::default();
        if self.outcome == Outcome::Right {
            let truth = &self.truth;
            self.answer.hypotheses.retain(|row| truth.effects.iter().any(|concealed| concealed.names(row)));
            self.answer.hypotheses.shrink_to_fit();
        }
        self
    }

    /// Share of the held-out error above the floor that is closed if `error` remains, mean over the channels of the named effects; `None` if there is no error
    /// to close.
    pub fn closed(&self, error: impl Fn(&Errors) -> f64) -> Option<f64> {
        let channels: std::collections::BTreeSet<_> =
            self.answer.effects.iter().flat_map(|e| &e.channels).collect();
        let errors = channels.into_iter().filter_map(|channel| self.answer.fit.get(channel));
        let shares: Vec<f64> = errors
            .filter(|e| e.before > NOTHING_TO_CLOSE * e.floor)
            .map(|e| (e.before - error(e)) / (e.before - e.floor))
            .collect();
        (!shares.is_empty()).then(|| shares.iter().sum::<f64>() / shares.len() as f64)
    }

    /// True if the answer names a false effect.
    pub fn names_wrongly(&self) -> bool {
        self.answer.verdict == "named" && matches!(self.outcome, Outcome::Wrong | Outcome::Extra)
    }

    /// True if the named effects reduce the held-out error.
    pub fn fits_better(&self) -> bool {
        self.closed(|e| e.after).is_some_and(|closed| closed > 0.0)
    }
}

/// The cases of one sort.
pub fn of_sort(cases: &[Judged], sort: Sort) -> impl Iterator<Item = &Judged> + Clone {
    cases.iter().filter(move |case| case.truth.sort() == sort)
}
