//! `freeplay blind`: the proof on concealed effects.
//!
//! Freeze, seed, generate, seal, analyse once, commit to the answers, reveal, score. Generator and analysts are separate processes; only the memory of their
//! parent holds the truth until the answers are committed.
//!
//! Modules in the order of the protocol: `hash` and `canonical` (the freeze), `sweep` (the requested cases), `source`, `generator`, `names` and `arrange` (the
//! sealed folder), `analysis` and `lures` (start of the analysts and checks of their isolation), `analyst` and `answer` (the answers), `sandbox`, `namespaces`
//! and `channels` (the isolation), `truth`, `score`, `confidence_intervals`, `tally`, `confusion`, `controls`, `nearest_neighbours` and `leak` (the score),
//! `receipt`, `strict`, `overlap`, `verify`, `verification`, `gathered`, `merge` and `history` (the records), `terminal_summary`, `document` and `matrix` (the
//! display).

mod analysis;
mod analyst;
mod answer;
mod arrange;
mod canonical;
mod channels;
mod confidence_intervals;
mod confusion;
mod controls;
mod document;
mod gathered;
mod generator;
pub(crate) mod hash;
mod history;
mod judged;
mod leak;
mod lures;
mod matrix;
mod merge;
mod names;
mod namespaces;
mod nearest_neighbours;
mod order;
mod overlap;
mod protocol;
mod receipt;
mod sandbox;
mod score;
mod shard;
mod source;
mod strict;
mod sweep;
mod tally;
mod terminal_summary;
mod truth;
mod verification;
mod verify;

use std::path::{Path, PathBuf};
use std::time::Duration;

use clap::Args;
use freeplay_terminal::arguments::{Format, at_least_one};
use freeplay_terminal::exit::{Exit, Failure};
use freeplay_terminal::files::{check_target, claim, claim_or_new};
use freeplay_terminal::output::{say, show};
use rustix::process::{DumpableBehavior, set_dumpable_behavior};
use serde_json::json;

use freeplay_storage::OutputFolder;
use judged::Judged;
use merge::Merged;
use receipt::{Part, Receipt};
use sweep::Sweep;
use tally::Score;

pub use analyst::{AnalystArgs, analyst};
pub use generator::{GenerateArgs, generate};

/// Tests the diagnosis on concealed effects. The command makes recordings and seals the true effects before the analysis, which
/// has one attempt.
///
/// Without --full, the set is small: half of the cases have a single effect, a fifth are negative controls, a fifth have physics
/// outside the catalogue, and a tenth have two effects at once. Exit code 1: a receipt does not verify. The command reports
/// whether the results meet the goals. A missed goal does not change the exit code.
#[derive(Args, Debug)]
pub struct BlindArgs {
    /// Seed of the set. Default: a seed from the operating system, drawn after the freeze.
    #[arg(long)]
    seed: Option<u64>,
    /// Number of cases.
    #[arg(long, value_name = "N", default_value_t = 40, conflicts_with_all = ["full", "matrix"], value_parser = at_least_one)]
    cases: usize,
    /// Use the full set: 1080 cases with a single effect, 300 negative controls, 152 cases outside the catalogue, and 156 with
    /// two effects.
    #[arg(long)]
    full: bool,
    #[command(flatten)]
    sweep: Sweep,
    /// Generator of the recordings. The value mujoco simulates with MuJoCo, and mujoco-servos records commanded and measured
    /// positions alone. Both need Python with the package mujoco; FREEPLAY_PYTHON names an interpreter that has it. Other values:
    /// an executable, or a Python file or folder, that follows the contract of proof/mujoco/README.md. Default: the generator in
    /// this program.
    #[arg(long, value_name = "PROGRAM", conflicts_with_all = ["matrix", "merge", "analyse", "score", "verify"])]
    generator: Option<PathBuf>,
    /// Take only every N-th case, starting with case I, so that N machines can share a set. Give all machines the same --seed,
    /// and merge the receipts with --merge.
    #[arg(long, value_name = "I/N", value_parser = shard, default_value = "1/1")]
    shard: Shard,
    /// Merge the receipts in these folders into one score and report.
    #[arg(long, value_name = "DIR", num_args = 1.., conflicts_with_all = ["full", "matrix", "seed"])]
    merge: Vec<PathBuf>,
    /// Diagnose the cases in a folder that someone else sealed: DIR/NAME/{model.toml,recording.csv,second.csv}. Writes
    /// DIR/receipt.json.
    #[arg(long, value_name = "DIR", conflicts_with_all = ["full", "matrix", "seed", "merge"])]
    analyse: Option<PathBuf>,
    /// Score the answers of --analyse DIR against TRUTH, a JSON file. Writes DIR/receipt.json and DIR/report.html.
    #[arg(long, value_names = ["DIR", "TRUTH"], num_args = 2, conflicts_with_all = ["full", "matrix", "seed", "merge", "analyse"])]
    score: Vec<PathBuf>,
    /// Recompute every hash in these receipts. With --history, also check that the list contains their seals.
    #[arg(long, value_name = "RECEIPT", num_args = 1.., conflicts_with_all = ["full", "matrix", "seed", "merge", "analyse", "score"])]
    verify: Vec<PathBuf>,
    /// Write the sealed recordings, receipt.json and report.html to this folder, which must be empty. Default: out/blind-TIME.
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Replace results of an earlier command in the folder.
    #[arg(long)]
    force: bool,
    /// Number of processes that run at a time. Default: one for each core.
    #[arg(long, value_name = "N", value_parser = at_least_one)]
    jobs: Option<usize>,
    /// Time limit of an analyst for one case, s. A case that exceeds the limit counts as answered wrongly.
    #[arg(long, value_name = "S", default_value_t = 120, value_parser = clap::value_parser!(u64).range(1..))]
    patience: u64,
    /// Append one line to this list when the set is sealed, and one line when the set is scored.
    #[arg(long, value_name = "FILE")]
    history: Option<PathBuf>,
    /// Output format.
    #[arg(long, default_value = "text")]
    format: Format,
}

