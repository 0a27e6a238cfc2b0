//! The diagnosis from end to end.

use freeplay_arm::Arm;
use freeplay_laws::{Effects, Placed};
use freeplay_model::ArmFile;
use freeplay_recording::Recording;

use crate::candidates::candidate::{Candidate, Untestable, candidates};
use crate::candidates::transients::window;
use crate::choice::choose::choose;
use crate::choice::confirm::{compared, confirmed, searched_again};
use crate::data::columns::{Column, add_all, less};
use crate::data::linearised::{LinearisedRecording, PreparedRecording};
use crate::data::parts::Part;
use crate::data::stacked::Data;
use crate::data::thinning;
use crate::data::weights::Weights;
use crate::evidence::nameless::is_unexplained;
use crate::evidence::system::System;
use crate::findings::conclude::conclude;
use crate::findings::event::{Event, contribution_of};
use crate::findings::event_search::find_events;
use crate::findings::recording_quality;
use crate::findings::standing::Standing;
use crate::report::diagnosis::{Diagnosis, insufficient};
use crate::report::settings::{DiagnoseError, DiagnoseSettings};
use crate::search::moves::{EffectSet, Found, Search};
use crate::signals::residual::check_joints;

/// Locates the differences between `recordings` and the model `file`, names and fits the missing effects, and shows the gain on the test part of the
/// data. No search uses that part: it can only reject laws. The zeros of the joints `fitted_zeros` are uncertain. The function reports each step to `progress`.
///
/// # Errors
/// See [`DiagnoseError`].
pub(crate) fn diagnose(
    file: &ArmFile,
    recordings: &[Recording],
    settings: &DiagnoseSettings,
    fitted_zeros: &[usize],
    progress: &mut dyn FnMut(&str),
) -> Result<Diagnosis, DiagnoseError> {
    check(&file.arm, recordings)?;
    let known = Effects::of(file)?;
    let known: Vec<&Placed> = known.placed.iter().collect();
    let mut notes: Vec<String> = recordings.iter().flat_map(|recording| recording.notes.clone()).collect();
    progress("preparing the recordings");
    let whole = recordings;
    let recordings = thinning::bounded(recordings, &mut notes);
    let mut prepared = Vec::new();
    for recording in &recordings {
        match PreparedRecording::new(&file.arm, recording, &settings.treatment) {
            Ok(one) => prepared.push(one),
            Err(short) if short.is_of_a_part(whole) => {
                return Ok(insufficient(file, settings, notes, short.in_a_diagnosis(whole)));
            }
            Err(error) => return Err(error.into()),
        }
    }
    notes.extend(prepared.iter().flat_map(|one| one.treatment.notes().to_vec()));
    let recordings: Vec<LinearisedRecording> = prepared
        .iter()
        .map(|one| LinearisedRecording::new(&file.arm, &known, one))
        .collect::<Result<_, _>>()?;
    let mut data = Data::new(recordings, &settings.tolerances, fitted_zeros);
    if let Some(lack) = recording_quality::lack(&data) {
        return Ok(insufficient(file, settings, notes, lack));
    }
    notes.extend(recording_quality::notes(&data));
    let target = data.target();
    let (mut lasting, untestable) = candidates(&data, progress);
    lasting.retain(|candidate| !candidate.kind.happens());
    let mut study = Study { file, settings, target: &target, lasting, notes, untestable };
    let found = study.first_found(&mut data, progress)?;
    study.concluded(data, found, progress)
}

/// The input of a diagnosis.
struct Study<'s> {
    file: &'s ArmFile,
    settings: &'s DiagnoseSettings,
    /// The residuals of the given model.
    target: &'s [Vec<f64>],
    /// All lasting laws; after the first search linearised on the machine with the found laws.
    lasting: Vec<Candidate>,
    notes: Vec<String>,
    untestable: Vec<Untestable>,
}

