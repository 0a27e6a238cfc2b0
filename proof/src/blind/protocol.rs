//! The protocol from freeze to reveal.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;
use std::time::Instant;

use freeplay_concealed::Quota;
use freeplay_storage::remove_folder;
use freeplay_terminal::exit::Failure;
use freeplay_terminal::files::make_folder;
use freeplay_terminal::hex::hex;
use freeplay_terminal::{messages, progress};
use indicatif::ProgressBar;
use rustix::rand::{GetRandomFlags, getrandom};
use serde_json::Value;

use super::analysis::{Analysts, isolation, sealed};
use super::arrange::arrange;
use super::generator::{Line, made};
use super::lures::Held;
use super::order::Order;
use super::receipt::{Draw, Part, Program, Receipt, Record, SCHEMA};
use super::source::Source;
use super::verify::{broken, checks};
use super::{BlindArgs, hash, history, strict};

/// Bytes of a salt.
const SALT: usize = 16;

/// The salt and the truth of each case, kept in memory.
type Withheld = BTreeMap<String, (String, Value)>;

/// Bytes from the operating system.
fn random<const N: usize>() -> Result<[u8; N], Failure> {
    let mut bytes = [0; N];
    match getrandom(&mut bytes, GetRandomFlags::empty()) {
        Ok(filled) if filled == N => Ok(bytes),
        Ok(_) => Err(Failure::internal("the operating system gives no random numbers")),
        Err(error) => {
            Err(Failure::internal(format!("the operating system gives no random numbers: {error}")))
        }
    }
}

/// A progress bar on standard error with the remaining time.
fn bar(length: usize, what: &'static str) -> ProgressBar {
    let bar = progress::bar(length as u64, "{msg:<10} {wide_bar} {pos}/{len} {elapsed}").with_message(what);
    bar.tick();
    bar
}

/// A line on standard error for each stage.
fn tell(stage: &str, words: &str) {
    messages::note(format_args!("{stage:8} {words}"));
}

/// A part with the frozen program alone.
fn frozen() -> Result<Part, Failure> {
    let mut part = Part {
        program: Program::this()?,
        draw: None,
        sealed: BTreeMap::new(),
        commitments: BTreeMap::new(),
        not_made: Vec::new(),
        isolation: BTreeMap::new(),
        answers: String::new(),
        seconds: [0.0; 2],
        machine: machine(),
        stages: Vec::new(),
    };
    part.finish("freeze", &BTreeMap::new());
    Ok(part)
}

/// Processor and kernel.
fn machine() -> String {
    let system = std::fs::read_to_string("/proc/sys/kernel/osrelease").unwrap_or_default();
    let info = std::fs::read_to_string("/proc/cpuinfo").unwrap_or_default();
    let model = info.lines().find_map(|line| line.strip_prefix("model name")).unwrap_or("unknown processor");
    let cores = std::thread::available_parallelism().map_or(1, usize::from);
    let model = model.trim_start_matches(['\t', ' ', ':']);
    format!("{model}, {cores} cores, Linux {}", system.trim())
}

/// The whole protocol, in `folder`.
///
/// # Errors
/// A folder that is not empty or can't be written; a process that can't be started.
pub fn whole(args: &BlindArgs, folder: &Path) -> Result<Receipt, Failure> {
    let mut part = frozen()?;
    let (source, generator) = Source::named(args.generator.as_deref(), folder)?;
    let short = super::verify::start;
    let (program, catalogue) = (short(&part.program.sha256), short(&part.program.catalogue));
    tell("frozen", &format!("program {program}, catalogue {catalogue}"));
    if let Some(other) = &generator {
        tell("", &format!("generator {} {}", other.name, short(&other.sha256)));
    }
    let seed = match args.seed {
        Some(seed) => seed,
        None => u64::from_le_bytes(random()?),
    };
    let seed_from = if args.seed.is_some() { "--seed" } else { "the operating system, after the freeze" };
    let matrix = args.sweep.matrix()?;
    let quota = match &matrix {
        Some(matrix) => matrix.quota().map_err(Failure::internal)?,
        None if args.full => Quota::FULL,
        None => Quota::small(args.cases),
    };
    let shard = [args.shard.0, args.shard.1];
    let names = hex(&random::<SALT>()?);
    part.draw = Some(Draw { seed, seed_from: seed_from.to_owned(), names, quota, shard, matrix, generator });
    part.finish("seed", &BTreeMap::new());
    tell("seed", &format!("{seed}, from {seed_from}"));
    let withheld = generate(args, &source, folder, &mut part)?;
    let commitment = part.finish("seal", &BTreeMap::new());
    tell(
        "sealed",
        &format!("{} cases, truth withheld, commitment {}", part.sealed.len(), short(&commitment)),
    );
    if let Some(list) = &args.history {
        history::sealed(list, &part)?;
    }
    let mut receipt = ask(args, &folder.join("sealed"), part)?;
    let Some(part) = receipt.parts.first_mut() else { return Ok(receipt) };
    for (name, (salt, truth)) in withheld {
        if let Some(record) = receipt.cases.get_mut(&name) {
            (record.salt, record.truth) = (salt, truth);
        }
    }
    part.finish("reveal", &receipt.cases);
    let kept = part.records(&receipt.cases).all(|(name, record)| {
        part.commitments.get(name) == Some(&hash::commitment(&record.salt, &record.truth))
    });
    tell("opened", if kept { "truth matches the commitment" } else { "TRUTH DOES NOT MATCH THE COMMITMENT" });
    Ok(receipt)
}

