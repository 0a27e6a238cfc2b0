//! Whole cases: the same seed gives the same numbers, severities are as asked for, files tell nothing.

use freeplay_concealed::{
    CATALOGUE, Case, Demand, Machine, Noise, OUTSIDE, Severity, generate, seats, write_case,
};

fn case(kind: Option<&str>, seed: u64) -> Case {
    let effects = kind.map(|kind| Demand { kind: kind.to_owned(), joint: None, severity: Severity::Clear });
    Case {
        machine: Machine::Slide,
        effects: effects.into_iter().collect(),
        family: None,
        noise: Noise::Middle,
        seed,
    }
}

#[test]
fn the_same_case_gives_the_same_numbers() {
    let wanted = case(Some("coulomb_friction"), 11);
    let (one, two) = (generate(&wanted).expect("a case"), generate(&wanted).expect("a case"));
    assert_eq!(one.recording, two.recording);
    assert_eq!(one.truth, two.truth);
    let other = generate(&case(Some("coulomb_friction"), 12)).expect("a case");
    assert_ne!(one.recording, other.recording);
    let found = one.truth.effects[0].signal_to_floor;
    println!("signal to floor {found:.3}, asked for 3.6 to 4.6");
    assert!(found > 3.0 && found < 5.5);
    assert!(
        one.recording.t.len() > 1000
            && one.recording.columns.iter().all(|c| c.len() == one.recording.t.len())
    );
    assert!(one.recording.t.windows(2).all(|pair| pair[1] > pair[0]), "time increases");
}

/// What is drawn beside the effect does not depend on it: length, rate and columns are those of the negative control.
#[test]
fn an_effect_leaves_no_mark_on_the_form() {
    let seed = 5;
    let (with, without) = (
        generate(&case(Some("viscous_friction"), seed)).expect("a case"),
        generate(&case(None, seed)).expect("a case"),
    );
    assert_eq!(with.recording.names, without.recording.names);
    assert_eq!(with.recording.t, without.recording.t);
    assert_eq!(with.model, without.model);
    assert_ne!(with.recording.columns, without.recording.columns);
}

#[test]
fn every_kind_has_a_place_in_three_machines() {
    for kind in CATALOGUE.iter().chain(&OUTSIDE) {
        let places = Machine::ALL
            .iter()
            .filter(|machine| !seats(kind, &machine.data_sheet().expect("a data sheet")).is_empty())
            .count();
        assert!(places >= 3, "{kind}: {places}");
    }
}

#[test]
fn files_can_be_read_back() {
    let folder = tempfile::tempdir().expect("a folder");
    let made = generate(&case(None, 2)).expect("a case");
    write_case(folder.path(), 7, &made).expect("files");
    let arm = freeplay_arm::load(&folder.path().join("0007/model.toml")).expect("a model");
    assert!(arm.effects.is_empty() && arm.arm.dof() == 1);
    for file in ["recording.csv", "second.csv"] {
        let read =
            freeplay_recording::read(&folder.path().join("0007").join(file), Some(1)).expect("a recording");
        assert!(read.len() > 1000);
    }
    let truth = std::fs::read_to_string(folder.path().join("truth/0007.json")).expect("the truth");
    let truth: serde_json::Value = serde_json::from_str(&truth).expect("JSON");
    assert_eq!(truth["effects"].as_array().map(Vec::len), Some(0));
}