impl Study<'_> {
    /// The lasting laws that the search finds first. Pieces of any law resemble events, so that it searches for laws alone. But several laws together
    /// can also imitate one event. Therefore it then starts a second time, beside the events that the given model leaves, and the more probable answer remains.
    fn first_found(
        &mut self,
        data: &mut Data,
        progress: &mut dyn FnMut(&str),
    ) -> Result<Found, DiagnoseError> {
        let (lasting, alone) = self.searched(data, &[], progress)?;
        let events = if alone.members.len() > 1 {
            progress("searching for transients, such as pushes");
            let nothing = self.nothing(data)?;
            self.events_beside(data, &nothing, &[])
        } else {
            Vec::new()
        };
        if !events.is_empty() {
            let (lasting, mut beside) = self.searched(data, &events, progress)?;
            let weights = self.weights(data, &events, &beside.residual, &beside.row_error);
            let without = self.evidence(data, &[], weights.clone(), &alone.members)?;
            if self.evidence(data, &events, weights, &beside.members)? > without {
                // The next search for events starts without them.
                add_all(&mut beside.residual, events.iter().flat_map(Event::columns));
                self.lasting = lasting;
                return Ok(beside);
            }
        }
        self.lasting = lasting;
        Ok(alone)
    }

    /// The most probable laws beside `events`, from the fit and the choice part; and all lasting laws, linearised on the machine with them.
    fn searched(
        &self,
        data: &Data,
        events: &[Event],
        progress: &mut dyn FnMut(&str),
    ) -> Result<(Vec<Candidate>, Found), DiagnoseError> {
        progress("searching");
        let (mut search, _) = self.search(data, events, self.weights_at_first(data, events), &[])?;
        let mut answer = || {
            search.run(&[], progress)?;
            progress("choosing among the best sets of effects");
            let answer = choose(&mut search)?;
            let answer = search.made_consistent(&answer)?;
            Some((search.candidates(&search.available), search.found(&answer, self.settings.seed)?))
        };
        answer().ok_or(DiagnoseError::Singular)
    }

    /// The given model without any effect.
    fn nothing(&self, data: &Data) -> Result<Found, DiagnoseError> {
        let (mut search, none) = self.search(data, &[], self.weights_at_first(data, &[]), &[])?;
        let answer = search.with_best_shares(none);
        let nothing = answer.and_then(|answer| search.found(&answer, self.settings.seed));
        nothing.ok_or(DiagnoseError::Singular)
    }

    /// The weights of the active rows before any law is known, beside `events`.
    fn weights_at_first(&self, data: &Data, events: &[Event]) -> Weights {
        let target = less(self.target, &contribution_of(events, self.target));
        Weights::new(data, &target, None, &data.row_error, self.settings.seed)
    }

    /// The diagnosis from the laws that the search `found` in `data`, and from the events beside them.
    fn concluded(
        mut self,
        mut data: Data,
        found: Found,
        progress: &mut dyn FnMut(&str),
    ) -> Result<Diagnosis, DiagnoseError> {
        found.set_on(&data);
        data.update_tolerances(&self.settings.tolerances);
        if found.members.iter().any(|member| member.acts_on_readings) {
            // A found sensor also reads the contributions of other laws.
            let read = |one: &mut Candidate| {
                one.reformed(&data, one.form.clone()).into_iter().for_each(|read| *one = read);
            };
            self.lasting.iter_mut().filter(|one| !one.changes_arm).for_each(read);
        }
        progress("searching for transients, such as pushes");
        let parts = data.parts.clone();
        let mut events = self.events_reserving_rows(&mut data, &found, &parts);
        data.active_parts = vec![Part::Fit, Part::Choice];
        progress("confirming the findings");
        let residual = less(&found.residual, &contribution_of(&events, self.target));
        let mut with = {
            let weights = self.weights(&data, &events, &residual, &data.row_error);
            self.confirmed(&data, &events, weights, &found.members, progress)?
        };
        if events.is_empty() {
            let stood = self.standing(&data, &residual, with, progress)?;
            // Laws that the test part rejects may have imitated events.
            if stood.leaves_more || stood.is_less {
                events = self.events_reserving_rows(&mut data, &stood.found, &parts);
            }
            if events.is_empty() {
                return self.by_laws(&data, &residual, stood.found);
            }
            let stood = stood.found;
            let weights = self.weights(
                &data,
                &events,
                &less(&residual, &contribution_of(&events, self.target)),
                &stood.row_error,
            );
            with = self.confirmed(&data, &events, weights, &stood.members, progress)?;
        }
        // A law found after the events may explain what they seemed to explain.
        let without = {
            let weights = self.weights(&data, &[], &found.residual, &with.row_error);
            let (mut search, members) = self.search(&data, &[], weights, &with.members)?;
            let answer = compared(&mut search, members, progress).ok_or(DiagnoseError::Singular)?;
            let answer = explained(&mut search, answer, progress).ok_or(DiagnoseError::Singular)?;
            search.found(&answer, self.settings.seed).ok_or(DiagnoseError::Singular)?
        };
        progress("searching for transients, such as pushes");
        events = self.events_beside(&mut data, &with, &events);
        data.parts.clone_from(&parts);
        if are_the_same(&with.members, &without.members) {
            data.exclude_from_test(columns_of(&events));
        } else {
            let others = self.events_beside(&mut data, &without, &[]);
            data.exclude_from_test(columns_of(&events).chain(columns_of(&others)));
            let weights = self.weights(&data, &events, &residual, &with.row_error);
            let of_with = self.evidence(&data, &events, weights.clone(), &with.members)?;
            let of_without = self.evidence(&data, &others, weights, &without.members)?;
            if of_without > of_with {
                (with, events) = (Found { row_error: with.row_error, ..without }, others);
            }
        }
        let with = self.rivals_resolved(&data, &events, with)?;
        let weights = self.weights(&data, &events, &residual, &with.row_error);
        let (mut search, members) = self.search(&data, &events, weights, &with.members)?;
        let answer = compared(&mut search, members, progress).ok_or(DiagnoseError::Singular)?;
        let answer = explained(&mut search, answer, progress).ok_or(DiagnoseError::Singular)?;
        progress("testing");
        self.conclusion(&mut search, &answer, &events)
    }

    /// Compares each law of `found` that has several possible solutions, or that replaces such a law, with its rivals. Each is compared under the row
    /// errors that follow from its own solutions. The search then excludes the rejected laws.
    fn rivals_resolved(
        &mut self,
        data: &Data,
        events: &[Event],
        mut found: Found,
    ) -> Result<Found, DiagnoseError> {
        for place in 0..found.members.len() {
            let member = &found.members[place];
            let is_open_rival = |one: &Candidate| {
                one.excludes(member)
                    && !one.same_effect(member)
                    && (one.has_several_solutions || member.has_several_solutions)
            };
            if !self.lasting.iter().any(is_open_rival) {
                continue;
            }
            let weights = self.weights(data, events, &found.residual, &found.row_error);
            let (mut search, members) = self.search(data, events, weights.clone(), &found.members)?;
            if members.len() < found.members.len() {
                break;
            }
            let rivals = search.open_rivals(&members, place).ok_or(DiagnoseError::Singular)?;
            let evidence = |of: &Found| {
                weights.with_row_error(&of.row_error).robust_log_likelihood(&of.residual) + of.log_prior
            };
            for rival in rivals {
                let lost = search.system.candidate(rival).clone();
                let instead = [&members[..place], &[rival], &members[place + 1..]].concat();
                let answer = search.polished(instead);
                let there = answer.and_then(|answer| search.found(&answer, self.settings.seed));
                let there = there.ok_or(DiagnoseError::Singular)?;
                let lost = if evidence(&there) > evidence(&found) {
                    std::mem::replace(&mut found, there).members.swap_remove(place)
                } else {
                    lost
                };
                self.lasting.retain(|one| !one.same_effect(&lost));
            }
        }
        Ok(found)
    }

    /// Confirms `members` by rows with these `weights` beside `events`: the search may change members, drop them or add others. Returns the resulting
    /// laws.
    fn confirmed(
        &self,
        data: &Data,
        events: &[Event],
        weights: Weights,
        members: &[Candidate],
        progress: &mut dyn FnMut(&str),
    ) -> Result<Found, DiagnoseError> {
        let (mut search, members) = self.search(data, events, weights, members)?;
        let answer = confirmed(&mut search, members, progress);
        let found = answer.and_then(|answer| search.found(&answer, self.settings.seed));
        found.ok_or(DiagnoseError::Singular)
    }

    /// The laws of `confirmed` that the test part does not reject. If these laws leave an unexplained error, the search starts again before their
    /// test. The `residual` of the first search determines the effective number of rows.
    fn standing(
        &self,
        data: &Data,
        residual: &[Vec<f64>],
        mut confirmed: Found,
        progress: &mut dyn FnMut(&str),
    ) -> Result<StandingLaws, DiagnoseError> {
        let mut is_less = false;
        loop {
            let count = confirmed.members.len();
            let weights = self.weights(data, &[], residual, &confirmed.row_error);
            let (mut search, members) = self.search(data, &[], weights, &confirmed.members)?;
            let answer = search.with_best_shares(members).and_then(|answer| search.made_consistent(&answer));
            let answer = answer.ok_or(DiagnoseError::Singular)?;
            let answer = explained(&mut search, answer, progress).ok_or(DiagnoseError::Singular)?;
            progress("testing");
            let standing = self.tested(&mut search, &answer, &[]);
            let (members, leaves_more) = standing.stands()?.ok_or(DiagnoseError::Singular)?;
            let stood =
                search.with_best_shares(members).and_then(|answer| search.found(&answer, self.settings.seed));
            let found = stood.ok_or(DiagnoseError::Singular)?;
            if found.members.len() >= count {
                return Ok(StandingLaws { found, leaves_more, is_less });
            }
            // The rows lose the variance that the rejected law gave them, and the loop tests the other laws again.
            (confirmed, is_less) = (found, true);
        }
    }

    /// The diagnosis from the laws `found`, without events.
    fn by_laws(
        &mut self,
        data: &Data,
        residual: &[Vec<f64>],
        found: Found,
    ) -> Result<Diagnosis, DiagnoseError> {
        let found = self.rivals_resolved(data, &[], found)?;
        let weights = self.weights(data, &[], residual, &found.row_error);
        let (mut search, members) = self.search(data, &[], weights, &found.members)?;
        // Rows with several possible solutions have less weight now than during the search for the law's parameters.
        let answer = search.refitted(members).ok_or(DiagnoseError::Singular)?;
        self.conclusion(&mut search, &answer, &[])
    }

    /// The events beside the laws `found`. The method removes the rows of these events from the test part of `parts`.
    fn events_reserving_rows(&self, data: &mut Data, found: &Found, parts: &[Vec<Part>]) -> Vec<Event> {
        let events = self.events_beside(data, found, &[]);
        data.parts.clone_from_slice(parts);
        // Events in nearly every row are no events, but a law without a name.
        if data.exclude_from_test(columns_of(&events)) { events } else { Vec::new() }
    }

    /// The events beside the laws `found`, in all parts. The data don't distinguish a push from the impacts of parts that separate and meet again.
    fn events_beside(&self, data: &mut Data, found: &Found, events: &[Event]) -> Vec<Event> {
        if found.members.iter().any(|candidate| candidate.kind.shakes) {
            return Vec::new();
        }
        found.set_on(data);
        // The residuals include the events, because the search did not see them.
        let mut residual = found.residual.clone();
        add_all(&mut residual, events.iter().flat_map(Event::columns));
        let active = std::mem::replace(&mut data.active_parts, Part::ALL.to_vec());
        let sizes = self.weights(data, &[], &residual, &found.row_error);
        // Exact rows have no drift and leave no residual for an event.
        let happened =
            find_events(data, &residual, &self.lasting, &sizes, self.settings.seed).unwrap_or_default();
        data.active_parts = active;
        happened
    }

    /// The weights of the active rows of `data` beside `events`. `residual` is that of the present model, and `row_error` is the standard deviation
    /// of a perfect model's error.
    fn weights(
        &self,
        data: &Data,
        events: &[Event],
        residual: &[Vec<f64>],
        row_error: &[Vec<f64>],
    ) -> Weights {
        let target = less(self.target, &contribution_of(events, self.target));
        Weights::new(data, &target, Some(residual), row_error, self.settings.seed)
    }

    /// The search in the rows of `data` with these `weights`, after the subtraction of the `events`; and the numbers of its `members`.
    fn search<'d, 'a>(
        &self,
        data: &'d Data<'a>,
        events: &[Event],
        weights: Weights,
        members: &[Candidate],
    ) -> Result<(Search<'d, 'a>, Vec<usize>), DiagnoseError> {
        let target = less(self.target, &contribution_of(events, self.target));
        let system = System::new(data, target, weights).ok_or(DiagnoseError::Singular)?;
        let mut search = Search::new(system, self.lasting.clone());
        let members = members.iter().filter_map(|one| search.system.take(one.clone())).collect();
        Ok((search, members))
    }

    /// The log of the evidence of `members` and `events` together.
    fn evidence(
        &self,
        data: &Data,
        events: &[Event],
        weights: Weights,
        members: &[Candidate],
    ) -> Result<f64, DiagnoseError> {
        let (mut search, members) = self.search(data, events, weights, members)?;
        let answer = search.with_best_shares(members).ok_or(DiagnoseError::Singular)?;
        Ok(answer.evidence + events.iter().map(|event| event.log_prior).sum::<f64>())
    }

    /// The diagnosis of `answer` beside `events`.
    fn conclusion(
        &self,
        search: &mut Search,
        answer: &EffectSet,
        events: &[Event],
    ) -> Result<Diagnosis, DiagnoseError> {
        let standing = self.tested(search, answer, events);
        let diagnosis = conclude(standing, self.notes.clone(), self.untestable.clone())?;
        diagnosis.ok_or(DiagnoseError::Singular)
    }

    /// The `answer` beside `events`, ready for the judgement by the test part.
    fn tested<'c, 'd, 'a>(
        &'c self,
        search: &'c mut Search<'d, 'a>,
        answer: &'c EffectSet,
        events: &'c [Event],
    ) -> Standing<'c, 'd, 'a> {
        Standing { file: self.file, settings: self.settings, search, answer, events, target: self.target }
    }
}

