//! Changes of a hypothesis, of the reading or of the physics beside it, and their prior odds.

use freeplay_arm::{Arm, JointKind};
use nalgebra::Vector3;

use super::reading::Reading;

/// The channels on another clock than the positions.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Late {
    /// The torques.
    Torque,
    /// The tool.
    Tool,
    /// Both.
    Both,
}

/// Physics beside the reading, in the coarse form in which it could hide or imitate a fault.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Physics {
    /// A load at the tool.
    Payload,
    /// The inertia of a joint's rotor.
    Rotor(usize),
    /// A spring at a joint.
    Spring(usize),
    /// Drag that grows with the square of a joint's speed.
    Drag(usize),
    /// The mass of a link, with its inertia.
    Link(usize),
    /// Torque of this joint due to the motion of another joint.
    Coupling(usize, usize),
    /// Friction that grows with the load a joint carries.
    LoadFriction(usize),
}

impl Physics {
    /// Returns true for a change of masses, which a change of the links includes.
    pub fn is_mass(&self) -> bool {
        matches!(self, Physics::Payload | Physics::Link(_) | Physics::LoadFriction(_))
    }
}

/// One change of the reading, or of the physics beside it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Change {
    /// All revolute joints are in degrees, all prismatic ones in millimetres.
    AngleUnit,
    /// Two joints are exchanged.
    Exchange(usize, usize),
    /// The direction of a joint is inverted, with or without its torque.
    Direction { joint: usize, with_torque: bool },
    /// A joint has another zero, rad (m); fitted, or one of the common offsets.
    Zero { joint: usize, offset: f64, is_fitted: bool },
    /// The recorded position of a joint includes another joint's position times a factor; the torques are converted accordingly, or not.
    Relative { joint: usize, other: usize, factor: f64 },
    /// A joint's torque has the other sign.
    TorqueSign(usize),
    /// All torques have the other sign.
    CommonSign,
    /// A joint's torque is the model's times a factor that is fitted.
    Scale(usize),
    /// A joint's torque is the model's times a fixed factor from another joint's fit.
    SameScale(usize, f64),
    /// All torques are the model's times one factor that is fitted.
    CommonScale,
    /// The gravity vector in the base frame, m/s².
    Gravity(Vector3<f64>),
    /// Gravity in the base frame has any direction; the fit determines it.
    AnyGravity,
    /// The driver subtracted gravity from the torques.
    Compensated,
    /// A group of channels is late, s.
    Delay(Late, f64),
    /// Physics beside the reading.
    Beside(Physics),
}

/// Prior odds of the first change of a kind. Most recordings need no change.
pub(super) const RARE: f64 = 0.01;
/// Prior odds of a further change of a kind: where one joint is in amperes, others often are, too.
pub(super) const FURTHER: f64 = 0.2;
/// Prior odds of physics beside it: a model without a load, a rotor or a spring is common.
pub(super) const COMMON: f64 = 0.1;

impl Change {
    /// The kind of change, for prior odds and for finding a replacement.
    pub fn sort(&self) -> u8 {
        match self {
            Change::AngleUnit => 0,
            Change::Exchange(..) => 1,
            Change::Direction { .. } => 2,
            Change::Zero { .. } => 3,
            Change::Relative { .. } => 4,
            Change::TorqueSign(_) | Change::CommonSign => 5,
            Change::Scale(_) | Change::SameScale(..) | Change::CommonScale => 6,
            Change::Gravity(_) | Change::AnyGravity | Change::Compensated => 7,
            Change::Delay(..) => 8,
            Change::Beside(_) => 9,
        }
    }

    /// Returns true for a change of the reading, false for physics beside it.
    pub fn is_reading(&self) -> bool {
        !matches!(self, Change::Beside(_))
    }

    /// Returns true for a change of joint positions.
    pub fn is_of_positions(&self) -> bool {
        matches!(
            self,
            Change::AngleUnit
                | Change::Exchange(..)
                | Change::Direction { .. }
                | Change::Zero { .. }
                | Change::Relative { .. }
        )
    }

    /// Natural logarithm of its prior odds, given `others`.
    pub fn log_odds(&self, others: &[Change]) -> f64 {
        let is_further = others.iter().any(|other| other.sort() == self.sort());
        let first = |odds: f64| if is_further { FURTHER } else { odds };
        let odds: f64 = match self {
            Change::Beside(_) => COMMON,
            // One of several equally probable changes: six faces, a quarter turn either way and a half turn, a joint with or without its torque.
            Change::Gravity(_) => RARE / 6.0,
            Change::Zero { .. } => first(RARE) / 3.0,
            Change::Direction { .. } => first(RARE) / 2.0,
            _ => first(RARE),
        };
        odds.ln()
    }

