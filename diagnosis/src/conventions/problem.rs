//! The evidence of a set of changes: what the model says along the motion as they read it, against what was recorded.
//!
//! *Score.* Of m rows a torque channel c keeps the mean square r_c after dry and viscous friction (neither below zero) and an offset are
//! fitted, and a tracked coordinate of the tool keeps r_c as it is. With σ_c integrated out under Jeffreys' prior (Jeffreys 1961, §3.1)
//!
//! ln p(S) = Σ_c −½ m ln(r_c + f_c) − ½ p ln(m C) + Σ_S ln odds,
//!
//! p numbers fitted by the changes S on C channels (Schwarz 1978). The floor f_c is a share of the channel's own variance: no question
//! about the reading is decided by the last per cent.

use std::cell::RefCell;
use std::collections::HashMap;
use std::rc::Rc;

use freeplay_arm::{Arm, Inertia, Workspace, forward_kinematics, rnea};
use nalgebra::{Isometry3, Matrix3, Vector3};

use super::change::{Change, Physics, reading};
use super::reading::Reading;
use super::regression::{Channel, Fit, Own, dot, fit};
use super::samples::Samples;

/// What real arms are off their laws by: 5 % of a torque's standard deviation leaves 0.25 % of its variance.
pub(crate) const FLOOR: f64 = 0.05;
/// A joint turns one way or the other above this share of its greatest speed; below, its dry friction may be anything between.
const MOVES: f64 = 0.02;
/// Columns of friction and offset, before those of other physics.
const FRICTION: usize = 3;
/// Rotors up to this many times the inertia that their joint moves, loads and links up to this share of the arm and the link more.
const MOST_ROTOR: f64 = 4.0;
const MOST_LOAD: f64 = 0.7;
const MOST_LINK: f64 = 2.0;
/// What an arm may lack of its mass, and a link of its own: no arm is without weight.
const LEAST_LOAD: f64 = 0.2;
const LEAST_LINK: f64 = 0.6;
/// No unit makes a torque larger or smaller than by this: counts of 16 bits, micronewton metres of a wrist are below.
const MOST_SCALE: f64 = 1e6;
/// Rounds in which gravity and scales, whose product is fitted, are fitted in turn.
const TURNS: usize = 5;
/// Distance of the points at which a load at the tool is weighed, m.
const LEVER: f64 = 0.1;

/// Values by joint and row.
type Rows = Vec<Vec<f64>>;
/// An arm and the number under which its torques are kept.
type Numbered<'a> = (usize, &'a Arm);

/// An arm, the rows of a recording, and what was already worked out for them.
pub(crate) struct Problem<'a> {
    pub arm: &'a Arm,
    pub samples: &'a Samples,
    /// One of how many rows is looked at.
    stride: usize,
    /// What every real arm is off its laws by, as a share of a channel's standard deviation: below it, nothing is asked.
    floor: f64,
    links: Vec<Option<Arm>>,
    loads: Vec<Arm>,
    seen: RefCell<HashMap<Vec<u64>, Rc<Along>>>,
    /// Torques of the arm with other masses along motions, `[joint][row]`.
    weighed: RefCell<HashMap<Vec<u64>, Rc<Rows>>>,
}

/// The model along a motion, `[joint][row]`.
pub(crate) struct Along {
    q: Vec<Vec<f64>>,
    pub v: Vec<Vec<f64>>,
    a: Vec<Vec<f64>>,
    inertial: Vec<Vec<f64>>,
    /// Torque per m/s² of gravity along each axis of the base.
    gravity: [Vec<Vec<f64>>; 3],
    tool: [Vec<f64>; 3],
}

