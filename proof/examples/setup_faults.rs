//! Diagnoses of set-up faults that the example inserts into recordings of concealed and of real machines:
//! `cargo run --release -p freeplay-proof --example setup_faults -- single|two|clean|real|physics ROUNDS SEED [KIND]`.
//! `real` reads the folder in `FREEPLAY_RECORDINGS`. `physics` diagnoses the same machine, effect and noise without a fault and with one, ROUNDS pairs for each
//! kind of fault, and compares the named effects with those of the pair without a fault and with the truth.
//!
//! The example prints each case with a wrong answer, and a table at the end: right kind and joint, missed, wrong, time. Among the missed faults of real
//! machines, `hidden` counts those that increase the error of every channel by less than the model's error without the fault: no method could detect them.

use std::collections::BTreeMap;
use std::error::Error;
use std::path::{Path, PathBuf};
use std::time::Instant;

use freeplay_concealed::{
    CATALOGUE, Case, Demand, Kept, Machine, Made, Noise, SETUP, Samples, SetupFault, Severity, TruthEffect,
    generate, with_setup_faults,
};
use freeplay_diagnosis::{Certainty, DiagnoseSettings, Diagnosis, Settings, compare, diagnose, examine};
use freeplay_recording::Recording;

/// Effects that the model lacks in addition to the fault.
const BESIDE: [&str; 4] = ["", "coulomb_friction", "payload", "joint_coupling"];

#[derive(Default)]
struct Row {
    right: usize,
    missed: usize,
    hidden: usize,
    wrong: usize,
    seconds: f64,
}

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().collect();
    let usage = "give single, two, clean, real or physics, a number of rounds and a seed";
    let mode = arguments.get(1).ok_or(usage)?;
    let rounds: u64 = arguments.get(2).ok_or(usage)?.parse()?;
    let seed: u64 = arguments.get(3).ok_or(usage)?.parse()?;
    let only = arguments.get(4).map(String::as_str);
    if mode == "physics" {
        return physics(rounds, seed, only);
    }
    let mut rows: BTreeMap<String, Row> = BTreeMap::new();
    if mode == "real" {
        real(rounds, seed, only, &mut rows)?;
    } else {
        concealed(mode, rounds, seed, only, &mut rows)?;
    }
    print_table(&rows);
    Ok(())
}

/// Faults in recordings of machines from the generator.
fn concealed(
    mode: &str,
    rounds: u64,
    seed: u64,
    only: Option<&str>,
    rows: &mut BTreeMap<String, Row>,
) -> Result<(), Box<dyn Error>> {
    for round in 0..rounds {
        for (number, machine) in Machine::ALL.into_iter().enumerate() {
            let draw = (seed * 7919 + round) as usize * 7 + number;
            let kind = if mode == "clean" { CATALOGUE[draw % CATALOGUE.len()] } else { BESIDE[draw % 4] };
            let effects = if kind.is_empty() || (mode == "clean" && draw.is_multiple_of(3)) {
                Vec::new()
            } else {
                let severity = Severity::ALL[draw % 3];
                vec![Demand { kind: kind.to_owned(), joint: None, severity }]
            };
            let noise = Noise::ALL[(draw / 3) % 3];
            let case = Case { machine, effects, family: None, noise, hollow: false, seed: draw as u64 };
            let Ok(made) = generate(&case) else { continue };
            for (k, kinds) in sets(mode, draw, only).into_iter().enumerate() {
                let kept = match (draw + k) % 4 {
                    0 => Kept { torque: true, tool: true, friction: (draw + k).is_multiple_of(3) },
                    3 => Kept { torque: false, tool: true, friction: true },
                    _ => Kept { torque: true, tool: false, friction: !(draw + k).is_multiple_of(3) },
                };
                let name = if kinds.is_empty() { "clean".to_owned() } else { kinds.join(" + ") };
                let faulty = with_setup_faults(&made, &kinds, kept, (draw * 31 + k) as u64)?;
                if let Some((made, truth)) = faulty {
                    let label = format!("{machine:?} {kind} {kept:?} {}", made.truth.families[0]);
                    score(rows.entry(name).or_default(), &label, &made, &truth)?;
                }
            }
        }
    }
    Ok(())
}

/// The effects named with a fault, against those named without it.
#[derive(Default)]
struct Beside {
    pairs: usize,
    unmended: usize,
    same: usize,
    /// Without the fault and with it: pairs in which the diagnosis names all missing effects, and pairs with a false effect.
    found: [usize; 2],
    invented: [usize; 2],
    /// Without the fault and with it: relative error of each parameter.
    errors: [Vec<f64>; 2],
}

