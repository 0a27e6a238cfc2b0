//! The process that makes the sealed recordings, and the parent's side of it.

use std::io::{BufRead, BufReader, Read, Write};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use clap::Args;
use freeplay_concealed::{
    Case, GenerateError, Made, Matrix, Quota, draw_set, make_case, make_here, write_sealed,
};
use freeplay_terminal::exit::{Exit, Failure};
use freeplay_terminal::output::say;
use freeplay_terminal::parallel::on_cores;
use freeplay_terminal::process::Running;
use freeplay_terminal::process::end_with_parent;
use indicatif::ProgressBar;
use serde::{Deserialize, Serialize};
use serde_json::Value;

use super::names::name;
use super::truth::at;

/// Makes sealed recordings as standard input asks; `freeplay blind` starts it.
#[derive(Args, Debug)]
pub struct GenerateArgs {
    /// The process that it ends with.
    #[arg(long, value_name = "PID")]
    with_parent: u32,
}

/// What is to be made.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Order {
    /// Everything that is drawn comes from it.
    pub seed: u64,
    /// How many cases of which sort, over all shards.
    pub quota: Quota,
    /// What is swept instead of drawn at random.
    pub matrix: Option<Matrix>,
    /// The key that the names of their folders follow from.
    pub names: String,
    /// Which part of the cases: every `shard[1]`-th, from the `shard[0]`-th on, counted from 1.
    pub shard: [usize; 2],
    /// Where the cases are written.
    pub folder: PathBuf,
    /// Cases made at a time.
    pub jobs: usize,
}

impl Order {
    /// The cases of all shards.
    fn cases(&self) -> Result<Vec<Case>, GenerateError> {
        match &self.matrix {
            Some(matrix) => matrix.draw(self.seed),
            None => draw_set(&self.quota, self.seed),
        }
    }

    /// Makes `case`: a place of a matrix is that place, anything else may go to another machine.
    fn make(&self, case: &Case) -> Result<Made, GenerateError> {
        if self.matrix.is_some() && !case.hollow { make_here(case) } else { make_case(case) }
    }

    /// What `case` asks for, in words: its kinds, or the [`place`] of a matrix.
    fn asked(&self, case: &Case) -> String {
        let words = case.effects.iter().map(|effect| {
            if self.matrix.is_none() || case.hollow {
                return effect.kind.clone();
            }
            let arm = case.machine.data_sheet().ok();
            let joint = effect.joint.and_then(|joint| Some(arm?.joints().get(joint)?.name.clone()));
            place(&effect.kind, joint.as_deref(), case.machine.name(), effect.severity.name())
        });
        words.collect::<Vec<_>>().join(" + ")
    }
}

/// A place of a matrix in words.
pub fn place(kind: &str, joint: Option<&str>, machine: &str, severity: &str) -> String {
    format!("{} on {machine}, {severity}", at(kind, joint))
}

/// A case that was made, or not.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub enum Line {
    /// The folder's name and what is concealed.
    Made {
        /// Name of the folder.
        name: String,
        /// What is concealed, as the generator says it.
        truth: Value,
    },
    /// No machine shows what was drawn as strongly as asked for.
    NotMade {
        /// What was drawn.
        asked: String,
        /// Why it was not made.
        why: String,
    },
}

/// The process: reads an order from standard input, writes the cases, and one line for each to standard output.
///
/// # Errors
/// An order that can't be read; a data sheet or a file that can't be written.
pub fn generate(args: &GenerateArgs) -> Result<Exit, Failure> {
    end_with_parent(args.with_parent)?;
    let mut text = String::new();
    std::io::stdin().read_to_string(&mut text).map_err(Failure::input)?;
    let order: Order = serde_json::from_str(&text).map_err(Failure::input)?;
    let cases = order.cases().map_err(Failure::internal)?;
    let [shard, shards] = order.shard;
    let mine: Vec<usize> = (0..cases.len()).filter(|index| index % shards == shard - 1).collect();
    on_cores(order.jobs, mine.len(), |at| {
        let index = mine[at];
        let name = name(&order.names, index);
        let line = match order.make(&cases[index]) {
            Ok(made) => {
                write_sealed(&order.folder.join(&name), &made).map_err(Failure::input)?;
                let truth = serde_json::to_value(&made.truth).map_err(Failure::internal)?;
                Line::Made { name, truth }
            }
            Err(error) => Line::NotMade { asked: order.asked(&cases[index]), why: error.to_string() },
        };
        say(&(serde_json::to_string(&line).map_err(Failure::internal)? + "\n"))
    })?;
    Ok(Exit::Done)
}

/// Has `order` made by a process of its own; what it made, by name, and what it did not.
///
/// # Errors
/// A process that can't be started, that ends badly, or says what can't be read.
pub fn made(order: &Order, bar: &ProgressBar) -> Result<Vec<Line>, Failure> {
    let mut command = Command::new(std::env::current_exe().map_err(Failure::internal)?);
    command.arg("blind-generate").args(["--with-parent", &std::process::id().to_string()]);
    command.stdin(Stdio::piped()).stdout(Stdio::piped());
    let mut child =
        Running(command.spawn().map_err(|error| Failure::internal(format!("generator: {error}")))?);
    let order = serde_json::to_string(order).map_err(Failure::internal)?;
    if let Some(mut pipe) = child.0.stdin.take() {
        pipe.write_all(order.as_bytes()).map_err(Failure::internal)?;
    }
    let mut lines = Vec::new();
    if let Some(pipe) = child.0.stdout.take() {
        for line in BufReader::new(pipe).lines() {
            lines.push(serde_json::from_str(&line.map_err(Failure::internal)?).map_err(Failure::internal)?);
            bar.inc(1);
        }
    }
    let status = child.0.wait().map_err(Failure::internal)?;
    if status.success() {
        Ok(lines)
    } else {
        Err(Failure::internal(format!("the generator ended with {status}")))
    }
}

/// Gives every file and folder below `folder` the same time, so that none tells when it was made.
///
/// # Errors
/// What the file system says.
pub fn without_times(folder: &Path) -> std::io::Result<()> {
    let times = std::fs::FileTimes::new();
    let one = std::time::SystemTime::UNIX_EPOCH + std::time::Duration::from_secs(946_684_800);
    for entry in std::fs::read_dir(folder)? {
        let path = entry?.path();
        if path.is_dir() {
            without_times(&path)?;
        }
        std::fs::File::open(&path)?.set_times(times.set_accessed(one).set_modified(one))?;
    }
    Ok(())
}
