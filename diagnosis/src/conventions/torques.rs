//! The torque channels of a reading: the model is fitted to them, with gravity and scales where these are free.

use std::rc::Rc;

use nalgebra::{DMatrix, DVector, Vector3};

use super::along::{Along, Column, LOADS, dot};
use super::change::{Change, Physics};
use super::free_arm::Target;
use super::normal::{Channel, Fit, fit};
use super::problem::{Measured, Problem};
use super::reading::Reading;
use crate::statistics::{TURNS, variance};

/// Greatest inertia of a rotor, in multiples of the inertia that its joint moves: behind a gear of 160, a rotor weighs about as much as a light arm.
const MOST_ROTOR: f64 = 4.0;
/// Greatest load, as a share of the arm's mass: makers' ratios of load to mass end below.
const MOST_LOAD: f64 = 0.7;
/// Greatest mass that a link may have beyond its model, in multiples of the modelled mass: a larger error means another link, and thus another arm.
const MOST_LINK: f64 = 2.0;
/// Greatest share of its mass in the model that a real link may lack: a link that lacks more is another link, and every link weighs something.
const LEAST_LINK: f64 = 0.6;
/// Greatest distance between the tool and the centre of mass of a load, as a share of the arm's reach: a load that hangs farther out would be a link of its own.
const FARTHEST: f64 = 0.25;
/// Greatest friction due to a load, as a share of that load: a gear that loses half of it locks itself.
const MOST_LOSS: f64 = 0.5;
/// Greatest factor of a unit, up or down: counts of 16 bits and micronewton metres of a wrist are below.
const MOST_SCALE: f64 = 1e6;

/// The scale of a joint's torque.
#[derive(Clone, Copy, PartialEq)]
enum Scale {
    Known(f64),
    Fitted,
    Common,
}

/// The torque channels of a reading under a set of changes.
pub(super) struct Torques<'p, 'a> {
    problem: &'p Problem<'a>,
    along: &'p Along,
    changes: &'p [Change],
    physics: Vec<Physics>,
    /// Joints with a torque that varies at all.
    pub joints: Vec<usize>,
    measured: Vec<(Rc<Measured>, f64)>,
    scales: Vec<Scale>,
    /// Gravity that was subtracted from the measured torques, m/s².
    taken_out: Option<Vector3<f64>>,
}

/// Parts of a channel's target beyond the measurement, and of its columns.
struct Parts<'f> {
    /// Weights of motion and gravity in the model.
    weights: [f64; 4],
    gravity_is_free: bool,
    /// Weights of motion and gravity in the load of a joint; some friction grows with this load.
    load: [f64; 4],
    scale: &'f [f64],
    shared: &'f [Vec<Vec<f64>>],
}

impl<'p, 'a> Torques<'p, 'a> {
    /// The torques of `reading`, which is that of `changes`, along its motion.
    pub fn new(problem: &'p Problem<'a>, reading: &Reading, along: &'p Along, changes: &'p [Change]) -> Self {
        let mut scales = vec![Scale::Known(1.0); problem.arm.dof()];
        for change in changes {
            match *change {
                Change::Scale(joint) => scales[joint] = Scale::Fitted,
                Change::SameScale(joint, factor) => scales[joint] = Scale::Known(factor),
                Change::CommonScale => scales.fill(Scale::Common),
                _ => {}
            }
        }
        let physics = changes.iter().filter_map(|change| match change {
            Change::Beside(physics) => Some(*physics),
            _ => None,
        });
        let physics = physics.collect();
        let (mut joints, mut measured) = (Vec::new(), Vec::new());
        for (joint, read) in reading.torques.iter().enumerate() {
            let column = problem.measured(read.source, reading.torque_delay);
            if column.variance > 0.0 && column.variance.is_finite() {
                joints.push(joint);
                measured.push((column, read.factor));
            }
        }
        let taken_out = reading.gravity_added.then(|| *problem.arm.gravity());
        Self { problem, along, changes, physics, joints, measured, scales, taken_out }
    }

