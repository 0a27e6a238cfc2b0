//! The evidence of a set of changes: the prediction of the model along the motion as the changes read it, against the recording.
//!
//! *Score.* Of m rows a torque channel c keeps the mean square r_c after dry and viscous friction (neither below zero) and an offset are
//! fitted, and a tracked coordinate of the tool keeps r_c as it is. With σ_c integrated out (Bernardo & Smith 1994, §5.2)
//!
//! ln p(S) = Σ_c −(½ m + a) ln(r_c + f_c) − ½ p ln(m C) + Σ_S ln odds,
//!
//! a the shape of an inverse gamma prior of σ_c², p numbers fitted by the changes S on C channels (Schwarz 1978). The floor f_c is a share of
//! the channel's own variance: no question about the reading is decided by the last per cent.

use std::cell::RefCell;
use std::collections::HashMap;
use std::rc::Rc;

use freeplay_arm::Arm;
use nalgebra::Vector3;

use super::along::{Along, dot};
use super::change::{COMMON, Change, RARE, reading};
use super::reading::{PositionReading, Reading};
use super::samples::Samples;
use super::torques::Torques;
use super::{free_arm, kinds};
use crate::conventions::outcome::Outcome;
use crate::statistics::variance;

/// Typical relative error of a model of a real arm: 5 % of a torque's standard deviation leaves 0.25 % of its variance.
pub(crate) const FLOOR: f64 = 0.05;

/// Shape of the inverse gamma prior of the variance that a model leaves of a channel: the probability that it leaves more than R falls as 1/R. Jeffreys' prior,
/// of shape 0, expects a model that leaves thirty times the variance of a torque as often as one that leaves a thirtieth of it, which decides where a recording
/// has few independent rows.
const SHAPE: f64 = 1.0;

/// The same for a tracked tool, as a share of the torques' floor: no friction blurs geometry, and 1 % of a motion is more than play and elasticity cause.
pub(crate) const GEOMETRY: f64 = 0.2;

/// Relative error of a model's inertias, as a share of the size of a link. With 0.1 and with 0.2, the search distinguishes faults put into recordings of real
/// and of concealed machines from other arms; with 0.3, models of other arms of the same build begin to pass as the right one.
const SHEET: f64 = 0.2;

/// The assumption on the links of an arm.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Links {
    /// Those of the model, within the error of a data sheet.
    OfSheet,
    /// Those of another arm; its joints may have other zeros.
    Any { own_zeros: bool },
}

/// An arm, the rows of a recording, and cached results for them.
pub(crate) struct Problem<'a> {
    pub arm: &'a Arm,
    pub samples: &'a Samples,
    /// The problem uses one of this many rows.
    stride: usize,
    /// Relative error of every real arm's model, as a share of a channel's standard deviation: the search does not resolve smaller errors.
    pub floor: f64,
    /// Reach of the arm, m.
    pub reach: f64,
    seen: RefCell<HashMap<Vec<u64>, Rc<Along>>>,
    measured: RefCell<HashMap<(usize, u64), Rc<Measured>>>,
    /// Number of rows that count as one independent row, by recorded channel: the torques by column, then the tool; one where unknown.
    counts: Vec<f64>,
}

/// A measured torque.
pub(super) struct Measured {
    pub column: Vec<f64>,
    /// Sum of squares, and mean square about the mean.
    pub square: f64,
    pub variance: f64,
}

impl<'a> Problem<'a> {
    /// One of `stride` rows of `samples`.
    pub fn new(arm: &'a Arm, samples: &'a Samples, stride: usize, floor: f64) -> Self {
        let joints = arm.joints().iter().skip(1).map(|joint| joint.placement.translation.vector.norm());
        let reach = joints.sum::<f64>() + arm.tool().translation.vector.norm();
        Self {
            arm,
            samples,
            stride,
            floor,
            reach,
            seen: RefCell::default(),
            measured: RefCell::default(),
            counts: Vec::new(),
        }
    }

