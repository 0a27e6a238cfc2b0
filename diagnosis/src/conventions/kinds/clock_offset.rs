//! `clock_offset`: groups of channels from two logs whose clocks don't agree.
//!
//! Tested: the delay of the torques, the tool, or both behind the positions, up to half a second. The hypothesis shifts them. A delay that a position loop
//! could tolerate is the catalogue's `time_delay`.

use super::super::change::{Change, Late, groups};
use super::super::finding::{Certainty, SetupFinding};
use super::{Ask, Results};

/// Greatest delay of the catalogue, s: with a larger one, no position loop of 3.5 Hz would be stable (60 degrees of its phase).
pub(crate) const LEAST: f64 = 0.048;
/// Number of tested delays in each direction: they reach half a second, and all tests lose the rows at the ends that the longest shift removes.
const COUNT: i8 = 16;
/// Distance between two tested delays, s: a fit starts within half of it, a small part of the period of the fastest motions, 0.7 s.
pub(crate) const APART: f64 = 0.03;
/// The name of this kind of finding.
pub(crate) const KIND: &str = "clock_offset";

/// Half the distance between two tested delays, s. The search may find a delay with this error, as long as it does not know the missing physics.
pub(crate) fn unsure() -> f64 {
    0.5 * APART
}

/// The tested changes.
pub(crate) fn asks(ask: &Ask) -> Vec<Change> {
    let large = || (-COUNT..=COUNT).filter(|k| *k != 0).map(|k| f64::from(k) * APART);
    let delays = || large().chain([unsure(), -unsure()]);
    let groups = groups(ask.has_torques, ask.has_tool).into_iter();
    groups.flat_map(|late| delays().map(move |delay| Change::Delay(late, delay))).collect()
}

/// Words and remedy.
pub(crate) fn findings(results: &Results) -> Vec<SetupFinding> {
    let found = results.of(|change| matches!(change, Change::Delay(..)));
    let one = |change| match change {
        Change::Delay(late, delay) => Some(finding(late, delay, Certainty::Sure)),
        _ => None,
    };
    found.into_iter().filter_map(one).collect()
}

/// The finding that the channels `late` are `delay` s behind the joint positions.
pub(crate) fn finding(late: Late, delay: f64, certainty: Certainty) -> SetupFinding {
    let group = match late {
        Late::Torque => "torques are",
        Late::Tool => "tracked tool is",
        Late::Both => "torques and the tracked tool are",
    };
    let (ms, way) = ((delay.abs() * 1e3).round(), if delay > 0.0 { "late" } else { "early" });
    SetupFinding {
        kind: KIND,
        joint: None,
        value: delay,
        unit: "s",
        certainty,
        statement: format!(
            "The {group} {ms} ms {way} relative to the joint positions. Do they come from two logs with different clocks?"
        ),
        remedy: format!("Shift them by {ms} ms in the mapping, or join the logs on one clock."),
        gravity: None,
    }
}
