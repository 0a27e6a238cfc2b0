//! A diagnosis that asks first whether recording and model mean the same.

use freeplay_arm::ArmFile;
use freeplay_recording::Recording;

use super::conclude::insufficient;
use super::engine::{self, DiagnoseError, DiagnoseSettings};
use super::report::{Diagnosis, Verdict};
use crate::conventions::{Certainty, Mended, SetupFinding, sentences};
use crate::servo::{self, commands_alone};

/// Locates where `recordings` differ from the model `file`, names what is missing, fits it and shows the gain on held-out data.
///
/// Before, it asks whether recordings and model mean the same: units, signs, order, zeros, gravity, clocks. What is surely wrong there makes the verdict
/// [`Verdict::Setup`], and all else is said of the mended reading. A sure fault that can't be mended ends the diagnosis.
///
/// # Errors
/// See [`DiagnoseError`].
pub fn diagnose(
    file: &ArmFile,
    recordings: &[Recording],
    settings: &DiagnoseSettings,
    progress: &mut dyn FnMut(&str),
) -> Result<Diagnosis, DiagnoseError> {
    engine::check(&file.arm, recordings)?;
    progress("asking whether recording and model mean the same");
    let mended = Mended::of(file, recordings);
    let statement = in_words(&mended.findings);
    if let Some(why) = &mended.stop {
        let advice: Vec<String> = mended.findings.iter().map(|finding| finding.remedy.clone()).collect();
        let mut stopped = insufficient(file, settings, Vec::new(), format!("{why}; {}", advice.join(" ")));
        stopped.verdict = Verdict::Setup;
        stopped.statement = format!("{statement} There is nothing to diagnose before this is mended.");
        stopped.next = advice;
        stopped.setup = mended.findings;
        return Ok(stopped);
    }
    if !mended.is_mended() {
        let mut diagnosis = by_channels(file, recordings, settings, progress)?;
        diagnosis.setup = mended.findings;
        return Ok(diagnosis);
    }
    let mut diagnosis = by_channels(&mended.file, &mended.recordings, settings, progress)?;
    diagnosis.statement = format!("{statement} With that reading: {}", diagnosis.statement);
    diagnosis.verdict = Verdict::Setup;
    diagnosis.setup = mended.findings;
    diagnosis.mapping = mended.mapping;
    Ok(diagnosis)
}

impl Diagnosis {
    /// True if a set-up fault that can't be mended ended the diagnosis before anything was compared: the model is then as given.
    pub fn ends_at_setup(&self) -> bool {
        self.verdict == Verdict::Setup
            && self.fit.is_none()
            && self.mapping.is_none()
            && self.noise.is_empty()
    }
}

/// By torques and poses, and by commanded positions beside them; where there are only commanded and measured positions, by these.
fn by_channels(
    file: &ArmFile,
    recordings: &[Recording],
    settings: &DiagnoseSettings,
    progress: &mut dyn FnMut(&str),
) -> Result<Diagnosis, DiagnoseError> {
    if recordings.iter().all(commands_alone) {
        return servo::diagnose(file, recordings, settings, progress);
    }
    let diagnosis = engine::diagnose(file, recordings, settings, progress)?;
    servo::add_servos(file, recordings, settings, diagnosis, progress)
}

fn in_words(findings: &[SetupFinding]) -> String {
    let sure = sentences(findings).into_iter().filter(|(certainty, ..)| *certainty == Certainty::Sure);
    sure.map(|(_, statement, _)| statement).collect::<Vec<_>>().join(" ")
}