/// Has the sealed cases made, and commits to their truth.
fn generate(args: &BlindArgs, source: &Source, folder: &Path, part: &mut Part) -> Result<Withheld, Failure> {
    let cases = folder.join("sealed");
    if args.force {
        // Cases of an earlier set must not mix with those of this one.
        remove_folder(&cases)?;
        remove_folder(&folder.join("making"))?;
    }
    make_folder(&cases)?;
    let Some(draw) = part.draw.as_ref() else { return Ok(Withheld::new()) };
    // Beside the sealed cases: the cases are copied there in an uninformative order.
    let making = folder.join("making");
    if making.exists() {
        let path = making.display();
        return Err(Failure::input(format!(
            "{path} belongs to an interrupted set; remove it or choose another --out"
        )));
    }
    make_folder(&making)?;
    let order = Order {
        seed: draw.seed,
        names: draw.names.clone(),
        quota: draw.quota,
        matrix: draw.matrix.clone(),
        shard: draw.shard,
        folder: making.clone(),
        jobs: args.jobs(),
        done: BTreeSet::new(),
    };
    let bar = bar(draw.quota.cases() / draw.shard[1], "generating");
    let start = Instant::now();
    let lines = made(&order, source, &bar);
    if lines.is_err() {
        // The cases are useless without their truth; the error states the cause.
        for left in [&making, &cases, &folder.join("generator")] {
            let _ = remove_folder(left);
        }
    }
    let lines = lines?;
    bar.finish_and_clear();
    part.seconds[0] = start.elapsed().as_secs_f64();
    let mut withheld = Withheld::new();
    for line in lines {
        match line {
            Line::Made { name, truth } => {
                let salt = hex(&random::<SALT>()?);
                part.commitments.insert(name.clone(), hash::commitment(&salt, &truth));
                withheld.insert(name, (salt, truth));
            }
            Line::NotMade { asked, why } => part.not_made.push(format!("{asked}: {why}")),
        }
    }
    arrange(&making, &cases)?;
    part.sealed = sealed(&cases)?;
    part.not_made.sort_unstable();
    Ok(withheld)
}

/// Has an analyst answer each case of `cases` and commits to the answers.
fn ask(args: &BlindArgs, cases: &Path, mut part: Part) -> Result<Receipt, Failure> {
    let lures = Held::beside(cases, &hex(&random::<SALT>()?))?;
    let analysts = Analysts { jobs: args.jobs(), patience: args.patience(), lures };
    let bar = bar(part.sealed.len(), "analysing");
    let start = Instant::now();
    let answers = analysts.answers(cases, &part.sealed, &bar)?;
    bar.finish_and_clear();
    part.seconds[1] = start.elapsed().as_secs_f64();
    drop(analysts);
    part.isolation = isolation(answers.values());
    let record =
        |(name, answer)| (name, Record { salt: String::new(), truth: Value::Null, answer, outcome: None });
    let cases: BTreeMap<String, Record> = answers.into_iter().map(record).collect();
    part.answers = part.hash_of_answers(&cases);
    part.finish("answer", &cases);
    let (seconds, hash) = (part.seconds[1], super::verify::start(&part.answers));
    tell("analysed", &format!("once in {seconds:.0} s, answers committed {hash}"));
    for (words, count) in &part.isolation {
        tell("", &format!("{count} analysts behind {words}"));
    }
    let (schema, sha256) = (SCHEMA.to_owned(), String::new());
    Ok(Receipt { schema, parts: vec![part], cases, score: Value::Null, sha256 })
}

/// The answers for the sealed `folder` of someone else, with the commitments in its `commitments.json`, if there is one.
///
/// # Errors
/// A folder without cases; an invalid commitments file.
pub fn answered(args: &BlindArgs, folder: &Path) -> Result<Receipt, Failure> {
    let mut part = frozen()?;
    part.sealed = sealed(folder)?;
    let path = folder.join("commitments.json");
    if path.is_file() {
        part.commitments = strict::read(&path, "the hashes of the truths by case")?;
    }
    part.finish("seal", &BTreeMap::new());
    ask(args, folder, part)
}

/// The answers in `folder` with the truth in the file `truth`.
///
/// # Errors
/// Missing or changed answers; a truth file that is invalid or lacks a case.
pub fn opened(folder: &Path, truth: &Path) -> Result<Receipt, Failure> {
    let path = folder.join("receipt.json");
    let mut receipt = Receipt::read(&path)?;
    if let Some(check) = broken(&checks(&receipt, folder, &Program::this()?)?) {
        return Err(Failure::input(format!("{}: {}: {}", path.display(), check.what, check.found)));
    }
    let shown = truth.display();
    let truths: Value = strict::read(truth, "the truths by case, as in docs/blind")?;
    let Some(truths) = truths["cases"].as_object() else {
        return Err(Failure::input(format!(
            "{shown}: no table \"cases\" of the truths by the name of the folder"
        )));
    };
    for (name, record) in &mut receipt.cases {
        let Some(case) = truths.get(name) else {
            return Err(Failure::input(format!("{shown}: no truth for the case {name}")));
        };
        let mut case = case.clone();
        let salt = case.as_object_mut().and_then(|case| case.shift_remove("salt"));
        record.salt = salt.and_then(|salt| salt.as_str().map(str::to_owned)).unwrap_or_default();
        record.truth = case;
    }
    let Some(part) = receipt.parts.first_mut() else { return Ok(receipt) };
    part.stages.retain(|stage| stage.name != "reveal");
    part.finish("reveal", &receipt.cases);
    let kept = |name: &String, record: &Record| {
        part.commitments.get(name).is_none_or(|found| hash::commits(found, &record.salt, &record.truth))
    };
    if let Some((name, _)) = part.records(&receipt.cases).find(|(name, record)| !kept(name, record)) {
        return Err(Failure::input(format!(
            "{shown}: the truth of {name} is not the one committed to in commitments.json"
        )));
    }
    Ok(receipt)
}
