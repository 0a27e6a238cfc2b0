//! The protocol from freeze to reveal.

use std::collections::BTreeMap;
use std::path::Path;
use std::time::Instant;

use freeplay_concealed::Quota;
use freeplay_storage::{remove_file, remove_folder};
use indicatif::ProgressBar;
use rustix::rand::{GetRandomFlags, getrandom};
use serde_json::{Value, json};

use super::analysis::{Analysts, sealed};
use super::generator::{Line, Order, made, without_times};
use super::receipt::{Draw, Part, Program, Receipt, Record, SCHEMA};
use super::{BlindArgs, hash, history};
use crate::exit::Failure;
use crate::files::{make_folder, read_json};
use crate::hex::hex;
use crate::voice;

/// Bytes of a salt.
const SALT: usize = 16;

/// The salt and the truth of each case, withheld in memory.
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

/// A bar on standard error with the time that remains.
fn bar(length: usize, what: &'static str) -> ProgressBar {
    let bar =
        voice::bar(length as u64, "{msg:<10} {bar:30} {pos}/{len} {elapsed}, {eta} left").with_message(what);
    bar.tick();
    bar
}

/// A line on standard error for each stage.
fn tell(stage: &str, words: &str) {
    voice::note(format_args!("{stage:8} {words}"));
}

/// The program and nothing else.
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
    part.complete("freeze", &json!(part.program));
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
    let short = super::verify::start;
    let (program, catalogue) = (short(&part.program.sha256), short(&part.program.catalogue));
    tell("frozen", &format!("program {program}, catalogue {catalogue}"));
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
    part.draw = Some(Draw { seed, seed_from: seed_from.to_owned(), quota, shard, matrix });
    part.complete("seed", &json!(part.draw));
    tell("seed", &format!("{seed}, from {seed_from}"));
    let withheld = generate(args, folder, &mut part)?;
    let commitment = part.complete("seal", &json!([part.sealed, part.commitments, part.not_made]));
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
    let truths = part.brought(&receipt.cases).remove("reveal").unwrap_or_default();
    part.complete("reveal", &truths);
    let kept = part.records(&receipt.cases).all(|(name, record)| {
        part.commitments.get(name) == Some(&hash::commitment(&record.salt, &record.truth))
    });
    tell("opened", if kept { "truth matches the commitment" } else { "TRUTH DOES NOT MATCH THE COMMITMENT" });
    Ok(receipt)
}

/// Has the sealed cases made, and commits to their truth.
fn generate(args: &BlindArgs, folder: &Path, part: &mut Part) -> Result<Withheld, Failure> {
    let cases = folder.join("sealed");
    if args.force {
        // Cases of an earlier set must not mix with those of this one.
        remove_folder(&cases)?;
    }
    make_folder(&cases)?;
    let Some(draw) = part.draw.as_ref() else { return Ok(Withheld::new()) };
    let order = Order {
        seed: draw.seed,
        quota: draw.quota,
        matrix: draw.matrix.clone(),
        shard: draw.shard,
        folder: cases.clone(),
        jobs: args.jobs(),
    };
    let bar = bar(draw.quota.cases() / draw.shard[1], "generating");
    let start = Instant::now();
    let lines = made(&order, &bar)?;
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
    without_times(&cases)?;
    part.sealed = sealed(&cases)?;
    part.not_made.sort_unstable();
    Ok(withheld)
}

/// Asks an analyst for each case of `cases` and commits to the answers.
fn ask(args: &BlindArgs, cases: &Path, mut part: Part) -> Result<Receipt, Failure> {
    // Beside the sealed cases, where the truth would be if it were anywhere: no analyst may be able to read it.
    let canary = cases.join("canary");
    let secret = hex(&random::<SALT>()?);
    crate::files::write(&canary, &secret)?;
    let analysts = Analysts { jobs: args.jobs(), patience: args.patience(), canary: Some(canary.clone()) };
    let bar = bar(part.sealed.len(), "analysing");
    let start = Instant::now();
    let answers = analysts.answers(cases, &part.sealed, &bar)?;
    bar.finish_and_clear();
    part.seconds[1] = start.elapsed().as_secs_f64();
    // It is of no use any more; a folder that can't be written to was refused before.
    let _ = remove_file(&canary);
    for answer in answers.values() {
        *part.isolation.entry(isolation(answer)).or_default() += 1;
    }
    let record =
        |(name, answer)| (name, Record { salt: String::new(), truth: Value::Null, answer, outcome: None });
    let cases: BTreeMap<String, Record> = answers.into_iter().map(record).collect();
    part.answers = part.hash_of_answers(&cases);
    part.complete("answer", &json!(part.answers));
    let (seconds, hash) = (part.seconds[1], super::verify::start(&part.answers));
    tell("analysed", &format!("once in {seconds:.0} s, answers committed {hash}"));
    for (words, count) in &part.isolation {
        tell("", &format!("{count} analysts behind {words}"));
    }
    Ok(Receipt { schema: SCHEMA.to_owned(), parts: vec![part], cases, score: Value::Null })
}

/// What kept an analyst from the truth, in words.
fn isolation(answer: &super::answer::Answer) -> String {
    let isolation = &answer.isolation;
    if isolation.mechanism.is_empty() {
        return "unknown: no answer".to_owned();
    }
    let refused = |refused| if refused { "refused" } else { "OPEN" };
    let (canary, parent) = (refused(isolation.canary_refused), refused(isolation.parent_refused));
    format!("{} (canary {canary}, memory of the parent {parent})", isolation.mechanism)
}

/// The answers for the sealed `folder` of someone else, with the commitments in its `commitments.json`, if there is one.
///
/// # Errors
/// A folder without cases; a commitments file that is none.
pub fn answered(args: &BlindArgs, folder: &Path) -> Result<Receipt, Failure> {
    let mut part = frozen()?;
    part.sealed = sealed(folder)?;
    let path = folder.join("commitments.json");
    if path.is_file() {
        part.commitments = read_json(&path, "the hashes of the truths by case")?;
    }
    part.complete("seal", &json!([part.sealed, part.commitments, part.not_made]));
    ask(args, folder, part)
}

/// The answers in `folder` with the truth in the file `truth`.
///
/// # Errors
/// Answers that were not given, or changed since; a truth file that is none, or misses a case.
pub fn opened(folder: &Path, truth: &Path) -> Result<Receipt, Failure> {
    let mut receipt = Receipt::read(&folder.join("receipt.json"))?;
    let shown = truth.display();
    let truths: Value = read_json(truth, "the truths by case, as in docs/blind")?;
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
    let truths = part.brought(&receipt.cases).remove("reveal").unwrap_or_default();
    part.stages.retain(|stage| stage.name != "reveal");
    part.complete("reveal", &truths);
    Ok(receipt)
}