    /// Variance of the measured torque, by channel.
    pub fn variance(&self, channel: usize) -> f64 {
        self.measured[channel].0.variance
    }

    /// Variance of the whole torque of a channel, recorded in `scale`: measured torque plus the gravity that a driver subtracted. The driver subtracts a model
    /// of gravity, so that the model error is a share of the whole torque, not of the remainder.
    pub fn size(&self, channel: usize, scale: f64) -> f64 {
        let (measured, sign) = (&self.measured[channel].0, self.measured[channel].1);
        let Some(gravity) = self.taken_out else { return measured.variance };
        let held = self.along.model(self.joints[channel], &[0.0, gravity.x, gravity.y, gravity.z]);
        let whole = measured.column.iter().zip(&held).map(|(seen, held)| sign * seen + scale * held);
        variance(&whole.collect::<Vec<f64>>())
    }

    /// The targets for links of any inertia: the residual of `fitted` in each channel, or the whole measured torque without `fitted`; and the ratio of measured
    /// to modelled torques.
    pub fn targets(
        &self,
        fitted: Option<&Fit>,
        gravity: &Vector3<f64>,
        scale: &[f64],
        independent: &dyn Fn(usize) -> f64,
        floor: f64,
        rows: f64,
    ) -> (Vec<Target<'p>>, f64) {
        let (mut recorded, mut modelled) = (0.0, 0.0);
        let target = |(channel, &joint): (usize, &usize)| {
            let (measured, sign) = (&self.measured[channel].0, self.measured[channel].1);
            recorded += measured.variance;
            modelled += self.spoken(joint, gravity, scale[joint]);
            let column = fitted.map_or_else(
                || measured.column.iter().map(|x| sign * x).collect(),
                |fitted| self.residual(channel, fitted, gravity, scale),
            );
            let own = self.own(joint).into_iter();
            let own = own
                .map(|(column, positive)| (self.along.column(joint, column), positive && fitted.is_none()));
            Target {
                joint,
                column,
                scale: scale[joint],
                own: own.collect(),
                floor: floor.powi(2) * measured.variance * rows,
                independent: independent(joint),
            }
        };
        let targets = self.joints.iter().enumerate().map(target).collect();
        (targets, (recorded / modelled.max(f64::MIN_POSITIVE)).sqrt())
    }

    /// The fit, with gravity and scales where these are free; `None` for an impossible fit.
    pub fn fitted(&self, gravity: &mut Vector3<f64>, scale: &mut [f64]) -> Option<Fit> {
        for (scale, kind) in scale.iter_mut().zip(&self.scales) {
            if let Scale::Known(factor) = kind {
                *scale = *factor;
            }
        }
        let is_scaled = self.scales.iter().any(|scale| !matches!(scale, Scale::Known(_)));
        if self.changes.contains(&Change::AnyGravity) {
            let size = gravity.norm();
            for _ in 0..if is_scaled { TURNS } else { 1 } {
                let fitted = self.fit(gravity, scale, true);
                let turned = Vector3::from_column_slice(&fitted.shared[..3]);
                *gravity = turned.try_normalize(1e-9)? * size;
                if is_scaled {
                    let fitted = self.fit(gravity, scale, false);
                    self.take_scales(&fitted, scale)?;
                }
            }
        }
        let mut fitted = self.fit(gravity, scale, false);
        self.take_scales(&fitted, scale)?;
        if is_scaled && !fitted.shared.is_empty() {
            fitted = self.fit(gravity, scale, false);
            self.take_scales(&fitted, scale)?;
        }
        Some(fitted)
    }