    /// Number of parameters that the change fits.
    pub fn parameters(&self) -> usize {
        match self {
            Change::Zero { is_fitted, .. } => usize::from(*is_fitted),
            Change::Scale(_) | Change::SameScale(..) | Change::CommonScale | Change::Delay(..) => 1,
            Change::AnyGravity => 2,
            Change::Beside(Physics::Payload) => 4,
            Change::Beside(Physics::Coupling(..)) => 3,
            Change::Beside(_) => 1,
            _ => 0,
        }
    }

    /// Returns true if the two changes can't be combined.
    pub fn excludes(&self, other: &Change) -> bool {
        match (self, other) {
            (Change::Direction { joint: a, .. }, Change::Direction { joint: b, .. })
            | (Change::Zero { joint: a, .. }, Change::Zero { joint: b, .. })
            | (Change::Relative { joint: a, .. }, Change::Relative { joint: b, .. })
            | (Change::Scale(a) | Change::SameScale(a, _), Change::Scale(b) | Change::SameScale(b, _)) => {
                a == b
            }
            // An inverted joint includes the sign of its torque.
            (Change::Direction { joint: a, .. }, Change::TorqueSign(b))
            | (Change::TorqueSign(b), Change::Direction { joint: a, .. }) => a == b,
            // The common sign takes the place of single ones; a single one beside it is an exception.
            (Change::TorqueSign(_), Change::CommonSign)
            | (Change::CommonScale, Change::Scale(_) | Change::SameScale(..) | Change::CommonScale)
            | (Change::Scale(_) | Change::SameScale(..), Change::CommonScale)
            | (Change::Delay(..), Change::Delay(..)) => true,
            _ => self.sort() == 7 && other.sort() == 7 || self == other,
        }
    }

    /// The joint of the change; `None` if it concerns all joints.
    pub fn joint(&self) -> Option<usize> {
        match self {
            Change::Direction { joint, .. } | Change::Zero { joint, .. } | Change::Relative { joint, .. } => {
                Some(*joint)
            }
            Change::TorqueSign(joint) | Change::Scale(joint) | Change::SameScale(joint, _) => Some(*joint),
            _ => None,
        }
    }
}

/// The reading of `changes`, as far as it needs no fit.
pub(crate) fn reading(arm: &Arm, changes: &[Change]) -> Reading {
    let mut reading = Reading::plain(arm.dof());
    for change in changes {
        match *change {
            Change::AngleUnit => {
                for (position, joint) in reading.positions.iter_mut().zip(arm.joints()) {
                    position.unit = match joint.kind {
                        JointKind::Revolute => std::f64::consts::PI / 180.0,
                        JointKind::Prismatic => 1e-3,
                    };
                }
            }
            Change::Exchange(one, other) => reading.exchange(one, other),
            Change::Direction { joint, with_torque } => {
                reading.positions[joint].sign *= -1.0;
                if with_torque {
                    reading.torques[joint].factor *= -1.0;
                }
            }
            Change::Zero { joint, offset, .. } => reading.positions[joint].zero = offset,
            Change::Relative { joint, other, factor } => {
                reading.positions[joint].relative = Some((other, factor));
            }
            Change::TorqueSign(joint) => reading.torques[joint].factor *= -1.0,
            Change::CommonSign => reading.torques.iter_mut().for_each(|torque| torque.factor *= -1.0),
            Change::Gravity(gravity) => reading.gravity = Some(gravity),
            Change::Delay(late, delay) => {
                if late != Late::Tool {
                    reading.torque_delay = delay;
                }
                if late != Late::Torque {
                    reading.tool_delay = delay;
                }
            }
            Change::Compensated => reading.gravity_added = true,
            Change::Scale(_)
            | Change::SameScale(..)
            | Change::CommonScale
            | Change::AnyGravity
            | Change::Beside(_) => {}
        }
    }
    reading
}

/// Physics that could hide or imitate a fault of the reading.
pub(crate) fn physics(joints: usize) -> Vec<Change> {
    let mut all = vec![Physics::Payload];
    for joint in 0..joints {
        all.extend([
            Physics::Rotor(joint),
            Physics::Spring(joint),
            Physics::Drag(joint),
            Physics::Link(joint),
            Physics::LoadFriction(joint),
        ]);
        all.extend((joint > 0).then(|| Physics::Coupling(joint, joint - 1)));
        all.extend((joint + 1 < joints).then_some(Physics::Coupling(joint, joint + 1)));
    }
    all.into_iter().map(Change::Beside).collect()
}

/// The groups of channels that a clock offset can separate.
pub(crate) fn groups(has_torques: bool, has_tool: bool) -> Vec<Late> {
    match (has_torques, has_tool) {
        (true, true) => vec![Late::Torque, Late::Tool, Late::Both],
        (true, false) => vec![Late::Torque],
        (false, true) => vec![Late::Tool],
        (false, false) => Vec::new(),
    }
}
