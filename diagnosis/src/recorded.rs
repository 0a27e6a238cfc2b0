//! A recording of the arm that a model describes, with checks of its units.

use std::path::{Path, PathBuf};

use freeplay_arm::{Arm, Purpose, Shortfall};
use freeplay_model::ArmFile;
use freeplay_recording::{ColumnError, JointsError, Mapping, Place, ReadError, Recording, Row};
use freeplay_storage::same_file;
use thiserror::Error;

use crate::conventions::{Reading, SetupFinding, time_unit};

/// Greatest reach of an arm, m: only the longest truck cranes reach as far, and their files are no arms; positions in millimetres exceed it.
const FARTHEST_M: f64 = 30.0;

/// Why a recording cannot be compared with a model.
#[derive(Debug, Error)]
pub enum RecordedError {
    /// The file cannot be read.
    #[error(transparent)]
    Read(#[from] ReadError),
    /// The recording names some of the model's joints, and not all.
    #[error(transparent)]
    Names(#[from] JointsError),
    /// The recording has another number of joints than the model.
    #[error("{error} The joints of {model} are {joints}{locked}")]
    Joints {
        /// The reader's error.
        error: Box<ReadError>,
        /// The name of the model, as given.
        model: String,
        /// The model's joints.
        joints: String,
        /// The chain of the robot that makes the arm, in words.
        locked: String,
    },
    /// The model can't predict torques, and the recording has no other channel.
    #[error(transparent)]
    Unfit(#[from] Shortfall),
    /// The times are in another unit than seconds.
    #[error("{}: column t: {words}", file.display())]
    NotSeconds {
        /// The recording.
        file: PathBuf,
        /// The apparent unit, and the remedy.
        words: String,
    },
    /// The command names one recording twice.
    #[error("--recording {}: is given twice, but the held-out recording must differ from the others: name each once", file.display())]
    Twice {
        /// The recording.
        file: PathBuf,
    },
}

/// Reads the recording at `path` as it stands, or with `mapping`.
///
/// # Errors
/// The reader's own.
pub fn unmatched(path: &Path, mapping: Option<&Mapping>) -> Result<Recording, RecordedError> {
    Ok(match mapping {
        None => freeplay_recording::read(path, None)?,
        Some(mapping) => freeplay_recording::import_csv(path, mapping)?,
    })
}

/// The recording for the arm in `file`, which the user named `model`. It has the joints of the arm in its order, if both have names, no torques for a model
/// without masses, and the arm's weight if `mapping` says that the torques lack it. Notes list columns that may be in another unit.
///
/// # Errors
/// Joints that differ from the arm's; times that are not in seconds; torques alone for a model without masses.
pub fn of_arm(
    recording: Recording,
    model: &str,
    file: &ArmFile,
    mapping: Option<&Mapping>,
) -> Result<Recording, RecordedError> {
    let joints: Vec<String> = file.arm.joints().iter().map(|joint| joint.name.clone()).collect();
    let mut recording = recording.for_joints(&joints)?;
    if recording.joints() != joints.len() {
        return Err(other_number(&recording, model, file));
    }
    check_times(&recording)?;
    check_masses(&mut recording, &file.arm)?;
    recording.notes.extend(far_tool(&recording));
    if mapping.is_some_and(Mapping::is_gravity_compensated) {
        let reading = Reading { gravity_added: true, ..Reading::plain(file.arm.dof()) };
        return Ok(reading.mended(&file.arm, &recording));
    }
    Ok(recording)
}

/// The error of a recording whose number of joints differs from the model in `file`, with the chain that the file's arm was taken from.
fn other_number(recording: &Recording, model: &str, file: &ArmFile) -> RecordedError {
    let joints: Vec<&str> = file.arm.joints().iter().map(|joint| joint.name.as_str()).collect();
    let taken = file.ignored.first().filter(|note| note.starts_with("arm: "));
    let locked =
        taken.map_or_else(String::new, |taken| format!("; {taken}; choose another chain with --tip LINK"));
    let place = Place { file: recording.origin.clone(), row: Row::Whole };
    let source = ColumnError::JointCount { expected: joints.len(), found: recording.joints() };
    let error = Box::new(ReadError::Columns { place, source });
    RecordedError::Joints { error, model: model.to_owned(), joints: joints.join(", "), locked }
}

/// Removes torques that the model can't predict, with a note.
fn check_masses(recording: &mut Recording, arm: &Arm) -> Result<(), RecordedError> {
    let Err(shortfall) = arm.require(Purpose::Torque) else { return Ok(()) };
    let has_poses = recording.tool.is_some() || recording.q_link.iter().any(Option::is_some);
    if recording.tau.is_none() {
        return Ok(());
    }
    if !has_poses {
        return Err(shortfall.into());
    }
    recording.tau = None;
    recording.notes.push("the recorded torques are not compared: the model can't predict torques".to_owned());
    Ok(())
}

/// Rejects times that are not in seconds.
fn check_times(recording: &Recording) -> Result<(), RecordedError> {
    let Some(SetupFinding { statement, remedy, .. }) = time_unit(recording) else { return Ok(()) };
    Err(RecordedError::NotSeconds { file: recording.origin.clone(), words: format!("{statement} {remedy}") })
}

/// A note on a tool farther away than any arm reaches.
fn far_tool(recording: &Recording) -> Option<String> {
    let farthest = |axis: &Vec<f64>| axis.iter().fold(0.0, |most: f64, value| most.max(value.abs()));
    let most = recording.tool.iter().flatten().map(farthest).fold(0.0, f64::max);
    (most > FARTHEST_M).then(|| {
        format!("x, y, z reach {most:.0} m from the base; they must be in m: are they in millimetres?")
    })
}

/// Rejects a recording that is given twice: the fit would have used held-out data.
///
/// # Errors
/// The recording.
pub fn only_once(recordings: &[PathBuf]) -> Result<(), RecordedError> {
    let is_before = |place: &usize| {
        let (before, this) = (&recordings[..*place], &recordings[*place]);
        before.iter().any(|path| path == this || same_file(path, this))
    };
    let twice = (0..recordings.len()).find(is_before);
    twice.map_or(Ok(()), |place| Err(RecordedError::Twice { file: recordings[place].clone() }))
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use freeplay_recording::Recording;

    use super::{check_times, far_tool};

    fn recording(step: f64, x: f64) -> Recording {
        let rows = 0..10;
        let of = |value: &dyn Fn(f64) -> f64| rows.clone().map(|k| value(f64::from(k))).collect();
        let columns: [(&str, Vec<f64>); 5] = [
            ("t", of(&|k| 1.7e9 + k * step)),
            ("q1", of(&|k| k)),
            ("x", of(&|_| x)),
            ("y", of(&|_| 0.0)),
            ("z", of(&|_| -x)),
        ];
        let columns = columns.into_iter().map(|(name, values)| (name.to_owned(), values)).collect();
        Recording::new(Path::new("run.csv"), columns).expect("a recording")
    }

    #[test]
    fn times_that_are_no_seconds_are_refused_with_the_unit_that_they_seem_to_be_in() {
        for step in [1e-4, 0.02, 0.5] {
            assert!(check_times(&recording(step, 1.0)).is_ok(), "{step}");
        }
        let cases =
            [(4.0, "milliseconds"), (100.0, "milliseconds"), (1e3, "microseconds"), (4e6, "nanoseconds")];
        for (step, unit) in cases {
            let said = check_times(&recording(step, 1.0)).expect_err("refused").to_string();
            assert!(said.contains("run.csv: column t") && said.contains(unit), "{said}");
        }
    }

    #[test]
    fn a_tool_in_millimetres_is_noted() {
        assert_eq!(far_tool(&recording(0.01, 2.1)), None);
        let said = far_tool(&recording(0.01, 812.0)).expect("a note");
        assert!(said.contains("812 m") && said.contains("millimetres"), "{said}");
    }
}
