//! `time_unit`: time stamps in milliseconds, microseconds or nanoseconds.
//!
//! Tested: the distance between rows. With a second or more between them, a recording does not show the motion of an arm.

use freeplay_recording::Recording;

use super::super::finding::{Certainty, SetupFinding};
use super::super::samples::SPACING;

/// Longest step of a recording in seconds, s: with longer ones it would not show the motion of an arm, so that its times have another unit.
const LONGEST_STEP_S: f64 = 1.0;

/// The finding for times of `recording` that are not in seconds; `None` if they are. The statement and the remedy continue a sentence that starts with a file
/// and a column.
pub fn found(recording: &Recording) -> Option<SetupFinding> {
    let step = recording.median_step();
    if step < LONGEST_STEP_S {
        return None;
    }
    // The first unit that gives a period of the fastest motions two rows (Shannon 1949): rates from 3 Hz to 3 kHz.
    let units = [("milliseconds", "ms", 1e3), ("microseconds", "us", 1e6), ("nanoseconds", "ns", 1e9)];
    let (unit, short, per_second) =
        units.into_iter().find(|(.., per_second)| step < 2.0 * SPACING * per_second).unwrap_or(units[2]);
    Some(SetupFinding {
        kind: "time_unit",
        joint: None,
        value: per_second,
        unit: "1",
        certainty: Certainty::Sure,
        statement: format!("rows are {step} apart, and times must be in seconds; are these {unit}?"),
        remedy: format!(
            "give seconds (divide by {per_second:e}), or set the unit in a mapping file for freeplay record import: unit = \"{short}\" under [t]"
        ),
        gravity: None,
    })
}
