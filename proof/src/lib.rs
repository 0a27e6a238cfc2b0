//! Proof of the diagnosis on machines whose physics is known to nobody but their generator.
//!
//! - [`blind`]: recordings are sealed, diagnosed once, opened and scored.
//! - [`demo`]: the whole loop on the paper's arm: run, diagnose, control with what was found.

pub mod blind;
pub mod demo;
