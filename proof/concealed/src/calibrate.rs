//! Strength of an effect: its trace in the recording, compared with noise and tolerances.
//!
//! The same machine, with the same tolerances and motion, runs with and without the effect. In both runs the data sheet is compared with noise-free sensors:
//! torque minus inverse dynamics and nominal friction, tool minus forward kinematics. The trace of the effect is the difference of the two; the floor is the
//! residual without it, tolerances and noise together.

use freeplay_arm::{Arm, Workspace, crba, forward_kinematics, rnea};
use nalgebra::DMatrix;

use crate::data_sheet_deviations::DataSheetDeviations;
use crate::machine::{Plan, Trace};
use crate::sensors::{Chain, Clean};

/// Time between points, s.
const GRID: f64 = 4e-3;
/// Half the distance of central differences, s.
const HALF: f64 = 2e-3;
/// Points to either side of a moving average: a trace has no content above some 20 Hz.
const EITHER_SIDE: usize = 3;
/// A joint slower than this share of its largest speed counts as standing.
const STANDS: f64 = 2e-3;
/// Least lever of a joint on the tool in an initial guess, m.
const LEAST_LEVER: f64 = 0.05;

/// Residual of the data sheet against the machine along a motion, without noise.
#[derive(Clone, Debug, Default)]
pub(crate) struct Residual {
    /// By joint; NaN while the joint stands.
    torque: Vec<Vec<f64>>,
    /// Root mean square of the faster content, by joint.
    rough: Vec<f64>,
    tool: Vec<[f64; 3]>,
}

impl Residual {
    /// True if a joint shakes by more than the floor, faster than any motion: a servo that has lost its damping.
    pub fn shakes(&self, floor: &Floor) -> bool {
        self.rough.iter().zip(&floor.torque).any(|(rough, floor)| rough > floor)
    }

    /// Tool position minus that in `without`, m, point by point.
    pub fn tool_shift(&self, without: &Residual) -> impl Iterator<Item = [f64; 3]> {
        self.tool.iter().zip(&without.tool).map(|(a, b)| [0, 1, 2].map(|i| a[i] - b[i]))
    }
}

#[cfg(test)]
impl Residual {
    /// Root mean square by joint, and that of the tool.
    pub fn sizes(&self) -> (Vec<f64>, f64) {
        let torque = self.torque.iter().map(|r| rms(r.iter().copied())).collect();
        (torque, rms(self.tool.iter().map(length)))
    }
}

/// Residuals without an effect, and the size of the motion; all root mean squares unless stated otherwise.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Floor {
    /// Torque: tolerances and noise, N·m or N, by joint.
    pub torque: Vec<f64>,
    /// Tool: tolerances and noise, m.
    pub tool: f64,
    /// Speed, rad/s or m/s.
    pub speed: Vec<f64>,
    /// Acceleration, rad/s² or m/s².
    pub acceleration: Vec<f64>,
    /// Model torque without friction, N·m or N.
    pub load: Vec<f64>,
    /// Share of the time, 0 to ½, in which the model torque without friction has its less frequent sign.
    pub reversal: Vec<f64>,
    /// Largest absolute torque, friction included.
    pub peak: Vec<f64>,
    /// Nominal friction.
    pub friction: Vec<f64>,
    /// Standard deviation of the position, rad or m.
    pub way: Vec<f64>,
    /// Mean position, rad or m.
    pub middle: Vec<f64>,
    /// Movement of the tool per movement of the joint, m.
    pub lever: Vec<f64>,
    /// Effective inertia in the mean position, kg·m² or kg.
    pub effective_inertia: Vec<f64>,
}

/// Strength of an effect.
#[derive(Clone, Debug, PartialEq)]
pub struct Strength {
    /// Root mean square of the effect's trace over that of the floor, in the channel where this is largest.
    pub signal_to_floor: f64,
    /// That channel: `tau1`…, or `tool`.
    pub channel: String,
}

/// Workspace for the residuals along a motion.
struct ResidualWorkspace<'a> {
    nominal: &'a Arm,
    ws: Workspace,
    q: Vec<f64>,
    v: Vec<f64>,
    a: Vec<f64>,
    tau: Vec<f64>,
    model: Vec<f64>,
}

