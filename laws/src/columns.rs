//! Columns that are zero until something is written to them: most effects show at one joint of many.

use std::ops::{Index, IndexMut};

/// Numbers `[column][point]`, all zero at first. A column takes room when it is first written to.
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

    /// The column `index`, if anything was written to it.
    pub fn written(&self, index: usize) -> Option<&[f64]> {
        self.columns.get(index).map(Vec::as_slice).filter(|column| !column.is_empty())
    }

    /// The columns that were written to, each with its index.
    pub fn all_written(&self) -> impl Iterator<Item = (usize, &[f64])> {
        self.columns
            .iter()
            .enumerate()
            .filter(|(_, column)| !column.is_empty())
            .map(|(i, c)| (i, c.as_slice()))
    }

    /// Makes `change` of each column that was written to.
    pub fn change_written(&mut self, change: impl FnMut(&mut Vec<f64>)) {
        self.columns.iter_mut().filter(|column| !column.is_empty()).for_each(change);
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

    /// The column `index`; empty if nothing was written to it.
    fn index(&self, index: usize) -> &[f64] {
        &self.columns[index]
    }
}

impl IndexMut<usize> for Columns {
    /// The column `index` to write to.
    fn index_mut(&mut self, index: usize) -> &mut [f64] {
        let column = &mut self.columns[index];
        if column.is_empty() {
            *column = vec![0.0; self.points];
        }
        column
    }
}

impl From<Vec<Vec<f64>>> for Columns {
    /// All columns written, of equal length.
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
