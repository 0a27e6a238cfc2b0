//! Diagnoses of generated machines.

use std::path::Path;

use freeplay_concealed::{Case, Demand, Machine, Noise, Severity, generate};
use freeplay_diagnosis::{DiagnoseSettings, Diagnosis, diagnose};
use freeplay_model::parse_toml;

use crate::common::of_samples;

/// The diagnosis of a machine of three axes whose joint number `joint`, from 0, has a random effect of this `kind`, drawn with `seed`.
pub fn of_three_axes(kind: &str, joint: usize, seed: u64) -> Diagnosis {
    of_machine(kind, Some(joint), seed)
}

/// The same for an effect that may belong to no joint.
fn of_machine(kind: &str, joint: Option<usize>, seed: u64) -> Diagnosis {
    let effects = vec![Demand { kind: kind.to_owned(), joint, severity: Severity::Clear }];
    let case =
        Case { machine: Machine::Three, effects, family: None, noise: Noise::Low, hollow: false, seed };
    let made = generate(&case).expect("a machine");
    let file = parse_toml(&made.model, Path::new("model.toml")).expect("a model");
    let recordings = [&made.recording, &made.second].map(of_samples);
    diagnose(&file, &recordings, &DiagnoseSettings::default(), &mut |_| {}).expect("rows")
}

/// A force that lasts for seconds is not explained by several laws that each resemble a part of it.
#[test]
fn a_long_force_is_named_and_no_laws_in_its_place() {
    let diagnosis = of_machine("external_force", None, 1);
    let names: Vec<&str> = diagnosis.effects.iter().map(|effect| effect.kind).collect();
    println!("{}", diagnosis.statement);
    assert_eq!(names, ["external_force"]);
}
