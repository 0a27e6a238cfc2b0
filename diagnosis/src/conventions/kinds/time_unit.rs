//! `time_unit`: time stamps in milliseconds, microseconds or nanoseconds.
//!
//! It asks how far apart the rows are: with a second and more between them, a recording shows nothing of how an arm moves.

use freeplay_recording::Recording;

use super::super::finding::{Certainty, SetupFinding};
use super::super::samples::SPACING;

/// A recording with longer steps shows nothing of how an arm moves, s: its times are no seconds.
const LONGEST_STEP_S: f64 = 1.0;

/// Times of `recording` that are no seconds; none where they are. The statement and the remedy go on where a file and a column stand before them.
pub fn found(recording: &Recording) -> Option<SetupFinding> {
    let step = recording.median_step();
    if step < LONGEST_STEP_S {
        return None;
    }
    // The first unit in which a period of the quickest motions has two rows (Shannon 1949): rates from 3 Hz to 3 kHz.
    let units = [("milliseconds", "ms", 1e3), ("microseconds", "us", 1e6), ("nanoseconds", "ns", 1e9)];
    let (unit, short, per_second) =
        units.into_iter().find(|(.., per_second)| step < 2.0 * SPACING * per_second).unwrap_or(units[2]);
    Some(SetupFinding {
        kind: "time_unit",
        joint: None,
        value: per_second,
        unit: "1",
        certainty: Certainty::Sure,
        statement: format!("rows are {step} apart, and times are in seconds; are these {unit}?"),
        remedy: format!(
            "give seconds (divide by {per_second:e}), or say the unit in a mapping file: freeplay record import, under [t] unit = \"{short}\""
        ),
        gravity: None,
    })
}
