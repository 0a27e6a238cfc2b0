//! The faults that a controller can have, in the words of PX4 and its users.

use serde::{Deserialize, Serialize};

/// Kind of fault.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize, clap::ValueEnum)]
#[serde(rename_all = "kebab-case")]
pub enum Kind {
    /// No fault: every reported fault is a false alarm.
    Ok,
    /// The controller sends no answers.
    Off,
    /// The controller sends the values of its last good answer again and again as new answers.
    Stuck,
    /// Answers contain random bits instead of numbers.
    Garbage,
    /// The value of one joint is shifted by a fifth of its range.
    Wrong,
    /// Only every fourth answer arrives.
    Slow,
    /// Answers arrive three ticks late.
    Delayed,
    /// About every second answer arrives.
    Intermittent,
    /// The process is killed with SIGKILL.
    Crash,
    /// The process is stopped with SIGSTOP, and continues later.
    Hang,
    /// Each answer is sent 64 times.
    Flood,
    /// Answers arrive in the wrong order.
    Reorder,
    /// Messages have another layout version.
    StaleVersion,
    /// An answer contains NaN instead of a number.
    Nan,
    /// The value of one joint is just beyond its limit.
    Limit,
    /// The value of one joint drifts by its range in each second.
    Drift,
    /// The value of one joint has the wrong sign.
    SignFlip,
    /// The value of one joint is multiplied by 1.5.
    Gain,
    /// The clock of the states jumps by one second and back.
    ClockJump,
    /// The process that holds the controller's seat is killed while it holds borrowed memory for a message that it never sends.
    /// The controller itself stays alive.
    LoanLost,
}

/// Expected outcome of a fault.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Expected {
    /// The gate, or a missing answer, reveals the fault within so many ticks.
    Detected {
        /// Ticks, in lockstep; in real time only for faults in the content of a message.
        ticks: u64,
    },
    /// A possible command that only the comparison with another controller distinguishes from a good one; the time is unbounded.
    Compared,
    /// No detection: the fault does no harm.
    Harmless,
}

impl Kind {
    /// All kinds, in the order of the exam.
    pub const ALL: [Kind; 20] = [
        Self::Ok,
        Self::Off,
        Self::Stuck,
        Self::Garbage,
        Self::Wrong,
        Self::Slow,
        Self::Delayed,
        Self::Intermittent,
        Self::Crash,
        Self::Hang,
        Self::Flood,
        Self::Reorder,
        Self::StaleVersion,
        Self::Nan,
        Self::Limit,
        Self::Drift,
        Self::SignFlip,
        Self::Gain,
        Self::ClockJump,
        Self::LoanLost,
    ];

    /// Its name.
    pub fn name(self) -> &'static str {
        match self {
            Self::Ok => "ok",
            Self::Off => "off",
            Self::Stuck => "stuck",
            Self::Garbage => "garbage",
            Self::Wrong => "wrong",
            Self::Slow => "slow",
            Self::Delayed => "delayed",
            Self::Intermittent => "intermittent",
            Self::Crash => "crash",
            Self::Hang => "hang",
            Self::Flood => "flood",
            Self::Reorder => "reorder",
            Self::StaleVersion => "stale-version",
            Self::Nan => "nan",
            Self::Limit => "limit",
            Self::Drift => "drift",
            Self::SignFlip => "sign-flip",
            Self::Gain => "gain",
            Self::ClockJump => "clock-jump",
            Self::LoanLost => "loan-lost",
        }
    }

    /// The expected outcome of the kind.
    pub fn expected(self) -> Expected {
        match self {
            Self::Ok | Self::Flood | Self::ClockJump => Expected::Harmless,
            Self::Stuck | Self::Wrong | Self::Drift | Self::SignFlip | Self::Gain => Expected::Compared,
            Self::Crash | Self::Hang | Self::LoanLost => Expected::Detected { ticks: 2 },
            // The first answer of the window may be one that arrives.
            Self::Slow | Self::Intermittent | Self::Reorder => Expected::Detected { ticks: FAULT_TICKS },
            Self::Off | Self::Garbage | Self::Delayed | Self::StaleVersion | Self::Nan | Self::Limit => {
                Expected::Detected { ticks: 1 }
            }
        }
    }

    /// True if the controller has ended afterwards, so that a run can have the fault only once.
    pub fn ends_the_process(self) -> bool {
        matches!(self, Self::Crash | Self::LoanLost)
    }
}

/// Duration of a fault, ticks.
pub const FAULT_TICKS: u64 = 40;

/// One fault at one tick.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Injection {
    /// Kind of the fault.
    pub kind: Kind,
    /// The first tick with an affected answer.
    pub tick: u64,
    /// Seed of its random numbers.
    pub seed: u64,
}

impl Injection {
    /// True if the fault acts at `tick`.
    pub fn holds(&self, tick: u64) -> bool {
        (self.tick..self.tick + FAULT_TICKS).contains(&tick)
    }
}

/// Instructions for a fault injector.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Plan {
    /// Non-overlapping faults, in the order of their ticks.
    pub injections: Vec<Injection>,
    /// Least and greatest value of each joint, N·m or rad.
    pub limits: Vec<[f64; 2]>,
}
