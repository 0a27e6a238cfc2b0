//! The diagnosis from end to end.

use freeplay_arm::{Arm, ArmFile};
use freeplay_laws::{Effects, LawError, Placed};
use freeplay_recording::Recording;
use thiserror::Error;

use super::case::Case;
use super::conclude::Conclusion;
use super::floor::null;
use super::hypothesis::hypotheses;
use super::judge::{Judge, Turn};
use super::parts::{Held, Parts, file_name};
use super::quality;
use super::report::{Diagnosis, Verdict};
use super::robust::Numbers;
use super::search::Search;
use super::stage::{Ground, Stage};
use super::tolerance::Tolerances;
use crate::error::ResidualError;
use crate::motion::Settings;

/// What a user may choose of a diagnosis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DiagnoseSettings {
    /// The treatment of recordings.
    pub treatment: Settings,
    /// How far a machine may be from its model without that being a finding.
    pub tolerances: Tolerances,
    /// Number of twins; more make the thresholds surer.
    pub twins: usize,
    /// Seed of twins and intervals.
    pub seed: u64,
}

impl Default for DiagnoseSettings {
    fn default() -> Self {
        Self { treatment: Settings::default(), tolerances: Tolerances::default(), twins: 24, seed: 1 }
    }
}

/// Why there is no diagnosis.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum DiagnoseError {
    /// No recording.
    #[error("no recording: give at least one")]
    NoRecording,
    /// The recordings don't hold the same columns.
    #[error("{first} and {other} hold different columns; diagnose them one by one, or record the same")]
    DifferentColumns {
        /// The first recording.
        first: String,
        /// One that differs.
        other: String,
    },
    /// Model and recording can't be compared.
    #[error(transparent)]
    Residual(#[from] ResidualError),
    /// The effects of the model can't be taken.
    #[error("the model's effects: {0}")]
    Law(#[from] LawError),
    /// The numbers of this recording are beyond double precision.
    #[error(
        "the fit of the model's tolerances to this recording is singular; are q in rad (or m), tau in N*m and t in s?"
    )]
    Singular,
}

/// Locates where `recordings` differ from the model `file`, names what is missing, fits it and shows the gain on held-out data: the last
/// of several recordings, or the last 30 % of the only one. Where so nothing has a name, the first recording is held out, or else the last 30 % of
/// each: some of them may show what the others don't. `progress` is told what is being done.
///
/// # Errors
/// See [`DiagnoseError`].
pub(crate) fn diagnose(
    file: &ArmFile,
    recordings: &[Recording],
    settings: &DiagnoseSettings,
    progress: &mut dyn FnMut(&str),
) -> Result<Diagnosis, DiagnoseError> {
    check(&file.arm, recordings)?;
    let last = recordings.len() - 1;
    let diagnosis = judged_on(Held::Recording(last), file, recordings, settings, progress)?;
    if diagnosis.verdict != Verdict::Unknown || !diagnosis.effects.is_empty() || last == 0 {
        return Ok(diagnosis);
    }
    for (held, words) in
        [(Held::Recording(0), "the first recording"), (Held::Ends, "the end of each recording")]
    {
        progress(&format!("nothing has a name: once more with {words} held out"));
        let mut other = judged_on(held, file, recordings, settings, progress)?;
        if matches!(other.verdict, Verdict::Named | Verdict::OneOf) {
            other.quality.push(format!(
                "what is named shows too little in the other recordings for a name: {} takes part in the fit",
                file_name(&recordings[last])
            ));
            return Ok(other);
        }
    }
    Ok(diagnosis)
}