/// Laws that the test part did not reject.
struct StandingLaws {
    found: Found,
    /// True if `found` leaves errors so large that a law must act that the catalogue does not have.
    leaves_more: bool,
    /// True if the test part rejected laws that the search had confirmed, so that `found` has fewer laws.
    is_less: bool,
}

/// `answer`, or, if it leaves an unexplained error, the result of a new search in all active rows; `None` if the system is singular.
fn explained(search: &mut Search, answer: EffectSet, progress: &mut dyn FnMut(&str)) -> Option<EffectSet> {
    let fit = search.system.fit_within_tolerances(&answer.members)?;
    if is_unexplained(&search.system, &fit, &search.system.weights) {
        searched_again(search, &answer, progress)
    } else {
        Some(answer)
    }
}

/// The columns of those `events` that end.
fn columns_of(events: &[Event]) -> impl Iterator<Item = &Column> {
    let ending = events.iter().map(|event| &event.candidate).filter(|one| window(&one.form.shape).is_some());
    ending.flat_map(|one| one.columns.iter())
}

/// Returns true if `one` and `other` are the same effects, in any forms.
fn are_the_same(one: &[Candidate], other: &[Candidate]) -> bool {
    one.len() == other.len() && one.iter().all(|one| other.iter().any(|other| one.same_effect(other)))
}

/// Checks that there are recordings, that they fit this arm, and that they have the same columns.
pub(crate) fn check(arm: &Arm, recordings: &[Recording]) -> Result<(), DiagnoseError> {
    let first = recordings.first().ok_or(DiagnoseError::NoRecording)?;
    let columns = |recording: &Recording| {
        let links: Vec<bool> = recording.q_link.iter().map(Option::is_some).collect();
        (recording.tau.is_some(), recording.tool.is_some(), links)
    };
    for recording in recordings {
        check_joints(arm, recording)?;
        if columns(recording) != columns(first) {
            return Err(DiagnoseError::DifferentColumns {
                first: first.origin.display().to_string(),
                other: recording.origin.display().to_string(),
            });
        }
    }
    Ok(())
}
