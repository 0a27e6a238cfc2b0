//! `freeplay campaign`: many runs of this command, distributed over cores and machines by Freeplay's Python package.

use std::ffi::OsString;
use std::os::unix::process::CommandExt;
use std::path::PathBuf;
use std::process::{Command, Stdio};

use clap::Args;
use freeplay_terminal::exit::{Exit, Failure};
use freeplay_terminal::flags;

/// The options of the package's own command, for `--help`, which needs no Python.
const OPTIONS: &str = "\
Give these options after the command and its own arguments:
  --out DIR         Folder for the results, which every worker sees under this path
  --shards N        Number of tasks that blind is divided into; four for each worker without it
  --sweep KEY=V,V   Values of a key of the scenario, or of an option (--sweep=--seed=1,2,3)
  --engine NAME     Engine that runs the tasks: local, hyperqueue, dask, slurm
  --workers N       Tasks at a time; one for each core without it
  --cluster ADDRESS A running cluster: HyperQueue's server folder, Dask's scheduler, Slurm's partition
  --attempts N      Attempts for each task; 4 without it
  --keep            Keep the sealed recordings of blind

A campaign that is started again continues where it stopped:
  freeplay campaign blind --cases 2000 --seed 7 --shards 100 --engine hyperqueue --out proved
  freeplay campaign run s.toml --sweep path.period=6,12 --sweep=--seed=1,2,3 --out swept";

/// Distributes a command over cores and machines, and merges the results into one receipt.
///
/// The command is part of the Python package. Freeplay looks for the package in three interpreters, in this order: the one that FREEPLAY_PYTHON
/// names, the one beside this executable, and the system's.
#[derive(Args, Debug)]
#[command(after_help = OPTIONS)]
pub struct CampaignArgs {
    /// Command to distribute, followed by its arguments: blind, or, with --sweep, run, faults, swap, cells, reference-runs and
    /// others.
    #[arg(trailing_var_arg = true, allow_hyphen_values = true, required = true, value_name = "COMMAND")]
    arguments: Vec<OsString>,
}

/// Becomes the Python package's own command with the arguments of `args`.
///
/// # Errors
/// No Python with the package.
pub fn campaign(args: &CampaignArgs) -> Result<Exit, Failure> {
    let this = std::env::current_exe().map_err(Failure::internal)?;
    let python = interpreters(&this).find(has_package).ok_or_else(|| {
        Failure::peer(
            "freeplay campaign needs the Python package, and no Python here has it: install the wheel of this version with pip, or name an interpreter that has it with FREEPLAY_PYTHON",
        )
    })?;
    let mut command = Command::new(&python);
    command.args(["-m", "freeplay", "campaign"]).args(&args.arguments).env("FREEPLAY_EXECUTABLE", &this);
    if flags::is_quiet() {
        command.arg("--quiet");
    }
    // `exec` returns only after an error.
    Err(Failure::internal(format!("{}: {}", python.display(), command.exec())))
}

/// The candidate interpreters, in order: the one that the user names, the one beside this executable, the system's.
fn interpreters(this: &std::path::Path) -> impl Iterator<Item = PathBuf> {
    let named = std::env::var_os("FREEPLAY_PYTHON").filter(|name| !name.is_empty()).map(PathBuf::from);
    let beside = this.with_file_name("python");
    named.into_iter().chain(beside.is_file().then_some(beside)).chain(["python3".into(), "python".into()])
}

/// True if `python` starts and has the package.
fn has_package(python: &PathBuf) -> bool {
    let mut command = Command::new(python);
    command.args(["-c", "import freeplay.campaigns"]).stdin(Stdio::null()).stdout(Stdio::null());
    command.stderr(Stdio::null()).status().is_ok_and(|status| status.success())
}
