//! The laws of a joint with play, and of all other effects beyond a rigid arm: one file per law.
//!
//! Nothing here has a state or a clock. The plant integrates these laws, the quasi-static predictor solves them for equilibrium and the
//! diagnosis fits their parameters, so that one definition serves all three.
//!
//! The nouns, in the order in which numbers pass through them:
//!
//! - [`Material`] and [`hertz_stiffness`]: the elasticity of bearing and journal, and the stiffness of their contact.
//! - [`NormalContact`]: the force that pushes the journal back; its [`NormalLaw`] defines the dissipation.
//! - [`ContactFriction`]: the force along the bearing's surface, by one of the [`FrictionLaw`]s.
//! - [`Clearance`]: the play of one joint: the range of the journal, and its contact with the bearing.
//! - [`bearing_contact`]: from the journal's position in the bearing to force and moment.
//! - [`BearingLoad`]: the load of a bearing in a moving arm, and the tool's displacement by its journal.
//! - [`ArmWithPlay`]: the arm with two slides perpendicular to the axis of every joint with play.
//! - [`DriveFriction`]: the nominal friction of a joint's drive.
//! - [`Film`]: the oil in a bearing; [`settle`] and [`Rest`]: the rest position of a journal in a dry one.
//! - [`CATALOGUE`]: every [`Kind`] of effect: its name, [`Parameter`]s, equation, source, signature and confounders; one file each;
//!   [`COMMANDED`] lists the kinds that appear only in commanded against measured positions.
//! - [`Term`]s: the terms of an effect at a [`Place`], which add up; [`Need`]s: the requirements on a recording ([`Recorded`]) that
//!   identifies the effect.
//! - [`Values`]: the values of one `[[effect]]` table, checked against its kind.
//! - [`Effect`]: the law with its values; [`Placed`] at a joint or on the whole arm; [`Effects`]: all of an arm file.
//! - [`Trajectory`] and [`Scene`]: the motion, as input of effects; [`Prediction`]: the predicted recording; made by [`predict`], or by a
//!   [`Baseline`], which also computes the [`Change`] by one more effect, in [`Columns`].
//! - [`Injection`]: the contributions of effects to a plant: [`DriveLaw`], [`Transmission`], [`ToolForce`], [`SensorLaw`]; an [`Archive`]
//!   saves and restores their state variables.
//! - [`mechanism`]: an arm file for the formats of other tools; [`ExportCoverage`]: the part of an effect that these formats can express.

mod archive;
mod arm_parts;
mod basis;
mod bearing;
mod bearing_course;
mod bearing_load;
pub mod beyond;
pub mod catalogue;
mod clearance;
mod columns;
mod contact;
mod drive_friction;
mod effect;
mod effects;
mod flight;
mod friction;
mod harmonic;
mod injection;
mod joint_law;
mod journal_flight;
mod kind;
mod law_error;
mod lookup;
mod lubrication;
mod manual;
mod mechanism;
mod nameless;
mod needs;
mod parameter;
mod place;
mod placed;
mod play;
mod predict;
mod prediction;
mod resonance;
mod rest;
mod sag;
mod scene;
mod term_columns;
mod terms;
mod trajectory;
mod transmission;
mod values;

pub use archive::Archive;
pub use arm_parts::ArmParts;
pub use basis::Term;
pub use bearing::{Approach, BearingContact, Journal, bearing_contact};
pub use bearing_load::BearingLoad;
pub use beyond::BEYOND_CATALOGUE;
pub use catalogue::{CATALOGUE, COMMANDED, holding};
pub use clearance::{Clearance, ClearanceTable};
pub use columns::Columns;
pub use contact::{Material, NormalContact, NormalLaw, hertz_stiffness};
pub use drive_friction::DriveFriction;
pub use effect::{Effect, ExportCoverage, Start};
pub use effects::Effects;
pub use friction::{ContactFriction, FrictionLaw};
pub use harmonic::PERIODS;
pub use injection::{
    DriveLaw, DriveState, Injection, Readings, SensorLaw, ServoLaw, ToolForce, Transmission,
};
pub use joint_law::{AtJoint, Instant, JointLaw};
pub use kind::{Kind, OPERATING_POINT, Occurrence, START, Seen, Terms, Tolerance};
pub use law_error::LawError;
pub use lookup::{kind, kinds};
pub use lubrication::Film;
pub use manual::manual;
pub use mechanism::mechanism;
pub use nameless::NAMELESS;
pub use needs::{Need, Recorded};
pub use parameter::{Absent, Parameter, Range, Role};
pub use place::{Place, Site};
pub use placed::Placed;
pub use play::{ArmWithPlay, Play};
pub use predict::{Baseline, LowPassFilter, changed, predict};
pub use prediction::{Change, Prediction};
pub use rest::{Rest, settle};
pub use scene::{Scene, rigid_torques, tool_positions, tool_sensitivity, torque_sensitivity, torque_unit};
pub use trajectory::Trajectory;
pub use values::Values;
