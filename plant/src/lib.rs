//! The simulated machine: an arm whose joints have play, stepped in time, and the loop that runs it.
//!
//! The nouns, in the order in which data passes through them:
//!
//! - [`Motion`]: positions of prescribed joints, and their braking.
//! - [`System`]: the arm with play; [`Bearing`] is one joint's contact in it, [`Ledger`] keeps its energy.
//! - [`Sensors`]: the machine's measurements.
//! - [`Gate`]: the check of commands from a controller to the joints, and the fallback for commands that fail.
//! - [`Reflexes`]: limits of the arm's motion, beyond which its brakes close; [`Stop`] holds the time and the reason, [`LimitViolation`]
//!   the limit.
//! - [`ControllerManager`]: the controllers of a run, one active, the others standbys; [`Swap`] is a change of the active controller,
//!   [`Blend`] smooths the command at a swap; [`ReferenceDivergence`] is the difference between controllers in a fault-free run.
//! - [`TickRecord`]: the record of one tick; it leaves the loop through a queue.
//! - [`Stages`]: latencies of the stages of the loop.
//! - [`OperatorRequests`]: requests of a user to the running loop.
//! - [`JointUse`]: use of the drives in a run, beside their limits.
//! - [`Misses`]: the missed deadlines, each with its [`Evidence`] and its [`MissCause`].
//! - [`Plant`]: the loop itself.

mod answer_counts;
mod bearing;
mod blend;
mod cause;
mod controller_manager;
mod cross_check;
mod damping;
mod deviation;
mod drives;
mod gate;
mod joint_use;
mod ledger;
mod limit_violation;
mod misses;
mod motion;
mod operator_requests;
mod plant;
mod position_servo;
mod reference_divergence;
mod reflex;
mod rejection;
mod response_timeouts;
mod rotor;
mod round_trips;
mod sensors;
mod stages;
mod stiction;
mod system;
mod system_error;
mod thread_watch;
mod tick_record;
mod tool_forces;

pub use answer_counts::AnswerCounts;
pub use bearing::{Bearing, ContactTally, IMPACT_LIMIT};
pub use blend::Blend;
pub use cause::{Cause as MissCause, Evidence, ThreadDelays, TickLatencies, cause as miss_cause};
pub use controller_manager::{Cause, ControllerManager, ControllerSet, PlannedSwap, Swap};
pub use cross_check::{Comparison, PROBATION};
pub use deviation::{Deviation, DeviationStatistics};
pub use gate::{Applied, Gate, GateLimits};
pub use joint_use::{JointUse, Used, UsedByJoint};
pub use ledger::Ledger;
pub use limit_violation::{LimitViolation, Quantity, RefusedCommand, Stop, StopReason};
pub use misses::{Miss, Misses, Stall};
pub use motion::{Braking, Hermite, Motion};
pub use operator_requests::{OperatorRequest, OperatorRequests};
pub use plant::{Deadlines, Ending, Plant, PlantConfig, PlantError, PlantOutcome, TickLaws};
pub use reference_divergence::ReferenceDivergence;
pub use reflex::{ReflexLimits, ReflexSpec, Reflexes, SPEED_MARGIN};
pub use rejection::Rejection;
pub use rotor::ROTOR_SHARE;
pub use sensors::{Channel, Sensors, SensorsSpec};
pub use stages::{Stage, Stages};
pub use system::{Input, System, TickPeaks};
pub use system_error::{MAX_CONTACT_STEP, SystemError};
pub use tick_record::{MAX_PLAYS, NO_DIFFERENCES, PlayRecord, TickRecord};
