//! The paper (S. Erkaya, 2018) and further studies of its arm.
//!
//! - `simulation`: the arm simulated in one process, without a controller.
//! - [`reference_runs`] and `reference_report`: runs compared with an independent reference.
//! - [`reproduce`]: the scenarios, figures and claims of the paper, each with a verdict.
//! - [`cells`]: the table of compensation; `bound` and [`bound_table`]: the lower bound of the deviation at sharp corners.

mod bound;
pub mod bound_table;
pub mod cells;
mod reference_pair;
mod reference_report;
pub mod reference_runs;
pub mod reproduce;
mod simulation;
