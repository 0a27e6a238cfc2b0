//! The diagnosis from end to end.

use freeplay_arm::{Arm, ArmFile};
use freeplay_laws::{Effects, LawError, Placed};
use freeplay_recording::Recording;
use thiserror::Error;

use super::candidate::{Candidate, candidates};
use super::choice::choose;
use super::conclude::{Conclusion, insufficient, is_told};
use super::confirm::{confirmed, confirmed_without_events, searched_again};
use super::data::{Data, add};
use super::moments::{happenings, window};
use super::nameless::is_unexplained;
use super::parts::Part;
use super::quality;
use super::report::Diagnosis;
use super::search::Search;
use super::stage::{Ground, Stage};
use super::system::System;
use super::thinning;
use super::tolerance::Tolerances;
use super::weights::Weights;
use crate::error::ResidualError;
use crate::motion::Settings;

/// What a user may choose of a diagnosis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DiagnoseSettings {
    /// The treatment of recordings.
    pub treatment: Settings,
    /// How far a machine may be from its model without that being a finding.
    pub tolerances: Tolerances,
    /// Seed of all random numbers.
    pub seed: u64,
}

impl Default for DiagnoseSettings {
    fn default() -> Self {
        Self { treatment: Settings::default(), tolerances: Tolerances::default(), seed: 1 }
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

/// Locates where `recordings` differ from the model `file`, names what is missing, fits it and shows the gain on the test part of the data, which no step
/// before has seen. `progress` is told what is being done.
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
    let known = Effects::of(file)?;
    let known: Vec<&Placed> = known.placed.iter().collect();
    let mut notes: Vec<String> = recordings.iter().flat_map(|recording| recording.notes.clone()).collect();
    progress("treating the recordings");
    let whole = recordings;
    let recordings = thinning::bounded(recordings, &mut notes);
    let mut grounds = Vec::new();
    for recording in &recordings {
        match Ground::new(&file.arm, recording, &settings.treatment) {
            Ok(ground) => grounds.push(ground),
            Err(short) if short.is_of_a_part(whole) => {
                return Ok(insufficient(file, settings, notes, short.in_a_diagnosis(whole)));
            }
            Err(error) => return Err(error.into()),
        }
    }
    notes.extend(grounds.iter().flat_map(|ground| ground.treatment.notes().to_vec()));
    let stages: Vec<Stage> =
        grounds.iter().map(|ground| Stage::new(&file.arm, &known, ground)).collect::<Result<_, _>>()?;
    let mut data = Data::new(stages, &settings.tolerances);
    if let Some(lack) = quality::lack(&data) {
        return Ok(insufficient(file, settings, notes, lack));
    }
    notes.extend(quality::notes(&data));
    let target = data.target();
    let (candidates, untestable) = candidates(&data, &target, progress);
    let (laid, mut found) = {
        // Pieces of any law look like pushes: what lasts is asked for first.
        let lasting = candidates.into_iter().filter(|candidate| !candidate.kind.happens()).collect();
        let mut search = search(&data, &target, None, lasting, settings).ok_or(DiagnoseError::Singular)?;
        searched(&mut search, progress).ok_or(DiagnoseError::Singular)?
    };
    progress("looking for what happens at a time");
    data.heard = vec![Part::Fit, Part::Choice, Part::Test];
    // Nothing tells a push from the knocks of parts that come apart and meet again.
    let (mut happened, mut left) = if found.members.iter().any(|candidate| candidate.kind.shakes) {
        (Vec::new(), found.left)
    } else {
        found.members.retain(|candidate| !candidate.kind.happens());
        let sizes = Weights::new(&data, &target, Some(&found.left_by_what_lasts), settings.seed);
        // Where the rows are exact nothing wanders, and nothing happens that the laws don't say.
        happenings(&data, found.left_by_what_lasts.clone(), &sizes)
            .unwrap_or_else(|| (Vec::new(), found.left_by_what_lasts.clone()))
    };
    let ends = |candidate: &&Candidate| window(&candidate.form.shape).is_some();
    let moments: Vec<&Candidate> = found.members.iter().chain(&happened).filter(ends).collect();
    if !data.give_moments(&moments) {
        // What happens nearly always does not happen at a time: a law without a name says it.
        (happened, left) = (Vec::new(), found.left_by_what_lasts);
    }
    data.heard = vec![Part::Fit, Part::Choice];
    let mut search = search(&data, &target, Some(&left), laid, settings).ok_or(DiagnoseError::Singular)?;
    let mut members: Vec<usize> =
        found.members.into_iter().filter_map(|candidate| search.system.take(candidate)).collect();
    for candidate in happened {
        // Where laws are off the same way for a while, white rows believe an event too readily.
        let Some(index) = search.system.take(candidate) else { continue };
        let with = [members.clone(), vec![index]].concat();
        let values = [&members, &with].map(|members| search.system.fit(members).map(|fit| fit.value));
        if let [Some(without), Some(value)] = values
            && is_told(value - without)
        {
            members = with;
        }
    }
    progress("confirming what was found");
    let answer = confirmed(&mut search, members, progress).ok_or(DiagnoseError::Singular)?;
    let mut answer =
        confirmed_without_events(&mut search, answer, progress).ok_or(DiagnoseError::Singular)?;
    let fit = search.system.held_fit(&answer.members).ok_or(DiagnoseError::Singular)?;
    if is_unexplained(&search.system, &fit, &search.system.weights) {
        // Something is left: with all that may be seen another answer may say it.
        answer = searched_again(&mut search, &answer, progress).ok_or(DiagnoseError::Singular)?;
    }
    progress("testing");
    let conclusion = Conclusion { file, settings, search: &mut search, answer: &answer };
    conclusion.diagnosis(notes, untestable)?.ok_or(DiagnoseError::Singular)
}

/// A search among `candidates` by the rows of `data` that are heard, of which `target` is what the model as given leaves, and `left` what is left with all that is
/// known so far; `None` if the system is singular.
fn search<'d, 'a>(
    data: &'d Data<'a>,
    target: &[Vec<f64>],
    left: Option<&[Vec<f64>]>,
    candidates: Vec<Candidate>,
    settings: &DiagnoseSettings,
) -> Option<Search<'d, 'a>> {
    let weights = Weights::new(data, target, left, settings.seed);
    let system = System::new(data, target.to_vec(), weights)?;
    Some(Search::new(system, candidates))
}

/// What a search found, for the next one.
struct Found {
    /// The effects.
    members: Vec<Candidate>,
    /// What they leave of every row.
    left: Vec<Vec<f64>>,
    /// What those of them leave that do not happen at a time.
    left_by_what_lasts: Vec<Vec<f64>>,
}

/// The most probable answer of `search` by the fit and the choice part, and all candidates as they are beside it; `None` if the system is singular.
fn searched(search: &mut Search, progress: &mut dyn FnMut(&str)) -> Option<(Vec<Candidate>, Found)> {
    progress("searching");
    search.run(&[], progress)?;
    progress("choosing between the best answers");
    let answer = choose(search)?;
    let answer = search.agreed(&answer)?;
    let fit = search.system.held_fit(&answer.members)?;
    let candidates = |indices: &[usize]| -> Vec<Candidate> {
        indices.iter().map(|&index| search.system.candidate(index).clone()).collect()
    };
    let left = search.system.left(&fit);
    let columns = search.system.columns(&fit.members).zip(fit.beta.iter().copied());
    let happens = fit.members.iter().flat_map(|&member| {
        let candidate = search.system.candidate(member);
        std::iter::repeat_n(candidate.kind.happens(), candidate.size())
    });
    let mut left_by_what_lasts = left.clone();
    for ((column, x), _) in columns.zip(happens).filter(|(_, happens)| *happens) {
        add(&mut left_by_what_lasts, column, x);
    }
    let found = Found { members: candidates(&answer.members), left, left_by_what_lasts };
    Some((candidates(&search.laid), found))
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
