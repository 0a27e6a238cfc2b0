//! A model's prediction for each measured channel, and the change of it by an effect.

use crate::columns::Columns;

/// The model's values for each measured channel.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Prediction {
    /// Joint torques, `[joint][point]`, N·m (N).
    pub torque: Vec<Vec<f64>>,
    /// The part of them from the nominal friction of the drives.
    pub friction: Vec<Vec<f64>>,
    /// Tool position in the base frame, `[axis][point]`, m.
    pub tool: [Vec<f64>; 3],
    /// Link-side position of each joint, `[joint][point]`, rad (m).
    pub link: Vec<Vec<f64>>,
}

impl Prediction {
    /// All zeros, for an arm of `dof` joints and a motion of `points`.
    pub fn blank(dof: usize, points: usize) -> Prediction {
        let joints = || vec![vec![0.0; points]; dof];
        let tool = [const { Vec::new() }; 3].map(|_: Vec<f64>| vec![0.0; points]);
        Prediction { torque: joints(), friction: joints(), tool, link: joints() }
    }

    /// Every column.
    pub fn columns_mut(&mut self) -> impl Iterator<Item = &mut Vec<f64>> {
        let joints = self.torque.iter_mut().chain(&mut self.friction).chain(&mut self.link);
        joints.chain(&mut self.tool)
    }

    /// Every column, in the same order.
    pub fn columns(&self) -> impl Iterator<Item = &Vec<f64>> {
        self.torque.iter().chain(&self.friction).chain(&self.link).chain(&self.tool)
    }

    /// Adds `change`, point by point.
    pub fn add(&mut self, change: &Change) {
        let parts = [
            (&mut self.torque[..], &change.torque),
            (&mut self.tool, &change.tool),
            (&mut self.link, &change.link),
        ];
        for (columns, change) in parts {
            for (index, change) in change.all_written() {
                columns[index].iter_mut().zip(change).for_each(|(x, change)| *x += change);
            }
        }
    }

    /// Subtracts `other`, point by point.
    pub fn subtract(&mut self, other: &Prediction) {
        for (column, other) in self.columns_mut().zip(other.columns()) {
            column.iter_mut().zip(other).for_each(|(x, other)| *x -= other);
        }
    }
}

/// The change of a prediction by an effect: a [`Prediction`] minus another.
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

    /// The change from `before` to `after`.
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
