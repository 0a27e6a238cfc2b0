//! What the tracked tool says that physics does not: the slowly varying part of the deviation beyond the prediction, learned online.
//!
//! At tick k the tool is where the joints were sent, plus what the plan did not know: `r = p_tool − FK(q_target) − d`, with q_target
//! the corrected motion meant for that tick and d the deviation that physics predicted there. In the frame of the contact (first
//! axis along d, carried along as d turns) a wrong clearance is a constant, and so is a friction that was left out, for as long as
//! the joint turns one way. There r passes two first-order filters, and what comes out is added to the deviations planned for. With
//! the plan's own correction taken out of r, the loop is an internal-model control: its filter makes an integral action on the tool,
//! and the ticks between plan and measurement cost speed but not stability (Morari & Zafiriou 1989, ch. 4).
//!
//! Bounces are no slow residual: a step of the filter is never longer than [`LONGEST_STEP`] of the reach, and while r moves by more
//! than [`BOUNCE`] of it within `BOUNCE_TICKS` ticks the estimate stands still.

use freeplay_arm::{Arm, Workspace, forward_kinematics};
use freeplay_shm::State;
use nalgebra::{Rotation3, Vector3};

use crate::compensation::Motion;
use crate::tracking::Plan;

/// Longest innovation that counts in full, share of the reach.
pub const LONGEST_STEP: f64 = 0.05;
/// Movement of the residual that is a bounce, share of the reach.
pub const BOUNCE: f64 = 0.05;
/// Ticks within which it is one, and for which the estimate stands still after it.
const BOUNCE_TICKS: usize = 10;
/// Largest estimate, share of the reach.
pub const LARGEST: f64 = 0.5;
/// Time constant of the first filter, s.
const FILTER: f64 = 0.05;
/// Time constant of the second, which smooths what is to be differentiated twice, s.
const SMOOTHING: f64 = 0.02;
/// Reach where the model knows of no play, m.
const REACH_WITHOUT_PLAY: f64 = 1e-3;
/// A deviation below this share of the reach has no direction worth following.
const LEAST_DIRECTION: f64 = 0.2;
/// Oldest reading of a tracker that is understood, ticks.
pub const LONGEST_DELAY: u64 = 50;
/// Instants that are remembered: more than lie between plan and measurement.
const REMEMBERED: usize = 64;

/// What was expected of one instant.
#[derive(Clone, Copy)]
struct Expected {
    tick: u64,
    /// From the frame of the contact to the base frame.
    frame: Rotation3<f64>,
    /// Deviation by physics, base frame, m.
    physics: Vector3<f64>,
    /// Tool of the perfect arm at the corrected motion, base frame, m, once that is known.
    tool: Option<Vector3<f64>>,
}

/// The estimate of one run; see the module. Without a tracked tool it stays zero.
pub struct ToolResidual {
    arm: Arm,
    workspace: Workspace,
    period: f64,
    reach: f64,
    /// Age of a measured tool pose, ticks.
    delay: u64,
    expected: [Option<Expected>; REMEMBERED],
    frame: Rotation3<f64>,
    /// The latest residuals, frame of the contact, m.
    latest: [Vector3<f64>; BOUNCE_TICKS],
    measured: usize,
    /// Ticks for which the estimate still stands still.
    waiting: usize,
    estimate: Vector3<f64>,
    smooth: Vector3<f64>,
}

impl ToolResidual {
    /// For the nominal `arm` whose plays together reach `reach` m, ticks of `period` s, and tool poses that are `delay` ticks old.
    pub fn new(arm: &Arm, reach: f64, period: f64, delay: u64) -> ToolResidual {
        ToolResidual {
            workspace: Workspace::new(arm),
            arm: arm.clone(),
            period,
            reach: if reach > 0.0 { reach } else { REACH_WITHOUT_PLAY },
            delay,
            expected: [None; REMEMBERED],
            frame: Rotation3::identity(),
            latest: [Vector3::zeros(); BOUNCE_TICKS],
            measured: 0,
            waiting: 0,
            estimate: Vector3::zeros(),
            smooth: Vector3::zeros(),
        }
    }

