//! Makes cases: `cargo run --release -p freeplay-concealed --example make -- --out DIR --seed S --cases N`.
//!
//! Writes numbered folders with `model.toml`, `recording.csv` and `second.csv`, in an order that the seed shuffles, and the truth of each in
//! `DIR/truth/NNNN.json`.

use std::error::Error;
use std::path::PathBuf;
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Instant;

use clap::Parser;
use freeplay_concealed::{
    CATALOGUE, Case, Demand, Family, Machine, Noise, OUTSIDE, Severity, generate, make_case, seats,
    write_case,
};
use rand::seq::SliceRandom;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// Generates recordings of machines with concealed physics.
#[derive(Parser)]
struct Options {
    /// Write the recordings to this folder.
    #[arg(long)]
    out: PathBuf,
    /// Seed of all random draws.
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Number of cases with one effect of the catalogue.
    #[arg(long, default_value_t = 0)]
    cases: usize,
    /// Use only these kinds, in and outside the catalogue. Several are allowed.
    #[arg(long)]
    kind: Vec<String>,
    /// Number of cases without any effect.
    #[arg(long, default_value_t = 0)]
    negative: usize,
    /// Number of cases with an effect outside the catalogue.
    #[arg(long, default_value_t = 0)]
    unknown: usize,
    /// Number of cases with two effects of the catalogue.
    #[arg(long, default_value_t = 0)]
    double: usize,
    /// Use only these machines (slide, two, three, sixbench, sixcell, seven, paper).
    #[arg(long)]
    machine: Vec<String>,
    /// Use only this severity (slight, clear, strong).
    #[arg(long)]
    severity: Option<String>,
    /// Use only this noise level (low, middle, high).
    #[arg(long)]
    noise: Option<String>,
    /// Number of threads.
    #[arg(long, default_value_t = 1)]
    jobs: usize,
}

/// Sort of a case.
#[derive(Clone, Copy)]
enum Sort {
    Single,
    Negative,
    Unknown,
    Double,
}

fn main() -> Result<(), Box<dyn Error>> {
    let options = Options::parse();
    let mut rng = ChaCha8Rng::seed_from_u64(options.seed);
    let mut cases = plan(&options, &mut rng)?;
    cases.shuffle(&mut rng);
    let (next, failures) = (AtomicUsize::new(0), Mutex::new(Vec::new()));
    let start = Instant::now();
    std::thread::scope(|scope| {
        for _ in 0..options.jobs.max(1) {
            scope.spawn(|| {
                loop {
                    let number = next.fetch_add(1, Ordering::Relaxed);
                    let Some(case) = cases.get(number) else { break };
                    if let Err(error) = one(&options, number, case)
                        && let Ok(mut failures) = failures.lock()
                    {
                        failures.push(format!("case {number} ({case:?}): {error}"));
                    }
                }
            });
        }
    });
    let seconds = start.elapsed().as_secs_f64();
    eprintln!("{} cases in {seconds:.1} s, {:.2} s each", cases.len(), seconds / cases.len().max(1) as f64);
    match failures.into_inner()?.as_slice() {
        [] => Ok(()),
        failures => Err(format!("not made:\n{}", failures.join("\n")).into()),
    }
}

/// Makes one case; if its machine can't show the effects, tries others, unless the options select machines.
fn one(options: &Options, number: usize, case: &Case) -> Result<(), Box<dyn Error>> {
    let made = if options.machine.is_empty() { make_case(case)? } else { generate(case)? };
    Ok(write_case(&options.out, number + 1, &made)?)
}

fn plan(options: &Options, rng: &mut ChaCha8Rng) -> Result<Vec<Case>, Box<dyn Error>> {
    let sorts = [
        (Sort::Single, options.cases),
        (Sort::Negative, options.negative),
        (Sort::Unknown, options.unknown),
        (Sort::Double, options.double),
    ];
    let mut cases = Vec::new();
    for (sort, count) in sorts {
        for number in 0..count {
            let effects = match sort {
                Sort::Single => vec![demand(options, &CATALOGUE, number, rng)?],
                Sort::Negative => Vec::new(),
                Sort::Unknown => vec![demand(options, &OUTSIDE, number, rng)?],
                Sort::Double => two(options, rng)?,
            };
            let noise = Noise::ALL.into_iter().find(|n| options.noise.as_ref().is_some_and(|o| is(n, o)));
            cases.push(Case {
                machine: machine(options, &effects, rng)?,
                effects,
                family: None::<Family>,
                hollow: false,
                noise: noise.unwrap_or(Noise::ALL[rng.random_range(0..3)]),
                seed: rng.random(),
            });
        }
    }
    Ok(cases)
}

fn is(value: &impl std::fmt::Debug, name: &str) -> bool {
    format!("{value:?}").eq_ignore_ascii_case(name)
}

/// The `number`-th effect: the kinds in rotation, the severities in rotation.
fn demand(
    options: &Options,
    kinds: &[&str],
    number: usize,
    rng: &mut ChaCha8Rng,
) -> Result<Demand, Box<dyn Error>> {
    let wanted: Vec<&str> = kinds
        .iter()
        .copied()
        .filter(|k| options.kind.is_empty() || options.kind.iter().any(|o| o == k))
        .collect();
    if wanted.is_empty() {
        return Err(format!("none of {:?} is one of {kinds:?}", options.kind).into());
    }
    let severity = Severity::ALL.into_iter().find(|s| options.severity.as_ref().is_some_and(|o| is(s, o)));
    let severity = severity.unwrap_or(Severity::ALL[rng.random_range(0..3)]);
    Ok(Demand { kind: wanted[number % wanted.len()].to_owned(), joint: None, severity })
}

fn two(options: &Options, rng: &mut ChaCha8Rng) -> Result<Vec<Demand>, Box<dyn Error>> {
    let first = demand(options, &CATALOGUE, rng.random_range(0..CATALOGUE.len()), rng)?;
    loop {
        let second = demand(options, &CATALOGUE, rng.random_range(0..CATALOGUE.len()), rng)?;
        if second.kind != first.kind || options.kind.len() == 1 {
            return Ok(vec![first, second]);
        }
    }
}

/// A machine with a place for each of `effects`.
fn machine(options: &Options, effects: &[Demand], rng: &mut ChaCha8Rng) -> Result<Machine, Box<dyn Error>> {
    let mut fits = Vec::new();
    for machine in Machine::ALL {
        let arm = machine.data_sheet()?;
        let asked = options.machine.is_empty() || options.machine.iter().any(|name| is(&machine, name));
        if asked && effects.iter().all(|e| !seats(&e.kind, &arm).is_empty()) && arm.dof() >= effects.len() {
            fits.push(machine);
        }
    }
    match fits.len() {
        0 => Err(format!("no machine of {:?} has a place for {effects:?}", options.machine).into()),
        count => Ok(fits[rng.random_range(0..count)]),
    }
}
