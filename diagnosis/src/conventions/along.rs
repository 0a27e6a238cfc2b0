//! The model along a motion: the columns that can explain the torque of each joint, and their inner products.

use std::cell::OnceCell;

use freeplay_arm::Arm;
use nalgebra::DMatrix;

use super::bodies::{Bodies, PARAMETERS, Parts};
use super::change::Physics;
use crate::signals::stuck::MOVES;

/// The columns of a joint with the model's masses.
#[derive(Clone, Copy, PartialEq)]
pub(super) enum Column {
    /// Constant one: an offset.
    One,
    /// Direction of the joint's motion.
    Turns,
    /// Its velocity.
    Speed,
    /// Its acceleration.
    Acceleration,
    /// Its position.
    Position,
    /// Its velocity times its speed.
    Drag,
    /// Acceleration, velocity and direction (0 to 2) of the joint before (0) or behind (1).
    Other(usize, usize),
    /// Torque due to the arm's motion (0), and due to gravity along each axis (1 to 3).
    Model(usize),
}

impl Column {
    /// Number of columns.
    fn count() -> usize {
        Self::Model(3).place() + 1
    }

    /// Index of the column.
    pub fn place(self) -> usize {
        match self {
            Column::One => 0,
            Column::Turns => 1,
            Column::Speed => 2,
            Column::Acceleration => 3,
            Column::Position => 4,
            Column::Drag => 5,
            Column::Other(joint, what) => 6 + 3 * joint + what,
            Column::Model(part) => 12 + part,
        }
    }
}

/// The model along a motion.
pub(super) struct Along {
    /// By joint and column.
    columns: Vec<Vec<Vec<f64>>>,
    /// Inner products of the columns, by joint.
    products: Vec<DMatrix<f64>>,
    /// Position of the tool, by axis; m.
    pub tool: [Vec<f64>; 3],
    /// Torques of a load and of each link by body, joint, part and row.
    masses: OnceCell<Vec<Vec<[Vec<f64>; 4]>>>,
}

/// Parameters of a load: its mass and three first moments. The inertia about its own centre is left out, since a tool is small.
pub(super) const LOADS: usize = 4;

impl Along {
    /// The columns of `arm` along the positions `motion[0]`, velocities and accelerations, `[joint][row]`.
    pub fn new(arm: &Arm, motion: &[Vec<Vec<f64>>; 3], has_torques: bool) -> Self {
        let (n, rows) = (arm.dof(), motion[0][0].len());
        let mut columns = vec![vec![vec![0.0; rows]; Column::count()]; if has_torques { n } else { 0 }];
        let mut tool = [const { Vec::new() }; 3];
        for (row, bodies) in (0..rows).map(|row| (row, posture(arm, motion, row))) {
            tool.iter_mut().zip(bodies.tool().iter()).for_each(|(column, x)| column.push(*x));
            if has_torques {
                let mut add = |joint: usize, parts: Parts| {
                    columns[joint][Column::Model(0).place()][row] += parts.inertial;
                    for (axis, x) in parts.gravity.into_iter().enumerate() {
                        columns[joint][Column::Model(1 + axis).place()][row] += x;
                    }
                };
                (0..n).for_each(|body| bodies.link(body, &mut add));
            }
        }
        for (joint, columns) in columns.iter_mut().enumerate() {
            let rotor = arm.joints()[joint].rotor_inertia;
            let [q, v, a] = motion;
            let inertial = &mut columns[Column::Model(0).place()];
            inertial.iter_mut().zip(&a[joint]).for_each(|(x, a)| *x += rotor * a);
            columns[Column::One.place()].fill(1.0);
            columns[Column::Turns.place()] = directions(&v[joint]);
            columns[Column::Speed.place()].clone_from(&v[joint]);
            columns[Column::Acceleration.place()].clone_from(&a[joint]);
            columns[Column::Position.place()].clone_from(&q[joint]);
            columns[Column::Drag.place()] = v[joint].iter().map(|v| v * v.abs()).collect();
            let others = [joint.checked_sub(1), Some(joint + 1).filter(|next| *next < n)];
            for (side, other) in others.into_iter().enumerate() {
                let Some(other) = other else { continue };
                columns[Column::Other(side, 0).place()].clone_from(&a[other]);
                columns[Column::Other(side, 1).place()].clone_from(&v[other]);
                columns[Column::Other(side, 2).place()] = directions(&v[other]);
            }
        }
        let products = columns.iter().map(|columns| {
            DMatrix::from_fn(Column::count(), Column::count(), |i, k| {
                if i <= k { dot(&columns[i], &columns[k]) } else { 0.0 }
            })
        });
        let products = products.map(|mut half: DMatrix<f64>| {
            half.fill_lower_triangle_with_upper_triangle();
            half
        });
        Self { products: products.collect(), columns, tool, masses: OnceCell::new() }
    }