/// What a set of changes is worth.
#[derive(Clone)]
pub(crate) struct Outcome {
    pub changes: Vec<Change>,
    /// ln p(S), up to a constant.
    pub evidence: f64,
    /// What the channels put into it, in the order of `left`; 0 where there is none.
    pub likelihood: Vec<f64>,
    /// Mean square of what is left of each channel over its variance: the torques by joint (NaN where none), then the tool.
    pub left: Vec<f64>,
    /// Variance of what the rigid arm asks for over that of what was recorded, in the same order: a channel of friction alone shows
    /// nothing of how it is to be read.
    pub spoken: Vec<f64>,
    /// What is left, row by row, in the same order; empty where none.
    pub residual: Vec<Vec<f64>>,
    /// Gravity, m/s².
    pub gravity: Vector3<f64>,
    /// Measured torque over the model's, by joint.
    pub scale: Vec<f64>,
}

/// How the torque of a joint is scaled.
#[derive(Clone, Copy, PartialEq)]
enum Scale {
    Known(f64),
    Fitted,
    Common,
}

impl<'a> Problem<'a> {
    /// The rows of `samples`, one of `stride` of them.
    pub fn new(arm: &'a Arm, samples: &'a Samples, stride: usize, floor: f64) -> Self {
        let links = (0..arm.dof()).map(|joint| heavier(arm, joint)).collect();
        Self {
            arm,
            samples,
            stride,
            floor,
            links,
            loads: loads(arm),
            seen: RefCell::default(),
            weighed: RefCell::default(),
        }
    }

    fn rows(&self) -> usize {
        self.samples.len().div_ceil(self.stride)
    }

    fn thinned(&self, column: &[f64]) -> Vec<f64> {
        column.iter().step_by(self.stride).copied().collect()
    }

    /// The model along the motion as `reading` has it.
    pub fn along(&self, reading: &Reading) -> Rc<Along> {
        let key = key(reading);
        if let Some(known) = self.seen.borrow().get(&key) {
            return Rc::clone(known);
        }
        let along = Rc::new(self.work_out(reading));
        self.seen.borrow_mut().insert(key, Rc::clone(&along));
        along
    }

    fn work_out(&self, reading: &Reading) -> Along {
        let [q, v, a] = [0, 1, 2].map(|order| {
            let columns: Vec<Vec<f64>> =
                self.samples.motion[order].iter().map(|column| self.thinned(column)).collect();
            reading.motion(&columns, order == 0)
        });
        let still = vec![vec![0.0; self.rows()]; self.arm.dof()];
        let torques = self.samples.has_torques();
        let held = |axis: Vector3<f64>| {
            if torques { self.torques(&self.arm.with_gravity(axis), &q, &still, &still) } else { Vec::new() }
        };
        let floating = self.arm.with_gravity(Vector3::zeros());
        let inertial = if torques { self.torques(&floating, &q, &v, &a) } else { Vec::new() };
        let gravity = [Vector3::x(), Vector3::y(), Vector3::z()].map(held);
        let tool = if self.samples.has_tool() { self.tool(&q) } else { [const { Vec::new() }; 3] };
        Along { q, v, a, inertial, gravity, tool }
    }

    fn torques(&self, arm: &Arm, q: &[Vec<f64>], v: &[Vec<f64>], a: &[Vec<f64>]) -> Vec<Vec<f64>> {
        let n = arm.dof();
        let mut ws = Workspace::new(arm);
        let [mut qs, mut vs, mut accelerations, mut tau] =
            [const { Vec::new() }; 4].map(|_: Vec<f64>| vec![0.0; n]);
        let mut out = vec![Vec::with_capacity(self.rows()); n];
        for row in 0..self.rows() {
            for joint in 0..n {
                (qs[joint], vs[joint], accelerations[joint]) = (q[joint][row], v[joint][row], a[joint][row]);
            }
            rnea(arm, &mut ws, &qs, &vs, &accelerations, &mut tau);
            out.iter_mut().zip(&tau).for_each(|(column, tau)| column.push(*tau));
        }
        out
    }

    fn tool(&self, q: &[Vec<f64>]) -> [Vec<f64>; 3] {
        let mut ws = Workspace::new(self.arm);
        let mut out = [const { Vec::new() }; 3];
        let mut at = vec![0.0; self.arm.dof()];
        for row in 0..self.rows() {
            at.iter_mut().zip(q).for_each(|(at, column)| *at = column[row]);
            let tool = forward_kinematics(self.arm, &mut ws, &at).translation.vector;
            out.iter_mut().zip(tool.iter()).for_each(|(column, x)| column.push(*x));
        }
        out
    }