/// A named effect: kind and joint.
type Named = (String, Option<String>);

/// The physics next to single faults: diagnoses of the same recordings without and with a fault.
fn physics(rounds: u64, seed: u64, only: Option<&str>) -> Result<(), Box<dyn Error>> {
    let mut count = Beside::default();
    let kinds: Vec<&str> = SETUP
        .into_iter()
        .filter(|kind| {
            only.is_none_or(|only| only == *kind) && !["frozen_channel", "another_arm"].contains(kind)
        })
        .collect();
    for round in 0..rounds {
        for (number, fault) in kinds.iter().enumerate() {
            let draw = (seed * 7919 + round) as usize * 17 + number;
            let machine = Machine::ALL[draw % Machine::ALL.len()];
            let severity = Severity::ALL[1 + (draw / 2) % 2];
            let kind = BESIDE[1 + (draw / 3) % 3];
            let effects = vec![Demand { kind: kind.to_owned(), joint: None, severity }];
            let noise = Noise::ALL[(draw / 5) % 3];
            let case = Case { machine, effects, family: None, noise, hollow: false, seed: draw as u64 };
            let Ok(made) = generate(&case) else { continue };
            let kept = Kept { torque: true, tool: draw.is_multiple_of(4), friction: true };
            let twin = with_setup_faults(&made, &[], kept, draw as u64)?;
            let faulty = with_setup_faults(&made, &[*fault], kept, draw as u64)?;
            let (Some((twin, _)), Some((faulty, truth))) = (twin, faulty) else { continue };
            let label = format!("{machine:?} {kind} + {fault} {:?} {:.3?}", truth[0].joints, truth[0].values);
            count.add(&label, &made, fault, [&diagnosed(&twin)?, &diagnosed(&faulty)?]);
        }
    }
    count.print();
    Ok(())
}

fn diagnosed(made: &Made) -> Result<Diagnosis, Box<dyn Error>> {
    let file = freeplay_model::parse_toml(&made.model, Path::new("model.toml"))?;
    let recordings = [recording(&made.recording)?, recording(&made.second)?];
    Ok(diagnose(&file, &recordings, &DiagnoseSettings::default(), &mut |_| {})?)
}

impl Beside {
    /// Counts one pair: the diagnosis without the fault and the one with it.
    fn add(&mut self, label: &str, made: &Made, fault: &str, pair: [&Diagnosis; 2]) {
        let is_mended = pair[1].setup.iter().any(|finding| finding.kind == fault);
        if !is_mended {
            self.unmended += 1;
            println!("{label}: not mended");
            return;
        }
        self.pairs += 1;
        let missing = &made.truth.effects;
        let named = pair.map(|diagnosis| -> Vec<Named> {
            diagnosis.effects.iter().map(|effect| (effect.kind.to_owned(), effect.joint.clone())).collect()
        });
        let same = named[0].len() == named[1].len() && named[0].iter().all(|one| named[1].contains(one));
        self.same += usize::from(same);
        for (k, named) in named.iter().enumerate() {
            // One effect by its name, or all effects of an equivalent.
            let ways: Vec<Vec<Vec<Named>>> = missing
                .iter()
                .map(|effect| {
                    let own = vec![(effect.kind.clone(), effect.joint.clone())];
                    let others = effect.equivalents.iter().map(|other| {
                        other.kinds.iter().map(|kind| ((*kind).to_owned(), other.joint.clone())).collect()
                    });
                    std::iter::once(own).chain(others).collect()
                })
                .collect();
            let is_said =
                |ways: &Vec<Vec<Named>>| ways.iter().any(|way| way.iter().all(|one| named.contains(one)));
            self.found[k] += usize::from(ways.iter().all(is_said));
            let is_true = |one: &Named| ways.iter().flatten().any(|way| way.contains(one));
            self.invented[k] += usize::from(!named.iter().all(is_true));
            self.errors[k].extend(missing.iter().flat_map(|effect| errors_of(effect, pair[k])));
        }
        if !same {
            println!("{label}: {:?} {:?}", missing[0].kind, missing[0].joint);
            println!("    without {:?}", named[0]);
            println!("    with    {:?}", named[1]);
            pair[1].setup.iter().for_each(|finding| println!("    {}", finding.statement));
        }
    }

    fn print(&mut self) {
        println!(
            "{} pairs mended, {} not mended, the same effects named in {}",
            self.pairs, self.unmended, self.same
        );
        for (k, name) in ["without", "with"].into_iter().enumerate() {
            let errors = &mut self.errors[k];
            errors.sort_by(f64::total_cmp);
            let at =
                |share: f64| errors.get((errors.len() as f64 * share) as usize).copied().unwrap_or(f64::NAN);
            println!(
                "{name:8} all missing physics named {:3}  an effect invented {:3}  parameter error median {:.4} 90 % {:.4} of {}",
                self.found[k],
                self.invented[k],
                at(0.5),
                at(0.9),
                errors.len()
            );
        }
    }
}

