//! The `freeplay` command.
//!
//! Modules in the order of a run: `args` (what was typed), `scenario` and `setup` (what runs), `run` and `processes` (the parent),
//! `plant_command` and `controller_command` (its children), `columns` and `recorder` (what is kept), `summary`,
//! `histogram_files`, `screen`, `live` and `run_report` (what a person sees); `swaps` (who is in charge when), `swap_command` and
//! `swap_measures` (what a swap costs); `bench` and `doctor` (timing, and whether the machine is fit for it); `diagnose` and
//! `diagnose_report` (what is missing from a model), `excite` (the next motion), `demo` (the loop closed), `blind` (the proof on concealed
//! effects); `cells` and `bound` (how far a correction gets); `compare`, `replay`, `reference_runs` and `reproduce` beside them; `record`,
//! `scenario_command` and `manual` run nothing. `voice` and `say` are how all of them speak.

mod args;
mod bench;
mod blind;
mod bound;
mod bound_table;
mod cells;
mod check;
mod closed_loop;
mod columns;
mod compare;
mod controller_command;
mod demo;
mod diagnose;
mod diagnose_report;
mod diagnose_screen;
mod doctor;
mod excite;
mod exit;
mod faults;
mod files;
mod hex;
mod histogram_files;
mod live;
mod manual;
mod plant_command;
mod process;
mod processes;
mod record;
mod recorded;
mod recorder;
mod reference_report;
mod reference_runs;
mod replay;
mod report_command;
mod reproduce;
mod run;
mod run_film;
mod run_report;
mod say;
mod scenario;
mod scenario_command;
mod scenario_place;
mod screen;
mod setup;
mod simulation;
mod summary;
mod swap_command;
mod swap_measures;
mod swaps;
mod train;
mod units;
mod voice;

/// A diagnosis makes and drops thousands of columns; the system's allocator gives each back to the kernel.
#[global_allocator]
static ALLOCATOR: mimalloc::MiMalloc = mimalloc::MiMalloc;

fn main() -> std::process::ExitCode {
    match args::dispatch() {
        Ok(exit) => exit.into(),
        Err(failure) => {
            eprintln!("freeplay: {failure}");
            failure.exit.into()
        }
    }
}
