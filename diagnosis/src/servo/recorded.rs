//! The recordings of an arm with servos, their fit and choice parts, and the events in them that no servo explains.

use std::collections::BTreeSet;

use freeplay_model::ArmFile;
use freeplay_servo::{Fitted, Problem, ServoArm, Sight, Track, Unknown};

use super::burdens::Burdened;
use super::changes::{Change, Given};
use super::events::{Event, Judging, What};
use super::findings::Numbers;
use super::parts::{Parts, Rows, WINDOW, problem};
use crate::data::tolerance::Tolerances;

/// The recordings of an arm.
pub struct Recorded<'a> {
    /// The file of the arm.
    pub file: &'a ArmFile,
    /// The recordings.
    pub tracks: &'a [Track],
    /// The rows of the fit, the choice and the test.
    pub parts: &'a Parts,
    /// Prior information from the recordings on each joint.
    pub sights: &'a [Sight],
    /// True for each joint whose command moves.
    pub moves: &'a [bool],
    /// Tolerances of the machine about its model.
    pub tolerances: &'a Tolerances,
}

/// The findings on the servos.
pub struct Found {
    /// The fit.
    pub fitted: Fitted,
    /// Its unknowns.
    pub unknowns: Vec<Unknown>,
    /// Burdens of the arm beyond its model: payload or inclination.
    pub burdened: Vec<Burdened>,
    /// The changes of the given model; `None` if no servos were given.
    pub changes: Option<Vec<Change>>,
    /// The recordings without the rows of events.
    pub undisturbed: Vec<Track>,
}

impl Recorded<'_> {
    /// `model` as the given model.
    pub fn given<'g>(&'g self, model: &'g ServoArm) -> Given<'g> {
        let Recorded { file, sights, moves, tolerances, .. } = *self;
        Given { file, model, sights, moves, tolerances }
    }

    /// The problems of the fit and of the choice part of `tracks`, with those rows whose prediction under `model` no longer depends on the start of their
    /// window.
    pub fn fit_and_choice<'t>(&self, tracks: &'t [Track], model: &ServoArm) -> [Problem<'t>; 2] {
        [&self.parts.fit, &self.parts.choice]
            .map(|part| problem(tracks, part, self.sights, WINDOW).forgetting(model))
    }

    /// The recordings without the rows of `events`, where a recording has fit or choice rows.
    pub fn undisturbed(&self, events: Vec<Event>) -> Vec<Track> {
        let seen: BTreeSet<usize> =
            self.parts.fit.iter().chain(&self.parts.choice).map(|(index, _)| *index).collect();
        let events: Vec<Event> = events.into_iter().filter(|event| seen.contains(&event.recording)).collect();
        without(self.tracks, &events)
    }

    /// The events of all recordings under the fitted model.
    pub fn events(&self, fitted: &Fitted, unknowns: &[Unknown]) -> Vec<Event> {
        let (file, sights, tolerances) = (self.file, self.sights, self.tolerances);
        let numbers = Numbers { file, fitted, unknowns, sights, tolerances };
        let is_known: Vec<bool> = (0..self.moves.len()).map(|joint| numbers.is_known(joint)).collect();
        let ticks: Vec<f64> = sights.iter().map(|sight| sight.tick).collect();
        let (model, noise, tracks) = (&fitted.model, &fitted.noise, self.tracks);
        let judging = Judging { model, noise, is_known: &is_known, ticks: &ticks, tracks };
        let whole: Vec<Rows> =
            tracks.iter().enumerate().map(|(index, track)| (index, 0..track.stamps.len())).collect();
        let problem = problem(tracks, &whole, sights, f64::INFINITY).forgetting(model);
        let residuals = problem.residuals(model);
        let windows = problem.windows.iter().zip(&residuals);
        windows.flat_map(|((index, rows), residual)| judging.events(*index, rows, residual)).collect()
    }

    /// The events of all recordings under the fitted model, with its joints ending at the detected stops: a known stop is not a second event. `known` holds the
    /// unknowns of the given model.
    pub fn events_beside_stops(
        &self,
        fitted: &Fitted,
        unknowns: &[Unknown],
        known: Option<&[[f64; 2]]>,
    ) -> Vec<Event> {
        let mut fitted = fitted.clone();
        let joints = fitted.model.joints.iter_mut();
        joints.zip(known.into_iter().flatten()).for_each(|(joint, stops)| joint.stops = *stops);
        let mut stops: Vec<Event> = Vec::new();
        loop {
            let found = self.events(&fitted, unknowns);
            let new: Vec<Event> =
                found.iter().filter(|event| stop(&mut fitted.model, event)).cloned().collect();
            if new.is_empty() {
                return stops.into_iter().chain(found).collect();
            }
            stops.extend(new);
        }
    }
}

/// Sets the end stop of a joint of `model` that `event` detected, and returns true if the model lacked this stop.
pub fn stop(model: &mut ServoArm, event: &Event) -> bool {
    let What::Stop { joint, position, is_above } = event.what else { return false };
    let end = &mut model.joints[joint].stops[usize::from(is_above)];
    let is_new = end.is_infinite();
    if is_new {
        *end = position;
    }
    is_new
}

/// Returns true if `a` and `b` have measurements in the same rows.
pub fn is_same(a: &[Track], b: &[Track]) -> bool {
    let rows = |tracks: &[Track]| {
        let all = tracks.iter().flat_map(|track| track.measured.iter().flatten());
        all.map(|q| q.is_finite()).collect::<Vec<bool>>()
    };
    rows(a) == rows(b)
}

/// `tracks` without the measurements during `events`.
fn without(tracks: &[Track], events: &[Event]) -> Vec<Track> {
    let mut tracks = tracks.to_vec();
    for event in events {
        tracks[event.recording]
            .measured
            .iter_mut()
            .for_each(|column| column[event.rows.clone()].fill(f64::NAN));
    }
    tracks
}