/// Relative error of each numeric parameter of a true effect that the diagnosis names.
fn errors_of(effect: &TruthEffect, diagnosis: &Diagnosis) -> Vec<f64> {
    let named = diagnosis.effects.iter().find(|one| one.kind == effect.kind && one.joint == effect.joint);
    let (Some(named), Some(parameters)) = (named, effect.parameters.as_object()) else { return Vec::new() };
    let strong = parameters.iter().filter(|(name, _)| !effect.weak.contains(&name.as_str()));
    strong
        .filter_map(|(name, value)| {
            let (truth, value) = (value.as_f64()?, named.parameters.get(name)?.value.as_float()?);
            (truth != 0.0).then(|| (value / truth - 1.0).abs())
        })
        .collect()
}

/// Sets of recordings of real machines with their models, and the recording of each that receives the faults.
const REAL: [(&str, &str, &str); 7] = [
    ("kuka_kr300", "kr300_r2500_payload150.urdf", "train_A.csv"),
    ("kuka_kr300", "kr300_r2500_payload150.urdf", "test_B.csv"),
    ("kuka_lwr4", "kuka_lwr4.urdf", "train_1.csv"),
    ("kuka_lwr4", "kuka_lwr4.urdf", "test_3_fast.csv"),
    ("dfki_double_pendulum", "double_pendulum_C1.urdf", "train_1.csv"),
    ("dfki_double_pendulum", "double_pendulum_C1.urdf", "train_5_swing.csv"),
    ("dfki_double_pendulum", "double_pendulum_C1.urdf", "test_2.csv"),
];

/// Faults in recordings of real machines. The true reading of their clocks is not known to the last milliseconds, so the example only checks the inserted
/// faults.
fn real(
    rounds: u64,
    seed: u64,
    only: Option<&str>,
    rows: &mut BTreeMap<String, Row>,
) -> Result<(), Box<dyn Error>> {
    let folder = std::env::var_os("FREEPLAY_RECORDINGS").ok_or("FREEPLAY_RECORDINGS names no folder")?;
    let case = Case {
        machine: Machine::ALL[0],
        effects: Vec::new(),
        family: None,
        noise: Noise::ALL[0],
        hollow: false,
        seed,
    };
    let mut made = generate(&case)?;
    for (k, (set, model, file)) in REAL.into_iter().enumerate() {
        let folder = PathBuf::from(&folder).join(set);
        let arm = freeplay_model::load(&folder.join(model))?;
        let read = freeplay_recording::read(&folder.join(file), Some(arm.arm.dof()))?;
        made.model = freeplay_model::to_toml(&arm);
        made.recording = samples(&read);
        made.second = made.recording.clone();
        let label = format!("{set}/{file}");
        score(rows.entry("clean".to_owned()).or_default(), &label, &made, &[])?;
        let plain = errors(&made)?;
        for round in 0..rounds {
            for (number, kinds) in sets("single", k, only).into_iter().enumerate() {
                let kept = Kept { torque: true, tool: false, friction: true };
                let draw = (seed * 7919 + round) * 997 + (number * 31 + k) as u64;
                if let Some((made, truth)) = with_setup_faults(&made, &kinds, kept, draw)? {
                    let row = rows.entry(kinds.join(" + ")).or_default();
                    let missed = row.missed;
                    score(row, &label, &made, &truth)?;
                    if row.missed > missed && is_hidden(&plain, &errors(&made)?) {
                        row.hidden += 1;
                        println!("    hidden by what the model is off anyway");
                    }
                }
            }
        }
    }
    Ok(())
}

/// Error variance of each torque relative to the variance of the recorded torque.
fn errors(made: &Made) -> Result<Vec<f64>, Box<dyn Error>> {
    let arm = freeplay_model::parse_toml(&made.model, Path::new("model.toml"))?.arm;
    let (comparison, _) = compare(&arm, &[], &recording(&made.recording)?, &Settings::default())?;
    let share = |std: f64, of: f64| if of > 0.0 { (std / of).powi(2) } else { 1.0 };
    Ok(comparison.channels.iter().map(|channel| share(channel.std_error, channel.std_measured)).collect())
}

/// Returns true if a fault increases the errors of all channels by less than they are without it.
fn is_hidden(plain: &[f64], faulty: &[f64]) -> bool {
    plain.len() == faulty.len() && plain.iter().zip(faulty).all(|(plain, faulty)| *faulty < 2.0 * plain)
}

