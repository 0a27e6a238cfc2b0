//! `joint_order`: columns in another order than the joints of the model.
//!
//! Tested for every pair of joints: they are exchanged, positions and torques; several exchanges make any order. If recording and model both have names, these
//! match the joints before the test.

use super::super::change::Change;
use super::super::finding::{Certainty, SetupFinding};
use super::{Ask, Results, listed};

/// The tested changes.
pub(crate) fn asks(ask: &Ask) -> Vec<Change> {
    let n = ask.arm.dof();
    (0..n).flat_map(|a| (a + 1..n).map(move |b| Change::Exchange(a, b))).collect()
}

/// Words and remedy: one finding for each joint that has another column, with that column's number as its value.
pub(crate) fn findings(results: &Results) -> Vec<SetupFinding> {
    let found = results.of(|change| matches!(change, Change::Exchange(..)));
    if found.is_empty() {
        return Vec::new();
    }
    let reading = super::super::change::reading(results.arm, &found);
    let sources: Vec<usize> = reading.positions.iter().map(|position| position.source).collect();
    let moved: Vec<usize> = (0..sources.len()).filter(|&joint| sources[joint] != joint).collect();
    let names: Vec<String> = moved.iter().map(|&joint| results.name(joint)).collect();
    let columns: Vec<String> = sources.iter().map(|source| format!("q{}", source + 1)).collect();
    let statement = if moved.len() == 2 {
        format!("{} are exchanged in the recording.", listed(&names))
    } else {
        format!(
            "The recording has its joints in another order: its columns for the model's joints are {}.",
            columns.join(", ")
        )
    };
    let remedy = format!("Name the columns in the model's order in the mapping: {}.", columns.join(", "));
    let one = |joint: &usize| SetupFinding {
        kind: "joint_order",
        joint: Some(results.name(*joint)),
        value: (sources[*joint] + 1) as f64,
        unit: "1",
        certainty: Certainty::Sure,
        statement: statement.clone(),
        remedy: remedy.clone(),
        gravity: None,
    };
    moved.iter().map(one).collect()
}
