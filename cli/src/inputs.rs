//! The recordings on a command line, and the model for the comparison.

use std::path::{Path, PathBuf};

use freeplay_diagnosis::recorded;
use freeplay_harness::setup::load_selected;
use freeplay_model::{ArmFile, Selection};
use freeplay_recording::{Mapping, Recording};
use freeplay_terminal::exit::Failure;
use freeplay_terminal::messages;

/// A recording as in its file, which may name its joints.
pub struct Measured(Recording, Option<Mapping>);

impl Measured {
    /// Reads the recording at `path`, with its columns according to the mapping file `mapping`.
    ///
    /// # Errors
    /// Errors of the reader, as bad input.
    pub fn read(path: &Path, mapping: Option<&Path>) -> Result<Self, Failure> {
        let mapping = mapping.map(Mapping::load).transpose().map_err(Failure::input)?;
        let recording = recorded::unmatched(path, mapping.as_ref()).map_err(Failure::input)?;
        messages::detail(format_args!(
            "read {}: {} samples of {} joints, {:.1} s at {:.0} Hz",
            path.display(),
            recording.len(),
            recording.joints(),
            recording.duration(),
            recording.rate_hz()
        ));
        Ok(Self(recording, mapping))
    }

    /// The recording as in its file.
    pub fn recording(&self) -> &Recording {
        &self.0
    }

    /// The model `model` with the chain to the link `tip`, or else the one whose joints the recording names.
    ///
    /// # Errors
    /// Errors of the model file, as bad input.
    pub fn model(&self, model: &str, tip: Option<&str>) -> Result<ArmFile, Failure> {
        let joints = self.0.joint_names.clone();
        load_selected(model, &Selection { tip: tip.map(str::to_owned), joints })
    }

    /// The recording of the arm in `file`, which was named `model`.
    ///
    /// # Errors
    /// A recording that cannot be compared with the model, as bad input.
    pub fn for_arm(self, model: &str, file: &ArmFile) -> Result<Recording, Failure> {
        recorded::of_arm(self.0, model, file, self.1.as_ref()).map_err(Failure::input)
    }
}

/// Refuses a recording that is named twice.
///
/// # Errors
/// The recording, as bad usage.
pub fn only_once(recordings: &[PathBuf]) -> Result<(), Failure> {
    recorded::only_once(recordings).map_err(Failure::usage)
}
