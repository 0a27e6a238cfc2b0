//! Recordings of machines with concealed physics: the test data of the blind proof of `diagnose`.
//!
//! The generator shares no law and no integrator with the diagnosis: it depends on `arm` and `recording` alone. The nouns, in the order in which data passes
//! through them:
//!
//! - [`Quota`]: number of cases of each sort; [`draw_set`] draws them from a seed. [`Matrix`]: every kind at every [`Place`] instead.
//! - [`Case`]: a request: a [`Machine`] (an arm by its data sheet), [`Demand`]s (physics missing on the data sheet, with its strength), a [`Noise`] level and a
//!   seed.
//! - [`Physics`]: one effect, of the catalogue or outside it, with its parameters.
//! - [`Motion`]: the commanded motion.
//! - [`DataSheetDeviations`]: random deviations of the true arm from its data sheet: factors and offsets within its tolerances.
//! - [`Plan`]: the true machine: arm, drives, transmissions, bearings, springs.
//! - [`Trace`]: its motion, from the servo controller and the time stepping of [`Plan::run`].
//! - [`Chain`]: the sensors, which turn the motion into samples.
//! - [`SetupFault`]: a difference in conventions between recording and data sheet, added by [`with_setup_faults`], of [`Kept`] channels.
//! - [`Made`]: the data sheet, two recordings and the [`Truth`]; from [`make_case`], [`make_here`] or [`generate`].

mod arms;
mod calibrate;
mod case;
mod data_sheet_deviations;
mod distinct;
mod draft;
mod effective_inertia;
mod kinds;
mod machine;
mod matrix;
mod motion;
mod physics;
mod random;
mod sensors;
mod servo;
mod set;
mod setup;
mod sizing;
mod truth;
mod write;

pub use arms::{Load, Machine};
pub use calibrate::{Floor, Strength};
pub use case::{Case, Demand, GenerateError, Made, Severity, generate};
pub use data_sheet_deviations::DataSheetDeviations;
pub use distinct::Equivalent;
pub use kinds::{CATALOGUE, OUTSIDE, Seat, seats};
pub use machine::{Plan, PlanError, Trace};
pub use matrix::{Matrix, Place};
pub use motion::{Family, Motion};
pub use physics::{Effect, Physics};
pub use sensors::{Chain, Noise, Samples};
pub use servo::Servo;
pub use set::{Quota, draw_set, make_case, make_here};
pub use setup::{Kept, SETUP, SetupFault, with_setup_faults};
pub use truth::{Truth, TruthEffect};
pub use write::{WriteCaseError, write_case, write_sealed};