    /// What `changes` are worth.
    pub fn outcome(&self, changes: &[Change]) -> Outcome {
        let reading = reading(self.arm, changes);
        let along = self.along(&reading);
        let mut outcome = Outcome {
            changes: changes.to_vec(),
            evidence: 0.0,
            likelihood: Vec::new(),
            left: Vec::new(),
            spoken: Vec::new(),
            residual: Vec::new(),
            gravity: if reading.gravity_added {
                Vector3::zeros()
            } else {
                reading.gravity.unwrap_or(*self.arm.gravity())
            },
            scale: vec![1.0; self.arm.dof()],
        };
        let mut count = 0;
        let torques = self.samples.has_torques().then(|| Torques::new(self, &reading, &along, changes));
        if let Some(torques) = torques.filter(|torques| !torques.joints.is_empty()) {
            let fitted = torques.fitted(&mut outcome.gravity, &mut outcome.scale);
            let Some(fitted) = fitted.filter(|fitted| torques.is_possible(fitted, &outcome.scale)) else {
                outcome.evidence = f64::NEG_INFINITY;
                return outcome;
            };
            outcome.left = vec![f64::NAN; self.arm.dof()];
            outcome.likelihood = vec![0.0; self.arm.dof()];
            outcome.residual = vec![Vec::new(); self.arm.dof()];
            outcome.spoken = vec![0.0; self.arm.dof()];
            for (channel, (&joint, left)) in torques.joints.iter().zip(&fitted.left).enumerate() {
                let variance = torques.variance[channel];
                outcome.likelihood[joint] = self.log_likelihood(*left, variance);
                outcome.left[joint] = left / variance;
                outcome.spoken[joint] = torques.spoken(joint, &outcome) / variance;
                outcome.residual[joint].clone_from(&fitted.residual[channel]);
            }
            count += torques.joints.len();
        }
        if self.samples.has_tool() {
            self.judge_tool(&reading, &along, &mut outcome);
            count += 3;
        }
        let data = (self.rows() * count.max(1)) as f64;
        let parameters: usize = changes.iter().map(Change::parameters).sum();
        let odds: f64 = changes.iter().enumerate().map(|(k, change)| change.log_odds(&changes[..k])).sum();
        outcome.evidence =
            outcome.likelihood.iter().sum::<f64>() + odds - 0.5 * parameters as f64 * data.ln();
        outcome
    }

    fn log_likelihood(&self, left: f64, variance: f64) -> f64 {
        -0.5 * self.rows() as f64 * (left + self.floor.powi(2) * variance).ln()
    }

    fn judge_tool(&self, reading: &Reading, along: &Along, outcome: &mut Outcome) {
        let tool = [0, 1, 2].map(|axis| self.thinned(&self.samples.tool(axis, reading.tool_delay)));
        let variance = tool.iter().map(|column| variance(column)).sum::<f64>() / 3.0;
        for (seen, model) in tool.iter().zip(&along.tool) {
            let residual: Vec<f64> = seen.iter().zip(model).map(|(seen, model)| seen - model).collect();
            let left = mean_square(&residual);
            outcome.likelihood.push(self.log_likelihood(left, variance));
            outcome.left.push(left / variance);
            outcome.spoken.push(1.0);
            outcome.residual.push(residual);
        }
    }
}

/// The torque channels of a reading.
struct Torques<'p, 'a> {
    problem: &'p Problem<'a>,
    along: &'p Along,
    key: Vec<u64>,
    changes: &'p [Change],
    /// Joints with a torque that answers at all.
    joints: Vec<usize>,
    measured: Vec<Vec<f64>>,
    variance: Vec<f64>,
    scales: Vec<Scale>,
}