    /// Sets the weight of the rows of each recorded channel c to 1/`counts[c]`.
    pub fn count_rows(&mut self, counts: &[f64]) {
        self.counts = counts.to_vec();
    }

    /// Number of independent rows of the recorded channel `source`. It depends on the recorded column alone: if it changed when a reading swaps the columns of
    /// two joints, the unit of a column would count as evidence for one order.
    fn independent(&self, source: usize) -> f64 {
        let count = self.counts.get(source).copied().unwrap_or(1.0);
        (self.samples.len() as f64 / count).min(self.rows() as f64)
    }

    fn rows(&self) -> usize {
        self.samples.len().div_ceil(self.stride)
    }

    fn thinned(&self, column: &[f64]) -> Vec<f64> {
        column.iter().step_by(self.stride).copied().collect()
    }

    /// The model along the motion that `reading` gives.
    fn along(&self, reading: &Reading) -> Rc<Along> {
        let key = key(reading);
        if let Some(known) = self.seen.borrow().get(&key) {
            return Rc::clone(known);
        }
        let motion = [0, 1, 2].map(|order| {
            let columns: Vec<Vec<f64>> =
                self.samples.motion[order].iter().map(|column| self.thinned(column)).collect();
            reading.motion(&columns, order == 0)
        });
        let along = Rc::new(Along::new(self.arm, &motion, self.samples.has_torques()));
        self.seen.borrow_mut().insert(key, Rc::clone(&along));
        along
    }

    /// Torque column `source`, read `delay` s later.
    pub fn measured(&self, source: usize, delay: f64) -> Rc<Measured> {
        let key = (source, delay.to_bits());
        if let Some(known) = self.measured.borrow().get(&key) {
            return Rc::clone(known);
        }
        let column = self.thinned(&self.samples.torque(source, delay));
        let (square, variance) = (dot(&column, &column), variance(&column));
        let measured = Rc::new(Measured { column, square, variance });
        self.measured.borrow_mut().insert(key, Rc::clone(&measured));
        measured
    }

    /// The evidence for `changes`.
    pub fn outcome(&self, changes: &[Change]) -> Outcome {
        let reading = reading(self.arm, changes);
        let along = self.along(&reading);
        let mut outcome = Outcome {
            changes: changes.to_vec(),
            evidence: 0.0,
            likelihood: Vec::new(),
            left: Vec::new(),
            spoken: Vec::new(),
            sizes: Vec::new(),
            floors: Vec::new(),
            gravity: self.gravity(&reading),
            scale: vec![1.0; self.arm.dof()],
            sources: Vec::new(),
        };
        let torques = self.samples.has_torques().then(|| Torques::new(self, &reading, &along, changes));
        if let Some(torques) = torques.filter(|torques| !torques.joints.is_empty()) {
            let fitted = torques.fitted(&mut outcome.gravity, &mut outcome.scale);
            let Some(fitted) = fitted.filter(|fitted| torques.is_possible(fitted, &outcome.scale)) else {
                outcome.evidence = f64::NEG_INFINITY;
                return outcome;
            };
            outcome.sources = reading.torques.iter().map(|torque| torque.source).collect();
            outcome.left = vec![f64::NAN; self.arm.dof()];
            outcome.likelihood = vec![0.0; self.arm.dof()];
            outcome.spoken = vec![0.0; self.arm.dof()];
            outcome.sizes = vec![1.0; self.arm.dof()];
            outcome.floors = vec![0.0; self.arm.dof()];
            for (channel, (&joint, left)) in torques.joints.iter().zip(&fitted.left).enumerate() {
                let scale = outcome.scale[joint];
                let (size, left) = (torques.size(channel, scale), left / self.rows() as f64);
                // All readings use the same floor, that of the recorded column.
                outcome.floors[joint] = self.floor.powi(2) * torques.variance(channel);
                outcome.likelihood[joint] =
                    self.log_likelihood(outcome.sources[joint], left, outcome.floors[joint]);
                outcome.left[joint] = left / size;
                outcome.spoken[joint] = torques.spoken(joint, &outcome.gravity, scale) / size;
                outcome.sizes[joint] = size;
            }
        }
        if self.samples.has_tool() {
            let (residuals, variance) = self.tool_residuals(&reading, &along);
            for residual in residuals {
                let left = mean_square(&residual);
                let channel = outcome.likelihood.len();
                let floor = (self.floor * GEOMETRY).powi(2) * variance;
                outcome.floors.push(floor);
                outcome.likelihood.push(self.log_likelihood(channel, left, floor));
                outcome.sources.push(channel);
                outcome.left.push(left / variance);
                outcome.spoken.push(1.0);
                outcome.sizes.push(variance);
            }
        }
        let (parameters, odds) = self.prior(&outcome);
        outcome.evidence =
            outcome.likelihood.iter().sum::<f64>() + odds - parameters as f64 * self.log_price(&outcome);
        outcome
    }

