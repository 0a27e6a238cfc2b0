//! The paper (S. Erkaya, 2018) and the studies beside it.
//!
//! - `simulation`: the arm simulated in one process, without a controller.
//! - [`reference_runs`] and `reference_report`: runs beside an independent reference.
//! - [`reproduce`]: the scenarios, figures and claims of the paper, each with a verdict.
//! - [`cells`]: the table of compensation; `bound` and [`bound_table`]: how far the deviation at sharp corners can be reduced at all.

mod bound;
pub mod bound_table;
pub mod cells;
mod reference_pair;
mod reference_report;
pub mod reference_runs;
pub mod reproduce;
mod simulation;