impl<'p, 'a> Torques<'p, 'a> {
    fn new(problem: &'p Problem<'a>, reading: &Reading, along: &'p Along, changes: &'p [Change]) -> Self {
        let mut scales = vec![Scale::Known(1.0); problem.arm.dof()];
        for change in changes {
            match *change {
                Change::Scale(joint) => scales[joint] = Scale::Fitted,
                Change::SameScale(joint, factor) => scales[joint] = Scale::Known(factor),
                Change::CommonScale => scales.fill(Scale::Common),
                _ => {}
            }
        }
        let mut torques = Self {
            problem,
            along,
            key: key(reading),
            changes,
            joints: Vec::new(),
            measured: Vec::new(),
            variance: Vec::new(),
            scales,
        };
        for (joint, read) in reading.torques.iter().enumerate() {
            let column = problem.samples.torque(read.source, reading.torque_delay);
            let column: Vec<f64> = problem.thinned(&column).iter().map(|x| x * read.factor).collect();
            let variance = variance(&column);
            if variance > 0.0 && variance.is_finite() {
                torques.joints.push(joint);
                torques.measured.push(column);
                torques.variance.push(variance);
            }
        }
        torques
    }

    /// The fit, and with it gravity where it is free, and the scales; `None` for a common scale below zero.
    fn fitted(&self, gravity: &mut Vector3<f64>, scale: &mut [f64]) -> Option<Fit> {
        for (scale, kind) in scale.iter_mut().zip(&self.scales) {
            if let Scale::Known(factor) = kind {
                *scale = *factor;
            }
        }
        let is_scaled = self.scales.iter().any(|scale| !matches!(scale, Scale::Known(_)));
        if self.changes.contains(&Change::AnyGravity) {
            let size = gravity.norm();
            for _ in 0..if is_scaled { TURNS } else { 1 } {
                let fitted = fit(&self.channels(gravity, scale, true));
                let turned = Vector3::from_column_slice(&fitted.shared[..3]);
                *gravity = turned.try_normalize(1e-9)? * size;
                if is_scaled {
                    let fitted = fit(&self.channels(gravity, scale, false));
                    self.take_scales(&fitted, scale)?;
                }
            }
        }
        let fitted = fit(&self.channels(gravity, scale, false));
        self.take_scales(&fitted, scale)?;
        let is_shared = !fitted.shared.is_empty();
        if is_scaled && is_shared {
            let again = fit(&self.channels(gravity, scale, false));
            self.take_scales(&again, scale)?;
            return Some(again);
        }
        Some(fitted)
    }

    /// Whether physics beside the reading has sizes that a machine can have.
    fn is_possible(&self, fitted: &Fit, scale: &[f64]) -> bool {
        let of_joint = |(own, &joint): (&Vec<f64>, &usize)| {
            let mut at = FRICTION;
            self.changes.iter().all(|change| match *change {
                Change::Beside(Physics::Rotor(here)) if here == joint => {
                    at += 1;
                    own[at - 1] / scale[joint] <= MOST_ROTOR * self.inertia(joint)
                }
                Change::Beside(Physics::Spring(here) | Physics::Drag(here)) if here == joint => {
                    at += 1;
                    true
                }
                Change::Beside(Physics::Coupling(here, _)) if here == joint => {
                    at += 3;
                    true
                }
                _ => true,
            })
        };
        let mut at = 0;
        let mass: f64 = self.problem.arm.joints().iter().map(|joint| joint.inertia.mass).sum();
        let are_masses = self.changes.iter().all(|change| match change {
            Change::Beside(Physics::Payload) => {
                at += 4;
                (-LEAST_LOAD * mass..=MOST_LOAD * mass).contains(&fitted.shared[at - 4])
            }
            Change::Beside(Physics::Link(joint)) if self.problem.links[*joint].is_some() => {
                at += 1;
                (-LEAST_LINK..=MOST_LINK).contains(&fitted.shared[at - 1])
            }
            _ => true,
        });
        are_masses && fitted.own.iter().zip(&self.joints).all(of_joint)
    }

    /// Inertia that `joint` feels, about.
    fn inertia(&self, joint: usize) -> f64 {
        let a = &self.along.a[joint];
        (dot(&self.along.inertial[joint], a) / dot(a, a).max(f64::MIN_POSITIVE)).max(0.0)
    }

