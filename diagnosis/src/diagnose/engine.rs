//! The diagnosis from end to end.

use freeplay_arm::{Arm, ArmFile};
use freeplay_laws::{Effects, LawError, Placed};
use freeplay_recording::Recording;
use thiserror::Error;

use super::candidate::{Candidate, candidates};
use super::choice::choose;
use super::conclude::{Conclusion, insufficient};
use super::confirm::{confirmed, searched_again};
use super::data::{Data, add_all, less};
use super::event::{Event, said_by};
use super::moments::happenings;
use super::nameless::is_unexplained;
use super::parts::Part;
use super::quality;
use super::report::{Diagnosis, Untestable};
use super::search::{Answer, Found, Search};
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
    let data = Data::new(stages, &settings.tolerances);
    if let Some(lack) = quality::lack(&data) {
        return Ok(insufficient(file, settings, notes, lack));
    }
    notes.extend(quality::notes(&data));
    let target = data.target();
    let (candidates, untestable) = candidates(&data, progress);
    let (laid, found) = {
        // Pieces of any law look like pushes: what lasts is asked for first.
        let lasting = candidates.into_iter().filter(|candidate| !candidate.kind.happens()).collect();
        let mut search = search(&data, &target, None, lasting, settings).ok_or(DiagnoseError::Singular)?;
        searched(&mut search, progress).ok_or(DiagnoseError::Singular)?
    };
    let study = Study { file, settings, target: &target, laid, notes, untestable };
    study.concluded(data, found, progress)
}

/// What a diagnosis rests on once laws that last were searched for.
struct Study<'s> {
    file: &'s ArmFile,
    settings: &'s DiagnoseSettings,
    /// The model as given leaves this of every row.
    target: &'s [Vec<f64>],
    /// All laws that last, as they are beside what was found.
    laid: Vec<Candidate>,
    notes: Vec<String>,
    untestable: Vec<Untestable>,
}

