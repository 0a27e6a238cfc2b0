//! The arm with play as an FMU: FMI 3.0 Co-Simulation (Modelica Association 2022).
//!
//! The nouns, in the order in which data passes through them:
//!
//! - [`Variable`]: an input, output or parameter of the FMU, by its value reference; [`Variables`] are those of an arm file.
//! - [`Machine`]: the plant of an arm file with given parameters, stepped tick by tick with external torques.
//! - [`Instance`]: the object that an importer controls through its modes: values, steps, and each [`State`] that it saves and restores.
//! - [`description()`]: `modelDescription.xml`; [`write_fmu`]: the whole FMU as one file.
//! - [`guest`]: third-party FMUs as controllers.
//! - `abi`: the C functions of FMI 3.0 over an [`Instance`], in the shared library of an FMU. It and the module of a guest's library are the only places with
//!   `unsafe`.

mod abi;
mod description;
mod fault;
pub mod guest;
mod instance;
mod machine;
mod package;
mod state;
mod units;
mod variables;

pub use description::LIBRARY;
pub use description::description;
pub use fault::Fault;
pub use instance::Instance;
pub use machine::{Contact, Machine, PERIOD, Readout, Stimulus};
pub use package::{PackageError, archive, write_fmu};
pub use state::State;
pub use variables::{Causality, Quantity, Value, Variable, Variables};