    /// Variance of what the rigid arm of `outcome` asks of `joint`.
    fn spoken(&self, joint: usize, outcome: &Outcome) -> f64 {
        let held = |row: usize| -> f64 {
            (0..3).map(|axis| outcome.gravity[axis] * self.along.gravity[axis][joint][row]).sum()
        };
        let model: Vec<f64> =
            self.along.inertial[joint].iter().enumerate().map(|(row, x)| x + held(row)).collect();
        variance(&model) * outcome.scale[joint].powi(2)
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

    /// The channels: with gravity to be fitted under known scales, or scales under a known gravity.
    fn channels(&self, gravity: &Vector3<f64>, scale: &[f64], is_gravity_free: bool) -> Vec<Channel> {
        let beside = self.beside(gravity);
        let one = |(channel, &joint): (usize, &usize)| {
            let along = self.along;
            let held = |row: usize| -> f64 {
                (0..3).map(|axis| gravity[axis] * along.gravity[axis][joint][row]).sum()
            };
            let inertial = &along.inertial[joint];
            let model: Vec<f64> = if is_gravity_free {
                inertial.clone()
            } else {
                inertial.iter().enumerate().map(|(row, x)| x + held(row)).collect()
            };
            let kind = self.scales[joint];
            let is_known = is_gravity_free || matches!(kind, Scale::Known(_));
            let factor = scale[joint];
            let measured = &self.measured[channel];
            let target = if is_known {
                measured.iter().zip(&model).map(|(seen, model)| seen - factor * model).collect()
            } else {
                measured.clone()
            };
            let times = |column: &[f64]| column.iter().map(|x| factor * x).collect::<Vec<f64>>();
            let mut shared: Vec<Vec<f64>> = if is_gravity_free {
                along.gravity.iter().map(|of_axis| times(&of_axis[joint])).collect()
            } else {
                Vec::new()
            };
            shared.extend(beside.iter().map(|columns| times(&columns[joint])));
            let mut own = self.own(joint);
            match kind {
                Scale::Fitted if !is_known => own.push(Own { column: model, is_positive: true }),
                Scale::Common if !is_known => shared.push(model),
                _ => {}
            }
            let floor = self.problem.floor.powi(2) * self.variance[channel];
            Channel { target, own, shared, floor }
        };
        self.joints.iter().enumerate().map(one).collect()
    }

    /// Friction, offset, and what physics beside the reading this joint has of its own.
    fn own(&self, joint: usize) -> Vec<Own> {
        let along = self.along;
        let turns = |joint: usize| directions(&along.v[joint]);
        let v = &along.v[joint];
        let mut own = vec![
            Own { column: vec![1.0; v.len()], is_positive: false },
            Own { column: turns(joint), is_positive: true },
            Own { column: v.clone(), is_positive: true },
        ];
        for change in self.changes {
            match *change {
                Change::Beside(Physics::Rotor(at)) if at == joint => {
                    own.push(Own { column: along.a[joint].clone(), is_positive: true });
                }
                Change::Beside(Physics::Drag(at)) if at == joint => {
                    let column = v.iter().map(|v| v * v.abs()).collect();
                    own.push(Own { column, is_positive: true });
                }
                Change::Beside(Physics::Spring(at)) if at == joint => {
                    own.push(Own { column: along.q[joint].clone(), is_positive: true });
                }
                Change::Beside(Physics::Coupling(at, other)) if at == joint => {
                    for column in [along.a[other].clone(), along.v[other].clone(), turns(other)] {
                        own.push(Own { column, is_positive: false });
                    }
                }
                _ => {}
            }
        }
        own
    }

    /// Columns that all joints share, `[column][joint][row]`.
    fn beside(&self, gravity: &Vector3<f64>) -> Vec<Vec<Vec<f64>>> {
        let problem = self.problem;
        // An arm with another mass, by its number, and the arm that it is compared with.
        let mut arms: Vec<(usize, &Arm, Option<Numbered>)> = Vec::new();
        let loads = 1 + problem.links.len();
        for change in self.changes {
            match *change {
                Change::Beside(Physics::Payload) => {
                    arms.push((loads, &problem.loads[0], None));
                    let pairs = problem.loads[1..].chunks(2).enumerate();
                    arms.extend(pairs.map(|(k, pair)| {
                        let number = loads + 1 + 2 * k;
                        (number, &pair[0], Some((number + 1, &pair[1])))
                    }));
                }
                Change::Beside(Physics::Link(joint)) => {
                    arms.extend(problem.links[joint].iter().map(|arm| (1 + joint, arm, None)));
                }
                _ => {}
            }
        }
        if arms.is_empty() {
            return Vec::new();
        }
        let bare = self.weighed(0, problem.arm, gravity);
        let column = |(number, arm, less): (usize, &Arm, Option<(usize, &Arm)>)| {
            let base =
                less.map_or_else(|| Rc::clone(&bare), |(number, arm)| self.weighed(number, arm, gravity));
            let with = self.weighed(number, arm, gravity);
            let both = with.iter().zip(base.iter());
            both.map(|(with, less)| with.iter().zip(less).map(|(with, less)| with - less).collect()).collect()
        };
        arms.into_iter().map(column).collect()
    }

    /// Torques of `arm`, known by its `number`, along the motion under `gravity`.
    fn weighed(&self, number: usize, arm: &Arm, gravity: &Vector3<f64>) -> Rc<Vec<Vec<f64>>> {
        let mut key = self.key.clone();
        key.push(number as u64);
        key.extend(gravity.iter().map(|x| x.to_bits()));
        if let Some(known) = self.problem.weighed.borrow().get(&key) {
            return Rc::clone(known);
        }
        let Along { q, v, a, .. } = self.along;
        let torques = Rc::new(self.problem.torques(&arm.with_gravity(*gravity), q, v, a));
        self.problem.weighed.borrow_mut().insert(key, Rc::clone(&torques));
        torques
    }
}

/// −1 to 1: which way a joint turns; between where it hardly does.
fn directions(v: &[f64]) -> Vec<f64> {
    let most = v.iter().fold(0.0_f64, |most, v| most.max(v.abs()));
    v.iter().map(|v| if most > 0.0 { (v / (MOVES * most)).clamp(-1.0, 1.0) } else { 0.0 }).collect()
}

/// `arm` with the link of `joint` twice as heavy; `None` for one without mass.
fn heavier(arm: &Arm, joint: usize) -> Option<Arm> {
    let mut joints = arm.joints().to_vec();
    let inertia = &mut joints[joint].inertia;
    (inertia.mass > 0.0).then_some(())?;
    inertia.mass *= 2.0;
    inertia.about_com *= 2.0;
    Arm::new(arm.name(), joints, *arm.tool(), *arm.gravity()).ok()
}

/// `arm` with 1 kg at its tool, then on either side of it along each axis of the last link.
fn loads(arm: &Arm) -> Vec<Arm> {
    let tool = arm.tool().translation.vector;
    let axes = [Vector3::x(), Vector3::y(), Vector3::z()].map(|axis| axis * LEVER);
    let places = std::iter::once(tool).chain(axes.iter().flat_map(|axis| [tool + axis, tool - axis]));
    let with = |place: Vector3<f64>| {
        let mut joints = arm.joints().to_vec();
        let point = Inertia { mass: 1.0, com: place, about_com: Matrix3::zeros() };
        if let Some(last) = joints.last_mut() {
            last.inertia = last.inertia.joined_with(&point, &Isometry3::identity());
        }
        Arm::new(arm.name(), joints, *arm.tool(), *arm.gravity()).unwrap_or_else(|_| arm.clone())
    };
    places.map(with).collect()
}

/// What of a reading the motion depends on.
fn key(reading: &Reading) -> Vec<u64> {
    let of_joint = |position: &super::reading::PositionReading| {
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

/// About the mean.
pub(crate) fn variance(column: &[f64]) -> f64 {
    let mean = column.iter().sum::<f64>() / column.len().max(1) as f64;
    column.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / column.len().max(1) as f64
}
