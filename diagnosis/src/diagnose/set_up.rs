//! A diagnosis that first tests whether recording and model use the same conventions.

use freeplay_model::ArmFile;
use freeplay_recording::Recording;

use super::engine;
use crate::conventions::{Certainty, Late, Mended, SetupFinding, clock_unsure, sentences};
use crate::data::tolerance::Of;
use crate::report::diagnosis::{Diagnosis, Tuned, Verdict, insufficient};
use crate::report::settings::{DiagnoseError, DiagnoseSettings};
use crate::servo;
use crate::servo::commands_alone;

/// Locates the differences between `recordings` and the model `file`, names the missing effects, fits them and measures the gain on held-out data.
///
/// First it tests whether recordings and model use the same conventions: units, signs, order, zeros, gravity, clocks. A certain fault makes the verdict
/// [`Verdict::Setup`], and all other results hold for the corrected reading. A certain fault without a correction ends the diagnosis.
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
    progress("checking that recording and model use the same conventions");
    let mut mended = Mended::of(file, recordings);
    if let Some(why) = &mended.stop {
        let advice: Vec<String> = mended.findings.iter().map(|finding| finding.remedy.clone()).collect();
        let mut stopped = insufficient(file, settings, Vec::new(), format!("{why}; {}", advice.join(" ")));
        stopped.verdict = Verdict::Setup;
        stopped.statement =
            format!("{} No diagnosis is possible until this is corrected.", in_words(&mended.findings));
        stopped.next = advice;
        stopped.setup = mended.findings;
        return Ok(stopped);
    }
    if !mended.is_mended() {
        let mut diagnosis = by_channels(file, recordings, settings, progress)?;
        diagnosis.setup = mended.findings;
        return Ok(diagnosis);
    }
    let (late, zeros) = (mended.late(), mended.fitted_zeros());
    if late.is_some() || !zeros.is_empty() {
        progress("estimating the correction together with the missing effects");
        let (later, farther) = together(&mended, late, &zeros, settings, progress)?;
        mended.refine(file, recordings, late.map(|late| (late, later)), &farther);
    }
    let mut diagnosis = by_channels(&mended.file, &mended.recordings, settings, progress)?;
    diagnosis.statement =
        format!("{} With this correction: {}", in_words(&mended.findings), diagnosis.statement);
    diagnosis.verdict = Verdict::Setup;
    diagnosis.setup = mended.findings;
    diagnosis.mapping = mended.mapping;
    Ok(diagnosis)
}

/// The correction of the delay of the channels `late`, s, and that of the `zeros` of joints, by number, rad. They were estimated in the `mended` recordings
/// before the missing physics were known; this diagnosis fits all together.
fn together(
    mended: &Mended,
    late: Option<Late>,
    zeros: &[usize],
    settings: &DiagnoseSettings,
    progress: &mut dyn FnMut(&str),
) -> Result<(f64, Vec<(usize, f64)>), DiagnoseError> {
    let mut tolerances = settings.tolerances;
    if late.is_some() {
        tolerances.delay = tolerances.delay.max(clock_unsure());
    }
    let settings = DiagnoseSettings { tolerances, ..*settings };
    let diagnosis = engine::diagnose(&mended.file, &mended.recordings, &settings, zeros, progress)?;
    // With torques and tool on one clock, the tool determines the delay better: geometry lacks no physics.
    let asked = if late == Some(Late::Torque) { Late::Torque } else { Late::Tool };
    let later = |tuned: &Tuned| match tuned.of {
        Of::Delay(late, seconds) if late == asked => Some(tuned.deviations * seconds),
        _ => None,
    };
    let farther = |tuned: &Tuned| match tuned.of {
        Of::FittedZero(joint, deviation) => Some((joint, tuned.deviations * deviation)),
        _ => None,
    };
    let tuned = &diagnosis.tuned;
    Ok((tuned.iter().find_map(later).unwrap_or_default(), tuned.iter().filter_map(farther).collect()))
}

impl Diagnosis {
    /// Returns true if the model is a result: the program compared recording and model, or corrected gravity in the model. Otherwise the model is the given
    /// one, and nothing supports it.
    pub fn has_model(&self) -> bool {
        self.fit.is_some() || self.has_other_gravity()
    }

    /// True if the model differs from the given one.
    pub fn changes_model(&self) -> bool {
        !self.effects.is_empty() && self.fit.is_some() || self.has_other_gravity()
    }

    fn has_other_gravity(&self) -> bool {
        let is_mended =
            |finding: &SetupFinding| finding.certainty == Certainty::Sure && finding.gravity.is_some();
        self.verdict == Verdict::Setup && self.setup.iter().any(is_mended)
    }
}

/// Diagnoses torques and poses, and the commanded positions beside them; recordings with only commanded and measured positions by these.
fn by_channels(
    file: &ArmFile,
    recordings: &[Recording],
    settings: &DiagnoseSettings,
    progress: &mut dyn FnMut(&str),
) -> Result<Diagnosis, DiagnoseError> {
    if recordings.iter().all(commands_alone) {
        return servo::diagnose(file, recordings, settings, progress);
    }
    let diagnosis = engine::diagnose(file, recordings, settings, &[], progress)?;
    servo::add_servos(file, recordings, settings, diagnosis, progress)
}

fn in_words(findings: &[SetupFinding]) -> String {
    let sure = sentences(findings).into_iter().filter(|(certainty, ..)| *certainty == Certainty::Sure);
    sure.map(|(_, statement, _)| statement).collect::<Vec<_>>().join(" ")
}
