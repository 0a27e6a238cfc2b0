//! Journals with play in bearings of vertical axes, where nothing holds them to one side.

use std::path::Path;

use freeplay_arm::parse_toml;
use freeplay_concealed::{Case, Demand, Machine, Noise, Severity, generate};
use freeplay_diagnosis::{DiagnoseSettings, diagnose};

use crate::common::of_samples;

/// The kinds that the diagnosis names where the column of a machine of three axes has an effect of this `kind`.
fn named(kind: &str, seed: u64) -> Vec<&'static str> {
    let effects = vec![Demand { kind: kind.to_owned(), joint: Some(0), severity: Severity::Clear }];
    let case =
        Case { machine: Machine::Three, effects, family: None, noise: Noise::Low, hollow: false, seed };
    let made = generate(&case).expect("a machine");
    let file = parse_toml(&made.model, Path::new("model.toml")).expect("a model");
    let recordings = [&made.recording, &made.second].map(of_samples);
    let diagnosis = diagnose(&file, &recordings, &DiagnoseSettings::default(), &mut |_| {}).expect("rows");
    diagnosis.effects.iter().map(|effect| effect.kind).collect()
}

/// When a bounce ends is not foretold from a recorded motion, and the mean of many looks like a film of oil.
#[test]
fn a_journal_that_bounces_is_told_from_one_in_oil() {
    for kind in ["joint_clearance", "lubricated_clearance"] {
        let named = named(kind, 1);
        println!("{kind}: {named:?}");
        assert_eq!(named, [kind]);
    }
}