    /// Forgets what was expected, for a motion that does not continue the last one; what was learned stays.
    pub fn restart(&mut self) {
        self.expected = [None; REMEMBERED];
        self.measured = 0;
    }

    /// The estimate in the frame of the contact, m: along the deviation, and across it.
    pub fn learned(&self) -> &Vector3<f64> {
        &self.smooth
    }

    /// The estimate as it was last added to a plan, base frame, m.
    pub fn now(&self) -> Vector3<f64> {
        self.frame * self.smooth
    }

    /// Takes the measured tool of `state`, if there is one that the plan was for.
    pub fn observe(&mut self, state: &State) {
        let Some(residual) = self.residual(state) else { return };
        let oldest = self.measured % BOUNCE_TICKS;
        let moved = (residual - self.latest[oldest]).norm();
        self.latest[oldest] = residual;
        self.measured += 1;
        if self.measured <= BOUNCE_TICKS || moved > BOUNCE * self.reach {
            self.waiting = BOUNCE_TICKS;
        }
        if self.waiting > 0 {
            self.waiting -= 1;
        } else {
            let step = shortened(residual - self.estimate, LONGEST_STEP * self.reach);
            let estimate = self.estimate + step * (self.period / FILTER).min(1.0);
            self.estimate = shortened(estimate, LARGEST * self.reach);
        }
        self.smooth += (self.estimate - self.smooth) * (self.period / SMOOTHING).min(1.0);
    }

    /// r at the instant of the measurement in `state`, frame of the contact.
    fn residual(&self, state: &State) -> Option<Vector3<f64>> {
        let tracked = state.has(State::FLAG_TOOL_TRACKED) && !state.has(State::FLAG_FALLBACK);
        let instant = state.tick.checked_sub(self.delay).filter(|_| tracked)?;
        let expected = self.expected[slot(instant)].filter(|expected| expected.tick == instant)?;
        let measured = Vector3::new(state.tool[0], state.tool[1], state.tool[2]);
        let beyond = measured - expected.tool? - expected.physics;
        let finite = beyond.iter().all(|value| value.is_finite());
        finite.then(|| expected.frame.inverse_transform_vector(&beyond))
    }

    /// Remembers the deviation of `plan` and says what to add to it, base frame, m.
    pub fn beyond(&mut self, plan: &Plan<'_>) -> Vector3<f64> {
        if plan.deviation.norm() > LEAST_DIRECTION * self.reach {
            let now = self.frame * Vector3::x();
            self.frame = least_turn(&now, &plan.deviation) * self.frame;
        }
        let expected = Expected { tick: plan.tick, frame: self.frame, physics: plan.deviation, tool: None };
        self.expected[slot(plan.tick)] = Some(expected);
        self.frame * self.smooth
    }

    /// Remembers that the joints are sent along `target` at the instant of `tick`.
    pub fn aim(&mut self, tick: u64, target: Motion<'_>) {
        let tool = forward_kinematics(&self.arm, &mut self.workspace, target.q).translation.vector;
        if let Some(expected) = self.expected[slot(tick)].as_mut().filter(|expected| expected.tick == tick) {
            expected.tool = Some(tool);
        }
    }
}

/// The smallest rotation that takes the direction of `from` to that of `to`; none where they point against each other, since then any
/// half turn would do. By the arc tangent: the arc cosine of a product rounded to above 1 is not a number.
fn least_turn(from: &Vector3<f64>, to: &Vector3<f64>) -> Rotation3<f64> {
    let axis = from.cross(to);
    let sine = axis.norm();
    if sine > 0.0 {
        Rotation3::from_scaled_axis(axis * (sine.atan2(from.dot(to)) / sine))
    } else {
        Rotation3::identity()
    }
}

fn slot(tick: u64) -> usize {
    (tick % REMEMBERED as u64) as usize
}

/// `vector`, no longer than `most`.
fn shortened(vector: Vector3<f64>, most: f64) -> Vector3<f64> {
    let length = vector.norm();
    if length > most { vector * (most / length) } else { vector }
}
