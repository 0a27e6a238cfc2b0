//! A reading as a mapping file: what `--mapping` takes.

use std::fmt::Write as _;

use freeplay_recording::{Group, Recording};

use super::reading::Reading;

/// `reading` as a mapping of the columns of `recording` under their own names; `None` for a reading that changes nothing.
pub(crate) fn mapping(reading: &Reading, recording: &Recording) -> Option<String> {
    if reading.is_plain() {
        return None;
    }
    let mut text = String::from("# How this recording is to be read. Correct it where it is wrong.\n");
    if recording.guessed.is_some() {
        text.push_str(
            "# Its columns are those that freeplay record import gives the recording: import it before.\n",
        );
    }
    if reading.gravity_added {
        text.push_str("gravity_compensated = true\n");
    }
    let _ = write!(text, "\n[t]\ncolumns = \"t\"\n{}", scale(&[reading.time_unit]));
    let joints = reading.positions.len();
    let sources: Vec<usize> = reading.positions.iter().map(|position| position.source).collect();
    let factors: Vec<f64> = reading.positions.iter().map(|position| position.sign * position.unit).collect();
    let zeros: Vec<f64> = reading.positions.iter().map(|position| position.zero).collect();
    let mut positions = |group: Group, name: &str, has_zero: bool| {
        let _ = write!(text, "\n[{name}]\n{}{}", columns(group, &sources), scale(&factors));
        if has_zero && zeros.iter().any(|zero| *zero != 0.0) {
            let _ = writeln!(text, "offset = {zeros:?}");
        }
        if has_zero && reading.unwrap {
            text.push_str("unwrap = true\n");
        }
    };
    positions(Group::Position, "q", true);
    if recording.qd.is_some() {
        positions(Group::Velocity, "qd", false);
    }
    if recording.q_ref.is_some() {
        positions(Group::Reference, "q_ref", true);
    }
    if recording.q_link.len() == joints && recording.q_link.iter().all(Option::is_some) {
        positions(Group::Link, "q_link", true);
    }
    if recording.tau.is_some() {
        let sources: Vec<usize> = reading.torques.iter().map(|torque| torque.source).collect();
        let factors: Vec<f64> = reading.torques.iter().map(|torque| torque.factor).collect();
        let _ = write!(text, "\n[tau]\n{}{}", columns(Group::Torque, &sources), scale(&factors));
        text.push_str(&delay(reading.torque_delay));
    }
    if recording.tool.is_some() {
        let _ = write!(text, "\n[tool]\ncolumns = [\"x\", \"y\", \"z\"]\n{}", delay(reading.tool_delay));
    }
    if recording.orientation.is_some() {
        let names = "columns = [\"qx\", \"qy\", \"qz\", \"qw\"]";
        let _ = write!(text, "\n[orientation]\n{names}\n{}", delay(reading.tool_delay));
    }
    for (joint, position) in reading.positions.iter().enumerate() {
        if let Some((other, factor)) = position.relative {
            let _ = write!(
                text,
                "\n[[relative]]\njoint = {}\nto = {}\nfactor = {factor:?}\n",
                joint + 1,
                other + 1
            );
        }
    }
    Some(text)
}

fn columns(group: Group, sources: &[usize]) -> String {
    let names: Vec<String> = sources.iter().map(|source| group.column(*source)).collect();
    format!("columns = {names:?}\n")
}

/// Nothing for factors of one.
fn scale(factors: &[f64]) -> String {
    match factors {
        factors if factors.iter().all(|factor| *factor == 1.0) => String::new(),
        [one] => format!("scale = {one:?}\n"),
        all => format!("scale = {all:?}\n"),
    }
}

fn delay(seconds: f64) -> String {
    if seconds == 0.0 { String::new() } else { format!("delay = {seconds:?}\n") }
}