/// A recording in the form of the generator.
fn samples(recording: &Recording) -> Samples {
    let (mut names, mut columns) = (Vec::new(), Vec::new());
    for (name, column) in recording.named().filter(|(name, _)| name != "t") {
        names.push(name);
        columns.push(column.to_vec());
    }
    Samples { t: recording.t.clone(), names, columns }
}

fn print_table(rows: &BTreeMap<String, Row>) {
    let mut all = Row::default();
    for (name, row) in rows {
        let Row { right, missed, hidden, wrong, seconds } = row;
        println!(
            "{name:40} right {right:3} missed {missed:3} (hidden {hidden:3}) wrong {wrong:3} {:.2} s each",
            seconds / (right + missed + wrong) as f64
        );
        all.right += right;
        all.missed += missed;
        all.hidden += hidden;
        all.wrong += wrong;
    }
    println!("all: right {} missed {} (hidden {}) wrong {}", all.right, all.missed, all.hidden, all.wrong);
    if all.hidden > 0 {
        let visible = all.right + all.missed + all.wrong - all.hidden;
        println!("of the {visible} that the error of the model does not hide: right {}", all.right);
    }
}

/// The sets of faults for one recording.
fn sets(mode: &str, draw: usize, only: Option<&str>) -> Vec<Vec<&'static str>> {
    let wanted = SETUP.into_iter().filter(|kind| only.is_none_or(|only| only == *kind));
    match mode {
        "clean" => vec![Vec::new()],
        "two" => {
            let other = |(k, kind): (usize, &'static str)| {
                let second = SETUP[(draw + 3 * k + 1) % SETUP.len()];
                let alone = ["frozen_channel", "another_arm"];
                let fits = second != kind && !alone.contains(&kind) && !alone.contains(&second);
                fits.then(|| vec![kind, second])
            };
            wanted.enumerate().filter_map(other).collect()
        }
        _ => wanted.map(|kind| vec![kind]).collect(),
    }
}

fn score(row: &mut Row, label: &str, made: &Made, truth: &[SetupFault]) -> Result<(), Box<dyn Error>> {
    let arm = freeplay_model::parse_toml(&made.model, Path::new("model.toml"))?.arm;
    let recording = recording(&made.recording)?;
    let start = Instant::now();
    let setup = examine(&arm, &recording);
    row.seconds += start.elapsed().as_secs_f64();
    let name = |joint: usize| Some(arm.joints()[joint].name.clone());
    let mut wanted: Vec<(String, Option<String>)> = Vec::new();
    for fault in truth {
        let kind = || fault.kind.to_owned();
        match fault.joints.as_slice() {
            [] => wanted.push((kind(), None)),
            joints => wanted.extend(joints.iter().map(|&joint| (kind(), name(joint)))),
        }
    }
    let mut found: Vec<(String, Option<String>)> = Vec::new();
    for finding in setup.findings.iter().filter(|finding| finding.certainty == Certainty::Sure) {
        let kind = || finding.kind.to_owned();
        let is_of_all =
            finding.joint.is_none() && wanted.iter().any(|(w, joint)| *w == finding.kind && joint.is_some());
        if is_of_all {
            found.extend((0..arm.dof()).map(|joint| (kind(), name(joint))));
        } else {
            found.push((kind(), finding.joint.clone()));
        }
    }
    wanted.sort();
    found.sort();
    if wanted == found
        && (setup.findings.len() >= wanted.len() || !truth.is_empty())
        && (!truth.is_empty() || setup.findings.is_empty())
    {
        row.right += 1;
        return Ok(());
    }
    if found.iter().all(|one| wanted.contains(one)) && !truth.is_empty() {
        row.missed += 1
    } else {
        row.wrong += 1
    }
    println!(
        "{label}: {:?}",
        truth
            .iter()
            .map(|t| format!("{} {:?} {:.3?} {}", t.kind, t.joints, t.values, t.detail))
            .collect::<Vec<_>>()
    );
    for finding in &setup.findings {
        println!(
            "    {:?} {} {:?} {:.4}: {}",
            finding.certainty, finding.kind, finding.joint, finding.value, finding.statement
        );
    }
    Ok(())
}

fn recording(samples: &Samples) -> Result<Recording, Box<dyn Error>> {
    let mut columns = vec![("t".to_owned(), samples.t.clone())];
    columns.extend(samples.names.iter().cloned().zip(samples.columns.iter().cloned()));
    Ok(Recording::new(Path::new("made.csv"), columns)?)
}
