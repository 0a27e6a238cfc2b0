//! The truth: an arm whose joints have play, stepped in time, and the loop that plays the machine.
//!
//! The nouns, in the order in which data passes through them:
//!
//! - [`Motion`]: where prescribed joints are, and how they brake.
//! - [`System`]: the arm with play; [`Bearing`] is one joint's contact in it, [`Ledger`] keeps its energy.
//! - [`Sensors`]: what the machine says of itself.
//! - [`Gate`]: what may pass from a controller to the joints, and what is applied instead.
//! - [`Reflexes`]: limits of what the arm does, beyond which its brakes close; [`Stop`] says when and why, [`Excess`] beyond which limit.
//! - [`LineUp`]: the controllers of a run, one in charge, the others warm; [`Swap`] is a change of who is in charge, [`Blend`] takes
//!   the jump out of it; [`Usual`] is what sound controllers differ by.
//! - [`TickRecord`]: all that is worth keeping of one tick; it leaves the loop through a queue.
//! - [`Stages`]: how long each stage of the loop took.
//! - [`Wishes`]: what a person asks of the loop while it runs.
//! - [`JointUse`]: what the run asked of the drives, beside their limits.
//! - [`Misses`]: the missed deadlines, each with its [`Evidence`] and its [`MissCause`].
//! - [`Plant`]: the loop itself.

mod answer_counts;
mod attendance;
mod bearing;
mod blend;
mod cause;
mod damping;
mod deviation;
mod drives;
mod excess;
mod gate;
mod joint_use;
mod ledger;
mod line_up;
mod misses;
mod motion;
mod plant;
mod position_servo;
mod reflex;
mod rotor;
mod round_trips;
mod sensors;
mod stages;
mod system;
mod thread_watch;
mod tick_record;
mod tool_forces;
mod usual;
mod wish;
mod witnesses;

pub use answer_counts::AnswerCounts;
pub use bearing::{Bearing, ContactTally, IMPACT_LIMIT};
pub use blend::Blend;
pub use cause::{Cause as MissCause, Evidence, Hardship, Links, cause as miss_cause};
pub use deviation::{Deviation, DeviationStatistics};
pub use excess::{Excess, Quantity, Refusal, Stop, StopReason};
pub use gate::{Applied, Gate, GateLimits, Rejection};
pub use joint_use::{JointUse, Used, UsedByJoint};
pub use ledger::Ledger;
pub use line_up::{Cause, LineUp, LineUpSpec, PlannedSwap, Swap};
pub use misses::{Miss, Misses, Stall};
pub use motion::{Braking, Hermite, Motion};
pub use plant::{Deadlines, Ending, Plant, PlantConfig, PlantError, PlantOutcome, TickLaws};
pub use reflex::{ReflexLimits, ReflexSpec, Reflexes, SPEED_MARGIN};
pub use rotor::ROTOR_SHARE;
pub use sensors::{Channel, Sensors, SensorsSpec};
pub use stages::{Stage, Stages};
pub use system::{Input, MAX_CONTACT_STEP, System, SystemError, TickPeaks};
pub use tick_record::{MAX_PLAYS, NO_DIFFERENCES, PlayRecord, TickRecord};
pub use usual::Usual;
pub use wish::{Wish, Wishes};
pub use witnesses::{Comparison, PROBATION};
