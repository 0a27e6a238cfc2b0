//! `freeplay run`: a plant process and a controller process for each run, and what they leave.
//!
//! Modules in the order of a run:
//!
//! - [`scenario`] and `scenario_place`: what was asked for, and where in the file; [`setup`] makes of it what runs.
//! - [`swaps`]: which controller is active, and when that changes.
//! - [`run`] and [`processes`]: the parent process.
//! - `gains`: the feedback with which the journals of a light arm rest, by trial.
//! - [`plant_command`] and [`controller_command`]: its children; `load` delays the answers of a controller.
//! - [`columns`], `recorder`, [`histogram_files`], [`summary`]: the recording, the latencies and the results.
//! - `verdict`: whether a run was sound, and the words for what stopped an arm.
//! - `live`: the view of a run in the terminal.
//! - `terminal_summary`, `run_report`, `run_film`, [`report_command`]: the table and the reports.
//! - [`weights`]: what a network learned beyond the model, and how far that reaches along the path.
//! - [`closed_loop`]: the same loop in this process, without shared memory and gate; [`loop_recorder`]: its recording.
//! - [`replay`]: the recorded states of a run, given to a new controller process.

pub mod closed_loop;
pub mod columns;
pub mod controller_command;
pub mod controller_selection;
mod gains;
pub mod histogram_files;
mod live;
mod load;
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
pub mod summary;
pub mod swap_tables;
pub mod swaps;
mod terminal_summary;
mod verdict;
pub mod weights;
mod weights_reach;

pub use terminal_summary::ending;
