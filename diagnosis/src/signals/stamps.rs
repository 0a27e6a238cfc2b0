//! Time stamps that shake while the samples don't: a clock that reads late now and then, a bus that delivers in bursts.

use std::ops::Range;

/// A lost sample is told by this many stamps on either side: the median of so many that shake by half a step stands to a tenth of a step.
const AROUND: usize = 31;
/// Samples on either side of where a loss is seen best among which it is sought: the medians hardly change from one row to the next.
const NEAR: usize = 3;

/// The stamps `t` of samples that were taken at even times, of which some were lost, and stamped late by chance: the straight line
/// through them, over the count of all samples. Stretch by stretch of `stretches`; `None` where no such line fits.
pub(crate) fn steadied(t: &[f64], stretches: impl Iterator<Item = Range<usize>>) -> Option<Vec<f64>> {
    let mut steady = t.to_vec();
    for rows in stretches {
        if rows.len() > 2 * AROUND {
            steady[rows.clone()].copy_from_slice(&line(&t[rows])?);
        }
    }
    steady.windows(2).all(|pair| pair[0] < pair[1]).then_some(steady)
}

/// The steadied stamps of one stretch.
fn line(t: &[f64]) -> Option<Vec<f64>> {
    let mut counts: Vec<f64> = (0..t.len()).map(|k| k as f64).collect();
    let (start, step) = fitted(&counts, t);
    for (row, lost) in losses(&off(&counts, t, start, step)) {
        counts[row..].iter_mut().for_each(|count| *count += lost);
    }
    let (start, step) = fitted(&counts, t);
    let left = off(&counts, t, start, step);
    // A clock that drifts by a step is left alone.
    let drifts = left.chunks(AROUND).any(|part| median(part).round() != 0.0);
    (step > 0.0 && !drifts).then(|| counts.iter().map(|count| start + step * count).collect())
}

/// Where samples were lost before a row, and how many.
fn losses(off: &[f64]) -> Vec<(usize, f64)> {
    let later = |row: usize| median(&off[row..row + AROUND]) - median(&off[row - AROUND..row]);
    // No loss hides where two stamps a window apart are no farther than they should be.
    let suspect = |row: &usize| off[row + AROUND - 1] - off[row - AROUND] > 0.0 && later(*row).round() > 0.0;
    let rows: Vec<usize> = (AROUND..off.len().saturating_sub(AROUND)).filter(suspect).collect();
    rows.chunk_by(|a, b| b - a <= NEAR)
        .map(|run| {
            let best = run.iter().copied().max_by(|&a, &b| later(a).total_cmp(&later(b))).unwrap_or(run[0]);
            let jump = |row: &usize| off[*row] - off[row - 1];
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

/// By how many steps each stamp is later than the line.
fn off(counts: &[f64], t: &[f64], start: f64, step: f64) -> Vec<f64> {
    counts.iter().zip(t).map(|(count, t)| (t - start) / step - count).collect()
}

fn median(x: &[f64]) -> f64 {
    let mut sorted = x.to_vec();
    *sorted.select_nth_unstable_by(x.len() / 2, f64::total_cmp).1
}

#[cfg(test)]
mod tests {
    use super::steadied;

    /// Stamps of 1000 samples, of which those in `lost` are missing, late by up to `shake` of the step 0.01 s.
    fn stamps(lost: &[usize], shake: f64) -> Vec<f64> {
        let late = |k: usize| shake * (((k * 7919) % 101) as f64 / 101.0);
        (0..1000).filter(|k| !lost.contains(k)).map(|k| 0.01 * (k as f64 + late(k))).collect()
    }

    #[test]
    fn shaking_stamps_are_steadied_and_lost_samples_stay_lost() {
        for lost in [vec![], vec![300], vec![200, 201, 640]] {
            let shaking = stamps(&lost, 0.6);
            let steady = steadied(&shaking, std::iter::once(0..shaking.len())).expect("a line");
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
        let steady = steadied(&bursts, std::iter::once(0..bursts.len())).expect("a line");
        assert!(steady.windows(2).all(|pair| (pair[1] - pair[0] - 0.01).abs() < 1e-5));
        let drifting: Vec<f64> =
            (0..1000).map(|k| 0.01 * f64::from(k) + 1e-6 * f64::from(k).powi(2)).collect();
        assert!(steadied(&drifting, std::iter::once(0..drifting.len())).is_none());
    }
}
