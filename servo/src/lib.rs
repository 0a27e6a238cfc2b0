//! Arms on position servos: from commanded to measured positions, and from recordings of both back to the servos.
//!
//! The nouns, in the order in which data passes through them:
//!
//! - [`Commands`]: the commands of one joint, held between their stamps.
//! - [`JointServo`]: the law of one joint: servo, friction, limits, delay; a piece of it is a [`Linearization`].
//! - [`ServoArm`]: the rigid arm with the servo of each joint, as an arm file has them.
//! - [`Burden`]: what the arm carries and how it stands beside what its file says.
//! - [`Sliding`]: one step with set-valued friction; [`Rollout`]: many of them from a [`State`] along a [`Course`] of commands.
//! - [`Track`]: a recording of commanded and measured positions; its windows begin anew from what was measured. One joint of it, under the [`Load`] that it had, is a track, too.
//! - [`Sight`]: what a recording says of a joint before any rollout ([`sights`], [`lag`]); [`servos`] to begin a fit from.
//! - [`Unknown`]: a [`ModelParameter`] of a joint that a fit looks for, with what is believed of it before ([`unknowns`]).
//! - [`Problem`]: windows of recordings; [`Fitted`]: what came out of them, with the [`Noise`] that is left.

mod alone;
mod arm_file;
mod beginning;
mod bounded;
mod burden;
mod command;
mod fit;
mod joint;
mod load;
mod model_parameter;
mod noise;
mod parallel;
mod priors;
mod rollout;
mod servo_arm;
mod solve;
mod track;
mod unknowns;

pub use beginning::{Sight, golden, lag, servos, sights};
pub use burden::Burden;
pub use command::Commands;
pub use fit::{Fitted, Problem};
pub use joint::{JointServo, Linearization};
pub use load::Load;
pub use model_parameter::ModelParameter;
pub use noise::{DEGREES_OF_FREEDOM, Noise};
pub use parallel::each;
pub use priors::{DIFFERENCE_STEP, unknowns};
pub use rollout::{Course, Rollout, State};
pub use servo_arm::ServoArm;
pub use solve::Sliding;
pub use track::Track;
pub use unknowns::Unknown;
