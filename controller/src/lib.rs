//! The built-in controllers and their compensation programme, on the SDK of `freeplay-controller-sdk`.
//!
//! A controller is a process of its own. It never sees the plant, only its states. Its knowledge of the arm comes from a model file, which may
//! be wrong. A controller of your own needs the SDK alone, without the solver and the network that this crate depends on.
//!
//! The nouns, in the order in which data passes through them:
//!
//! - [`Task`]: the file with a controller's model, reference path, gains and options.
//! - [`Model`]: the arm of that model file, with the clearances that the controller assumes.
//! - [`Controller`]: the trait: [`Controller::start`] with the task and the [`RunInfo`], then [`Controller::answer`] state by state.
//! - [`Answer`]: a controller's answer to one state.
//! - [`serve()`]: the process of a controller: it finds the run, shakes hands, answers, and ends with an exit code; [`serve_with`] takes
//!   custom [`ServeOptions`].
//! - [`LookAhead`]: the state of the joints when the answer takes effect.
//! - [`ImpactDetector`]: detects landings of journals in the encoder signals; after a landing the feedback is softer.
//! - [`QuasiStatic`]: the deviation of the tool by the physical prediction, from the rest position ([`freeplay_laws::Rest`]) of each journal.
//! - [`Geometry`]: displacement of the tool by a geometry that differs from the nominal one.
//! - [`DisplacementPreview`]: the journal displacements at the coming ticks, smoothed by a [`CentredAverage`].
//! - [`Compensator`]: the programme that turns a deviation into a correction of the joints, within their limits; [`Qp`] solves it if the
//!   [`FreeMinimiser`] of its cost violates a limit.
//! - [`Horizon`]: the same programme over several ticks at once, which anticipates corners; a [`HorizonPreview`] gives it the path ahead, and
//!   a [`DualActiveSet`] solves it if limits are active.
//! - [`CornerSearch`]: finds the corners that are too sharp for the journals, and lets a [`PassagePlanner`] plan a [`Passage`] through each of
//!   them before the run; together they are the [`Passages`].
//! - [`Rollout`]: a small simulation of the model that computes the motion of the journals.
//! - [`AccelerationProgramme`]: the joint accelerations of one tick within the limits of torque, braking and contact; the contact forces come
//!   from [`PinForce`].
//! - [`Correction`]: the correction over time, with its derivatives by [`Centred`] differences.
//! - [`Tracking`]: reference tracking with compensation of the deviation; the compensating controllers share it.
//! - [`ToolResidual`]: online estimate of the part of the tracked tool's deviation that the physical prediction misses.
//! - [`Remainder`]: a network's prediction of that residual deviation, trained while a tool was tracked; read from a [`WeightFile`].
//! - [`ComputedTorque`], [`QuasiStaticControl`], [`NarxQp`]: the controllers that come with the project; [`built_in()`] finds them by name.

pub mod acceleration_programme;
pub mod built_in;
pub mod centred;
pub mod centred_average;
pub mod command_filter;
pub mod compensation;
pub mod computed_torque;
pub mod corners;
pub mod correctable_deviation;
pub mod correction;
pub mod correction_bounds;
pub mod deviation;
pub mod displacement_preview;
pub mod dual_active_set;
pub mod free_minimiser;
pub mod geometry;
pub mod horizon;
pub mod horizon_preview;
pub mod identity;
pub mod impact_detector;
pub mod known_effects;
pub mod look_ahead;
pub mod model;
pub mod narx_qp;
pub mod not_ready;
pub mod observed_remainder;
pub mod passage;
pub mod passage_corner;
pub mod passage_layout;
pub mod passage_limits;
pub mod passage_planner;
pub mod passage_programme;
pub mod passage_trajectory;
pub mod pin_force;
pub mod qp;
pub mod quasi_static;
pub mod remainder;
pub mod rollout;
pub mod sparse_programme;
pub mod tool_residual;
pub mod tracking;
pub mod trial;

pub use acceleration_programme::{AccelerationOptions, AccelerationProgramme, Wanted};
pub use freeplay_controller_sdk::{
    Answer, Controller, ControllerError, Ended, Gains, LimitsFrom, PATIENCE_ENV, RunInfo, SLOT_ENV,
    ServeError, ServeOptions, ServeReport, Task, TaskError, TaskMode, controller, serve, serve_with, task,
};

pub use built_in::{BUILT_IN, built_in};
pub use centred::Centred;
pub use centred_average::CentredAverage;
pub use compensation::{CompensationReport, CompensationStatus, Compensator, Motion, Weights};
pub use computed_torque::ComputedTorque;
pub use corners::CornerSearch;
pub use correction::Correction;
pub use deviation::QuasiStatic;
pub use displacement_preview::{DisplacementPreview, JointMotion};
pub use dual_active_set::DualActiveSet;
pub use free_minimiser::FreeMinimiser;
pub use geometry::Geometry;
pub use horizon::{Horizon, HorizonError, HorizonReport, HorizonStatus};
pub use horizon_preview::HorizonPreview;
pub use impact_detector::ImpactDetector;
pub use look_ahead::{JointState, LookAhead};
pub use model::Model;
pub use narx_qp::{NarxQp, NarxQpOptions};
pub use not_ready::NotReady;
pub use passage::{Passage, PassageFault, PassageOptions, Passages, Step};
pub use passage_planner::PassagePlanner;
pub use pin_force::PinForce;
pub use qp::{Qp, QpError, QpReport, QpStatus};
pub use quasi_static::QuasiStaticControl;
pub use remainder::{Remainder, WeightFile};
pub use rollout::{Driven, Rollout, Touch};
pub use tool_residual::ToolResidual;
pub use tracking::{Beyond, Plan, Tracking, TrackingOptions};
