//! `freeplay completions`, `freeplay man`, `freeplay exit-codes`: descriptions of the command line for a shell and for a person.

use std::path::{Path, PathBuf};

use clap::Args;
use clap_complete::Shell;
use freeplay_report::paste::shell_word;
use freeplay_terminal::exit::{Exit, Failure};
use freeplay_terminal::files::make_folder;
use freeplay_terminal::output::{raw, say};

/// The exit codes, for `--help`, `freeplay help exit-codes` and the manual.
pub const EXIT_CODES: &str = "\
Exit codes:
    0  done
    1  a verdict failed: the command ran to its end and its result is not good enough
    2  usage: the command line is not understood
    3  bad input or configuration: a file, a scenario, a recording
    4  the machine is not fit (--require-rt)
    5  the other process is missing: the controller did not start, or the plant has ended
   70  an internal fault, of this program or of the machine, such as too little memory
  130  interrupted; recordings are closed properly";

/// Prints the completion script for a shell.
#[derive(Args, Debug)]
pub struct CompletionsArgs {
    /// Shell, as in: freeplay completions bash > ~/.local/share/bash-completion/completions/freeplay
    shell: Shell,
}

/// Prints the manual.
#[derive(Args, Debug)]
pub struct ManArgs {
    /// Write all pages to this folder: freeplay.1 and one page for each command. Default: print the first page to standard
    /// output.
    #[arg(long)]
    out: Option<PathBuf>,
}

/// Prints the completions of `command` for a shell.
///
/// # Errors
/// Standard output can't be written.
pub fn completions(args: &CompletionsArgs, mut command: clap::Command) -> Result<Exit, Failure> {
    let mut text = Vec::new();
    clap_complete::generate(args.shell, &mut command, "freeplay", &mut text);
    raw(&String::from_utf8_lossy(&text))?;
    Ok(Exit::Done)
}

/// Prints the manual of `command`, or writes all its pages.
///
/// # Errors
/// A folder or file that can't be written.
pub fn man(args: &ManArgs, command: clap::Command) -> Result<Exit, Failure> {
    let Some(out) = &args.out else {
        let mut page = Vec::new();
        clap_mangen::Man::new(command).render(&mut page).map_err(Failure::internal)?;
        raw(&String::from_utf8_lossy(&page))?;
        return Ok(Exit::Done);
    };
    make_folder(out)?;
    let mut command = command.disable_help_subcommand(true);
    command.build();
    write_pages(&command, out)?;
    say(&format!(
        "{}: freeplay.1 and a page for each command; man -l {1}\n",
        out.display(),
        shell_word(&out.join("freeplay.1"))
    ))?;
    Ok(Exit::Done)
}

/// Writes the page of `command` and those of its subcommands into the folder `out`.
fn write_pages(command: &clap::Command, out: &Path) -> Result<(), Failure> {
    for inner in command.get_subcommands().filter(|inner| !inner.is_hide_set()) {
        write_pages(inner, out)?;
    }
    let man = clap_mangen::Man::new(command.clone());
    let (name, mut page) = (man.get_filename(), Vec::new());
    man.render(&mut page).map_err(Failure::internal)?;
    Ok(freeplay_storage::write(&out.join(name), page)?)
}

/// Prints the exit codes.
///
/// # Errors
/// Standard output can't be written.
pub fn exit_codes() -> Result<Exit, Failure> {
    say(&format!("{EXIT_CODES}\n"))?;
    Ok(Exit::Done)
}
