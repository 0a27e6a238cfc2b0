//! Proof of the diagnosis on machines whose physics only their generator knows.
//!
//! - [`blind`]: recordings are sealed, diagnosed once, revealed and scored.
//! - [`demo`]: the whole loop on the paper's arm: run, diagnose, control with the diagnosed model.

pub mod blind;
pub mod demo;
