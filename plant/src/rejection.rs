//! The reasons for which a command does not pass the gate.

use serde::Serialize;

/// Reason of a rejection.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Rejection {
    /// No command arrived in time.
    Missing,
    /// It echoes another tick than the one for which it was due.
    Stale,
    /// Its magic, layout, run, slot or number of joints is not this run's, its status is unknown, or its kind does not fit the mode.
    Malformed,
    /// The controller itself reports that it has no answer.
    NoAnswer,
    /// A value is NaN or infinite.
    NotFinite,
    /// A torque is above the joint's effort limit, or a position outside its range.
    OutOfRange,
    /// A value changes faster than the joint allows.
    TooFast,
    /// It is a possible command, but the other controllers' commands for the same state contradict it.
    Disagrees,
}

impl Rejection {
    /// All reasons, in the order of the checks.
    pub const ALL: [Rejection; 8] = [
        Self::Missing,
        Self::Malformed,
        Self::Stale,
        Self::NoAnswer,
        Self::NotFinite,
        Self::OutOfRange,
        Self::TooFast,
        Self::Disagrees,
    ];

    /// The name in `summary.json`.
    pub fn name(self) -> &'static str {
        match self {
            Self::Missing => "missing",
            Self::Stale => "stale",
            Self::Malformed => "malformed",
            Self::NoAnswer => "no_answer",
            Self::NotFinite => "not_finite",
            Self::OutOfRange => "out_of_range",
            Self::TooFast => "too_fast",
            Self::Disagrees => "disagrees",
        }
    }
}
