//! A diagnosis that first tests whether recording and model use the same conventions.

use freeplay_model::ArmFile;
use freeplay_recording::Recording;

use super::engine;
use crate::conventions::{Certainty, Late, Mended, SetupFinding, clock_unsure, sentences};
use crate::data::tolerance::{Of, Tolerances};
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
    if let Some(late) = mended.late() {
        progress("estimating the clock offset together with the missing effects");
        let later = later(&mended, late, settings, progress)?;
        mended.set_clock(file, recordings, late, later);
    }
    let mut diagnosis = by_channels(&mended.file, &mended.recordings, settings, progress)?;
    diagnosis.statement =
        format!("{} With this correction: {}", in_words(&mended.findings), diagnosis.statement);
    diagnosis.verdict = Verdict::Setup;
    diagnosis.setup = mended.findings;
    diagnosis.mapping = mended.mapping;
    Ok(diagnosis)
}

/// The correction of the delay of the channels `late`, s. The delay in the `mended` recordings was estimated before the missing physics were known; this
/// diagnosis fits both together.
fn later(
    mended: &Mended,
    late: Late,
    settings: &DiagnoseSettings,
    progress: &mut dyn FnMut(&str),
) -> Result<f64, DiagnoseError> {
    let tolerances =
        Tolerances { delay: settings.tolerances.delay.max(clock_unsure()), ..settings.tolerances };
    let unsure = DiagnoseSettings { tolerances, ..*settings };
    let diagnosis = engine::diagnose(&mended.file, &mended.recordings, &unsure, progress)?;
    // With torques and tool on one clock, the tool determines the delay better: geometry lacks no physics.
    let asked = if late == Late::Torque { Late::Torque } else { Late::Tool };
    let of = |tuned: &Tuned| match tuned.of {
        Of::Delay(late, seconds) if late == asked => Some(tuned.deviations * seconds),
        _ => None,
    };
    Ok(diagnosis.tuned.iter().find_map(of).unwrap_or_default())
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
    let diagnosis = engine::diagnose(file, recordings, settings, progress)?;
    servo::add_servos(file, recordings, settings, diagnosis, progress)
}

fn in_words(findings: &[SetupFinding]) -> String {
    let sure = sentences(findings).into_iter().filter(|(certainty, ..)| *certainty == Certainty::Sure);
    sure.map(|(_, statement, _)| statement).collect::<Vec<_>>().join(" ")
}
