//! Inputs of the network: groups of signals of the planned motion alone; a network uses a group as a whole or not at all.

use freeplay_arm::{Arm, Workspace, rnea};
use serde::{Deserialize, Serialize};

use crate::compensation::Motion;

/// Travel over which [`InputGroup::Turn`] changes from one direction to the other, rad (m): friction reverses within a few mrad.
const TURN: f64 = 2e-3;

/// A group of input signals.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum InputGroup {
    /// Positions of the joints, rad (m).
    Position,
    /// Velocities of the joints, rad/s (m/s).
    Velocity,
    /// Torques of the model's rigid arm, N·m (N).
    Load,
    /// Direction of each joint with the distance since its reversal: s + (h₀ − s) exp(−x/δ), with s = ±1 the direction, x the travel since
    /// the reversal and h₀ the value at the reversal (the state variable of Dahl 1968).
    Turn,
    /// Time since the motion began, s.
    Elapsed,
}

impl InputGroup {
    /// All groups, roughly in the order of their information on most machines.
    pub const ALL: [InputGroup; 5] =
        [InputGroup::Position, InputGroup::Velocity, InputGroup::Turn, InputGroup::Load, InputGroup::Elapsed];

    /// Number of channels of the group for an arm of `joints` joints.
    pub fn width(self, joints: usize) -> usize {
        if self == InputGroup::Elapsed { 1 } else { joints }
    }

    /// Names of the channels.
    pub fn names(self, joints: usize) -> Vec<String> {
        let name = match self {
            InputGroup::Position => "position",
            InputGroup::Velocity => "velocity",
            InputGroup::Load => "load",
            InputGroup::Turn => "turn",
            InputGroup::Elapsed => return vec!["elapsed".to_owned()],
        };
        (1..=joints).map(|joint| format!("{name}_{joint}")).collect()
    }
}

/// The input signals along one motion; nothing is allocated after [`Inputs::new`].
pub struct Inputs {
    arm: Arm,
    workspace: Workspace,
    groups: Vec<InputGroup>,
    period: f64,
    /// Instant of the last call, and the joint positions there.
    last: Option<u64>,
    before: Vec<f64>,
    turns: Vec<f64>,
    load: Vec<f64>,
    row: Vec<f64>,
}

impl Inputs {
    /// Creates the signals of `groups` for the nominal `arm` of the model in ticks of `period` s.
    pub fn new(arm: &Arm, groups: &[InputGroup], period: f64) -> Inputs {
        let joints = arm.dof();
        let width = groups.iter().map(|group| group.width(joints)).sum();
        Inputs {
            workspace: Workspace::new(arm),
            arm: arm.clone(),
            groups: groups.to_vec(),
            period,
            last: None,
            before: vec![0.0; joints],
            turns: vec![0.0; joints],
            load: vec![0.0; joints],
            row: vec![0.0; width],
        }
    }

    /// Number of channels.
    pub fn len(&self) -> usize {
        self.row.len()
    }

    /// Returns true if there is no channel.
    pub fn is_empty(&self) -> bool {
        self.row.is_empty()
    }

    /// The inputs at the instant of `tick` on `motion`. Call it for one instant after another; after a gap no joint has a direction yet.
    pub fn at(&mut self, tick: u64, motion: Motion<'_>) -> &[f64] {
        if self.groups.contains(&InputGroup::Turn) {
            self.turn(tick, motion.q);
        }
        self.before.copy_from_slice(motion.q);
        self.last = Some(tick);
        if self.groups.contains(&InputGroup::Load) {
            rnea(&self.arm, &mut self.workspace, motion.q, motion.v, motion.a, &mut self.load);
        }
        let elapsed = [tick as f64 * self.period];
        let mut rest = self.row.as_mut_slice();
        for group in &self.groups {
            let values = match group {
                InputGroup::Position => motion.q,
                InputGroup::Velocity => motion.v,
                InputGroup::Load => &self.load,
                InputGroup::Turn => &self.turns,
                InputGroup::Elapsed => &elapsed,
            };
            let (here, others) = rest.split_at_mut(values.len());
            here.copy_from_slice(values);
            rest = others;
        }
        &self.row
    }
}

impl Inputs {
    /// Updates the direction of each joint for the positions `q` at the instant of `tick`.
    fn turn(&mut self, tick: u64, q: &[f64]) {
        let follows = self.last.is_some_and(|last| last.checked_add(1) == Some(tick));
        for (joint, turn) in self.turns.iter_mut().enumerate() {
            let travel = q[joint] - self.before[joint];
            if !follows {
                // The direction is unknown at first; it builds up over the first 2 mrad.
                *turn = 0.0;
            } else if travel != 0.0 {
                let way = travel.signum();
                *turn = way + (*turn - way) * (-travel.abs() / TURN).exp();
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::{InputGroup, Inputs, TURN};
    use crate::compensation::Motion;
    use freeplay_model::paper_arm;

    /// After a long travel and then δ beyond a reversal, the state is (1 − 2/e) times the direction, at any speed. A gap resets the state,
    /// and a joint at rest has no direction.
    #[test]
    fn the_direction_turns_with_the_travel_and_not_with_time() {
        let arm = paper_arm().arm;
        for steps in [1_u32, 10, 1000] {
            let mut inputs = Inputs::new(&arm, &[InputGroup::Turn, InputGroup::Elapsed], 1e-3);
            let zeros = [0.0; 6];
            let mut at = |tick: u64, q: f64| {
                let q = [q, 1e-18 * tick as f64, 0.0, 0.0, 0.0, 0.0];
                inputs.at(tick, Motion { q: &q, v: &zeros, a: &zeros }).to_vec()
            };
            assert!(at(0, 0.0)[0].abs() < 1e-15);
            assert!((at(1, 1.0)[0] - 1.0).abs() < 1e-15);
            let mut turned = 0.0;
            for step in 1..=steps {
                let q = 1.0 - TURN * f64::from(step) / f64::from(steps);
                turned = at(1 + u64::from(step), q)[0];
            }
            let expected = -1.0 + 2.0 * (-1.0_f64).exp();
            assert!((turned - expected).abs() < 1e-9, "{turned} in {steps} steps");
            let anew = at(5000, 0.7);
            assert!(anew[0].abs() < 1e-15 && anew[1].abs() < 1e-12, "{anew:?}");
            assert!((anew[6] - 5.0).abs() < 1e-12, "{anew:?}");
        }
    }
}
