//! The process that makes the sealed recordings, and the parent's side of it.

use std::collections::BTreeSet;
use std::io::{BufRead, BufReader, Read, Write};
use std::os::unix::process::ExitStatusExt;
use std::path::Path;
use std::process::ExitStatus;

use clap::Args;
use freeplay_concealed::write_sealed;
use freeplay_storage::{EntryKind, StorageError, list, plain_words, remove_folder, set_times};
use freeplay_terminal::exit::{Exit, Failure};
use freeplay_terminal::output::say;
use freeplay_terminal::parallel::on_cores;
use freeplay_terminal::process::die_with_parent;
use freeplay_terminal::running::Running;
use indicatif::ProgressBar;
use serde::{Deserialize, Serialize};
use serde_json::Value;

use super::names::name;
use super::order::Order;
use super::source::Source;

/// Generates the sealed recordings that standard input requests. `freeplay blind` starts this process.
#[derive(Args, Debug)]
pub struct GenerateArgs {
    /// End when the process with this ID ends.
    #[arg(long, value_name = "PID")]
    with_parent: u32,
}

/// Outcome of one drawn case.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub enum Line {
    /// The case was made: the folder's name and the concealed effects.
    Made {
        /// Name of the folder.
        name: String,
        /// The truth, as the generator writes it.
        truth: Value,
    },
    /// The case was not made: no machine shows the drawn effects with the requested strength.
    NotMade {
        /// The drawn request.
        asked: String,
        /// The reason.
        why: String,
    },
}

/// A message of the process about a case: its index in the draw, and its outcome, or `None` at its beginning.
type Told = (usize, Option<Line>);

/// The process: reads an order from standard input and writes the cases. For each case it prints the index in the draw on standard output at the beginning, and
/// again at the end with the outcome.
///
/// # Errors
/// An order that can't be read; a data sheet or a file that can't be written.
pub fn generate(args: &GenerateArgs) -> Result<Exit, Failure> {
    die_with_parent(args.with_parent)?;
    let mut text = String::new();
    std::io::stdin().read_to_string(&mut text).map_err(Failure::input)?;
    let order: Order =
        serde_json::from_str(&text).map_err(|error| Failure::input(plain_words(&error.to_string())))?;
    let cases = order.cases().map_err(Failure::internal)?;
    let open = order.open(cases.len());
    let tell = |line: &Told| say(&(serde_json::to_string(line).map_err(Failure::internal)? + "\n"));
    on_cores(order.jobs, open.len(), |at| {
        let index = open[at];
        let name = name(&order.names, index);
        tell(&(index, None))?;
        let line = match order.generate(&cases[index]) {
            Ok(made) => {
                write_sealed(&order.folder.join(&name), &made).map_err(Failure::input)?;
                let truth = serde_json::to_value(&made.truth).map_err(Failure::internal)?;
                Line::Made { name, truth }
            }
            Err(error) => Line::NotMade { asked: order.asked(&cases[index]), why: error.to_string() },
        };
        tell(&(index, Some(line)))
    })?;
    Ok(Exit::Done)
}

/// Runs `order` in a process of `source`. Returns the made cases, by name, and the others. If the process is killed, its unfinished cases count as not made,
/// and another process makes the rest.
///
/// # Errors
/// A process that can't be started, that fails for another reason than a kill, or whose output can't be read.
pub fn made(order: &Order, source: &Source, bar: &ProgressBar) -> Result<Vec<Line>, Failure> {
    let (mut order, mut lines) = (order.clone(), Vec::new());
    let count = source.case_count(&order).map_err(Failure::internal)?;
    loop {
        let (told, killed) = made_until_killed(&order, source, bar)?;
        let begun: BTreeSet<usize> = told.iter().map(|(index, _)| *index).collect();
        let ended: BTreeSet<usize> =
            told.iter().filter(|(_, line)| line.is_some()).map(|(index, _)| *index).collect();
        lines.extend(told.into_iter().filter_map(|(_, line)| line));
        let Some(how) = killed else { return Ok(lines) };
        remove_unfinished(&order.folder, &lines)?;
        let mut lost: Vec<usize> = (&begun - &ended).into_iter().collect();
        if begun.is_empty() {
            // Also a process that is killed before its first case costs a case, so that the attempts end.
            lost.extend(order.open(count).first());
        }
        for &index in &lost {
            let asked = source.asked_at(&order, index).map_err(Failure::internal)?;
            lines.push(Line::NotMade {
                asked,
                why: format!("the generator was killed during this case ({how})"),
            });
        }
        order.done.extend(begun.into_iter().chain(lost));
        if order.open(count).is_empty() {
            return Ok(lines);
        }
    }
}

/// The messages of one process about `order`, each with the index in the draw; and its status, if it was killed.
fn made_until_killed(
    order: &Order,
    source: &Source,
    bar: &ProgressBar,
) -> Result<(Vec<Told>, Option<ExitStatus>), Failure> {
    let mut child = Running::alone(source.start()?);
    // Writing fails if the process has already been killed; its status tells.
    let text = source.order(order)?;
    let given = child.0.stdin.take().map(|mut pipe| pipe.write_all(text.as_bytes()));
    let mut told = Vec::new();
    let mut garbled = None;
    if let Some(pipe) = child.0.stdout.take() {
        for line in BufReader::new(pipe).split(b'\n') {
            match serde_json::from_slice::<Told>(&line.map_err(Failure::internal)?) {
                Ok(line) => {
                    bar.inc(u64::from(line.1.is_some()));
                    told.push(line);
                }
                Err(error) => garbled = garbled.or(Some(error)),
            }
        }
    }
    let status = child.0.wait().map_err(Failure::internal)?;
    if status.signal().is_some() {
        return Ok((told, Some(status)));
    }
    let above = "the generator ended; its message is above";
    match status.code() {
        Some(0) => {}
        Some(code) if code == Exit::Input as i32 => return Err(Failure::input(above)),
        Some(code) if code == Exit::Peer as i32 => return Err(Failure::peer(above)),
        _ => return Err(Failure::internal(format!("the generator ended with {status}"))),
    }
    given.transpose().map_err(Failure::internal)?;
    match (garbled, source) {
        (None, _) => Ok((told, None)),
        (Some(error), Source::Own) => Err(Failure::internal(error)),
        (Some(error), Source::Program(path, _)) => Err(Failure::input(format!(
            "{}: a line on its standard output breaks the contract of a generator: {}",
            path.display(),
            plain_words(&error.to_string())
        ))),
    }
}

/// Removes the unfinished folders of a killed generator from `folder`: those that no line of `lines` names.
fn remove_unfinished(folder: &Path, lines: &[Line]) -> Result<(), Failure> {
    let is_made = |path: &Path| {
        lines.iter().any(|line| matches!(line, Line::Made { name, .. } if path.file_name().is_some_and(|it| it == name.as_str())))
    };
    for entry in list(folder)? {
        if !is_made(&entry.path) {
            remove_folder(&entry.path)?;
        }
    }
    Ok(())
}

/// Gives every file and folder below `folder` the same time, so that none reveals the time of its making.
///
/// # Errors
/// Errors of the file system.
pub fn without_times(folder: &Path) -> Result<(), StorageError> {
    let one = std::time::SystemTime::UNIX_EPOCH + std::time::Duration::from_secs(946_684_800);
    for entry in list(folder)? {
        if entry.kind == EntryKind::Folder {
            without_times(&entry.path)?;
        }
        set_times(&entry.path, one)?;
    }
    Ok(())
}
