//! A long recording in few rows: two rows keep the least and the greatest value of every column in each stretch of time, so that no peak is lost.

/// Collects rows into an overview.
#[derive(Debug)]
pub(crate) struct Overview {
    /// Largest number of rows, a multiple of four.
    most: usize,
    /// Number of rows of the recording that become two rows; 1 while all rows are kept.
    stride: u64,
    /// Rows of the present stretch so far.
    count: u64,
    least: Vec<f64>,
    greatest: Vec<f64>,
}

impl Overview {
    /// An overview of at most `most` rows, rounded to a multiple of four.
    pub fn new(most: usize) -> Self {
        let most = (most / 4).max(1) * 4;
        Self { most, stride: 1, count: 0, least: Vec::new(), greatest: Vec::new() }
    }

    /// Adds `row` to `columns`; the column number `time` has the time.
    pub fn push(&mut self, row: &[f64], columns: &mut [Vec<f64>], time: usize) {
        if self.stride == 1 {
            columns.iter_mut().zip(row).for_each(|(column, value)| column.push(*value));
        } else {
            self.add(row, time);
            if self.count == self.stride {
                self.finish(columns);
            }
        }
        if columns.first().is_some_and(|column| column.len() >= self.most) {
            for (index, column) in columns.iter_mut().enumerate() {
                fold(column, index == time);
            }
            self.stride = if self.stride == 1 { 4 } else { 2 * self.stride };
        }
    }

    fn add(&mut self, row: &[f64], time: usize) {
        if self.count == 0 {
            (self.least, self.greatest) = (row.to_vec(), row.to_vec());
        }
        for (index, &value) in row.iter().enumerate() {
            if index != time {
                self.least[index] = self.least[index].min(value);
            }
            self.greatest[index] = self.greatest[index].max(value);
        }
        self.count += 1;
    }

    /// Writes an incomplete stretch to `columns`.
    pub fn finish(&mut self, columns: &mut [Vec<f64>]) {
        let rows = match self.count {
            0 => &[][..],
            1 => &[&self.least][..],
            _ => &[&self.least, &self.greatest][..],
        };
        for row in rows {
            columns.iter_mut().zip(row.iter()).for_each(|(column, value)| column.push(*value));
        }
        self.count = 0;
    }
}

/// Makes two rows of each four: the first and the last time, the least and the greatest of all other columns.
fn fold(column: &mut Vec<f64>, is_time: bool) {
    let mut kept = 0;
    for start in (0..column.len()).step_by(4) {
        let four = &column[start..(start + 4).min(column.len())];
        let (least, greatest) = if is_time {
            (four[0], four[four.len() - 1])
        } else {
            let all = || four.iter().copied();
            (all().fold(f64::NAN, f64::min), all().fold(f64::NAN, f64::max))
        };
        (column[kept], column[kept + 1]) = (least, greatest);
        kept += 2;
    }
    column.truncate(kept);
}

#[cfg(test)]
mod tests {
    use super::Overview;

    /// `rows` rows of time, a ramp with one peak and one dip, and NaN.
    fn overview(rows: usize, most: usize) -> Vec<Vec<f64>> {
        let mut columns = vec![Vec::new(); 3];
        let mut overview = Overview::new(most);
        for row in 0..rows {
            let value = match row {
                777 => 1e6,
                778 => -1e6,
                _ => row as f64,
            };
            overview.push(&[row as f64 * 1e-3, value, f64::NAN], &mut columns, 0);
        }
        overview.finish(&mut columns);
        columns
    }

    #[test]
    fn a_short_recording_stays_as_it_is() {
        let columns = overview(39, 40);
        assert_eq!((columns[0].len(), columns[1][38]), (39, 38.0));
    }

    #[test]
    fn a_long_one_keeps_its_peaks_its_ends_and_the_order_of_time() {
        for rows in [1000, 12_345, 100_003] {
            let columns = overview(rows, 40);
            let [t, values, nothing] = &columns[..] else { panic!("three columns") };
            println!("{rows} rows become {}", t.len());
            assert!(t.len() <= 42 && t.len() >= 20);
            assert!(columns.iter().all(|column| column.len() == t.len()));
            assert!(t.windows(2).all(|pair| pair[0] < pair[1]), "{t:?}");
            assert_eq!((t[0], t[t.len() - 1]), (0.0, (rows - 1) as f64 * 1e-3));
            let most = values.iter().copied().fold(f64::NAN, f64::max);
            let least = values.iter().copied().fold(f64::NAN, f64::min);
            assert_eq!((least, most), (-1e6, 1e6));
            assert!(nothing.iter().all(|value| value.is_nan()));
        }
    }
}
