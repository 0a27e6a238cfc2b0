//! The paper (S. Erkaya, 2018) and the studies beside it.
//!
//! - `simulation` and `closed_loop`: the arm simulated in one process, without and with a built-in controller.
//! - [`reference_runs`] and `reference_report`: runs beside an independent reference.
//! - [`reproduce`]: the scenarios, figures and claims of the paper, each with a verdict.
//! - [`cells`]: the table of compensation; `bound` and [`bound_table`]: how far the deviation at sharp corners can be reduced at all.
//! - [`train`]: the network of `narx-qp`.

mod bound;
pub mod bound_table;
pub mod cells;
mod closed_loop;
mod reference_report;
pub mod reference_runs;
pub mod reproduce;
mod simulation;
pub mod train;
