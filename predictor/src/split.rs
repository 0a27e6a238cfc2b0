//! Split of the windows into training, validation (early stopping) and test.
//!
//! A random split puts neighbouring samples on both sides, so that the test only interpolates. A split by block or, better, by
//! run makes it extrapolate. Report both results and rely on the second.

use crate::window::Window;
use rand::{SeedableRng, seq::SliceRandom};
use rand_chacha::ChaCha8Rng;

/// Shares of the windows; their sum is 1.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Fractions {
    /// Training share, in (0, 1].
    pub train: f64,
    /// Validation share, in \[0, 1).
    pub validation: f64,
    /// Test share, in \[0, 1).
    pub test: f64,
}

impl Fractions {
    /// 50 % training, 20 % validation, 30 % test (Erkaya 2018).
    pub const PAPER: Self = Self { train: 0.5, validation: 0.2, test: 0.3 };
}

/// Use of a run in [`by_run`].
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Part {
    /// The run is for training.
    Train,
    /// The run is for validation.
    Validation,
    /// The run is for the test.
    Test,
    /// The run is not used.
    Unused,
}

/// Windows by use; no window appears twice.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Split {
    /// Training windows.
    pub train: Vec<Window>,
    /// Validation windows; may be empty.
    pub validation: Vec<Window>,
    /// Test windows; may be empty.
    pub test: Vec<Window>,
}

/// The fractions are negative, not finite, without a training share, or their sum is not 1.
#[derive(Debug, thiserror::Error, PartialEq)]
#[error(
    "fractions {train} / {validation} / {test} of training / validation / test: give shares >= 0 that add up to 1, training > 0"
)]
pub struct FractionsError {
    /// Given training share.
    pub train: f64,
    /// Given validation share.
    pub validation: f64,
    /// Given test share.
    pub test: f64,
}

/// Distributes the windows at random, like MATLAB's `dividerand`; each part stays in chronological order.
///
/// # Errors
/// If the fractions are invalid.
pub fn at_random(windows: &[Window], fractions: Fractions, seed: u64) -> Result<Split, FractionsError> {
    let [_, validation, test] = counts(windows.len(), fractions)?;
    let mut order: Vec<usize> = (0..windows.len()).collect();
    order.shuffle(&mut ChaCha8Rng::seed_from_u64(seed));
    let (test, rest) = order.split_at(test);
    let (validation, train) = rest.split_at(validation);
    let take = |indices: &[usize]| {
        let mut sorted = indices.to_vec();
        sorted.sort_unstable();
        sorted.into_iter().map(|i| windows[i]).collect()
    };
    Ok(Split { train: take(train), validation: take(validation), test: take(test) })
}

/// Cuts every run into three blocks in chronological order: training, validation, test (MATLAB's `divideblock`, run by run). The
/// function drops the first `gap` windows of each later block; with a gap of memory + horizon of the layout, no sample belongs to
/// two blocks. It expects windows in the order of [`crate::window::windows`].
///
/// # Errors
/// If the fractions are invalid.
pub fn by_block(windows: &[Window], fractions: Fractions, gap: usize) -> Result<Split, FractionsError> {
    let mut split = Split::default();
    for run in windows.chunk_by(|a, b| a.run == b.run) {
        let [train, validation, _] = counts(run.len(), fractions)?;
        let (first, rest) = run.split_at(train);
        let (second, third) = rest.split_at(validation);
        split.train.extend(first);
        split.validation.extend(second.iter().skip(gap));
        split.test.extend(third.iter().skip(gap));
    }
    counts(windows.len(), fractions)?;
    Ok(split)
}

/// Splits by whole runs: `part` gives the use of the run with this index.
#[must_use]
pub fn by_run(windows: &[Window], part: impl Fn(usize) -> Part) -> Split {
    let take = |wanted| windows.iter().filter(|window| part(window.run) == wanted).copied().collect();
    Split { train: take(Part::Train), validation: take(Part::Validation), test: take(Part::Test) }
}

/// Number of windows per part; rounding favours the training share, as in `dividerand`.
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, clippy::cast_precision_loss)]
fn counts(windows: usize, fractions: Fractions) -> Result<[usize; 3], FractionsError> {
    let Fractions { train, validation, test } = fractions;
    let sensible = train > 0.0 && validation >= 0.0 && test >= 0.0;
    if !sensible || (train + validation + test - 1.0).abs() > 1.0e-9 {
        return Err(FractionsError { train, validation, test });
    }
    let share = |fraction: f64| (fraction * windows as f64).round() as usize;
    let test = share(test).min(windows);
    let validation = share(validation).min(windows - test);
    Ok([windows - test - validation, validation, test])
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::HashSet;

    fn windows(runs: usize, per_run: usize) -> Vec<Window> {
        let of_run = |run| (5..5 + per_run).map(move |present| Window { run, present, target: present + 3 });
        (0..runs).flat_map(of_run).collect()
    }

    fn sizes(split: &Split) -> [usize; 3] {
        [split.train.len(), split.validation.len(), split.test.len()]
    }

    #[test]
    fn a_random_split_uses_every_window_once_and_depends_on_the_seed_alone() {
        let all = windows(2, 100);
        let split = at_random(&all, Fractions::PAPER, 7).unwrap();
        assert_eq!(sizes(&split), [100, 40, 60]);
        let used: HashSet<_> = split.train.iter().chain(&split.validation).chain(&split.test).collect();
        assert_eq!(used.len(), all.len());
        assert_eq!(split, at_random(&all, Fractions::PAPER, 7).unwrap());
        assert_ne!(split, at_random(&all, Fractions::PAPER, 8).unwrap());
        let neighbours = split.test.iter().filter(|w| split.train.iter().any(|t| t.present + 1 == w.present));
        assert!(neighbours.count() > 10, "test windows sit between training windows");
    }

    #[test]
    fn blocks_share_no_sample() {
        let (memory, horizon) = (5, 3);
        let split = by_block(&windows(2, 100), Fractions::PAPER, memory + horizon).unwrap();
        assert_eq!(sizes(&split), [100, 40 - 16, 60 - 16]);
        let last = |part: &[Window]| part.iter().filter(|w| w.run == 0).map(|w| w.target).max().unwrap();
        let first =
            |part: &[Window]| part.iter().filter(|w| w.run == 0).map(|w| w.present - memory).min().unwrap();
        assert_eq!(first(&split.validation), last(&split.train) + 1);
        assert_eq!(first(&split.test), last(&split.validation) + 1);
    }

    #[test]
    fn whole_runs_go_where_the_caller_says() {
        let parts = [Part::Train, Part::Test, Part::Unused, Part::Validation];
        let split = by_run(&windows(4, 10), |run| parts[run]);
        assert_eq!(sizes(&split), [10, 10, 10]);
        assert!(split.test.iter().all(|w| w.run == 1) && split.validation.iter().all(|w| w.run == 3));
    }

    #[test]
    fn senseless_fractions_are_refused() {
        for (train, validation, test) in [
            (0.0, 0.5, 0.5),
            (0.5, 0.2, 0.2),
            (1.2, -0.1, -0.1),
            (f64::NAN, 0.2, 0.3),
            (0.5, f64::INFINITY, 0.0),
        ] {
            let fractions = Fractions { train, validation, test };
            assert!(at_random(&windows(1, 10), fractions, 0).is_err());
            assert!(by_block(&windows(1, 10), fractions, 0).is_err());
            assert!(by_block(&[], fractions, 0).is_err());
        }
    }
}