impl<'a> ResidualWorkspace<'a> {
    fn new(nominal: &'a Arm) -> Self {
        let zeros = vec![0.0; nominal.dof()];
        let ws = Workspace::new(nominal);
        Self {
            nominal,
            ws,
            q: zeros.clone(),
            v: zeros.clone(),
            a: zeros.clone(),
            tau: zeros.clone(),
            model: zeros,
        }
    }

    /// Evaluates the sensors and the model's torque without friction at `t`.
    fn evaluate(&mut self, clean: &Clean<'_>, t: f64) {
        let n = self.q.len();
        let (mut before, mut after) = (vec![0.0; n], vec![0.0; n]);
        clean.positions(t - HALF, &mut before);
        clean.positions(t, &mut self.q);
        clean.positions(t + HALF, &mut after);
        for i in 0..n {
            self.v[i] = (after[i] - before[i]) / (2.0 * HALF);
            self.a[i] = (after[i] - 2.0 * self.q[i] + before[i]) / (HALF * HALF);
        }
        clean.torques(t, &mut self.tau);
        rnea(self.nominal, &mut self.ws, &self.q, &self.v, &self.a, &mut self.model);
    }

    fn friction(&self, i: usize) -> Option<f64> {
        let joint = &self.nominal.joints()[i];
        let v = self.v[i];
        (v.abs() > STANDS * joint.limits.velocity)
            .then(|| joint.friction.viscous * v + joint.friction.coulomb * v.signum())
    }

    fn tool(&mut self, clean: &Clean<'_>, t: f64) -> [f64; 3] {
        let model = forward_kinematics(self.nominal, &mut self.ws, &self.q).translation.vector;
        let seen = clean.tool(t);
        [0, 1, 2].map(|i| seen[i] - model[i])
    }
}

fn grid(duration: f64) -> impl Iterator<Item = f64> {
    (1..(duration / GRID) as usize).map(|k| k as f64 * GRID)
}

/// Residual of the data sheet against the machine over the first `duration` s.
pub(crate) fn residual(
    nominal: &Arm,
    plan: &Plan,
    trace: &Trace,
    deviations: &DataSheetDeviations,
    duration: f64,
) -> Residual {
    let clean = Clean::new(plan, trace, deviations);
    let mut workspace = ResidualWorkspace::new(nominal);
    let mut residual = Residual { torque: vec![Vec::new(); nominal.dof()], ..Residual::default() };
    for t in grid(duration) {
        workspace.evaluate(&clean, t);
        for (i, torque) in residual.torque.iter_mut().enumerate() {
            torque.push(
                workspace
                    .friction(i)
                    .map_or(f64::NAN, |friction| workspace.tau[i] - workspace.model[i] - friction),
            );
        }
        residual.tool.push(workspace.tool(&clean, t));
    }
    for torque in &mut residual.torque {
        let smooth = smoothed(torque);
        residual.rough.push(rms(torque.iter().zip(&smooth).map(|(all, smooth)| all - smooth)));
        *torque = smooth;
    }
    residual
}

/// The mean of each point's finite neighbours; NaN if the point itself is NaN.
fn smoothed(values: &[f64]) -> Vec<f64> {
    let mean = |at: usize| {
        let window = &values[at.saturating_sub(EITHER_SIDE)..(at + EITHER_SIDE + 1).min(values.len())];
        let (sum, count) =
            window.iter().filter(|v| !v.is_nan()).fold((0.0, 0.0), |(sum, count), v| (sum + v, count + 1.0));
        if values[at].is_nan() { f64::NAN } else { sum / count }
    };
    (0..values.len()).map(mean).collect()
}

/// Root mean square of the finite values; zero if there are none.
fn rms(values: impl Iterator<Item = f64>) -> f64 {
    let (mut sum, mut count) = (0.0, 0_u32);
    for value in values.filter(|value| !value.is_nan()) {
        sum += value * value;
        count += 1;
    }
    if count == 0 { 0.0 } else { (sum / f64::from(count)).sqrt() }
}

fn length(p: &[f64; 3]) -> f64 {
    p.iter().map(|x| x * x).sum::<f64>().sqrt()
}