/// The diagnosis with `held` of several recordings held out.
fn judged_on(
    held: Held,
    file: &ArmFile,
    recordings: &[Recording],
    settings: &DiagnoseSettings,
    progress: &mut dyn FnMut(&str),
) -> Result<Diagnosis, DiagnoseError> {
    let known = Effects::of(file)?;
    let known: Vec<&Placed> = known.placed.iter().collect();
    let parts = Parts::of(recordings, held);
    let mut notes: Vec<String> = recordings.iter().flat_map(|recording| recording.notes.clone()).collect();
    notes.extend(parts.notes.iter().cloned());
    progress("treating the recordings");
    let grounds =
        |recordings| -> Result<Vec<Ground>, ResidualError> { grounds_of(&file.arm, recordings, settings) };
    let (fitted, mut held) = match (grounds(&parts.fitted), grounds(&parts.held)) {
        (Ok(fitted), Ok(held)) => (fitted, held),
        (Err(short), _) | (_, Err(short)) if short.is_of_a_part(recordings) => {
            return Ok(Conclusion::insufficient(file, settings, notes, short.in_a_diagnosis(recordings)));
        }
        (Err(error), _) | (_, Err(error)) => return Err(error.into()),
    };
    // What was no measurement in all of the fit has nothing to be judged by.
    held.iter_mut().for_each(|held| held.silence_as(&fitted));
    notes.extend(fitted.iter().flat_map(|ground| ground.treatment.notes().to_vec()));
    if let Some(lack) = quality::lack(&file.arm, &fitted, &held) {
        return Ok(Conclusion::insufficient(file, settings, notes, lack));
    }
    let fitted = Case::new(stages_of(&file.arm, &known, &fitted)?, &settings.tolerances);
    let held = Case::new(stages_of(&file.arm, &known, &held)?, &settings.tolerances);
    notes.extend(quality::notes(&fitted));
    let system = fitted.system(fitted.target());
    let (hypotheses, untestable) = hypotheses(&fitted, &system, progress);
    progress("asking twins of the model what is found in nothing");
    let null = null(&fitted, &system, &hypotheses, &settings.tolerances, settings.twins, settings.seed)
        .ok_or(DiagnoseError::Singular)?;
    progress("searching");
    let mut search = Search::new(&fitted, system, hypotheses, null);
    search.run(progress).ok_or(DiagnoseError::Singular)?;
    progress("judging on held-out data");
    // Without a finding nothing is to be judged, and a part in which the arm stands can't.
    let is_found = !search.chosen.is_empty();
    let parted = if is_found { parts.turns.as_slice() } else { &[] };
    let of_turns: Vec<[Vec<Ground>; 2]> = parted
        .iter()
        .filter_map(|[fitted, held]| Some([grounds(fitted).ok()?, grounds(held).ok()?]))
        .collect();
    let case = |grounds| -> Result<Case, LawError> {
        Ok(Case::new(stages_of(&file.arm, &known, grounds)?, &settings.tolerances))
    };
    let turns = of_turns.iter().map(|turn| Ok(Turn { fitted: case(&turn[0])?, held: case(&turn[1])? }));
    let turns = turns.collect::<Result<Vec<_>, LawError>>()?;
    let judge = Judge::new(&search, &held, &turns, settings).ok_or(DiagnoseError::Singular)?;
    let known: Vec<usize> = search.chosen.iter().map(|chosen| chosen.hypothesis).collect();
    let proofs = judge.sift(&mut search, progress)?.ok_or(DiagnoseError::Singular)?;
    let proofs = judge.simplify(proofs, &known, &mut search, progress)?.ok_or(DiagnoseError::Singular)?;
    let proofs = judge.surely(proofs, &mut search, progress)?.ok_or(DiagnoseError::Singular)?;
    search.agree().ok_or(DiagnoseError::Singular)?;
    let is_found = !search.chosen.is_empty();
    let of_whole = grounds(&parts.whole).ok().filter(|grounds| is_found && !grounds.is_empty());
    let whole = of_whole.as_deref().map(case).transpose()?;
    let others: Vec<&Case> = whole.iter().chain([&held]).collect();
    search.lay_upon_found(&others)?.ok_or(DiagnoseError::Singular)?;
    // Without a whole, the numbers are those of the search, unless tolerances have to go through sensors.
    let is_behind = (0..search.chosen.len()).any(|index| search.named(index).is_read);
    let given = whole.as_ref().or(is_behind.then_some(&fitted));
    let whole = given.map(|case| search.given_on(case)).transpose()?.flatten();
    let whole = whole.filter(Search::is_possible);
    let of_whole = whole.as_ref().and_then(Numbers::of);
    let numbers = Numbers::of(&search).ok_or(DiagnoseError::Singular)?;
    let conclusion = Conclusion {
        file,
        settings,
        search: &search,
        numbers: &numbers,
        whole: whole.as_ref().zip(of_whole.as_ref()),
        judge: &judge,
        proofs: &proofs,
        data: &parts.how,
    };
    conclusion.diagnosis(notes, untestable)?.ok_or(DiagnoseError::Singular)
}

fn grounds_of<'r>(
    arm: &Arm,
    recordings: &'r [Recording],
    settings: &DiagnoseSettings,
) -> Result<Vec<Ground<'r>>, ResidualError> {
    recordings.iter().map(|recording| Ground::new(arm, recording, &settings.treatment)).collect()
}

fn stages_of<'a>(
    arm: &'a Arm,
    known: &[&'a Placed],
    grounds: &'a [Ground<'a>],
) -> Result<Vec<Stage<'a>>, LawError> {
    grounds.iter().map(|ground| Stage::new(arm, known, ground)).collect()
}

/// There are recordings, of this arm, with the same columns.
pub(crate) fn check(arm: &Arm, recordings: &[Recording]) -> Result<(), DiagnoseError> {
    let first = recordings.first().ok_or(DiagnoseError::NoRecording)?;
    let columns = |recording: &Recording| {
        let links: Vec<bool> = recording.q_link.iter().map(Option::is_some).collect();
        (recording.tau.is_some(), recording.tool.is_some(), links)
    };
    for recording in recordings {
        crate::residual::check_joints(arm, recording)?;
        if columns(recording) != columns(first) {
            return Err(DiagnoseError::DifferentColumns {
                first: first.origin.display().to_string(),
                other: recording.origin.display().to_string(),
            });
        }
    }
    Ok(())
}
