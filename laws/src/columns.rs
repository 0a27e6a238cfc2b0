//! Columns that are zero until something is written to them: most effects show at one joint of many.

use std::ops::{Index, IndexMut};

use crate::scene::Prediction;

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

/// By how much an effect changes what is predicted: a [`Prediction`] less another.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Change {
    /// Joint torques, `[joint][point]`, N·m (N).
    pub torque: Columns,
    /// Tool position in the base frame, `[axis][point]`, m.
    pub tool: Columns,
    /// Link-side position of each joint, `[joint][point]`, rad (m).
    pub link: Columns,
}

impl Change {
    /// No change, for an arm of `dof` joints and a motion of `points`.
    pub fn nothing(dof: usize, points: usize) -> Change {
        let joints = Columns::zero(dof, points);
        Change { torque: joints.clone(), tool: Columns::zero(3, points), link: joints }
    }

    /// What has changed from `before` to `after`.
    pub fn between(before: &Prediction, mut after: Prediction) -> Change {
        after.subtract(before);
        Change { torque: after.torque.into(), tool: Vec::from(after.tool).into(), link: after.link.into() }
    }

    /// Adds `factor` times `other`, of the same shape.
    pub fn add(&mut self, other: &Change, factor: f64) {
        for (columns, other) in self.parts_mut().into_iter().zip([&other.torque, &other.tool, &other.link]) {
            columns.add(other, factor);
        }
    }

    /// Multiplies every number by `factor`.
    pub fn scale(&mut self, factor: f64) {
        for columns in self.parts_mut() {
            columns.change_written(|column| column.iter_mut().for_each(|x| *x *= factor));
        }
    }

    /// Torques, tool and links.
    pub(crate) fn parts_mut(&mut self) -> [&mut Columns; 3] {
        [&mut self.torque, &mut self.tool, &mut self.link]
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
