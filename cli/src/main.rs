//! The `freeplay` command: the command line, and one short file for each command outside other crates.
//!
//! Modules: `args` (the command line), `manual`; `compare` with `compare_curves`, `diagnose` with `diagnose_args`, `diagnose_view` and `diagnose_screen`,
//! `excite`, `inputs` (recordings with their model); `arm_command`, `export_command`, `record`, `scenario_command`, `campaign_command`, `controller`.

mod args;
mod arm_command;
mod campaign_command;
mod check;
mod compare;
mod compare_curves;
mod controller;
mod diagnose;
mod diagnose_args;
mod diagnose_screen;
mod diagnose_view;
mod excite;
mod export_command;
mod help;
mod inputs;
mod manual;
mod margin;
mod record;
mod scenario_command;

/// A diagnosis allocates and frees thousands of columns; the system's allocator would return each to the kernel.
#[global_allocator]
static ALLOCATOR: mimalloc::MiMalloc = mimalloc::MiMalloc;

fn main() -> std::process::ExitCode {
    match freeplay_terminal::internal_fault::guarded(args::dispatch) {
        Ok(exit) => exit.into(),
        Err(failure) => {
            freeplay_terminal::messages::fault(&failure);
            failure.exit.into()
        }
    }
}
