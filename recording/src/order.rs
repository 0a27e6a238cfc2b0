//! Rows whose time stamps repeat or come late: put in order, repeats dropped.

/// How many rows were out of order.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub(crate) struct Reordered {
    /// Rows with a stamp before that of an earlier row.
    pub late: u64,
    /// Rows with the stamp of another row: all but the first are dropped.
    pub repeated: u64,
}

impl Reordered {
    /// What was done, in one sentence.
    pub fn in_words(self) -> Option<String> {
        let part = |count: u64, what: &str| (count > 0).then(|| format!("{count} {what}"));
        let parts = [part(self.late, "late, put in order"), part(self.repeated, "repeated, dropped")];
        let parts: Vec<String> = parts.into_iter().flatten().collect();
        (!parts.is_empty()).then(|| format!("time stamps: {}", parts.join("; ")))
    }
}

/// Sorts the rows of `columns` by the column `time` and drops repeats; `None` if that makes the `positions` go farther to and fro than
/// they do in the order of the file, as it does where a clock begins again and two motions would be mixed.
pub(crate) fn sort(columns: &mut [Vec<f64>], time: usize, positions: &[usize]) -> Option<Reordered> {
    let t = &columns[time];
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
    // Behind the look at the way: two motions with the same stamps are no repeats.
    order.dedup_by(|later, earlier| t[*later] == t[*earlier]);
    let repeated = (t.len() - order.len()) as u64;
    for column in columns.iter_mut() {
        *column = order.iter().map(|&row| column[row]).collect();
    }
    Some(Reordered { late: late as u64, repeated })
}

/// Two motions that are mixed row by row go this many times as far as one after the other, at least.
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

    #[test]
    fn a_clock_that_begins_again_is_no_late_stamp() {
        let t: Vec<f64> = (0..100).map(|k| 0.01 * f64::from(k % 50) + 1e-4 * f64::from(k / 50)).collect();
        let q = (0..100).map(|k| if k < 50 { 0.0 } else { 1.0 }).collect();
        assert_eq!(sort(&mut [t, q], 0, &[1]), None);
    }
}
