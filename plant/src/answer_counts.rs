//! Counts of the active controller's answers by their reported status.

use freeplay_shm::CommandStatus;
use serde::Serialize;

/// Answers of a run by their status; missing answers do not count.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct AnswerCounts {
    /// Computed as intended.
    pub ok: u64,
    /// A quadratic programme had no solution, or the planning for it found none before the run; the answer is the controller's own
    /// fallback.
    pub qp_failed: u64,
    /// A quadratic programme stopped at its limit of iterations.
    pub qp_limit: u64,
    /// The controller gave no answer; the gate took its fallback.
    pub no_answer: u64,
    /// A status unknown to this version; the gate refused the answer.
    pub unknown: u64,
    /// Answers whose quadratic programme needed iterations, since a limit was active; in the others the unconstrained minimiser kept all
    /// limits.
    pub iterated: u64,
    /// Answers of any controller with impossible times, which the latencies exclude.
    pub implausible_times: u64,
}

impl AnswerCounts {
    /// Counts an answer with the reported `status` and number of `iterations` of its quadratic programme.
    pub fn add(&mut self, status: u32, iterations: u32) {
        self.iterated += u64::from(iterations > 0);
        let count = match CommandStatus::from_code(status) {
            Some(CommandStatus::Ok) => &mut self.ok,
            Some(CommandStatus::QpFailed) => &mut self.qp_failed,
            Some(CommandStatus::QpLimit) => &mut self.qp_limit,
            Some(CommandStatus::NoAnswer) => &mut self.no_answer,
            None => &mut self.unknown,
        };
        *count += 1;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_status_has_a_count_of_its_own() {
        let mut counts = AnswerCounts::default();
        for (status, times) in [(0, 5), (1, 4), (2, 3), (3, 2), (77, 1)] {
            (0..times).for_each(|time| counts.add(status, time));
        }
        let expected = AnswerCounts {
            ok: 5,
            qp_failed: 4,
            qp_limit: 3,
            no_answer: 2,
            unknown: 1,
            iterated: 4 + 3 + 2 + 1,
            implausible_times: 0,
        };
        assert_eq!(counts, expected);
    }
}
