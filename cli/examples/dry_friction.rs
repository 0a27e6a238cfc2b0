//! Measures how often dry friction of one joint is the only finding of a diagnosis. The closed loops differ in the size of the friction, the time for which the
//! joint stands, the stiffness of the feedback, and the noise.
//!
//! ```sh
//! cargo build --release && cargo run --release -p freeplay --example dry_friction -- MODEL COUNT [FIRST_SEED]
//! ```
//!
//! MODEL is an arm file without friction, of an arm that can swing by half a radian about its middle. Each case is a run of the plant with `computed-torque`,
//! whose model is MODEL, and a diagnosis of its recording. A joint with more friction than the feedback overcomes, so that it swings by less than half of its
//! commanded motion, is counted separately.

use std::f64::consts::TAU;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::process::Command;

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde_json::Value;

type Fault = Box<dyn std::error::Error>;

/// Length of a recording and time between rows of a path, s.
const DURATION: f64 = 16.0;
const STEP: f64 = 0.01;
/// Longest commanded standstill of a joint, as a share of the time.
const REST: f64 = 0.5;

/// One case.
#[derive(Debug)]
struct Case {
    joint: usize,
    /// N·m.
    coulomb: f64,
    /// Share of the time of commanded standstill.
    rest: f64,
    /// rad/s.
    natural_frequency: f64,
    /// N·m.
    torque_noise: f64,
    /// rad.
    encoder_noise: f64,
    /// By joint: two amplitudes, rad; two frequencies, Hz; two phases, rad.
    swings: Vec<[f64; 6]>,
    seed: u64,
}

impl Case {
    fn drawn(joints: usize, seed: u64) -> Self {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let decades = |rng: &mut ChaCha8Rng, from: f64, to: f64| 10_f64.powf(rng.random_range(from..to));
        let swing = |rng: &mut ChaCha8Rng| {
            let ranges = [(0.2, 0.5), (0.1, 0.3), (0.1, 0.25), (0.25, 0.45), (0.0, TAU), (0.0, TAU)];
            ranges.map(|(from, to)| rng.random_range(from..to))
        };
        Self {
            joint: rng.random_range(0..joints),
            coulomb: rng.random_range(1.0..10.0),
            rest: rng.random_range(0.0..REST),
            natural_frequency: rng.random_range(10.0..50.0),
            torque_noise: decades(&mut rng, -1.7, -0.3),
            encoder_noise: decades(&mut rng, -7.0, -5.0),
            swings: (0..joints).map(|_| swing(&mut rng)).collect(),
            seed,
        }
    }

    /// The path as CSV: every joint swings about `home`, one of them stands for a while in the middle.
    fn path(&self, home: &[f64]) -> Result<String, std::fmt::Error> {
        let mut text = "t".to_owned();
        (1..=home.len()).try_for_each(|joint| write!(text, ",q{joint}"))?;
        let [from, to] = [-0.5, 0.5].map(|side| 0.5 * DURATION + side * self.rest * DURATION);
        let mut moved = 0.0;
        for row in 0..=(DURATION / STEP).round() as usize {
            let t = row as f64 * STEP;
            moved += STEP * (1.0 - smooth((t - from) / 0.5) + smooth((t - to) / 0.5));
            let envelope = smooth(t / 1.5) * smooth((DURATION - t) / 1.5);
            write!(text, "\n{t}")?;
            for (joint, (home, [a, b, slow, fast, p, q])) in home.iter().zip(&self.swings).enumerate() {
                let x = TAU * if joint == self.joint { moved } else { t };
                write!(text, ",{}", home + envelope * (a * (slow * x + p).sin() + b * (fast * x + q).sin()))?;
            }
        }
        Ok(text)
    }
}

/// A smooth step from 0 to 1 with continuous speed.
fn smooth(x: f64) -> f64 {
    let x = x.clamp(0.0, 1.0);
    x * x * (3.0 - 2.0 * x)
}

/// The outcome of a case.
enum Outcome {
    /// The run ended early: the arm was stopped.
    Stopped,
    /// The joint swung by less than half of its commanded motion.
    Stuck,
    /// The diagnosis; whether dry friction of this joint is its only finding, and whether the interval contains the truth.
    Diagnosed { is_alone: bool, is_inside: bool, statement: String },
}

/// Runs the command with `arguments` in `folder`; returns its standard output, or `None` if a run was stopped.
fn freeplay(folder: &Path, arguments: &[&str]) -> Result<Option<String>, Fault> {
    let own = std::env::current_exe()?;
    let built = own.parent().and_then(Path::parent).ok_or("the example lies in no folder of a build")?;
    let output = Command::new(built.join("freeplay")).args(arguments).current_dir(folder).output()?;
    match output.status.code() {
        Some(0) => Ok(Some(String::from_utf8(output.stdout)?)),
        Some(1) => Ok(None),
        code => Err(format!("{arguments:?}: {code:?}: {}", String::from_utf8_lossy(&output.stderr)).into()),
    }
}

