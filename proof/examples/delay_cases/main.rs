//! Success rate of a diagnosis in separating delayed commands from delayed encoders, with torques recorded next to commanded and measured positions.
//!
//! `cargo run --release -p freeplay-proof --example delay_cases -- COUNT [SEED]`. A case is right if the diagnosis names the delayed part, and no other
//! delay.
#![allow(clippy::unwrap_used, reason = "an example ends at the first surprise")]

mod case;
#[path = "../drawn/mod.rs"]
mod drawn;

use std::collections::BTreeMap;

use freeplay_diagnosis::{DiagnoseSettings, Diagnosis, diagnose};
use freeplay_model::{ArmFile, EffectTable, parse_toml};
use freeplay_recording::Recording;

use case::{Case, Late};
use drawn::JOINTS;

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let count: u64 = arguments[0].parse().unwrap();
    let first: u64 = arguments.get(1).map_or(1, |seed| seed.parse().unwrap());
    let mut score = Score::default();
    for seed in first..first + count {
        let mut case = Case::drawn(seed);
        let (bare, machine) = (file(&case.arm), file(&format!("{}{}", case.arm, case.effects)));
        let recordings: Vec<Recording> = (0..3).map(|number| case.recorded(&machine, number)).collect();
        let found = diagnose(&bare, &recordings, &DiagnoseSettings::default(), &mut |_| {}).unwrap();
        score.add(seed, &case, &machine, &found);
    }
    let Score { right, missing, intervals } = score;
    println!("{right} of {count} right; {missing} of {} servos missing", JOINTS.len() as u64 * count);
    for (name, [inside, all]) in intervals {
        println!("{inside} of {all} intervals of {name} hold");
    }
}

#[derive(Default)]
struct Score {
    right: u64,
    missing: usize,
    /// Number of intervals that include the truth, and of all intervals, by kind and name.
    intervals: BTreeMap<String, [usize; 2]>,
}

impl Score {
    fn add(&mut self, seed: u64, case: &Case, machine: &ArmFile, found: &Diagnosis) {
        let count = |kind: &str| found.effects.iter().filter(|effect| effect.kind == kind).count();
        let named = (count("command_delay"), count("time_delay"));
        let expected = match case.late {
            Late::Commands => (JOINTS.len(), 0),
            Late::Encoders => (0, 1),
            Late::Nothing => (0, 0),
        };
        self.right += u64::from(named == expected);
        self.missing += JOINTS.len() - count("servo");
        if named != expected || count("servo") < JOINTS.len() {
            let (late, ms) = (case.late, 1e3 * case.delay);
            println!(
                "seed {seed}: {late:?} late by {ms:.1} ms, named {named:?} and {} servos",
                count("servo")
            );
        }
        for effect in &found.effects {
            let is_it = |table: &&EffectTable| table.kind == effect.kind && table.joint == effect.joint;
            let Some(truth) = machine.effects.iter().find(is_it) else { continue };
            for (name, parameter) in &effect.parameters {
                let truth = truth.parameters.get(name).and_then(toml::Value::as_float);
                let (Some(truth), Some([low, high])) = (truth, parameter.ci95) else { continue };
                let [inside, all] = self.intervals.entry(format!("{} {name}", effect.kind)).or_default();
                *all += 1;
                *inside += usize::from(low <= truth && truth <= high);
            }
        }
    }
}

fn file(text: &str) -> ArmFile {
    parse_toml(text, "arm.toml".as_ref()).unwrap()
}
