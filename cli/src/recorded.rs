//! A recording of the arm that a model describes: read, and looked at for what stands in another unit than it should.

use std::path::{Path, PathBuf};

use freeplay_arm::ArmFile;
use freeplay_diagnosis::{Reading, SetupFinding, time_unit};
use freeplay_recording::{ColumnError, Mapping, ReadError, Recording};

use crate::exit::Failure;
use crate::voice;

/// No arm reaches farther, m.
const FARTHEST_M: f64 = 30.0;

/// Reads a recording of the arm in `file`, which was named `model`, its columns as `mapping` says. What may be in another unit is noted in it.
///
/// # Errors
/// The reader's own; another number of joints; times that are no seconds.
pub fn read(path: &Path, model: &str, file: &ArmFile, mapping: Option<&Path>) -> Result<Recording, Failure> {
    let mut recording = match mapping {
        None => {
            let read = freeplay_recording::read(path, Some(file.arm.dof()));
            read.map_err(|error| unreadable(&error, model, file))?
        }
        Some(mapping) => mapped(path, file, mapping)?,
    };
    check_times(&recording)?;
    recording.notes.extend(far_tool(&recording));
    voice::detail(format_args!(
        "read {}: {} samples of {} joints, {:.1} s at {:.0} Hz",
        path.display(),
        recording.len(),
        recording.joints(),
        recording.duration(),
        recording.rate_hz()
    ));
    Ok(recording)
}

/// A CSV as `mapping` says; where the arm's weight is missing from its torques, with it.
fn mapped(path: &Path, file: &ArmFile, mapping: &Path) -> Result<Recording, Failure> {
    let mapping = Mapping::load(mapping).map_err(Failure::input)?;
    let recording = freeplay_recording::import_csv(path, &mapping).map_err(Failure::input)?;
    if !mapping.is_gravity_compensated() || recording.joints() != file.arm.dof() {
        return Ok(recording);
    }
    let reading = Reading { gravity_added: true, ..Reading::plain(file.arm.dof()) };
    Ok(reading.mended(&file.arm, &recording))
}

/// The reader's error; where the number of joints differs, with what the model says of its own.
fn unreadable(error: &ReadError, model: &str, file: &ArmFile) -> Failure {
    let ReadError::Columns { source: ColumnError::JointCount { .. }, .. } = error else {
        return Failure::input(error);
    };
    let joints: Vec<&str> = file.arm.joints().iter().map(|joint| joint.name.as_str()).collect();
    let locked = file.ignored.iter().filter(|note| note.contains("locked"));
    let locked: String = locked.map(|note| format!("; {note}")).collect();
    Failure::input(format!("{error} The joints of {model} are {}{locked}", joints.join(", ")))
}

/// Refuses times that are no seconds.
fn check_times(recording: &Recording) -> Result<(), Failure> {
    let Some(SetupFinding { statement, remedy, .. }) = time_unit(recording) else { return Ok(()) };
    let origin = recording.origin.display();
    Err(Failure::input(format!("{origin}: column t: {statement} {remedy}")))
}

/// A tool that is farther away than any arm reaches.
fn far_tool(recording: &Recording) -> Option<String> {
    let farthest = |axis: &Vec<f64>| axis.iter().fold(0.0, |most: f64, value| most.max(value.abs()));
    let most = recording.tool.iter().flatten().map(farthest).fold(0.0, f64::max);
    (most > FARTHEST_M)
        .then(|| format!("x, y, z go up to {most:.0} m from the base: millimetres? they should be in m"))
}

/// Refuses a recording that is given twice: it would be held out from a fit that has seen it.
///
/// # Errors
/// The recording.
pub fn only_once(recordings: &[PathBuf]) -> Result<(), Failure> {
    let real = |path: &PathBuf| std::fs::canonicalize(path).unwrap_or_else(|_| path.clone());
    let all: Vec<PathBuf> = recordings.iter().map(real).collect();
    let twice = (0..all.len()).find(|&place| all[..place].contains(&all[place]));
    twice.map_or(Ok(()), |place| {
        Err(Failure::usage(format!(
            "--recording {}: is given twice, and what is held out has to be another one: name each once",
            recordings[place].display()
        )))
    })
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
            let said = check_times(&recording(step, 1.0)).expect_err("refused").message;
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