    /// Mean square residual of each joint's torque under `changes` if the arm has no mass: only friction and other physics of the joint itself explain it. NaN
    /// without a torque.
    pub fn without_arm(&self, changes: &[Change]) -> Vec<f64> {
        let dof = self.arm.dof();
        let reading = reading(self.arm, changes);
        let along = self.along(&reading);
        let is_kept = |change: &&Change| match change {
            Change::Beside(physics) => !physics.is_mass(),
            Change::Scale(_) | Change::SameScale(..) | Change::CommonScale => false,
            _ => true,
        };
        let massless = (0..dof).map(|joint| Change::SameScale(joint, 0.0));
        let massless: Vec<Change> = changes.iter().filter(is_kept).copied().chain(massless).collect();
        let torques = Torques::new(self, &reading, &along, &massless);
        let fitted = torques.fit(&self.gravity(&reading), &vec![0.0; dof], false);
        let mut left = vec![f64::NAN; dof];
        for (&joint, square) in torques.joints.iter().zip(&fitted.left) {
            left[joint] = square / self.rows() as f64;
        }
        left
    }

    /// The evidence for `outcome` with other links: those of the data sheet within a tolerance, or those of another arm with the same further physics, with or
    /// without joint zeros of its own. `None` without torques.
    pub fn with_links(&self, outcome: &Outcome, links: Links) -> Option<f64> {
        let is_kept = |change: &&Change| match links {
            Links::OfSheet => true,
            Links::Any { own_zeros } => match change {
                Change::Beside(physics) => !physics.is_mass(),
                change => own_zeros && change.is_of_positions(),
            },
        };
        let changes: Vec<Change> = outcome.changes.iter().filter(is_kept).copied().collect();
        let reading = reading(self.arm, &changes);
        let along = self.along(&reading);
        let torques = self.samples.has_torques().then(|| Torques::new(self, &reading, &along, &changes))?;
        let (mut gravity, mut scale) = (self.gravity(&reading), vec![1.0; self.arm.dof()]);
        let fitted = torques.fitted(&mut gravity, &mut scale)?;
        let rows = self.rows() as f64;
        let (targets, power) = torques.targets(
            (links == Links::OfSheet).then_some(&fitted),
            &gravity,
            &scale,
            &|joint| self.independent(reading.torques[joint].source),
            self.floor,
            rows,
        );
        let width = if links == Links::OfSheet { SHEET } else { power };
        let prior: Vec<f64> = free_arm::sizes(self.arm).iter().map(|size| size * width).collect();
        let free =
            free_arm::fitted(&along, self.arm, &[1.0, gravity.x, gravity.y, gravity.z], &targets, &prior)?;
        let of_torques: f64 = targets
            .iter()
            .zip(&free.left)
            .map(|(target, left)| {
                let source = reading.torques[target.joint].source;
                self.log_likelihood(source, left / rows, target.floor / rows)
            })
            .sum();
        let tool: f64 = outcome.likelihood.iter().skip(self.arm.dof()).sum();
        let price = match links {
            Links::OfSheet => outcome.price(),
            Links::Any { .. } => {
                let numbers: usize =
                    changes.iter().filter(|change| change.is_reading()).map(Change::parameters).sum();
                let physics = Outcome { changes: changes.clone(), ..outcome.clone() };
                self.physics_price(&physics) + numbers as f64 * self.log_price(outcome) - RARE.ln()
            }
        };
        Some(of_torques + tool - price - free.price)
    }

