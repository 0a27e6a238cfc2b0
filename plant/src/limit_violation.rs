//! A violated limit, with the joint and the value.

use freeplay_arm::JointKind;
use serde::Serialize;

use crate::rejection::Rejection;

/// The limited quantity.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Quantity {
    /// Position, rad (m).
    Position,
    /// Speed, rad/s (m/s).
    Speed,
    /// Acceleration, rad/s² (m/s²).
    Acceleration,
    /// Torque, N·m (N).
    Torque,
    /// Rate of a torque, N·m/s (N/s).
    TorqueRate,
    /// Distance of a joint from its reference, rad (m).
    Tracking,
}

impl Quantity {
    /// The name in `summary.json`.
    pub fn name(self) -> &'static str {
        match self {
            Self::Position => "position",
            Self::Speed => "speed",
            Self::Acceleration => "acceleration",
            Self::Torque => "torque",
            Self::TorqueRate => "torque_rate",
            Self::Tracking => "tracking",
        }
    }

    /// The unit for a joint of `kind`.
    pub fn unit(self, kind: JointKind) -> &'static str {
        let turns = kind == JointKind::Revolute;
        match self {
            Self::Position | Self::Tracking => {
                if turns {
                    "rad"
                } else {
                    "m"
                }
            }
            Self::Speed => {
                if turns {
                    "rad/s"
                } else {
                    "m/s"
                }
            }
            Self::Acceleration => {
                if turns {
                    "rad/s^2"
                } else {
                    "m/s^2"
                }
            }
            Self::Torque => {
                if turns {
                    "N*m"
                } else {
                    "N"
                }
            }
            Self::TorqueRate => {
                if turns {
                    "N*m/s"
                } else {
                    "N/s"
                }
            }
        }
    }
}

/// A violated limit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LimitViolation {
    /// The limited quantity.
    pub quantity: Quantity,
    /// The joint, from 0.
    pub joint: usize,
    /// The value found; for a tracking error and for a speed its magnitude.
    pub value: f64,
    /// The limit.
    pub limit: f64,
}

/// Reason of the closing of the brakes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(untagged)]
pub enum StopReason {
    /// Commands failed the gate for too long, the last for this reason.
    Rejected(Rejection),
    /// The arm was beyond a limit of this quantity.
    Reflex(Quantity),
}

impl StopReason {
    /// The name in `summary.json`.
    pub fn name(self) -> &'static str {
        match self {
            Self::Rejected(reason) => reason.name(),
            Self::Reflex(quantity) => quantity.name(),
        }
    }
}

/// Time and reason of the closing of the brakes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Stop {
    /// The tick.
    pub tick: u64,
    /// The reason.
    pub reason: StopReason,
    /// The violated limit, if a limit was the reason.
    pub excess: Option<LimitViolation>,
}

/// A refused command.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RefusedCommand {
    /// The tick that it answered.
    pub tick: u64,
    /// The slot of the controller.
    pub slot: usize,
    /// True if the controller was about to take over with it.
    pub takes_over: bool,
    /// The reason.
    pub reason: Rejection,
    /// The limit that it would have violated, if a limit was the reason.
    pub excess: Option<LimitViolation>,
}