    /// The fit under `gravity` and `scale`.
    pub fn fit(&self, gravity: &Vector3<f64>, scale: &[f64], gravity_is_free: bool) -> Fit {
        let weights = [1.0, gravity.x, gravity.y, gravity.z];
        let shared = self.along.shared(self.problem.arm, &self.physics, &weights);
        let model = if gravity_is_free { [1.0, 0.0, 0.0, 0.0] } else { weights };
        let parts = Parts { weights: model, gravity_is_free, load: weights, scale, shared: &shared };
        let channels: Vec<Channel> =
            (0..self.joints.len()).map(|channel| self.channel(channel, &parts)).collect();
        let is_common = !gravity_is_free && self.scales.contains(&Scale::Common);
        fit(&channels, shared.len() + usize::from(is_common) + if gravity_is_free { 3 } else { 0 })
    }

    /// The normal equations of a channel.
    fn channel(&self, channel: usize, parts: &Parts) -> Channel {
        let joint = self.joints[channel];
        let (measured, sign) = (&self.measured[channel].0, self.measured[channel].1);
        let (kind, factor) = (self.scales[joint], parts.scale[joint]);
        let is_known = parts.gravity_is_free || matches!(kind, Scale::Known(_));
        let (mut own, mut is_positive): (Vec<Term>, Vec<bool>) = self
            .own(joint)
            .into_iter()
            .map(|(column, positive)| (Term::Column(column, 1.0), positive))
            .unzip();
        let friction = self.load_friction(joint, &parts.load);
        if let Some(friction) = &friction {
            own.push(Term::Given(friction, 1.0));
            is_positive.push(true);
        }
        if kind == Scale::Fitted && !is_known {
            own.push(Term::Model);
            is_positive.push(true);
        }
        let mut terms = own;
        if parts.gravity_is_free {
            terms.extend((1..=3).map(|axis| Term::Column(Column::Model(axis), factor)));
        }
        terms.extend(parts.shared.iter().map(|columns| Term::Given(&columns[joint], factor)));
        if kind == Scale::Common && !is_known {
            terms.push(Term::Model);
        }
        let products = Products::new(
            self.along,
            joint,
            &parts.weights,
            friction.is_some() || !parts.shared.is_empty(),
            &measured.column,
        );
        // The target: measured torque, minus the model if its scale is known.
        let less = if is_known { factor } else { 0.0 };
        let right =
            |term: &Term| sign * products.with_measured(term) - less * products.of(term, &Term::Model);
        let model = products.of(&Term::Model, &Term::Model);
        let square =
            measured.square - 2.0 * less * sign * products.with_measured(&Term::Model) + less * less * model;
        let floor = self.problem.floor.powi(2) * measured.variance * measured.column.len() as f64;
        let mut normal = DMatrix::from_fn(terms.len(), terms.len(), |i, k| {
            if i <= k { products.of(&terms[i], &terms[k]) } else { 0.0 }
        });
        normal.fill_lower_triangle_with_upper_triangle();
        let right = DVector::from_iterator(terms.len(), terms.iter().map(right));
        Channel { normal, right, square, is_positive, floor }
    }

    /// The columns of `joint` alone: friction, offset and further physics. The flag is true for a coefficient that can't be negative.
    fn own(&self, joint: usize) -> Vec<(Column, bool)> {
        let mut own = vec![(Column::One, false), (Column::Turns, true), (Column::Speed, true)];
        for physics in &self.physics {
            match *physics {
                Physics::Rotor(at) if at == joint => own.push((Column::Acceleration, true)),
                Physics::Drag(at) if at == joint => own.push((Column::Drag, true)),
                Physics::Spring(at) if at == joint => own.push((Column::Position, true)),
                Physics::Coupling(at, other) if at == joint => {
                    let side = usize::from(other > joint);
                    own.extend([0, 1, 2].map(|what| (Column::Other(side, what), false)));
                }
                _ => {}
            }
        }
        own
    }

    /// Direction of `joint` times its absolute load under `weights`, if its friction grows with the load.
    fn load_friction(&self, joint: usize, weights: &[f64; 4]) -> Option<Vec<f64>> {
        self.physics.contains(&Physics::LoadFriction(joint)).then(|| {
            let turns = self.along.column(joint, Column::Turns);
            self.along
                .model(joint, weights)
                .iter()
                .zip(turns)
                .map(|(load, turns)| load.abs() * turns)
                .collect()
        })
    }