    /// Number of parameters that the changes of `outcome` fit, and their prior log odds. A small change is an effect of the catalogue, as common as other
    /// physics. A torque in the unit of another joint's has no parameter of its own.
    fn prior(&self, outcome: &Outcome) -> (usize, f64) {
        let (small, large): (Vec<Change>, Vec<Change>) =
            outcome.changes.iter().partition(|change| kinds::is_small(self.arm, outcome, change));
        let mut parameters: usize = small.iter().map(Change::parameters).sum();
        let mut odds = small.len() as f64 * COMMON.ln();
        for (k, change) in large.iter().enumerate() {
            if kinds::torque_unit::is_shared(outcome, change, &large[..k]) {
                // The unit of the other joint and a unit of its own are equally probable.
                odds -= std::f64::consts::LN_2;
            } else {
                parameters += change.parameters();
                odds += change.log_odds(&large[..k]);
            }
        }
        (parameters, odds)
    }

    /// Log-evidence price of the physics in `outcome`, apart from its reading.
    pub fn physics_price(&self, outcome: &Outcome) -> f64 {
        let physics = outcome.changes.iter().filter(|change| !change.is_reading());
        let each = self.log_price(outcome);
        physics.map(|change| change.parameters() as f64 * each - COMMON.ln()).sum()
    }

    /// Log-evidence price of one fitted parameter, for the recorded channels of `outcome`.
    pub fn log_price(&self, outcome: &Outcome) -> f64 {
        let channels = outcome.left.iter().enumerate().filter(|(_, left)| left.is_finite());
        let rows: f64 = channels.map(|(channel, _)| self.independent(outcome.sources[channel])).sum();
        0.5 * rows.max(self.rows() as f64).ln()
    }

    fn gravity(&self, reading: &Reading) -> Vector3<f64> {
        if reading.gravity_added {
            return Vector3::zeros();
        }
        reading.gravity.unwrap_or(*self.arm.gravity())
    }

    /// Log-likelihood of the recorded channel `source` with the mean square residual `left` and the noise `floor`.
    pub fn log_likelihood(&self, source: usize, left: f64, floor: f64) -> f64 {
        -(0.5 * self.independent(source) + SHAPE) * (left + floor).ln()
    }

    /// Residuals of the tool's coordinates, and the mean of the coordinates' variances.
    fn tool_residuals(&self, reading: &Reading, along: &Along) -> ([Vec<f64>; 3], f64) {
        let tool = [0, 1, 2].map(|axis| self.thinned(&self.samples.tool(axis, reading.tool_delay)));
        let variance = tool.iter().map(|column| variance(column)).sum::<f64>() / 3.0;
        let minus = |(seen, model): (&f64, &f64)| seen - model;
        let residuals = [0, 1, 2].map(|axis| tool[axis].iter().zip(&along.tool[axis]).map(minus).collect());
        (residuals, variance)
    }

    /// Residuals of `outcome` by row, in the order of its channels; empty for a channel without data.
    pub fn residuals(&self, outcome: &Outcome) -> Vec<Vec<f64>> {
        let reading = reading(self.arm, &outcome.changes);
        let along = self.along(&reading);
        let mut residuals = Vec::new();
        let of_tool = if self.samples.has_tool() { 3 } else { 0 };
        let is_fitted = outcome.likelihood.len() == self.arm.dof() + of_tool;
        if self.samples.has_torques() && is_fitted {
            let torques = Torques::new(self, &reading, &along, &outcome.changes);
            let (mut gravity, mut scale) = (self.gravity(&reading), vec![1.0; self.arm.dof()]);
            residuals = vec![Vec::new(); self.arm.dof()];
            if let Some(fitted) = torques.fitted(&mut gravity, &mut scale) {
                for (channel, &joint) in torques.joints.iter().enumerate() {
                    residuals[joint] = torques.residual(channel, &fitted, &gravity, &scale);
                }
            }
        }
        if self.samples.has_tool() {
            residuals.extend(self.tool_residuals(&reading, &along).0);
        }
        residuals
    }
}