    /// A column of `joint`.
    pub fn column(&self, joint: usize, column: Column) -> &[f64] {
        &self.columns[joint][column.place()]
    }

    /// Inner products of the columns of `joint`, by index.
    pub fn products(&self, joint: usize) -> &DMatrix<f64> {
        &self.products[joint]
    }

    /// Torque of the arm at `joint` under `weights` of motion and gravity.
    pub fn model(&self, joint: usize, weights: &[f64; 4]) -> Vec<f64> {
        let parts: [&[f64]; 4] = [0, 1, 2, 3].map(|part| self.column(joint, Column::Model(part)));
        weighed(parts, weights)
    }

    /// Columns of physics that all joints share, by index and joint, under `weights` of motion and gravity.
    pub fn shared(&self, arm: &Arm, physics: &[Physics], weights: &[f64; 4]) -> Vec<Vec<Vec<f64>>> {
        let bodies = physics.iter().flat_map(|physics| match physics {
            Physics::Payload => (0..LOADS).collect(),
            Physics::Link(joint) => vec![LOADS + joint],
            _ => Vec::new(),
        });
        let bodies: Vec<usize> = bodies.collect();
        if bodies.is_empty() {
            return Vec::new();
        }
        let masses = self.masses.get_or_init(|| self.by_mass(arm));
        let of_joint = |parts: &[Vec<f64>; 4]| weighed(parts.each_ref().map(Vec::as_slice), weights);
        bodies.into_iter().map(|body| masses[body].iter().map(of_joint).collect()).collect()
    }

    /// Torques of each inertial parameter of each link, by parameter, joint, part and row.
    pub fn by_parameter(&self, arm: &Arm) -> Vec<Vec<[Vec<f64>; 4]>> {
        self.by_number(arm, arm.dof() * PARAMETERS, |bodies, number, put| {
            bodies.parameter(number / PARAMETERS, number % PARAMETERS, put);
        })
    }

    /// Torques of a load and of each link.
    fn by_mass(&self, arm: &Arm) -> Vec<Vec<[Vec<f64>; 4]>> {
        self.by_number(arm, LOADS + arm.dof(), |bodies, body, put| {
            if body < LOADS { bodies.load(body, put) } else { bodies.link(body - LOADS, put) }
        })
    }

    /// Torques of `count` bodies; `torques` returns those of one of them.
    fn by_number(
        &self,
        arm: &Arm,
        count: usize,
        torques: impl Fn(&Bodies, usize, &mut dyn FnMut(usize, Parts)),
    ) -> Vec<Vec<[Vec<f64>; 4]>> {
        let n = arm.dof();
        let of =
            |column| -> Vec<Vec<f64>> { (0..n).map(|joint| self.column(joint, column).to_vec()).collect() };
        let motion = [of(Column::Position), of(Column::Speed), of(Column::Acceleration)];
        let rows = motion[0][0].len();
        let mut all = vec![vec![[const { Vec::new() }; 4].map(|_: Vec<f64>| vec![0.0; rows]); n]; count];
        for (row, bodies) in (0..rows).map(|row| (row, posture(arm, &motion, row))) {
            for (number, of_joint) in all.iter_mut().enumerate() {
                let mut put = |joint: usize, parts: Parts| {
                    let [gx, gy, gz] = parts.gravity;
                    for (column, x) in of_joint[joint].iter_mut().zip([parts.inertial, gx, gy, gz]) {
                        column[row] = x;
                    }
                };
                torques(&bodies, number, &mut put);
            }
        }
        all
    }
}

fn posture<'a>(arm: &'a Arm, motion: &[Vec<Vec<f64>>; 3], row: usize) -> Bodies<'a> {
    let [q, v, a] = motion;
    Bodies::new(arm, |k| q[k][row], |k| v[k][row], |k| a[k][row])
}

pub(super) fn weighed(parts: [&[f64]; 4], weights: &[f64; 4]) -> Vec<f64> {
    let row = |row: usize| parts.iter().zip(weights).map(|(part, weight)| weight * part[row]).sum();
    (0..parts[0].len()).map(row).collect()
}

/// Direction of a joint's motion, −1 to 1: intermediate where the joint hardly moves and its dry friction is unknown.
fn directions(v: &[f64]) -> Vec<f64> {
    let most = v.iter().fold(0.0_f64, |most, v| most.max(v.abs()));
    v.iter().map(|v| if most > 0.0 { (v / (MOVES * most)).clamp(-1.0, 1.0) } else { 0.0 }).collect()
}

/// The inner product.
pub(super) fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}
