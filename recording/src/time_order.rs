//! Sorting rows whose time stamps come late, and dropping repeats.

/// Number of rows out of order.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub(crate) struct Reordered {
    /// Rows with a stamp before that of an earlier row.
    pub late: u64,
    /// Rows with the stamp of another row: all but the first are dropped.
    pub repeated: u64,
}

impl Reordered {
    /// The corrections, in one sentence.
    pub fn in_words(self) -> Option<String> {
        let part = |count: u64, what: &str| (count > 0).then(|| format!("{count} {what}"));
        let parts = [part(self.late, "late, sorted by time"), part(self.repeated, "repeated, dropped")];
        let parts: Vec<String> = parts.into_iter().flatten().collect();
        (!parts.is_empty()).then(|| format!("time stamps: {}", parts.join("; ")))
    }
}

/// Sorts the rows of `columns` by the column `time` and drops repeats. `None` if the clock jumps back instead of rows coming late: then the times are steadier
/// in the order of the file, or the `positions` travel farther when sorted, since sorting mixes two motions.
pub(crate) fn sort(columns: &mut [Vec<f64>], time: usize, positions: &[usize]) -> Option<Reordered> {
    let t = &columns[time];
    if clock_jumps_back(t) {
        return None;
    }
    let mut latest = f64::NEG_INFINITY;
    let is_late = |t: &&f64| {
        let late = **t < latest;
        latest = latest.max(**t);
        late
    };
    let late = t.iter().filter(is_late).count();
    let mut order: Vec<usize> = (0..t.len()).collect();
    // Stable: of rows with one stamp the first in the file stays.
    order.sort_by(|&a, &b| t[a].total_cmp(&t[b]));
    let file: Vec<usize> = (0..t.len()).collect();
    let way = |order: &[usize]| -> f64 {
        let of =
            |column: &Vec<f64>| order.windows(2).map(|w| (column[w[1]] - column[w[0]]).abs()).sum::<f64>();
        positions.iter().map(|&position| of(&columns[position])).sum()
    };
    if way(&order) > MIXED * way(&file) {
        return None;
    }
    // Only after the comparison of the travel: two motions with the same stamps are no repeats.
    order.dedup_by(|later, earlier| t[*later] == t[*earlier]);
    let repeated = (t.len() - order.len()) as u64;
    for column in columns.iter_mut() {
        *column = order.iter().map(|&row| column[row]).collect();
    }
    Some(Reordered { late: late as u64, repeated })
}

/// True if the times `t` come from a clock that jumps back, not from late rows. A late row leaves a gap at its place and fills it when sorted. The times of a
/// clock that jumps back are steady before and behind the jump, and mixed when sorted. If the times behind a jump don't reach those before it, sorting mixes
/// nothing.
///
/// The test models the deviations of the time steps from their median with a Laplace distribution, in the order of the file and sorted. The order of the file pays
/// for place and size of each jump as in the Bayesian information criterion (Schwarz 1978): so stamps that jitter by more than a step are not taken for jumps.
fn clock_jumps_back(t: &[f64]) -> bool {
    let runs = t.chunk_by(|before, after| before <= after);
    let mut spans: Vec<[f64; 2]> = runs.map(|run| [run[0], run[run.len() - 1]]).collect();
    let jumps = spans.len().saturating_sub(1) as f64;
    spans.sort_by(|a, b| a[0].total_cmp(&b[0]));
    if spans.windows(2).all(|pair| pair[0][1] <= pair[1][0]) {
        return false;
    }
    let mut sorted = t.to_vec();
    sorted.sort_by(f64::total_cmp);
    let forward = |t: &[f64]| -> Vec<f64> {
        t.windows(2).map(|pair| pair[1] - pair[0]).filter(|step| *step >= 0.0).collect()
    };
    let [file, sorted] = [forward(t), forward(&sorted)];
    let mut steps = file.clone();
    if steps.is_empty() {
        return false;
    }
    let middle = steps.len() / 2;
    let median_step = *steps.select_nth_unstable_by(middle, f64::total_cmp).1;
    // The deviation of a gap is limited to that of a missing step.
    let mean_deviation = |steps: &[f64]| {
        steps.iter().map(|step| (step - median_step).abs().min(median_step)).sum::<f64>() / steps.len() as f64
    };
    let (count, gain) = (sorted.len() as f64, (mean_deviation(&sorted) / mean_deviation(&file)).ln());
    // Exactly even times give infinity, and NaN if sorting leaves them even.
    count * gain > 2.0 * jumps * count.ln()
}

