//! The laws of a joint with play: pure functions of numbers, one file a law.
//!
//! Nothing here has a state or a clock. The plant integrates these laws, the quasi-static predictor solves them
//! for equilibrium and the diagnosis fits their parameters, so that one definition serves all three.
//!
//! The nouns, in the order in which numbers pass through them:
//!
//! - [`Material`] and [`hertz_stiffness`]: what the bearing and the journal are made of, and how stiff they meet.
//! - [`NormalContact`]: the force that pushes the journal back, with the [`NormalLaw`] that says how it dissipates.
//! - [`ContactFriction`]: the force along the bearing's surface, by one of the [`FrictionLaw`]s.
//! - [`Clearance`]: one joint's play: how far the journal may move, and what happens when it arrives.
//! - [`bearing_contact`]: from where the journal is in the bearing to force and moment.
//! - [`ArmWithPlay`]: the arm that has two slides across the axis of every joint with play.
//! - [`DriveFriction`]: the nominal friction of a joint's drive.
//! - [`Effects`]: what the `[[effect]]` tables of an arm file say, as laws.

mod bearing;
mod clearance;
mod contact;
mod drive_friction;
mod effects;
mod friction;
mod play;

pub use bearing::{Approach, BearingContact, Journal, bearing_contact};
pub use clearance::{Clearance, ClearanceTable};
pub use contact::{Material, NormalContact, NormalLaw, hertz_stiffness};
pub use drive_friction::DriveFriction;
pub use effects::{Effects, LawError};
pub use friction::{ContactFriction, FrictionLaw};
pub use play::{ArmWithPlay, Play};
