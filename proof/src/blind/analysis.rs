//! The analysis of all cases of a sealed folder, each by an analyst of its own in one attempt.

use std::collections::BTreeMap;
use std::io::Read;
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use freeplay_storage::{EntryKind, list, open_without_links, plain_words};
use freeplay_terminal::exit::Failure;
use freeplay_terminal::parallel::on_cores;
use freeplay_terminal::running::Running;
use indicatif::ProgressBar;
use serde::{Deserialize, Serialize};

use super::analyst::FILES;
use super::answer::Answer;
use super::hash;
use super::lures::Held;

/// Polling interval for an analyst.
const LOOK: Duration = Duration::from_millis(10);

/// The files of each case, by name of the case and of the file.
pub type Sealed = BTreeMap<String, BTreeMap<String, SealedFile>>;

/// A sealed file.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct SealedFile {
    /// Its hash, the number that `sha256sum` prints.
    pub sha256: String,
    /// Its length.
    pub bytes: u64,
}

/// The cases in `folder`, with the hashes and lengths of their files.
///
/// # Errors
/// A folder without a case; files that can't be read.
pub fn sealed(folder: &Path) -> Result<Sealed, Failure> {
    let mut cases = Sealed::new();
    for entry in list(folder)? {
        // A link could lead out of the folder to an unsealed file.
        if entry.kind == EntryKind::Link && entry.path.join(FILES[0]).exists() {
            let path = entry.path.display();
            return Err(Failure::input(format!(
                "{path}: is a link; put the folder of the case itself there"
            )));
        }
        if entry.kind == EntryKind::Folder && entry.path.join(FILES[0]).is_file() {
            let mut files = BTreeMap::new();
            seal_below(&entry.path, "", &mut files)?;
            cases.insert(name(&entry.path), files);
        }
    }
    if cases.is_empty() {
        let all = FILES.join(", ");
        return Err(Failure::input(format!(
            "{}: no folder in it holds a case; give one whose folders hold {all}",
            folder.display()
        )));
    }
    Ok(cases)
}

/// Seals every file below `folder`, since an analyst can read them all; `prefix` precedes their names.
fn seal_below(folder: &Path, prefix: &str, files: &mut BTreeMap<String, SealedFile>) -> Result<(), Failure> {
    for entry in list(folder)? {
        let named = format!("{prefix}{}", name(&entry.path));
        match entry.kind {
            EntryKind::Folder => seal_below(&entry.path, &format!("{named}/"), files)?,
            EntryKind::File => drop(files.insert(named, seal(&entry.path)?)),
            kind => {
                let what = if kind == EntryKind::Link { "it is a link" } else { "it is no file" };
                let shown = entry.path.display();
                return Err(Failure::input(format!("{shown}: {what}; put a copy of the file in its place")));
            }
        }
    }
    Ok(())
}

fn seal(file: &Path) -> Result<SealedFile, Failure> {
    let bytes = open_without_links(file)?.length();
    Ok(SealedFile { sha256: hash::of_file(file)?, bytes })
}

fn name(path: &Path) -> String {
    path.file_name().map_or_else(String::new, |name| name.to_string_lossy().into_owned())
}

/// Number of analysts with `answers` by kind of isolation, in words.
pub fn isolation<'a>(answers: impl Iterator<Item = &'a Answer>) -> BTreeMap<String, usize> {
    let mut counts = BTreeMap::new();
    for answer in answers {
        *counts.entry(answer.isolation.words()).or_default() += 1;
    }
    counts
}

/// Settings of the analysts.
pub struct Analysts {
    /// Number of concurrent analysts.
    pub jobs: usize,
    /// Time limit of each.
    pub patience: Duration,
    /// Resources that no analyst may reach.
    pub lures: Held,
}

impl Analysts {
    /// The answer for each of `cases` in `folder`. A crash or a timeout of an analyst counts as a wrong answer.
    ///
    /// # Errors
    /// An analyst that can't be started.
    pub fn answers(
        &self,
        folder: &Path,
        cases: &Sealed,
        bar: &ProgressBar,
    ) -> Result<BTreeMap<String, Answer>, Failure> {
        let names: Vec<&String> = cases.keys().collect();
        let answers = on_cores(self.jobs, names.len(), |index| {
            let answer = self.one(&folder.join(names[index]));
            bar.inc(1);
            answer
        })?;
        Ok(names.into_iter().cloned().zip(answers).collect())
    }

    fn one(&self, case: &Path) -> Result<Answer, Failure> {
        let mut command = Command::new(std::env::current_exe().map_err(Failure::internal)?);
        command.arg("blind-analyst").args(["--with-parent", &std::process::id().to_string()]);
        command.env_clear().current_dir(case);
        self.lures.tell(&mut command);
        command.stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::null());
        let mut child =
            Running::alone(command.spawn().map_err(|error| Failure::internal(format!("analyst: {error}")))?);
        let Some(mut pipe) = child.0.stdout.take() else {
            return Err(Failure::internal("an analyst has no standard output"));
        };
        let reader = std::thread::Builder::new().spawn(move || {
            let mut text = String::new();
            pipe.read_to_string(&mut text).map(|_| text)
        });
        let reader = reader.map_err(Failure::no_thread)?;
        let ended = self.wait(&mut child.0)?;
        drop(child);
        let said =
            reader.join().map_err(|_| Failure::internal("the reader of an analyst's answer panicked"))?;
        Ok(match (ended, said) {
            (Err(why), _) => Answer::failed(why),
            (Ok(()), Err(error)) => Answer::failed(format!("its answer can't be read: {error}")),
            (Ok(()), Ok(text)) => serde_json::from_str(&text).unwrap_or_else(|error| {
                Answer::failed(format!("its answer can't be read: {}", plain_words(&error.to_string())))
            }),
        })
    }

    /// Waits for the analyst: success, or the reason of its failure.
    fn wait(&self, child: &mut Child) -> Result<Result<(), String>, Failure> {
        let start = Instant::now();
        loop {
            match child.try_wait().map_err(Failure::internal)? {
                Some(status) if status.success() => return Ok(Ok(())),
                Some(status) => return Ok(Err(format!("the analyst ended with {status}"))),
                None if start.elapsed() > self.patience => {
                    return Ok(Err(format!("no answer within {} s", self.patience.as_secs())));
                }
                None => std::thread::sleep(LOOK),
            }
        }
    }
}
