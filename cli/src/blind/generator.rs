//! The process that makes the sealed recordings, and the parent's side of it.

use std::io::{BufRead, BufReader, Read, Write};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use clap::Args;
use freeplay_concealed::{
    Case, GenerateError, Made, Matrix, Quota, draw_set, make_case, make_here, write_sealed,
};
use freeplay_storage::{EntryKind, StorageError, list, set_times};
use indicatif::ProgressBar;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde::{Deserialize, Serialize};
use serde_json::Value;

use super::truth::at;
use crate::exit::{Exit, Failure};
use crate::process::end_with_parent;
use crate::processes::Running;
use crate::say::say;
use crate::simulation::on_cores;

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

/// The process: reads an [`Order`] from standard input, writes the cases, and each [`Line`] to standard output.
///
/// # Errors
/// An order that can't be read; a data sheet or a file that can't be written.
pub fn generate(args: &GenerateArgs) -> Result<Exit, Failure> {
    end_with_parent(args.with_parent)?;
    let mut text = String::new();
    std::io::stdin().read_to_string(&mut text).map_err(Failure::input)?;
    let order: Order = serde_json::from_str(&text).map_err(Failure::input)?;
    let cases = order.cases().map_err(Failure::internal)?;
    let names = names(order.seed, cases.len());
    let [shard, shards] = order.shard;
    let mine: Vec<usize> = (0..cases.len()).filter(|index| index % shards == shard - 1).collect();
    on_cores(order.jobs, mine.len(), |at| {
        let index = mine[at];
        let line = match order.make(&cases[index]) {
            Ok(made) => {
                write_sealed(&order.folder.join(&names[index]), &made).map_err(Failure::input)?;
                let truth = serde_json::to_value(&made.truth).map_err(Failure::internal)?;
                Line::Made { name: names[index].clone(), truth }
            }
            Err(error) => Line::NotMade { asked: order.asked(&cases[index]), why: error.to_string() },
        };
        say(&(serde_json::to_string(&line).map_err(Failure::internal)? + "\n"))
    })?;
    Ok(Exit::Done)
}

/// Names of folders: twelve digits each that tell nothing, no two alike.
fn names(seed: u64, count: usize) -> Vec<String> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    // A stream of its own: the cases are drawn from the same seed.
    rng.set_stream(u64::from_le_bytes(*b"names of"));
    let mut names = Vec::with_capacity(count);
    while names.len() < count {
        let name = format!("{:012x}", rng.random::<u64>() >> 16);
        if !names.contains(&name) {
            names.push(name);
        }
    }
    names
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
    // A generator that has ended takes no order; its exit code says why.
    let sent = child.0.stdin.take().map_or(Ok(()), |mut pipe| pipe.write_all(order.as_bytes()));
    let mut lines = Vec::new();
    if let Some(pipe) = child.0.stdout.take() {
        for line in BufReader::new(pipe).lines() {
            lines.push(serde_json::from_str(&line.map_err(Failure::internal)?).map_err(Failure::internal)?);
            bar.inc(1);
        }
    }
    let status = child.0.wait().map_err(Failure::internal)?;
    if status.code() == Some(Exit::Input as i32) {
        return Err(Failure::input("the generator ended; its message is above"));
    }
    if !status.success() {
        return Err(Failure::internal(format!("the generator ended with {status}")));
    }
    sent.map_err(Failure::internal)?;
    Ok(lines)
}

/// Gives every file and folder below `folder` the same time, so that none tells when it was made.
///
/// # Errors
/// What the file system says.
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

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    #[test]
    fn names_are_unlike_and_follow_the_seed() {
        let some = super::names(4, 2000);
        assert_eq!(some.iter().collect::<BTreeSet<_>>().len(), 2000);
        assert!(some.iter().all(|name| name.len() == 12));
        assert_eq!(some, super::names(4, 2000));
        assert_ne!(some, super::names(5, 2000));
    }
}
