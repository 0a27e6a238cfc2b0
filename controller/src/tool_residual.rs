//! Online estimate of the residual of the tracked tool: the slowly varying part of the deviation that the physical prediction misses.
//!
//! At tick k the tool deviates from the plan by the residual `r = p_tool − FK(q_target) − d`, where q_target is the corrected motion for
//! that tick and d the deviation that the physical prediction gave. The filter works in the frame of the contact, whose first axis follows
//! d. In that frame a wrong clearance gives a constant residual, and so does a missing friction while the joint turns in one direction.
//! Two first-order low-pass filters smooth r, and the result is added to the planned deviations. Because r excludes the plan's own
//! correction, the loop is an internal-model control: its filter acts as an integrator on the tool, and the ticks between plan and
//! measurement reduce the speed but not the stability (Morari & Zafiriou 1989, ch. 4).
//!
//! While another controller's command is in force (this one is a standby, or a hand-over blends), the joints do not follow this
//! controller's plan. FK then uses the measured joints: the part of r by the play is the same whichever controller moves the arm, so a
//! standby has learned it before it takes over. With its own plan in FK, the standby would learn the other controller's correction. Once
//! its own command is in force, the controller uses the measured joints for another `SETTLING`, and then blends to the plan within
//! `RETURN`.
//!
//! Bounces are no slow residual. One step of the filter is limited to [`LARGEST_STEP`] of the reach, and the estimate is frozen while r
//! moves by more than [`BOUNCE_MOVEMENT`] of the reach within `BOUNCE_TICKS` ticks.

use freeplay_arm::{Arm, Workspace, forward_kinematics};
use freeplay_shm::{Joints, State};
use nalgebra::{Rotation3, Vector3};

use crate::compensation::Motion;
use crate::tracking::Plan;

/// Longest innovation that is not limited, share of the reach.
pub const LARGEST_STEP: f64 = 0.05;
/// Movement of the residual that counts as a bounce, share of the reach.
pub const BOUNCE_MOVEMENT: f64 = 0.05;
/// Ticks within which that movement counts as a bounce, and for which the estimate is frozen after it.
const BOUNCE_TICKS: usize = 10;
/// Largest estimate, share of the reach.
pub const LARGEST_ESTIMATE: f64 = 0.5;
/// Time constant of the first filter, s.
const FILTER: f64 = 0.05;
/// Time constant of the second filter, s; it smooths the signal for two differentiations.
const SMOOTHING: f64 = 0.02;
/// After a takeover, the expected tool position comes from the measured joints for this time, s.
const SETTLING: f64 = 0.2;
/// Time of the blend back to the planned joints, s.
const RETURN: f64 = 0.2;
/// Reach if the model has no play, m.
const REACH_WITHOUT_PLAY: f64 = 1e-3;
/// If the deviation is below this share of the reach, the frame does not follow its direction.
const LEAST_DIRECTION: f64 = 0.2;
/// Largest delay of the tracker that the estimate accepts, ticks.
pub const LONGEST_DELAY: u64 = 50;
/// Number of stored instants; more than lie between plan and measurement.
const REMEMBERED: usize = 64;

/// Expected values of one instant.
#[derive(Clone, Copy)]
struct Expected {
    tick: u64,
    /// Rotation from the frame of the contact to the base frame.
    frame: Rotation3<f64>,
    /// Deviation by physics, base frame, m.
    physics: Vector3<f64>,
    /// Tool of the perfect arm at the corrected motion, base frame, m; `None` until it is known.
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
    /// The last answer. It is in force during the next tick if its controller is active.
    said: Option<Joints>,
    /// Time for which the own command has been in force, s; limited to `SETTLING` + `RETURN`.
    in_force: f64,
    frame: Rotation3<f64>,
    /// The latest residuals, frame of the contact, m.
    latest: [Vector3<f64>; BOUNCE_TICKS],
    measured: usize,
    /// Remaining ticks for which the estimate is frozen.
    frozen_ticks: usize,
    estimate: Vector3<f64>,
    smooth: Vector3<f64>,
}

