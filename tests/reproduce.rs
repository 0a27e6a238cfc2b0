//! `freeplay reproduce --quick`, end to end: numbers, verdicts, pictures.

use std::path::Path;

use crate::common::{Call, fresh_folder};
use serde_json::Value;

/// Calls `freeplay reproduce --quick` with `more`, writing into `out`; returns its output. The test waits without a time limit.
fn quick(out: &Path, more: &[&str]) -> String {
    let out = out.display().to_string();
    let mut arguments = vec!["reproduce", "--quick", "--quiet", "--out", &out];
    arguments.extend(more);
    let mut call = Call::new(fresh_folder(), &arguments);
    let ended = call.command.stdout(std::process::Stdio::piped()).spawn().expect("it starts");
    let ended = ended.wait_with_output().expect("it ends");
    assert_eq!(ended.status.code(), Some(0));
    String::from_utf8(ended.stdout).expect("text")
}

fn claim<'a>(numbers: &'a Value, id: &str) -> &'a Value {
    let claims = numbers["claims"].as_array().expect("claims");
    claims.iter().find(|claim| claim["id"] == id).unwrap_or_else(|| panic!("no claim {id}"))
}

#[test]
fn the_quick_form_judges_the_claims_and_draws_the_figures() {
    let folder = fresh_folder();
    let screen = quick(folder.path(), &["--skip", "network", "--skip", "compensation"]);
    let text = std::fs::read_to_string(folder.path().join("reproduce.json")).expect("numbers");
    let numbers: Value = serde_json::from_str(&text).expect("JSON");
    assert_eq!(numbers["schema"], "freeplay.reproduce/1");
    let deviation = claim(&numbers, "deviation_grows_with_clearance");
    assert_eq!(deviation["verdict"], "holds");
    // The RMS equals the clearance on the smooth path; an independent simulator has it next to ours.
    let row = &deviation["situations"][0];
    for (place, clearance) in [0.2, 0.4, 0.6].into_iter().enumerate() {
        let (ours, theirs) = (row["values"][place].as_f64(), row["reference"][place].as_f64());
        let (ours, theirs) = (ours.expect("ours"), theirs.expect("theirs"));
        println!("c = {clearance} mm: {ours:.5} mm, reference {theirs:.5} mm");
        assert!((ours / clearance - 1.0).abs() < 0.01 && (ours / theirs - 1.0).abs() < 0.01);
    }
    assert_eq!(claim(&numbers, "peaks_at_the_beginning")["situations"].as_array().map(Vec::len), Some(6));
    let friction = claim(&numbers, "friction_opposes_sliding")["situations"].as_array().expect("situations");
    let rattling: Vec<f64> = friction.iter().map(|row| row["values"][2].as_f64().expect("mm")).collect();
    println!("std of x: {:.4} mm as printed, {:.4} mm corrected", rattling[0], rattling[1]);
    assert!(rattling[0] > 3.0 * rattling[1], "the printed law rattles");
    let report = std::fs::read_to_string(folder.path().join("report.html")).expect("a report");
    for label in
        ["force of joint 1 [N]", "torque of joint 2 [N·m]", "deviation along z [mm]", "eccentricity [mm]"]
    {
        assert!(report.contains(label), "{label}");
    }
    assert!(report.matches("<svg ").count() >= 10 && report.len() < 6_000_000, "{} bytes", report.len());
    println!("{screen}");
    assert!(screen.contains("does not hold") && screen.contains("report.html"), "{screen}");
    assert!(screen.lines().count() <= 40, "one screen");
}