fn outcome(model: &str, names: &[String], case: &Case) -> Result<Outcome, Fault> {
    let folder = tempfile::tempdir()?;
    let at = folder.path();
    let name = &names[case.joint];
    let machine = format!(
        "urdf = \"{model}\"\n\n[[effect]]\nkind = \"coulomb_friction\"\njoint = \"{name}\"\ncoulomb = {}\n",
        case.coulomb
    );
    std::fs::write(at.join("machine.toml"), machine)?;
    std::fs::write(at.join("path.csv"), case.path(&vec![0.3; names.len()])?)?;
    let sets = [
        format!("controller.model={model}"),
        format!("controller.gains.natural_frequency={}", case.natural_frequency),
        format!("sensors.position.noise={}", case.encoder_noise),
        format!("sensors.velocity.noise={}", 100.0 * case.encoder_noise),
        format!("sensors.torque.noise={}", case.torque_noise),
        "sensors.track_tool=false".to_owned(),
        "path.kind=file".to_owned(),
        "path.file=path.csv".to_owned(),
        format!("duration={DURATION}"),
        "recording=csv".to_owned(),
    ];
    let seed = case.seed.to_string();
    let mut run = vec!["run", "--quiet", "--model", "machine.toml", "--controller", "computed-torque"];
    run.extend(["--seed", &seed, "--out", "out"]);
    run.extend(sets.iter().flat_map(|set| ["--set", set]));
    if freeplay(at, &run)?.is_none() {
        return Ok(Outcome::Stopped);
    }
    let recording = at.join("out/computed-torque.csv");
    if followed(&recording, case.joint)? < 0.5 {
        return Ok(Outcome::Stuck);
    }
    let recording = recording.to_string_lossy();
    let asked = ["diagnose", "--quiet", "--model", model, "--recording", &recording, "--format", "json"];
    let found: Value = serde_json::from_str(&freeplay(at, &asked)?.ok_or("no diagnosis")?)?;
    let effects = found["effects"].as_array().ok_or("no effects")?;
    let is_it = |effect: &&Value| effect["kind"] == "coulomb_friction" && effect["joint"] == name.as_str();
    let is_alone = effects.len() == 1 && effects.iter().any(|effect| is_it(&effect));
    let interval = effects.iter().find(is_it).map(|effect| &effect["parameters"]["coulomb"]["ci95"]);
    let side = |k: usize| interval.and_then(|interval| interval[k].as_f64());
    let is_inside = side(0).is_some_and(|x| x <= case.coulomb) && side(1).is_some_and(|x| x >= case.coulomb);
    Ok(Outcome::Diagnosed { is_alone, is_inside, statement: found["statement"].to_string() })
}

/// Ratio of the range of `joint` in `recording` to that of its reference.
fn followed(recording: &Path, joint: usize) -> Result<f64, Fault> {
    let recording = freeplay_recording::read(recording, None)?;
    let width = |column: &[f64]| {
        let (least, most) = column.iter().fold((f64::MAX, f64::MIN), |(a, b), x| (a.min(*x), b.max(*x)));
        most - least
    };
    let reference = recording.q_ref.as_ref().ok_or("no reference")?;
    Ok(width(&recording.q[joint]) / width(&reference[joint]))
}

fn main() -> Result<(), Fault> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [model, count, rest @ ..] = arguments.as_slice() else {
        return Err("dry_friction MODEL COUNT [FIRST_SEED]".into());
    };
    let first: u64 = rest.first().map_or(Ok(1), |seed| seed.parse())?;
    let model: PathBuf = std::fs::canonicalize(model)?;
    let names: Vec<String> =
        freeplay_model::load(&model)?.arm.joints().iter().map(|joint| joint.name.clone()).collect();
    let model = model.to_string_lossy();
    let (mut right, mut inside, mut diagnosed, mut stuck, mut stopped) = (0, 0, 0, 0, 0);
    for seed in first..first + count.parse::<u64>()? {
        let case = Case::drawn(names.len(), seed);
        match outcome(&model, &names, &case)? {
            Outcome::Stopped => stopped += 1,
            Outcome::Stuck => stuck += 1,
            Outcome::Diagnosed { is_alone, is_inside, statement } => {
                diagnosed += 1;
                right += usize::from(is_alone);
                inside += usize::from(is_alone && is_inside);
                if !(is_alone && is_inside) {
                    println!("{seed}: {:.3} N*m at {}: {statement}", case.coulomb, names[case.joint]);
                }
            }
        }
    }
    println!(
        "{diagnosed} diagnosed: {right} with this finding alone, {inside} of them with the truth inside its interval; {stuck} stuck, {stopped} stopped"
    );
    Ok(())
}
