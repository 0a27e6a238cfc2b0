//! Jitter of time stamps of evenly spaced samples: a clock that sometimes reads late, a bus that delivers in bursts.

use std::ops::Range;

use crate::statistics::quantile;

/// Number of stamps on either side of a row that detect a lost sample: with a jitter of half a step, the median of so many has an error of a tenth of
/// a step.
const AROUND: usize = 31;
/// Samples on either side of the best row among which the search locates a loss: the medians hardly change from one row to the next.
const NEAR: usize = 3;

/// Corrected stamps `t` of evenly spaced samples, some of them lost, whose stamps are late at random: the straight line through the stamps over the
/// count of all samples. The function treats each stretch of `stretches` alone; `None` if no such line fits.
pub(crate) fn corrected_stamps(t: &[f64], stretches: impl Iterator<Item = Range<usize>>) -> Option<Vec<f64>> {
    let mut steady = t.to_vec();
    for rows in stretches {
        if rows.len() > 2 * AROUND {
            steady[rows.clone()].copy_from_slice(&line(&t[rows])?);
        }
    }
    steady.windows(2).all(|pair| pair[0] < pair[1]).then_some(steady)
}

/// The corrected stamps of one stretch.
fn line(t: &[f64]) -> Option<Vec<f64>> {
    let mut counts: Vec<f64> = (0..t.len()).map(|k| k as f64).collect();
    let (start, step) = fitted(&counts, t);
    for (row, lost) in losses(&lateness(&counts, t, start, step)) {
        counts[row..].iter_mut().for_each(|count| *count += lost);
    }
    let (start, step) = fitted(&counts, t);
    let left = lateness(&counts, t, start, step);
    // A clock that drifts by a step stays uncorrected.
    let drifts = left.chunks(AROUND).any(|part| median(part).round() != 0.0);
    (step > 0.0 && !drifts).then(|| counts.iter().map(|count| start + step * count).collect())
}

/// The rows before which samples were lost, and the number of lost samples.
fn losses(lateness: &[f64]) -> Vec<(usize, f64)> {
    let later = |row: usize| median(&lateness[row..row + AROUND]) - median(&lateness[row - AROUND..row]);
    // A loss requires two stamps a window apart to be farther apart than expected.
    let suspect =
        |row: &usize| lateness[row + AROUND - 1] - lateness[row - AROUND] > 0.0 && later(*row).round() > 0.0;
    let rows: Vec<usize> = (AROUND..lateness.len().saturating_sub(AROUND)).filter(suspect).collect();
    rows.chunk_by(|a, b| b - a <= NEAR)
        .map(|run| {
            let best = run.iter().copied().max_by(|&a, &b| later(a).total_cmp(&later(b))).unwrap_or(run[0]);
            let jump = |row: &usize| lateness[*row] - lateness[row - 1];
            let row = (best - NEAR..=best + NEAR).max_by(|a, b| jump(a).total_cmp(&jump(b))).unwrap_or(best);
            (row, later(best).round())
        })
        .collect()
}

/// Start and step of the straight line through `t` over `counts`.
fn fitted(counts: &[f64], t: &[f64]) -> (f64, f64) {
    let mean = |x: &[f64]| x.iter().sum::<f64>() / x.len() as f64;
    let (count, time) = (mean(counts), mean(t));
    let [both, squares] = counts.iter().zip(t).fold([0.0, 0.0], |[both, squares], (c, t)| {
        [both + (c - count) * (t - time), squares + (c - count).powi(2)]
    });
    let step = both / squares;
    (time - step * count, step)
}

/// Lateness of each stamp relative to the line, in steps.
fn lateness(counts: &[f64], t: &[f64], start: f64, step: f64) -> Vec<f64> {
    counts.iter().zip(t).map(|(count, t)| (t - start) / step - count).collect()
}

fn median(x: &[f64]) -> f64 {
    quantile(x.to_vec(), 0.5)
}

#[cfg(test)]
mod tests {
    use super::corrected_stamps;

    /// Stamps of 1000 samples, of which those in `lost` are missing, late by up to `shake` of the step 0.01 s.
    fn stamps(lost: &[usize], shake: f64) -> Vec<f64> {
        let late = |k: usize| shake * (((k * 7919) % 101) as f64 / 101.0);
        (0..1000).filter(|k| !lost.contains(k)).map(|k| 0.01 * (k as f64 + late(k))).collect()
    }

    #[test]
    fn shaking_stamps_are_steadied_and_lost_samples_stay_lost() {
        for lost in [vec![], vec![300], vec![200, 201, 640]] {
            let shaking = stamps(&lost, 0.6);
            let steady = corrected_stamps(&shaking, std::iter::once(0..shaking.len())).expect("a line");
            let exact = stamps(&lost, 0.0);
            let late = steady.iter().zip(&exact).map(|(a, b)| a - b).collect::<Vec<_>>();
            let (least, most) = late.iter().fold((f64::MAX, f64::MIN), |(l, m), x| (l.min(*x), m.max(*x)));
            println!(
                "{} lost: {:.2} to {:.2} steps late throughout",
                lost.len(),
                100.0 * least,
                100.0 * most
            );
            assert!(most - least < 1e-4, "late by a constant: the mean of how they shake");
        }
    }

    #[test]
    fn bursts_are_spread_and_a_clock_that_changes_its_rate_is_left_alone() {
        let bursts: Vec<f64> = (0..1000).map(|k| f64::from(k / 5) * 0.05 + f64::from(k % 5) * 1e-6).collect();
        let steady = corrected_stamps(&bursts, std::iter::once(0..bursts.len())).expect("a line");
        assert!(steady.windows(2).all(|pair| (pair[1] - pair[0] - 0.01).abs() < 1e-5));
        let drifting: Vec<f64> =
            (0..1000).map(|k| 0.01 * f64::from(k) + 1e-6 * f64::from(k).powi(2)).collect();
        assert!(corrected_stamps(&drifting, std::iter::once(0..drifting.len())).is_none());
    }
}