/// The floor, and the size of the motion, from the machine without effects.
pub(crate) fn floor(
    nominal: &Arm,
    plan: &Plan,
    trace: &Trace,
    deviations: &DataSheetDeviations,
    chain: &Chain,
    duration: f64,
) -> (Floor, Residual) {
    let without = residual(nominal, plan, trace, deviations, duration);
    let clean = Clean::new(plan, trace, deviations);
    let mut workspace = ResidualWorkspace::new(nominal);
    let n = nominal.dof();
    let mut seen: [Vec<Vec<f64>>; 5] = std::array::from_fn(|_| vec![Vec::new(); n]);
    let mut peak = vec![0.0_f64; n];
    for t in grid(duration).step_by(5) {
        workspace.evaluate(&clean, t);
        for i in 0..n {
            let row = [
                workspace.q[i],
                workspace.v[i],
                workspace.a[i],
                workspace.model[i],
                workspace.friction(i).unwrap_or(0.0),
            ];
            seen.iter_mut().zip(row).for_each(|(column, value)| column[i].push(value));
            peak[i] = peak[i].max(workspace.tau[i].abs());
        }
    }
    let mean = |values: &Vec<f64>| values.iter().sum::<f64>() / values.len().max(1) as f64;
    let sizes = |column: &[Vec<f64>]| column.iter().map(|v| rms(v.iter().copied())).collect::<Vec<_>>();
    let middle: Vec<f64> = seen[0].iter().map(mean).collect();
    let way = seen[0].iter().zip(&middle).map(|(q, m)| rms(q.iter().map(|q| q - m))).collect();
    let reversal = seen[3].iter().map(|load| {
        let positive = load.iter().filter(|load| **load > 0.0).count() as f64 / load.len().max(1) as f64;
        positive.min(1.0 - positive)
    });
    let torque = without.torque.iter().zip(&chain.torque_noise);
    let torque = torque.map(|(r, noise)| rms(r.iter().copied()).hypot(*noise)).collect();
    let tool = rms(without.tool.iter().map(length)).hypot(3.0_f64.sqrt() * chain.tool_noise);
    let (lever, effective_inertia) = geometry(nominal, &middle);
    let floor = Floor {
        torque,
        tool,
        speed: sizes(&seen[1]),
        acceleration: sizes(&seen[2]),
        load: sizes(&seen[3]),
        reversal: reversal.collect(),
        friction: sizes(&seen[4]),
        peak,
        way,
        middle,
        lever,
        effective_inertia,
    };
    (floor, without)
}

/// Lever of each joint on the tool and its effective inertia, in posture `q`.
fn geometry(nominal: &Arm, q: &[f64]) -> (Vec<f64>, Vec<f64>) {
    let n = nominal.dof();
    let mut ws = Workspace::new(nominal);
    let mut jacobian = DMatrix::zeros(6, n);
    freeplay_arm::jacobian(nominal, &mut ws, q, &mut jacobian);
    let lever = (0..n).map(|i| jacobian.fixed_view::<3, 1>(0, i).norm().max(LEAST_LEVER)).collect();
    let mut m = DMatrix::zeros(n, n);
    crba(nominal, &mut ws, q, &mut m);
    (lever, (0..n).map(|i| m[(i, i)]).collect())
}

/// Strength of an effect that turns the residual `without` into `with`; in the tool alone if `tool_only`.
pub(crate) fn strength(with: &Residual, without: &Residual, floor: &Floor, tool_only: bool) -> Strength {
    let tool = with.tool_shift(without).map(|shift| length(&shift));
    let mut best = Strength { signal_to_floor: rms(tool) / floor.tool, channel: "tool".to_owned() };
    let joints = if tool_only { 0 } else { with.torque.len() };
    for (i, (a, b)) in with.torque.iter().zip(&without.torque).enumerate().take(joints) {
        let ratio = rms(a.iter().zip(b).map(|(a, b)| a - b)) / floor.torque[i];
        if ratio > best.signal_to_floor {
            best = Strength { signal_to_floor: ratio, channel: format!("tau{}", i + 1) };
        }
    }
    best
}