impl Study<'_> {
    /// The diagnosis from what the search `found` in `data`, and from what happened beside it.
    fn concluded(
        self,
        mut data: Data,
        found: Found,
        progress: &mut dyn FnMut(&str),
    ) -> Result<Diagnosis, DiagnoseError> {
        progress("looking for what happens at a time");
        let parts = data.parts.clone();
        let mut events = self.happened_beside(&mut data, &found, &[]);
        if !data.give_moments(&all_of(&[&events])) {
            // What happens nearly always does not happen at a time: a law without a name says it.
            events.clear();
        }
        data.heard = vec![Part::Fit, Part::Choice];
        progress("confirming what was found");
        let left = less(&found.left, &said_by(&events, self.target));
        let with = {
            let (mut search, members) = self.search(&data, &events, &left, &found.members)?;
            let answer = confirmed(&mut search, members, progress).ok_or(DiagnoseError::Singular)?;
            if events.is_empty() {
                return self.conclusion(&mut search, answer, &events, progress);
            }
            search.found(&answer).ok_or(DiagnoseError::Singular)?
        };
        // A law that is found late says what seemed to happen.
        let without = {
            let (mut search, members) = self.search(&data, &[], &found.left, &with.members)?;
            let answer = confirmed(&mut search, members, progress).ok_or(DiagnoseError::Singular)?;
            let answer = explained(&mut search, answer, progress).ok_or(DiagnoseError::Singular)?;
            search.found(&answer).ok_or(DiagnoseError::Singular)?
        };
        progress("looking for what happens at a time");
        let mut members = with.members.clone();
        events = self.happened_beside(&mut data, &with, &events);
        data.parts.clone_from(&parts);
        if are_the_same(&with.members, &without.members) {
            data.give_moments(&all_of(&[&events]));
        } else {
            let others = self.happened_beside(&mut data, &without, &[]);
            data.give_moments(&all_of(&[&events, &others]));
            let of_with = self.evidence(&data, &events, &left, &members)?;
            let of_without = self.evidence(&data, &others, &left, &without.members)?;
            if of_without > of_with {
                (members, events) = (without.members, others);
            }
        }
        let (mut search, members) = self.search(&data, &events, &left, &members)?;
        let answer = confirmed(&mut search, members, progress).ok_or(DiagnoseError::Singular)?;
        self.conclusion(&mut search, answer, &events, progress)
    }

    /// What happens at a time beside what was `found`, in all parts. Nothing tells a push from the knocks of parts that come apart and meet again.
    fn happened_beside(&self, data: &mut Data, found: &Found, events: &[Event]) -> Vec<Event> {
        if found.members.iter().any(|candidate| candidate.kind.shakes) {
            return Vec::new();
        }
        // What the search did not see is left, too.
        let mut left = found.left.clone();
        add_all(&mut left, events.iter().flat_map(Event::columns));
        let heard = std::mem::replace(&mut data.heard, Part::ALL.to_vec());
        let sizes = Weights::new(data, self.target, Some(&left), self.settings.seed);
        // Where the rows are exact nothing wanders, and nothing happens that the laws don't say.
        let happened = happenings(data, &left, &self.laid, &sizes, self.settings.seed).unwrap_or_default();
        data.heard = heard;
        happened
    }

    /// The search by the rows of `data` that are heard, less what the `events` say, where so much is `left` with all that is known; and the numbers of its `members`.
    fn search<'d, 'a>(
        &self,
        data: &'d Data<'a>,
        events: &[Event],
        left: &[Vec<f64>],
        members: &[Candidate],
    ) -> Result<(Search<'d, 'a>, Vec<usize>), DiagnoseError> {
        let target = less(self.target, &said_by(events, self.target));
        let mut search = search(data, &target, Some(left), self.laid.clone(), self.settings)
            .ok_or(DiagnoseError::Singular)?;
        let members = members.iter().filter_map(|one| search.system.take(one.clone())).collect();
        Ok((search, members))
    }

    /// The log of the evidence of `members` and `events` together.
    fn evidence(
        &self,
        data: &Data,
        events: &[Event],
        left: &[Vec<f64>],
        members: &[Candidate],
    ) -> Result<f64, DiagnoseError> {
        let (mut search, members) = self.search(data, events, left, members)?;
        let answer = search.settled(members).ok_or(DiagnoseError::Singular)?;
        Ok(answer.evidence + events.iter().map(|event| event.log_prior).sum::<f64>())
    }

    /// The diagnosis of `answer`, or of what the search finds with all that may be seen, where `answer` leaves something.
    fn conclusion(
        self,
        search: &mut Search,
        answer: Answer,
        events: &[Event],
        progress: &mut dyn FnMut(&str),
    ) -> Result<Diagnosis, DiagnoseError> {
        let answer = explained(search, answer, progress).ok_or(DiagnoseError::Singular)?;
        progress("testing");
        let Self { file, settings, target, notes, untestable, .. } = self;
        let conclusion = Conclusion { file, settings, search, answer: &answer, events, target };
        conclusion.diagnosis(notes, untestable)?.ok_or(DiagnoseError::Singular)
    }
}

/// `answer`, or, where it leaves something, what the search finds with all that may be seen; `None` if the system is singular.
fn explained(search: &mut Search, answer: Answer, progress: &mut dyn FnMut(&str)) -> Option<Answer> {
    let fit = search.system.held_fit(&answer.members)?;
    if is_unexplained(&search.system, &fit, &search.system.weights) {
        searched_again(search, &answer, progress)
    } else {
        Some(answer)
    }
}

/// The candidates of all `events`.
fn all_of<'e>(events: &[&'e [Event]]) -> Vec<&'e Candidate> {
    events.iter().flat_map(|events| events.iter().map(|event| &event.candidate)).collect()
}

/// Whether `one` and `other` are the same effects in whatever form.
fn are_the_same(one: &[Candidate], other: &[Candidate]) -> bool {
    one.len() == other.len() && one.iter().all(|one| other.iter().any(|other| one.same_effect(other)))
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

/// The most probable answer of `search` by the fit and the choice part, and all candidates as they are beside it; `None` if the system is singular.
fn searched(search: &mut Search, progress: &mut dyn FnMut(&str)) -> Option<(Vec<Candidate>, Found)> {
    progress("searching");
    search.run(&[], progress)?;
    progress("choosing between the best answers");
    let answer = choose(search)?;
    let answer = search.agreed(&answer)?;
    Some((search.candidates(&search.laid), search.found(&answer)?))
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
