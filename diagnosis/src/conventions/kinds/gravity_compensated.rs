//! `gravity_compensated`: torques from which the controller has subtracted the gravity of the arm.
//!
//! Tested: the torques hold no gravity at all. The hypothesis adds the model's gravity to them.

use super::super::change::Change;
use super::super::finding::{Certainty, SetupFinding};
use super::{Ask, Results};

/// The tested changes.
pub(crate) fn asks(ask: &Ask) -> Vec<Change> {
    let is_asked = ask.has_torques && ask.arm.gravity().norm() > 0.0;
    is_asked.then_some(Change::Compensated).into_iter().collect()
}

/// Words and remedy.
pub(crate) fn findings(results: &Results) -> Vec<SetupFinding> {
    let found = results.of(|change| *change == Change::Compensated);
    let one = |change: Change| {
        SetupFinding {
        kind: "gravity_compensated",
        joint: None,
        value: 0.0,
        unit: "m/s^2",
        certainty: Certainty::Sure,
        statement: format!(
            "The torques contain no gravity: the controller or the driver has subtracted the arm's weight.{}",
            results.rival(&change)
        ),
        remedy: "Record the full torque, or set gravity_compensated = true in the mapping, which adds the model's weight."
            .to_owned(),
        gravity: Some([0.0; 3]),
    }
    };
    found.into_iter().map(one).collect()
}