    fn take_scales(&self, fitted: &Fit, scale: &mut [f64]) -> Option<()> {
        for (own, &joint) in fitted.own.iter().zip(&self.joints) {
            match self.scales[joint] {
                Scale::Fitted => scale[joint] = *own.last()?,
                Scale::Common => scale[joint] = *fitted.shared.last()?,
                Scale::Known(_) => {}
            }
            if !(1.0 / MOST_SCALE..=MOST_SCALE).contains(&scale[joint]) {
                return None;
            }
        }
        Some(())
    }

    /// Returns true if the physics beside the reading has sizes that a machine can have.
    pub fn is_possible(&self, fitted: &Fit, scale: &[f64]) -> bool {
        let of_joint = |(own, &joint): (&Vec<f64>, &usize)| self.are_own(joint, own, scale[joint]);
        let mass: f64 = self.problem.arm.joints().iter().map(|joint| joint.inertia.mass).sum();
        let own = self.problem.arm.joints().last().map_or(0.0, |last| last.inertia.mass);
        let mut at = 0;
        let are_masses = self.physics.iter().all(|physics| match physics {
            Physics::Payload => {
                at += LOADS;
                let load = &fitted.shared[at - LOADS..at];
                let moment = Vector3::from_column_slice(&load[1..]).norm();
                (-own..=MOST_LOAD * mass).contains(&load[0])
                    && moment <= (load[0].abs() + own) * FARTHEST * self.problem.reach
            }
            Physics::Link(_) => {
                at += 1;
                (-LEAST_LINK..=MOST_LINK).contains(&fitted.shared[at - 1])
            }
            _ => true,
        });
        are_masses && fitted.own.iter().zip(&self.joints).all(of_joint)
    }

    /// Returns true if the fitted physics of `joint` is possible. A rotor needs a size that drives have. A coupled joint has at most the inertia that leaves
    /// the inertia matrix positive, and at most the joint's own friction, so that friction takes energy whichever way both move.
    fn are_own(&self, joint: usize, coefficients: &[f64], scale: f64) -> bool {
        let products = self.along.products(joint);
        let own = self.own(joint);
        let of = |wanted: Column| {
            own.iter().position(|(column, _)| *column == wanted).map_or(0.0, |at| coefficients[at])
        };
        let friction = |turns: Column, speed: Column| -> f64 {
            let (c, v) = (of(turns), of(speed));
            let (turns, speed) = (turns.place(), speed.place());
            c * c * products[(turns, turns)]
                + 2.0 * c * v * products[(turns, speed)]
                + v * v * products[(speed, speed)]
        };
        let inertia = |at: usize| (1.0 + MOST_ROTOR) * self.inertia(at) * scale;
        let is_possible = |side: usize| {
            let other = if side == 0 { joint.wrapping_sub(1) } else { joint + 1 };
            other >= self.problem.arm.dof()
                || of(Column::Other(side, 0)).powi(2) <= inertia(joint) * inertia(other)
                    && friction(Column::Other(side, 2), Column::Other(side, 1))
                        <= friction(Column::Turns, Column::Speed)
        };
        let is_lossy = self.physics.contains(&Physics::LoadFriction(joint));
        of(Column::Acceleration) <= MOST_ROTOR * self.inertia(joint) * scale
            && (0..2).all(is_possible)
            && !(is_lossy && coefficients[own.len()] > MOST_LOSS * scale)
    }

    /// Approximate inertia that `joint` moves.
    fn inertia(&self, joint: usize) -> f64 {
        let products = self.along.products(joint);
        let a = Column::Acceleration.place();
        (products[(Column::Model(0).place(), a)] / products[(a, a)].max(f64::MIN_POSITIVE)).max(0.0)
    }

