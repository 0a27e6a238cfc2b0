//! Columns that are zero until a value is written: most effects concern one joint of many.

use std::ops::{Index, IndexMut};

/// Numbers `[column][point]`, initially zero. A column allocates memory when it is first written.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Columns {
    points: usize,
    columns: Vec<Vec<f64>>,
}

impl Columns {
    /// `count` columns of `points` zeros.
    pub fn zero(count: usize, points: usize) -> Columns {
        Columns { points, columns: vec![Vec::new(); count] }
    }

    /// The column `index`, if it has been written.
    pub fn written(&self, index: usize) -> Option<&[f64]> {
        self.columns.get(index).map(Vec::as_slice).filter(|column| !column.is_empty())
    }

    /// The written columns, each with its index.
    pub fn all_written(&self) -> impl Iterator<Item = (usize, &[f64])> {
        self.columns
            .iter()
            .enumerate()
            .filter(|(_, column)| !column.is_empty())
            .map(|(i, c)| (i, c.as_slice()))
    }

    /// Applies `change` to each written column.
    pub fn change_written(&mut self, change: impl FnMut(&mut Vec<f64>)) {
        self.columns.iter_mut().filter(|column| !column.is_empty()).for_each(change);
    }

    /// The columns on other `points`: `resampled` gives the values of a written column there.
    #[must_use]
    pub fn resampled(&self, points: usize, resampled: impl Fn(&[f64]) -> Vec<f64>) -> Columns {
        let of = |column: &Vec<f64>| if column.is_empty() { Vec::new() } else { resampled(column) };
        Columns { points, columns: self.columns.iter().map(of).collect() }
    }

    /// Releases the columns that hold zeros alone.
    pub(crate) fn release_zeros(&mut self) {
        self.change_written(|column| {
            if column.iter().all(|x| *x == 0.0) {
                *column = Vec::new();
            }
        });
    }

    /// Adds `factor` times `other`, of the same shape.
    pub fn add(&mut self, other: &Columns, factor: f64) {
        for (index, column) in other.all_written() {
            self[index].iter_mut().zip(column).for_each(|(x, other)| *x += factor * other);
        }
    }
}

impl Index<usize> for Columns {
    type Output = [f64];

    /// The column `index`; empty if it has not been written.
    fn index(&self, index: usize) -> &[f64] {
        &self.columns[index]
    }
}

impl IndexMut<usize> for Columns {
    /// The column `index` for writing.
    fn index_mut(&mut self, index: usize) -> &mut [f64] {
        let column = &mut self.columns[index];
        if column.is_empty() {
            *column = vec![0.0; self.points];
        }
        column
    }
}

impl From<Vec<Vec<f64>>> for Columns {
    /// All columns, as written, of equal length.
    fn from(columns: Vec<Vec<f64>>) -> Columns {
        Columns { points: columns.first().map_or(0, Vec::len), columns }
    }
}

#[cfg(test)]
mod tests {
    use super::Columns;

    #[test]
    fn a_column_takes_room_when_it_is_written_to() {
        let mut columns = Columns::zero(3, 4);
        columns[1][2] = 5.0;
        assert_eq!(columns.all_written().collect::<Vec<_>>(), [(1, [0.0, 0.0, 5.0, 0.0].as_slice())]);
        let mut sum = Columns::zero(3, 4);
        sum.add(&columns, -2.0);
        assert_eq!(sum.written(1), Some([0.0, 0.0, -10.0, 0.0].as_slice()));
        assert_eq!((sum.written(0), sum.written(7)), (None, None));
    }
}