impl ToolResidual {
    /// Creates an estimate for the nominal `arm` whose plays reach `reach` m together, ticks of `period` s, and tool poses that are
    /// `delay` ticks old.
    pub fn new(arm: &Arm, reach: f64, period: f64, delay: u64) -> ToolResidual {
        ToolResidual {
            workspace: Workspace::new(arm),
            arm: arm.clone(),
            period,
            reach: if reach > 0.0 { reach } else { REACH_WITHOUT_PLAY },
            delay,
            expected: [None; REMEMBERED],
            said: None,
            in_force: SETTLING + RETURN,
            frame: Rotation3::identity(),
            latest: [Vector3::zeros(); BOUNCE_TICKS],
            measured: 0,
            frozen_ticks: 0,
            estimate: Vector3::zeros(),
            smooth: Vector3::zeros(),
        }
    }

    /// Clears the expected values, for a motion that does not continue the last one; the estimate stays.
    pub fn restart(&mut self) {
        self.expected = [None; REMEMBERED];
        self.said = None;
        self.measured = 0;
    }

    /// The estimate in the frame of the contact, m: along the deviation, then across it.
    pub fn learned(&self) -> &Vector3<f64> {
        &self.smooth
    }

    /// The estimate as it was last added to a plan, base frame, m.
    pub fn now(&self) -> Vector3<f64> {
        self.frame * self.smooth
    }

    /// Updates the estimate by the measured tool of `state`, if there is one for a planned instant.
    pub fn observe(&mut self, state: &State) {
        self.follow(state);
        let Some(residual) = self.residual(state) else { return };
        let oldest = self.measured % BOUNCE_TICKS;
        let moved = (residual - self.latest[oldest]).norm();
        self.latest[oldest] = residual;
        self.measured += 1;
        if self.measured <= BOUNCE_TICKS || moved > BOUNCE_MOVEMENT * self.reach {
            self.frozen_ticks = BOUNCE_TICKS;
        }
        if self.frozen_ticks > 0 {
            self.frozen_ticks -= 1;
        } else {
            let step = shortened(residual - self.estimate, LARGEST_STEP * self.reach);
            let estimate = self.estimate + step * (self.period / FILTER).min(1.0);
            self.estimate = shortened(estimate, LARGEST_ESTIMATE * self.reach);
        }
        self.smooth += (self.estimate - self.smooth) * (self.period / SMOOTHING).min(1.0);
    }

    /// The residual r at the instant of the measurement in `state`, frame of the contact.
    fn residual(&self, state: &State) -> Option<Vector3<f64>> {
        let tracked = state.has(State::FLAG_TOOL_TRACKED) && !state.has(State::FLAG_FALLBACK);
        let instant = state.tick.checked_sub(self.delay).filter(|_| tracked)?;
        let expected = self.expected[slot(instant)].filter(|expected| expected.tick == instant)?;
        let measured = Vector3::new(state.tool[0], state.tool[1], state.tool[2]);
        let beyond = measured - expected.tool? - expected.physics;
        let finite = beyond.iter().all(|value| value.is_finite());
        finite.then(|| expected.frame.inverse_transform_vector(&beyond))
    }

    /// Stores the deviation of `plan` and returns the estimate to add to it, base frame, m.
    pub fn estimate_for(&mut self, plan: &Plan<'_>) -> Vector3<f64> {
        if plan.deviation.norm() > LEAST_DIRECTION * self.reach {
            let now = self.frame * Vector3::x();
            self.frame = least_turn(&now, &plan.deviation) * self.frame;
        }
        let expected = Expected { tick: plan.tick, frame: self.frame, physics: plan.deviation, tool: None };
        self.expected[slot(plan.tick)] = Some(expected);
        self.frame * self.smooth
    }

    /// Stores that the answer `said` sends the joints along `target` at the instant of `tick`.
    pub fn aim(&mut self, tick: u64, target: Motion<'_>, said: &Joints) {
        self.said = Some(*said);
        self.expect(tick, target.q);
    }

