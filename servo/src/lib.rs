//! Arms on position servos: simulation from commanded to measured positions, and identification of the servos from recordings of both.
//!
//! The nouns, in the order in which data passes through them:
//!
//! - [`Commands`]: the commands of one joint, held between their stamps.
//! - [`JointServo`]: the law of one joint: servo, friction, limits, delay; a piece of it is a [`Linearization`].
//! - [`ServoArm`]: the rigid arm with the servo of each joint, from an arm file.
//! - [`Burden`]: loads and mounting of the arm in addition to its file.
//! - [`Sliding`]: one step with set-valued friction; [`Rollout`]: many of them from a [`State`] along a [`Course`] of commands.
//! - [`Track`]: a recording of commanded and measured positions; each window starts from the measured state. One joint of it, under its
//!   recorded [`Load`], is a track, too.
//! - [`Sight`]: estimates for a joint from a recording before any rollout ([`sights`], [`lag`]); [`servos`]: the initial servos of a fit.
//! - [`Unknown`]: a [`ModelParameter`] of a joint that a fit estimates, with its prior ([`unknowns`]).
//! - [`Problem`]: windows of recordings; [`Fitted`]: the result of their fit, with the remaining [`Noise`].

mod alone;
mod arm_file;
mod beginning;
mod bounded;
mod burden;
mod command;
mod fit;
mod joint;
mod joint_load;
mod model_parameter;
mod noise;
mod parallel;
mod priors;
mod rollout;
mod servo_arm;
mod solve;
mod track;
mod unknowns;

pub use beginning::{Sight, golden_section, lag, servos, sights};
pub use burden::Burden;
pub use command::Commands;
pub use fit::{Fitted, Problem};
pub use joint::{JointServo, Linearization};
pub use joint_load::Load;
pub use model_parameter::ModelParameter;
pub use noise::{DEGREES_OF_FREEDOM, Noise};
pub use parallel::each;
pub use priors::{DIFFERENCE_STEP, unknowns};
pub use rollout::{Course, Rollout, State};
pub use servo_arm::ServoArm;
pub use solve::Sliding;
pub use track::Track;
pub use unknowns::Unknown;