    /// Variance of the rigid arm's torque at `joint` under `gravity`, as recorded in its `scale`.
    pub fn spoken(&self, joint: usize, gravity: &Vector3<f64>, scale: f64) -> f64 {
        let model = self.along.model(joint, &[1.0, gravity.x, gravity.y, gravity.z]);
        variance(&model) * scale.powi(2)
    }

    /// Residual of `fitted` in a channel, row by row.
    pub fn residual(&self, channel: usize, fitted: &Fit, gravity: &Vector3<f64>, scale: &[f64]) -> Vec<f64> {
        let joint = self.joints[channel];
        let (measured, sign) = (&self.measured[channel].0, self.measured[channel].1);
        let weights = [1.0, gravity.x, gravity.y, gravity.z];
        let mut left: Vec<f64> = measured.column.iter().map(|x| sign * x).collect();
        let mut take =
            |column: &[f64], by: f64| left.iter_mut().zip(column).for_each(|(left, x)| *left -= by * x);
        take(&self.along.model(joint, &weights), scale[joint]);
        for ((column, _), by) in self.own(joint).into_iter().zip(&fitted.own[channel]) {
            take(self.along.column(joint, column), *by);
        }
        if let Some(friction) = self.load_friction(joint, &weights) {
            take(&friction, fitted.own[channel][self.own(joint).len()]);
        }
        let shared = self.along.shared(self.problem.arm, &self.physics, &weights);
        for (columns, by) in shared.iter().zip(&fitted.shared) {
            take(&columns[joint], by * scale[joint]);
        }
        left
    }
}

/// A column of a channel, times a factor.
enum Term<'c> {
    Column(Column, f64),
    Given(&'c [f64], f64),
    /// The torque of the model.
    Model,
}

/// Inner products of terms.
struct Products<'c> {
    along: &'c Along,
    joint: usize,
    weights: &'c [f64; 4],
    /// The model row by row, for products with given columns.
    model: Option<Vec<f64>>,
    measured: &'c [f64],
}

impl<'c> Products<'c> {
    fn new(
        along: &'c Along,
        joint: usize,
        weights: &'c [f64; 4],
        are_given: bool,
        measured: &'c [f64],
    ) -> Self {
        Self { along, joint, weights, model: are_given.then(|| along.model(joint, weights)), measured }
    }

    fn of(&self, one: &Term, other: &Term) -> f64 {
        let products = self.along.products(self.joint);
        let with_model = |place: usize| -> f64 {
            (0..4).map(|part| self.weights[part] * products[(place, Column::Model(part).place())]).sum()
        };
        match (one, other) {
            (Term::Column(a, x), Term::Column(b, y)) => x * y * products[(a.place(), b.place())],
            (Term::Column(a, x), Term::Model) | (Term::Model, Term::Column(a, x)) => {
                x * with_model(a.place())
            }
            (Term::Model, Term::Model) => {
                (0..4).map(|part| self.weights[part] * with_model(Column::Model(part).place())).sum()
            }
            (Term::Given(given, x), Term::Column(a, y)) | (Term::Column(a, y), Term::Given(given, x)) => {
                x * y * dot(given, self.along.column(self.joint, *a))
            }
            (Term::Given(a, x), Term::Given(b, y)) => x * y * dot(a, b),
            (Term::Given(given, x), Term::Model) | (Term::Model, Term::Given(given, x)) => {
                self.model.as_ref().map_or(0.0, |model| x * dot(given, model))
            }
        }
    }

    fn with_measured(&self, term: &Term) -> f64 {
        match term {
            Term::Column(column, x) => x * dot(self.along.column(self.joint, *column), self.measured),
            Term::Given(given, x) => x * dot(given, self.measured),
            Term::Model => (0..4)
                .map(|part| {
                    self.weights[part]
                        * dot(self.along.column(self.joint, Column::Model(part)), self.measured)
                })
                .sum(),
        }
    }
}