/// The properties of a reading that determine the motion.
fn key(reading: &Reading) -> Vec<u64> {
    let of_joint = |position: &PositionReading| {
        let (other, factor) = position.relative.map_or((u64::MAX, 0.0), |(other, k)| (other as u64, k));
        [
            position.source as u64,
            position.unit.to_bits(),
            position.sign.to_bits(),
            position.zero.to_bits(),
            other,
            factor.to_bits(),
        ]
    };
    reading.positions.iter().flat_map(of_joint).collect()
}

fn mean_square(column: &[f64]) -> f64 {
    column.iter().map(|x| x * x).sum::<f64>() / column.len().max(1) as f64
}

#[cfg(test)]
mod tests {
    use freeplay_arm::{Workspace, gravity_torque, rnea};
    use freeplay_model::paper_arm;
    use freeplay_recording::Recording;

    use super::{FLOOR, Problem, SHAPE};
    use crate::conventions::change::Change;
    use crate::conventions::samples::{Samples, made};

    /// The weight of rows follows the recorded column, whichever joint a reading assigns it to: otherwise two columns of different units would look like two
    /// joints in another order.
    #[test]
    fn rows_are_counted_by_recorded_column() {
        let arm = paper_arm().arm;
        let n = arm.dof();
        // Torques unrelated to the arm.
        let recording = made(n, |[q, ..], torque| {
            torque.iter_mut().zip(q).for_each(|(torque, q)| *torque = (2.0 * q).cos());
        });
        let samples = Samples::new(&recording, &recording.q).expect("rows");
        let mut problem = Problem::new(&arm, &samples, 1, FLOOR);
        let exchanged = [Change::Exchange(0, 1)];
        let before = problem.outcome(&exchanged);
        let mut counts = vec![1.0; n];
        counts[1] = 4.0;
        problem.count_rows(&counts);
        let after = problem.outcome(&exchanged);
        assert_eq!(after.sources[..2], [1, 0]);
        let ratio = |joint: usize| after.likelihood[joint] / before.likelihood[joint];
        assert!(before.likelihood[0].abs() > 1.0 && before.likelihood[1].abs() > 1.0);
        let weight = |count: f64| 0.5 * samples.len() as f64 / count + SHAPE;
        let quarter = weight(counts[1]) / weight(1.0);
        assert!((ratio(0) - quarter).abs() < 1e-9, "joint 1 reads column 2: {}, not {quarter}", ratio(0));
        assert!((ratio(1) - 1.0).abs() < 1e-9, "joint 2 reads column 1: {}", ratio(1));
    }

    /// The floor is a share of the arm's whole torque, even if a driver has subtracted gravity from it.
    #[test]
    fn torques_without_gravity_are_measured_by_the_whole_torque() {
        let arm = paper_arm().arm;
        let n = arm.dof();
        let of_arm = |is_whole: bool| {
            made(n, |[q, v, a], torque| {
                let mut workspace = Workspace::new(&arm);
                rnea(&arm, &mut workspace, q, v, a, torque);
                let mut held = vec![0.0; n];
                gravity_torque(&arm, &mut workspace, q, &mut held);
                if !is_whole {
                    torque.iter_mut().zip(held).for_each(|(torque, held)| *torque -= held);
                }
            })
        };
        let sizes = |recording: Recording, changes: &[Change]| {
            let samples = Samples::new(&recording, &recording.q).expect("rows");
            Problem::new(&arm, &samples, 1, FLOOR).outcome(changes).sizes
        };
        let (whole, without) = (sizes(of_arm(true), &[]), sizes(of_arm(false), &[Change::Compensated]));
        assert!(whole.len() == n && without.len() == n);
        for (whole, without) in whole.iter().zip(&without) {
            assert!((without / whole - 1.0).abs() < 0.01, "{without} is not {whole}");
        }
    }
}