/// Two motions mixed row by row travel at least this many times as far as one after the other.
const MIXED: f64 = 2.0;

#[cfg(test)]
mod tests {
    use super::{Reordered, sort};

    fn columns(t: &[f64]) -> Vec<Vec<f64>> {
        vec![t.to_vec(), t.iter().map(|t| t.sin()).collect()]
    }

    #[test]
    fn late_and_repeated_stamps_are_put_right() {
        let mut mixed = columns(&[0.0, 0.1, 0.3, 0.2, 0.4, 0.4, 0.5]);
        let done = sort(&mut mixed, 0, &[1]);
        assert_eq!(done, Some(Reordered { late: 1, repeated: 1 }));
        assert_eq!(mixed, columns(&[0.0, 0.1, 0.2, 0.3, 0.4, 0.5]));
    }

    /// At rest and in motion: the test distinguishes a clock that jumps back from late rows; with jittering stamps, if the jump is by many steps.
    #[test]
    fn a_clock_that_jumps_back_is_told_from_rows_that_come_late() {
        let shaking =
            |k: usize, shake: f64| 0.01 * (k as f64 + shake * (((k * 7919) % 101) as f64 / 101.0 - 0.5));
        for shake in [0.0, 0.3, 0.8] {
            let t: Vec<f64> = (0..1000).map(|k| shaking(k, shake)).collect();
            for speed in [0.0, 1.0] {
                let with = |t: &[f64], order: &[usize]| {
                    vec![t.to_vec(), order.iter().map(|k| (speed * 0.01 * *k as f64).sin()).collect()]
                };
                let order: Vec<usize> = (0..1000).collect();
                let small: &[f64] = if shake == 0.0 { &[0.025, 0.12] } else { &[] };
                for &jump in small.iter().chain(&[0.5, 3.0]) {
                    let back: Vec<f64> =
                        t.iter().enumerate().map(|(k, t)| if k < 600 { *t } else { t - jump }).collect();
                    assert_eq!(
                        sort(&mut with(&back, &order), 0, &[1]),
                        None,
                        "{jump} s back, {shake}, {speed}"
                    );
                }
                for late in [2, 40, 300] {
                    let mut order = order.clone();
                    (0..5).for_each(|k| {
                        order[400 + late * k % 500..=400 + late * k % 500 + late.min(99)].rotate_left(1)
                    });
                    let stamps: Vec<f64> = order.iter().map(|k| t[*k]).collect();
                    let mut columns = with(&stamps, &order);
                    let done = sort(&mut columns, 0, &[1])
                        .unwrap_or_else(|| panic!("{late} late, {shake}, {speed}"));
                    assert!(done.late > 0 && done.repeated == 0, "{done:?}");
                    assert_eq!(columns[0], t);
                }
            }
        }
    }

    #[test]
    fn stamps_that_shake_by_more_than_a_step_are_sorted() {
        for shake in [3.0, 10.0] {
            let noise = |k: i32| (f64::from(k).sin() * 43_758.545).rem_euclid(1.0);
            let t: Vec<f64> = (0..1000).map(|k| f64::from(k) + shake * noise(k)).collect();
            let done = sort(&mut [t, vec![0.0; 1000]], 0, &[1]).expect("late rows");
            assert!(done.late > 100, "{done:?}");
        }
    }

    #[test]
    fn pieces_in_another_order_are_put_in_order() {
        let t: Vec<f64> = (0..100).map(|k| 0.01 * f64::from(k) - if k < 50 { 0.0 } else { 7.0 }).collect();
        assert_eq!(sort(&mut columns(&t), 0, &[1]), Some(Reordered { late: 50, repeated: 0 }));
    }

    #[test]
    fn a_clock_that_begins_again_is_no_late_stamp() {
        let t: Vec<f64> = (0..100).map(|k| 0.01 * f64::from(k % 50) + 1e-4 * f64::from(k / 50)).collect();
        let q = (0..100).map(|k| if k < 50 { 0.0 } else { 1.0 }).collect();
        assert_eq!(sort(&mut [t, q], 0, &[1]), None);
    }
}
