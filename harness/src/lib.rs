//! `freeplay run`: a plant process and a controller process for each run, and the results.
//!
//! Modules in the order of a run:
//!
//! - [`scenario`] and `scenario_place`: the requested scenario, and line and column of its keys; [`setup`] turns it into a plant
//!   and a path.
//! - [`swaps`]: the active controller over time.
//! - [`run`] and [`processes`]: the parent process.
//! - `gains`: a feedback with which the journals of a light arm rest, found by trial.
//! - [`plant_command`] and [`controller_command`]: its children; `slowed_controller` delays the answers of a controller.
//! - [`columns`], `recorder`, [`histogram_files`], [`summary`]: the recording, the latencies and the results.
//! - `verdict`: the verdict on a run, and the texts for a stopped arm.
//! - `live`: the view of a run in the terminal.
//! - `terminal_summary`, `run_report`, `run_film`, [`report_command`]: the table in the terminal and the reports.
//! - [`weights`]: the weight file of the controllers; `weights_reach`: the part of the path in its trained region.
//! - [`closed_loop`]: the same loop in this process, without shared memory and gate; [`loop_recorder`]: its recording.
//! - [`replay`]: the recorded states of a run, sent to a new controller process.

pub mod closed_loop;
pub mod columns;
pub mod controller_command;
pub mod controller_selection;
mod gains;
pub mod histogram_files;
mod live;
pub mod loop_recorder;
pub mod plant_command;
pub mod processes;
mod recorder;
pub mod replay;
pub mod report_command;
pub mod run;
pub mod run_files;
mod run_film;
mod run_report;
pub mod scenario;
pub mod scenario_place;
pub mod setup;
mod slowed_controller;
pub mod summary;
pub mod swap_tables;
pub mod swaps;
mod terminal_summary;
mod verdict;
pub mod weights;
mod weights_reach;

pub use terminal_summary::ending;
