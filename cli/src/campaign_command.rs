//! `freeplay campaign`: many runs of this command, spread over cores and machines by the Python package that comes with it.

use std::ffi::OsString;
use std::os::unix::process::CommandExt;
use std::path::PathBuf;
use std::process::{Command, Stdio};

use clap::Args;
use freeplay_terminal::exit::{Exit, Failure};

/// Spreads the shards of a command over cores and machines.
#[derive(Args, Debug)]
pub struct CampaignArgs {
    /// What to spread, and how: freeplay campaign --help.
    #[arg(trailing_var_arg = true, allow_hyphen_values = true, value_name = "ARGUMENTS")]
    arguments: Vec<OsString>,
}

/// Becomes the Python package's own command with the arguments of `args`.
///
/// # Errors
/// No Python that has the package.
pub fn campaign(args: &CampaignArgs) -> Result<Exit, Failure> {
    let this = std::env::current_exe().map_err(Failure::internal)?;
    let python = interpreters(&this).find(|python| has_package(python)).ok_or_else(|| {
        Failure::peer(
            "freeplay campaign is part of the Python package, and no Python here has it: pip install the wheel of this version, or name \
             an interpreter that has it with FREEPLAY_PYTHON",
        )
    })?;
    let mut command = Command::new(&python);
    command.args(["-m", "freeplay", "campaign"]).args(&args.arguments).env("FREEPLAY_EXECUTABLE", &this);
    // `exec` comes back only if it fails.
    Err(Failure::internal(format!("{}: {}", python.display(), command.exec())))
}

/// The interpreters to ask, in order: the one that the user names, the one beside this executable, the system's.
fn interpreters(this: &std::path::Path) -> impl Iterator<Item = PathBuf> {
    let named = std::env::var_os("FREEPLAY_PYTHON").filter(|name| !name.is_empty()).map(PathBuf::from);
    let beside = this.with_file_name("python");
    named.into_iter().chain(beside.is_file().then_some(beside)).chain(["python3".into(), "python".into()])
}

/// Whether `python` starts and has the package.
fn has_package(python: &PathBuf) -> bool {
    let mut command = Command::new(python);
    command.args(["-c", "import freeplay.campaigns"]).stdin(Stdio::null()).stdout(Stdio::null());
    command.stderr(Stdio::null()).status().is_ok_and(|status| status.success())
}
