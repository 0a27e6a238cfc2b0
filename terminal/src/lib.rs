//! Common parts of all commands for the interaction with a person, a shell and the system.
//!
//! - [`exit`]: the exit codes, and [`Failure`](exit::Failure), the error that ends a command with one of them.
//! - [`command_line`]: errors of a command line.
//! - [`arguments`]: values of options that several commands share.
//! - [`internal_fault`]: panics and failed allocations, as one line and an exit code.
//! - [`output`]: results, on standard output.
//! - [`layout`]: text and tables as wide as the terminal.
//! - [`flags`]: options of every command: --quiet, --verbose, --color.
//! - [`messages`]: progress, notes and details, on standard error.
//! - [`styles`]: the colours of words of verdict.
//! - [`files`]: files named on the command line, and errors with remedies.
//! - [`progress`]: the progress of long work, in one line.
//! - [`outside`]: names from arguments and the environment, kept on one line.
//! - [`target`]: the decision whether `--out` names a file or a folder.
//! - [`process`]: signals and parents.
//! - [`running`]: child processes that end with their owner.
//! - [`guard`]: the process that ends an executable and all its child processes together with its run.
//! - [`parallel`]: the same work for many cases, on several cores.
//! - [`hex`]: bytes as text.

pub mod arguments;
pub mod command_line;
pub mod exit;
pub mod files;
pub mod flags;
pub mod guard;
pub mod hex;
pub mod internal_fault;
pub mod layout;
pub mod messages;
pub mod output;
pub mod outside;
pub mod parallel;
pub mod process;
pub mod progress;
pub mod running;
mod step_line;
pub mod styles;
pub mod target;
