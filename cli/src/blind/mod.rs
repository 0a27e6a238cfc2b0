//! `freeplay blind`: the proof on concealed effects.
//!
//! Freeze, seed, generate, seal, analyse once, commit to the answers, reveal, score. Generator and analysts are processes of their
//! own; the truth is in the memory of their parent alone until the answers are committed to.
//!
//! Modules in the order of the protocol: `hash` (what is frozen), `sweep` (what is asked for), `generator`, `analysis` (who is asked), `analyst`, `sandbox` and
//! `answer` (who answers, where and what), `truth`, `score`, `interval`, `tally`, `confusion`, `controls` and `leak` (what it is worth),
//! `receipt`, `verify` and `history` (what stays), `screen`, `document` and `matrix` (what a person sees).

mod analysis;
mod analyst;
mod answer;
mod confusion;
mod controls;
mod document;
mod generator;
mod hash;
mod history;
mod interval;
mod leak;
mod matrix;
mod protocol;
mod receipt;
mod sandbox;
mod score;
mod screen;
mod sweep;
mod tally;
mod truth;
mod verify;

use std::path::{Path, PathBuf};
use std::time::Duration;

use clap::Args;
use freeplay_storage::OutputFolder;
use serde_json::json;

use crate::args::at_least_one;
use crate::exit::{Exit, Failure};
use crate::files::{check_target, claim, claim_or_new};
use crate::run::Format;
use crate::say::say;
use receipt::Receipt;
use sweep::Sweep;
use tally::Score;

pub use analyst::{AnalystArgs, analyst};
pub use generator::{GenerateArgs, generate};

/// Proves the diagnosis on concealed effects: recordings are made and their truth is sealed before the analysis, which has one try.
///
/// Without --full a small set of half single effects, a fifth each of negative controls and of physics outside the catalogue, a tenth of
/// two effects at once. Exit code 1: a receipt does not verify. What the goals ask for is said, and is no reason to fail.
#[derive(Args, Debug)]
pub struct BlindArgs {
    /// Seed of the set; without it the operating system is asked for one, after the freeze.
    #[arg(long)]
    seed: Option<u64>,
    /// Number of cases.
    #[arg(long, value_name = "N", default_value_t = 40, conflicts_with_all = ["full", "matrix"], value_parser = at_least_one)]
    cases: usize,
    /// The full set: 1080 single effects, 300 negative controls, 152 outside the catalogue, 156 double.
    #[arg(long)]
    full: bool,
    #[command(flatten)]
    sweep: Sweep,
    /// Only every N-th case, from the I-th on, so that N machines can share a set: give all the same --seed. Merge with --merge.
    #[arg(long, value_name = "I/N", value_parser = shard, default_value = "1/1")]
    shard: Shard,
    /// Merge the receipts in these folders into one score and report.
    #[arg(long, value_name = "DIR", num_args = 1.., conflicts_with_all = ["full", "matrix", "seed"])]
    merge: Vec<PathBuf>,
    /// Answer for a folder that someone else sealed: DIR/NAME/{model.toml,recording.csv,second.csv}. Writes DIR/receipt.json.
    #[arg(long, value_name = "DIR", conflicts_with_all = ["full", "matrix", "seed", "merge"])]
    analyse: Option<PathBuf>,
    /// Score the answers of --analyse DIR by TRUTH, a JSON file. Writes DIR/receipt.json and DIR/report.html.
    #[arg(long, value_names = ["DIR", "TRUTH"], num_args = 2, conflicts_with_all = ["full", "matrix", "seed", "merge", "analyse"])]
    score: Vec<PathBuf>,
    /// Compute every hash of a receipt anew.
    #[arg(long, value_name = "RECEIPT", conflicts_with_all = ["full", "matrix", "seed", "merge", "analyse", "score"])]
    verify: Option<PathBuf>,
    /// Folder for the sealed recordings, receipt.json and report.html. Without it: out/blind-TIME.
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Replace results of an earlier command in the folder.
    #[arg(long)]
    force: bool,
    /// Processes at work at a time; without it: one a core.
    #[arg(long, value_name = "N", value_parser = at_least_one)]
    jobs: Option<usize>,
    /// How long an analyst may take for a case, s; one that takes longer has answered wrongly.
    #[arg(long, value_name = "S", default_value_t = 120, value_parser = clap::value_parser!(u64).range(1..))]
    patience: u64,
    /// A list to which a line is appended when the set is sealed, and one when it is scored.
    #[arg(long, value_name = "FILE")]
    history: Option<PathBuf>,
    /// How results are printed.
    #[arg(long, default_value = "text")]
    format: Format,
}

