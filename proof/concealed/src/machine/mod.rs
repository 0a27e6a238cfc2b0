//! The true machine and its motion: one file per law, the plan that combines them, the time stepping.

mod bristles;
mod build;
mod cable;
mod chain;
mod drive;
mod dry_bearing;
mod film;
mod plan;
mod run;
mod step;
#[cfg(test)]
mod tests;
mod transmission;

pub use plan::{Plan, PlanError};
pub use run::Trace;
