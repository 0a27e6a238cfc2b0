//! Several recordings of one machine: one answer.

use freeplay_arm::ArmFile;
use freeplay_recording::Recording;

use super::examine::examine;
use super::finding::{Certainty, Setup, SetupFinding};

/// What is found in recordings of one machine, and these as they are to be read.
pub struct Mended {
    /// What is found, each kind and joint once; what one recording shows for sure holds for all.
    pub findings: Vec<SetupFinding>,
    /// Why no reading makes recordings and model meet.
    pub stop: Option<String>,
    /// The recordings, every sure fault mended; empty where none is.
    pub recordings: Vec<Recording>,
    /// The model under the gravity that the recordings show.
    pub file: ArmFile,
    /// The reading of the last recording that shows a fault, as a mapping file.
    pub mapping: Option<String>,
}

impl Mended {
    /// Asks each of `recordings` against the model `file`.
    pub fn of(file: &ArmFile, recordings: &[Recording]) -> Self {
        let setups: Vec<Setup> = recordings.iter().map(|recording| examine(&file.arm, recording)).collect();
        let mut mended = Self {
            findings: Vec::new(),
            stop: setups.iter().find_map(|setup| setup.stop.clone()),
            recordings: Vec::new(),
            file: file.clone(),
            mapping: None,
        };
        let is_sure = setups.iter().any(Setup::is_sure);
        for finding in setups.iter().flat_map(|setup| &setup.findings) {
            let is_known = |known: &SetupFinding| known.kind == finding.kind && known.joint == finding.joint;
            if !mended.findings.iter().any(is_known) {
                mended.findings.push(finding.clone());
            }
        }
        mended.findings.sort_by_key(|finding| finding.certainty == Certainty::Likely);
        let Some(known) = setups.iter().rev().find(|setup| setup.is_sure()).filter(|_| is_sure) else {
            return mended;
        };
        // A recording that shows nothing by itself is read as the others are.
        let readings =
            setups.iter().map(|setup| if setup.is_sure() { &setup.reading } else { &known.reading });
        let each = recordings.iter().zip(readings.clone());
        mended.recordings = each.map(|(recording, reading)| reading.mended(&file.arm, recording)).collect();
        mended.file.arm = known.reading.arm(&file.arm);
        let last = recordings.iter().zip(readings).rev().find(|(_, reading)| !reading.is_plain());
        mended.mapping = last.and_then(|(recording, reading)| super::mapping::mapping(reading, recording));
        mended
    }

    /// Whether the recordings are to be read otherwise than they stand.
    pub fn is_mended(&self) -> bool {
        !self.recordings.is_empty()
    }
}