/// Which part of a set.
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
            // The receipt in it is what is scored.
            return claim(Some(folder), &[], self.force);
        }
        let time = receipt::now().replace(':', "-");
        let new = PathBuf::from("out").join(format!("blind-{}", time.trim_end_matches('Z')));
        claim_or_new(self.out.as_deref(), &new, &["sealed", "receipt.json", "report.html"], self.force)
    }
}

/// Does what `args` ask for.
///
/// # Errors
/// Bad input; a folder that can't be written; a process that can't be started.
pub fn blind(args: &BlindArgs) -> Result<Exit, Failure> {
    // Before what takes minutes.
    args.history.as_deref().map_or(Ok(()), check_target)?;
    if let Some(path) = &args.verify {
        return verify(args, path);
    }
    if let Some(folder) = &args.analyse {
        return analyse(args, folder);
    }
    let folder = args.claim()?;
    let receipt = match args.score.as_slice() {
        [folder, truth] => protocol::opened(folder, truth)?,
        _ if args.merge.is_empty() => protocol::whole(args, folder.path())?,
        _ => merged(&args.merge)?,
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
    let path = folder.join("receipt.json");
    receipt.write(&path)?;
    let report = folder.join("report.html");
    crate::files::write(&report, &document::document(&receipt, &judged, &score).to_html())?;
    if let (Some(list), [part]) = (&args.history, receipt.parts.as_slice()) {
        let seal = part.stages.iter().find(|stage| stage.name == "seal");
        history::scored(list, seal.map_or("", |stage| stage.chain.as_str()), &score)?;
    }
    match args.format {
        Format::Json => say(&format!("{:#}\n", receipt.score))?,
        Format::Text => say(&screen::summary(&receipt, &judged, &score, &path, &report))?,
    }
    Ok(Exit::Done)
}

/// Answers for the sealed `folder` of someone else.
fn analyse(args: &BlindArgs, folder: &Path) -> Result<Exit, Failure> {
    // The folder of somebody else is not made here.
    freeplay_storage::list(folder)?;
    let _claimed = claim(Some(folder), &["receipt.json"], args.force)?;
    let receipt = protocol::answered(args, folder)?;
    let path = folder.join("receipt.json");
    receipt.write(&path)?;
    match args.format {
        Format::Json => say(&format!("{:#}\n", json!(receipt.cases)))?,
        Format::Text => say(&screen::answers(&receipt, &path))?,
    }
    Ok(Exit::Done)
}

fn verify(args: &BlindArgs, path: &Path) -> Result<Exit, Failure> {
    let receipt = Receipt::read(path)?;
    let folder = path.parent().unwrap_or(Path::new("."));
    let sealed = if receipt.parts.iter().all(|part| part.draw.is_some()) {
        folder.join("sealed")
    } else {
        folder.into()
    };
    let checks = verify::checks(&receipt, &sealed)?;
    let good = checks.iter().all(|check| check.good != Some(false));
    match args.format {
        Format::Json => {
            let rows = checks.iter().map(|c| json!({ "what": c.what, "good": c.good, "found": c.found }));
            say(&format!("{:#}\n", json!({ "good": good, "checks": rows.collect::<Vec<_>>() })))?;
        }
        Format::Text => say(&verify::text(&checks))?,
    }
    Ok(if good { Exit::Done } else { Exit::Verdict })
}

/// The receipts in `folders` as one.
fn merged(folders: &[PathBuf]) -> Result<Receipt, Failure> {
    let mut all: Option<Receipt> = None;
    for folder in folders {
        let path = folder.join("receipt.json");
        let receipt = Receipt::read(&path)?;
        let checks = verify::checks(&receipt, &folder.join("sealed"))?;
        // Another program may have made it; all that binds truths, answers and score has to hold.
        let broken = checks.iter().find(|check| check.good == Some(false) && check.what != "program");
        if let Some(check) = broken {
            return Err(Failure::input(format!("{}: {}: {}", path.display(), check.what, check.found)));
        }
        match &mut all {
            None => all = Some(receipt),
            Some(all) => {
                if receipt.parts[0].program != all.parts[0].program {
                    let what =
                        "was made by another program or catalogue than the first: shards have to be of one";
                    return Err(Failure::input(format!("{}: {what}", path.display())));
                }
                if let Some(name) = receipt.cases.keys().find(|name| all.cases.contains_key(*name)) {
                    return Err(Failure::input(format!(
                        "{}: case {name} is in two receipts",
                        path.display()
                    )));
                }
                all.parts.extend(receipt.parts);
                all.cases.extend(receipt.cases);
            }
        }
    }
    all.ok_or_else(|| Failure::usage("--merge needs folders"))
}
