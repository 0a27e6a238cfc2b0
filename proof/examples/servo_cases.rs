//! Success rate of a diagnosis of commanded and measured positions alone: machines with random servos, hidden from the diagnosis.
//!
//! `cargo run --release -p freeplay-proof --example servo_cases -- COUNT [SEED]`. Each case has two diagnoses: with the bare arm, and with the machine's
//! own model, which lacks nothing. The machine moves in steps of 1 ms; the law is that of the crate `servo`.
#![allow(clippy::unwrap_used, reason = "an example ends at the first surprise")]

use std::collections::BTreeMap;
use std::path::Path;

use freeplay_diagnosis::{DiagnoseSettings, Verdict, diagnose};
use freeplay_model::{ArmFile, parse_toml};
use freeplay_recording::Recording;
use freeplay_servo::{Commands, Course, Rollout, ServoArm, State};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

mod drawn;
use drawn::{JOINTS, link, servo};

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let count: u64 = arguments[0].parse().unwrap();
    let first: u64 = arguments.get(1).map_or(1, |seed| seed.parse().unwrap());
    let (mut told, mut alarms) = (BTreeMap::<&str, [u32; 3]>::new(), 0);
    let (mut inside, mut intervals) = (0, 0);
    for seed in first..first + count {
        let case = Case::drawn(seed);
        let (bare, machine) = (file(&case.arm), file(&format!("{}{}", case.arm, case.effects)));
        let recordings: Vec<Recording> = (0..3).map(|number| case.recorded(&machine, number)).collect();
        let run =
            |file: &ArmFile| diagnose(file, &recordings, &DiagnoseSettings::default(), &mut |_| {}).unwrap();
        let found = run(&bare);
        for kind in ["coulomb_friction", "stribeck_friction", "command_delay", "rotor_inertia", "hard_stop"] {
            for joint in JOINTS {
                let truth = machine
                    .effects
                    .iter()
                    .find(|effect| effect.kind == kind && effect.joint.as_deref() == Some(joint));
                let named = found
                    .effects
                    .iter()
                    .find(|effect| effect.kind == kind && effect.joint.as_deref() == Some(joint));
                let place = match (truth.is_some(), named.is_some()) {
                    (true, true) => 0,
                    (true, false) => 1,
                    (false, true) => 2,
                    (false, false) => continue,
                };
                told.entry(kind).or_default()[place] += 1;
                if place > 0 {
                    println!("seed {seed}: {kind} of {joint} {}", ["", "missed", "is not there"][place]);
                }
                let (Some(truth), Some(named)) = (truth, named) else { continue };
                for (name, parameter) in &named.parameters {
                    let (Some([low, high]), Some(x)) =
                        (parameter.ci95, truth.parameters.get(name).and_then(toml::Value::as_float))
                    else {
                        continue;
                    };
                    intervals += 1;
                    inside += u32::from(low <= x && x <= high);
                }
            }
        }
        let contacts = found.effects.iter().filter(|effect| effect.kind == "contact").count();
        if contacts > 0 {
            told.entry("contact").or_default()[2] += 1;
            println!("seed {seed}: {contacts} contacts are not there");
        }
        let own = run(&machine);
        if own.verdict != Verdict::NothingMissing {
            alarms += 1;
            println!("seed {seed}: of its own model: {}", own.statement);
        }
    }
    for (kind, [right, missed, wrong]) in &told {
        println!("{kind}: {right} named, {missed} missed, {wrong} not there");
    }
    println!(
        "{inside} of {intervals} intervals hold; {alarms} of {count} machines lack something of their own model"
    );
}

struct Case {
    arm: String,
    effects: String,
    tick: f64,
    phases: [f64; 3],
}

impl Case {
    fn drawn(seed: u64) -> Self {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let mut arm = String::from("name = \"three links\"\n");
        let mut effects = String::new();
        for (joint, name) in JOINTS.iter().enumerate() {
            arm += &link(&mut rng, joint);
            let (table, stiffness) = servo(&mut rng, name);
            effects += &table;
            let mut add = |chance: f64, kind: &str, number: &str, [low, high]: [f64; 2], more: &str| {
                if rng.random_bool(chance) {
                    let x = rng.random_range(low..high);
                    effects +=
                        &format!("[[effect]]\nkind = \"{kind}\"\njoint = \"{name}\"\n{number} = {x}\n{more}");
                }
            };
            let angle = |[low, high]: [f64; 2]| [low * stiffness, high * stiffness];
            add(0.7, "coulomb_friction", "coulomb", angle([5e-3, 4e-2]), "");
            add(0.3, "stribeck_friction", "extra", angle([5e-3, 3e-2]), "velocity = 0.03\n");
            add(0.6, "command_delay", "delay", [0.005, 0.05], "");
            add(0.2, "rotor_inertia", "inertia", [0.005, 0.05], "");
            add(0.1, "hard_stop", "lower", [-0.45, -0.3], "");
        }
        Self { arm, effects, tick: rng.random_range(3e-4..2e-3), phases: [0.0, 1.3, 2.9] }
    }

    fn recorded(&self, machine: &ArmFile, number: usize) -> Recording {
        let truth = ServoArm::of(machine).unwrap().unwrap();
        let t: Vec<f64> = (0..2000).map(|row| f64::from(row) * 0.02).collect();
        let wave = |t: f64, joint: usize| {
            let (phase, joint) = (self.phases[number] + joint as f64, joint as f64);
            0.3 * ((0.9 + 0.17 * joint) * t + phase).sin()
                + 0.2 * ((2.3 - 0.31 * joint) * t + 2.0 * phase).sin()
                + 0.06 * ((6.1 + 0.7 * joint) * t + 3.0 * phase).sin()
        };
        let commanded: Vec<Vec<f64>> =
            (0..JOINTS.len()).map(|joint| t.iter().map(|t| wave(*t, joint)).collect()).collect();
        let commands: Vec<Commands> = commanded.iter().map(|column| Commands::new(&t, column)).collect();
        let start = |joint: usize| commanded[joint][0].max(truth.joints[joint].stops[0]);
        let state = State { q: (0..JOINTS.len()).map(start).collect(), v: vec![0.0; JOINTS.len()] };
        let mut out = vec![0.0; JOINTS.len() * t.len()];
        let course = Course { commands: &commands, stamps: &t, loads: &[] };
        Rollout::new(&truth, 0.001).run(&truth, course, &state, &mut out);
        let mut all = vec![("t".to_owned(), t)];
        for (joint, column) in commanded.into_iter().enumerate() {
            let read = |q: &f64| (q / self.tick).round() * self.tick;
            let measured = out.iter().skip(joint).step_by(JOINTS.len()).map(read).collect();
            all.push((format!("q{}", joint + 1), measured));
            all.push((format!("q_ref{}", joint + 1), column));
        }
        Recording::new(Path::new(&format!("{number}.csv")), all).unwrap()
    }
}

fn file(text: &str) -> ArmFile {
    parse_toml(text, "arm.toml".as_ref()).unwrap()
}
