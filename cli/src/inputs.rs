//! Recordings that a command is given.

use std::path::{Path, PathBuf};

use freeplay_arm::ArmFile;
use freeplay_diagnosis::recorded;
use freeplay_recording::Recording;
use freeplay_terminal::exit::Failure;
use freeplay_terminal::messages;

/// Reads a recording of the arm in `file`, which was named `model`.
///
/// # Errors
/// A recording that cannot be compared with the model, as bad input.
pub fn recording(path: &Path, model: &str, file: &ArmFile) -> Result<Recording, Failure> {
    let recording = recorded::read(path, model, file).map_err(Failure::input)?;
    messages::detail(format_args!(
        "read {}: {} samples of {} joints, {:.1} s at {:.0} Hz",
        path.display(),
        recording.len(),
        recording.joints(),
        recording.duration(),
        recording.rate_hz()
    ));
    Ok(recording)
}

/// Refuses a recording that is named twice.
///
/// # Errors
/// The recording, as bad usage.
pub fn only_once(recordings: &[PathBuf]) -> Result<(), Failure> {
    recorded::only_once(recordings).map_err(Failure::usage)
}