/// Selects one part of a set.
#[derive(Clone, Copy, Debug)]
struct Shard(usize, usize);

fn shard(text: &str) -> Result<Shard, String> {
    let numbers = text.split_once('/').and_then(|(i, n)| Some((i.parse().ok()?, n.parse().ok()?)));
    match numbers {
        Some((i, n)) if i >= 1 && i <= n => Ok(Shard(i, n)),
        _ => Err("I/N with 1 ≤ I ≤ N, such as 2/8".to_owned()),
    }
}

impl BlindArgs {
    fn jobs(&self) -> usize {
        self.jobs.unwrap_or_else(|| std::thread::available_parallelism().map_or(1, usize::from)).max(1)
    }

    fn patience(&self) -> Duration {
        Duration::from_secs(self.patience)
    }

    /// The folder of the results.
    fn claim(&self) -> Result<OutputFolder, Failure> {
        if let [folder, _] = self.score.as_slice() {
            // The folder holds the receipt to be scored.
            return claim(Some(folder), &[], self.force);
        }
        let time = receipt::now().replace(':', "-");
        let new = PathBuf::from("out").join(format!("blind-{}", time.trim_end_matches('Z')));
        claim_or_new(
            self.out.as_deref(),
            &new,
            &["sealed", "generator", "gathered", "receipt.json", "report.html"],
            self.force,
        )
    }
}

/// Carries out the action of `args`.
///
/// # Errors
/// Bad input; a folder that can't be written; a process that can't be started.
pub fn blind(args: &BlindArgs) -> Result<Exit, Failure> {
    if !args.verify.is_empty() {
        return verification::verify(&args.verify, args.history.as_deref(), args.format);
    }
    // Checked first, since the rest takes minutes.
    args.history.as_deref().map_or(Ok(()), check_target)?;
    private()?;
    if let Some(folder) = &args.analyse {
        return analyse(args, folder);
    }
    let folder = args.claim()?;
    if !args.merge.is_empty() {
        return publish_merged(args, folder.path());
    }
    let receipt = match args.score.as_slice() {
        [folder, truth] => protocol::opened(folder, truth)?,
        _ => protocol::whole(args, folder.path())?,
    };
    publish(args, folder.path(), receipt)
}

/// Scores `receipt`, writes it with its report into `folder`, and prints the score.
fn publish(args: &BlindArgs, folder: &Path, mut receipt: Receipt) -> Result<Exit, Failure> {
    let judged = receipt.judged()?;
    for case in &judged {
        if let Some(record) = receipt.cases.get_mut(&case.name) {
            record.outcome = Some(case.outcome);
        }
    }
    let score = Score::of(&judged);
    receipt.score = json!(score);
    receipt.write(&folder.join("receipt.json"))?;
    if let (Some(list), [part]) = (&args.history, receipt.parts.as_slice()) {
        history::scored(list, part.seal_hash(), &receipt.sha256, &score)?;
    }
    present(args, folder, &receipt.parts, &judged, &score)
}

/// Merges, scores and publishes as [`publish`] does. The cases stream from the receipts to the new one without being held in memory.
fn publish_merged(args: &BlindArgs, folder: &Path) -> Result<Exit, Failure> {
    let Merged { parts, judged, cases } = merge::merged(&args.merge, folder)?;
    let score = Score::of(&judged);
    let hash = cases.write(&folder.join("receipt.json"), &parts, &json!(score))?;
    drop(cases);
    if let (Some(list), [part]) = (&args.history, parts.as_slice()) {
        history::scored(list, part.seal_hash(), &hash, &score)?;
    }
    present(args, folder, &parts, &judged, &score)
}

/// Writes the report into `folder`, beside the receipt, and prints the score.
fn present(
    args: &BlindArgs,
    folder: &Path,
    parts: &[Part],
    judged: &[Judged],
    score: &Score,
) -> Result<Exit, Failure> {
    let (path, report) = (folder.join("receipt.json"), folder.join("report.html"));
    freeplay_terminal::files::write(&report, &document::document(parts, judged, score).to_html())?;
    match args.format {
        Format::Json => say(&format!("{:#}\n", json!(score)))?,
        Format::Text => show(&terminal_summary::summary(parts, judged, score, &path, &report))?,
    }
    Ok(Exit::Done)
}

/// Runs the analysts on the sealed `folder` of someone else.
fn analyse(args: &BlindArgs, folder: &Path) -> Result<Exit, Failure> {
    // The folder must exist: this command does not create it.
    freeplay_storage::list(folder)?;
    let _claimed = claim(Some(folder), &["receipt.json"], args.force)?;
    let mut receipt = protocol::answered(args, folder)?;
    let path = folder.join("receipt.json");
    receipt.write(&path)?;
    match args.format {
        Format::Json => say(&format!("{:#}\n", json!(receipt.cases)))?,
        Format::Text => show(&terminal_summary::answers(&receipt, &path))?,
    }
    Ok(Exit::Done)
}

/// Hides the memory of this process from its children and from other processes of the same user: children inherit no open file, and reading the memory takes
/// privilege.
fn private() -> Result<(), Failure> {
    close_fds::set_fds_cloexec(3, &[]);
    set_dumpable_behavior(DumpableBehavior::NotDumpable).map_err(Failure::internal)
}