    /// Sets the expected joints to the measured ones of `state`, as far as the joints do not follow the plan.
    fn follow(&mut self, state: &State) {
        let joints = state.joints as usize;
        let is_own = self.said.is_none_or(|said| said[..joints] == state.applied[..joints]);
        self.in_force = if is_own { (self.in_force + self.period).min(SETTLING + RETURN) } else { 0.0 };
        let share = (self.in_force - SETTLING) / RETURN;
        if share >= 1.0 {
            return;
        }
        let planned = self.expected[slot(state.tick)].filter(|expected| expected.tick == state.tick);
        let planned = planned.and_then(|expected| expected.tool);
        self.expect(state.tick, &state.q[..joints]);
        let measured = self.expected[slot(state.tick)].as_mut().and_then(|expected| expected.tool.as_mut());
        if let (Some(planned), Some(measured)) = (planned, measured) {
            *measured += (planned - *measured) * share.max(0.0);
        }
    }

    /// Computes and stores the expected tool position for the joints at `q`, at the instant of `tick`.
    fn expect(&mut self, tick: u64, q: &[f64]) {
        let tool = forward_kinematics(&self.arm, &mut self.workspace, q).translation.vector;
        if let Some(expected) = self.expected[slot(tick)].as_mut().filter(|expected| expected.tick == tick) {
            expected.tool = Some(tool);
        }
    }
}

/// The smallest rotation from the direction of `from` to that of `to`. The function returns no rotation if they are opposite, since then
/// the axis is undefined. It uses the arc tangent, because the arc cosine of a product rounded to above 1 is NaN.
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

/// `vector`, limited to the length `most`.
fn shortened(vector: Vector3<f64>, most: f64) -> Vector3<f64> {
    let length = vector.norm();
    if length > most { vector * (most / length) } else { vector }
}

#[cfg(test)]
mod tests {
    use super::ToolResidual;
    use crate::compensation::Motion;
    use crate::tracking::Plan;
    use freeplay_arm::{Workspace, forward_kinematics};
    use freeplay_model::paper_arm;
    use freeplay_shm::State;
    use nalgebra::Vector3;

    const PERIOD: f64 = 1e-3;
    /// Deviation by the physical prediction, and the deviation beyond it, m.
    const PHYSICS: Vector3<f64> = Vector3::new(0.0, 0.0, -0.5e-3);
    const BEYOND: Vector3<f64> = Vector3::new(0.0, 0.0, -0.04e-3);

    /// Returns the estimate along the deviation after `ticks` ticks. The joints stay at zero while the plan has them elsewhere; from the
    /// tick `takes_over` on, the own command is in force and the joints follow the plan.
    fn learned(ticks: u64, takes_over: u64) -> f64 {
        let arm = paper_arm().arm;
        let n = arm.dof();
        let mut workspace = Workspace::new(&arm);
        let mut residual = ToolResidual::new(&arm, 0.6e-3, PERIOD, 0);
        let (mut planned, rest) = ([0.0; 12], [0.0; 12]);
        planned[1] = 4e-4;
        let mut state = State::new(1, n);
        state.flags = State::FLAG_TOOL_TRACKED;
        for tick in 0..ticks {
            let is_own = tick >= takes_over;
            state.tick = tick;
            state.q = if is_own { planned } else { rest };
            state.applied[0] = if is_own { 7.0 } else { 5.0 };
            let tool = forward_kinematics(&arm, &mut workspace, &state.q[..n]).translation.vector;
            state.tool[..3].copy_from_slice((tool + PHYSICS + BEYOND).as_slice());
            residual.observe(&state);
            let motion = Motion { q: &rest[..n], v: &rest[..n], a: &rest[..n] };
            residual.estimate_for(&Plan { tick: tick + 2, motion, deviation: PHYSICS });
            let target = Motion { q: &planned[..n], v: &rest[..n], a: &rest[..n] };
            let mut said = [0.0; 12];
            said[0] = 7.0;
            residual.aim(tick + 1, target, &said);
        }
        residual.learned().x
    }

    #[test]
    fn a_standby_learns_what_the_play_does_and_not_what_another_did_not_correct() {
        let expected = BEYOND.norm();
        for (what, takes_over) in [("on standby", u64::MAX), ("in charge", 0), ("after a while", 700)] {
            let found = learned(1500, takes_over);
            println!("{what}: {:.3} µm of {:.3} µm", found * 1e6, expected * 1e6);
            assert!((found / expected - 1.0).abs() < 1e-3, "{what}: {found}");
        }
    }
}
