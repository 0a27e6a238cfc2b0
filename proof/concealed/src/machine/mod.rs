//! The machine as it is, and what it does: laws one to a file, the plan that puts them together, the time stepping.

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
