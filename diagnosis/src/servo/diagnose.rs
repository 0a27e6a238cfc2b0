//! From recordings of commanded and measured positions to a diagnosis.

use std::collections::BTreeSet;

use freeplay_arm::ArmFile;
use freeplay_recording::Recording;
use freeplay_servo::{
    Fitted, JointServo, Problem, ServoArm, Sight, Track, Unknown, first_model, sights, unknowns,
};

use super::black_box::Filters;
use super::burdens::add_burden;
use super::compare::{late, simulated};
use super::conclude::Conclusion;
use super::events::{Event, Judging, What};
use super::findings::{Numbers, named_from};
use super::limits::{add_limits, lost};
use super::parts::{Parts, Rows, WINDOW, problem};
use super::rotors::{add_rotors, without_rotors};
use super::scores::{Deviations, deviations};
use super::tracks::{for_fit, for_lags, track};
use crate::diagnose::{DiagnoseError, DiagnoseSettings, Diagnosis};

/// Rounds in which a fit and the contacts and stops that it leaves out agree: the first fit knows none, the second those that it could not bend to.
const ROUNDS: usize = 2;
/// Fewest rows that judge.
const FEWEST: usize = 10;

/// Finds the servos of the arm of `file` in `recordings` of commanded and measured positions.
///
/// # Errors
/// [`DiagnoseError::Law`]: the effects of `file` can't be taken.
pub fn diagnose(
    file: &ArmFile,
    recordings: &[Recording],
    settings: &DiagnoseSettings,
    progress: &mut dyn FnMut(&str),
) -> Result<Diagnosis, DiagnoseError> {
    progress("measuring by how much positions follow their commands");
    let whole: Vec<Track> = recordings.iter().map(track).collect();
    let few: Vec<Track> = whole.iter().map(for_lags).collect();
    let seen = sights(&file.arm, &few);
    let tracks: Vec<Track> = whole.iter().map(|track| for_fit(track, quickest(&seen))).collect();
    drop((whole, few));
    let given = ServoArm::of(file)?;
    let parts = Parts::of(recordings, &tracks);
    let moves: Vec<bool> = (0..file.arm.dof()).map(|joint| moves(&tracks, &parts.fit, joint)).collect();
    if !moves.contains(&true) {
        return Ok(Conclusion::insufficient(file, settings, "no joint is commanded to move"));
    }
    let fit = problem(&tracks, &parts.fit, &seen, WINDOW);
    if fit.windows.is_empty() || parts.test.iter().all(|(_, rows)| rows.len() < FEWEST) {
        return Ok(Conclusion::insufficient(file, settings, "they are too short to be cut in three parts"));
    }
    let arm = given.as_ref().map_or(&file.arm, |given| &given.arm);
    let first = nearest(&fit, first_model(arm, &fit).0, given.as_ref());
    let believed = unknowns(&seen, &first, settings.tolerances.zero);
    let believed: Vec<Unknown> = believed.into_iter().filter(|unknown| moves[unknown.joint]).collect();
    let (mut believed, rotors) = without_rotors(believed, &first);
    let begun = begin(&fit, (&first, given.as_ref()), &believed, &mut |step, _| {
        progress(&format!("fitting the servos to a few of the windows, step {step}"));
    });
    let is_known = |fitted: &Fitted| {
        let numbers =
            Numbers { file, fitted, unknowns: &believed, sights: &seen, tolerances: &settings.tolerances };
        (0..moves.len()).map(|joint| numbers.is_known(joint)).collect::<Vec<bool>>()
    };
    // What happened to the arm in the fit's recordings is no servo's: the fit goes on without it.
    let seen_by_fit: BTreeSet<usize> =
        parts.fit.iter().chain(&parts.choice).map(|(index, _)| *index).collect();
    let happened = |fitted: &Fitted| -> Vec<Event> {
        let events = events(&tracks, fitted, &is_known(fitted), &seen);
        events.into_iter().filter(|event| seen_by_fit.contains(&event.recording)).collect()
    };
    let mut fitted = begun;
    let mut undisturbed = tracks.clone();
    for round in 1..=ROUNDS {
        progress("looking for contacts and stops");
        let others = without(&tracks, &happened(&fitted));
        if round > 1 && others.iter().zip(&undisturbed).all(|(other, one)| is_same(other, one)) {
            break;
        }
        undisturbed = others;
        let of_fit = problem(&undisturbed, &parts.fit, &seen, WINDOW).forgetting(&fitted.model);
        fitted = of_fit.fit(&fitted.model, &believed, &mut |step, _| {
            progress(&format!("fitting the servos by simulating the recordings, step {round}.{step}"));
        });
    }
    let [fit, choice] = [&parts.fit, &parts.choice]
        .map(|part| problem(&undisturbed, part, &seen, WINDOW).forgetting(&fitted.model));
    progress("asking whether other frictions and delays are nearer");
    let fitted = fit.leap(fitted, &believed, &mut |step, _| {
        progress(&format!("fitting the servos from other frictions and delays, step {step}"));
    });
    progress("asking whether the arm carries more, or stands otherwise, than its model says");
    let (fitted, burdened) = add_burden(
        [&fit, &choice],
        (file, given.as_ref()),
        &settings.tolerances,
        &mut believed,
        fitted,
        progress,
    );
    let fitted = add_rotors([&fit, &choice], &rotors, &mut believed, fitted, progress);
    progress("asking whether a servo has limits");
    let fitted = add_limits([&fit, &choice], &seen, &mut believed, fitted, progress);
    progress("judging on what no step has seen");
    let numbers = Numbers {
        file,
        fitted: &fitted,
        unknowns: &believed,
        sights: &seen,
        tolerances: &settings.tolerances,
    };
    let is_known: Vec<bool> = (0..moves.len()).map(|joint| numbers.is_known(joint)).collect();
    let rival = rivals(&parts.fit, &tracks, &seen);
    let events = with_stops(&tracks, &fitted, &is_known, &seen);
    let before = match &given {
        Some(given) => deviations_of(given, &tracks),
        None => tracks.iter().map(|track| deviations(track, &late(track, &vec![0.0; moves.len()]))).collect(),
    };
    let conclusion = Conclusion {
        settings,
        recordings,
        tracks: &tracks,
        parts: &parts,
        choice: &choice,
        sights: &seen,
        numbers,
        burdened,
        moves: &moves,
        given: given.as_ref(),
        before,
        lagged: rival.0,
        filtered: rival.1,
        after: deviations_of(&fitted.model, &tracks),
        events,
    };
    Ok(conclusion.diagnosis())
}

/// The least lag of a joint that follows later than its encoder's rounding hides, s.
pub fn quickest(sights: &[Sight]) -> f64 {
    let late = sights.iter().filter(|sight| sight.error > sight.tick && sight.lag > 0.0);
    late.map(|sight| sight.lag).fold(f64::INFINITY, f64::min)
}

/// Whether the command of `joint` moves in `parts`.
pub fn moves(tracks: &[Track], parts: &[Rows], joint: usize) -> bool {
    parts.iter().any(|(index, rows)| {
        let track = &tracks[*index];
        let first = track.commands[joint].held(track.stamps[rows.start]);
        rows.clone().any(|row| track.commands[joint].held(track.stamps[row]) != first)
    })
}

/// Joint by joint the servo of `first` or that of the model that was given, whichever is nearer to the fit's part: one thing that the model lacks at one joint says nothing against what it has at
/// the others. The stops that are known hold in both.
fn nearest(fit: &Problem, mut first: ServoArm, given: Option<&ServoArm>) -> ServoArm {
    let Some(given) = given else { return first };
    first.joints.iter_mut().zip(&given.joints).for_each(|(first, given)| first.stops = given.stops);
    let residuals = [&first, given].map(|model| fit.residuals(model));
    let noise = freeplay_servo::Noise::of(&residuals[0], &fit.rounding);
    let [of_first, of_given] = residuals.map(|residuals| fit.losses(&residuals, &noise));
    for (joint, first) in first.joints.iter_mut().enumerate() {
        if of_given[joint] < of_first[joint] {
            let given = given.joints[joint];
            // Of a stiction that is not there no model says at which speed it is gone.
            let stribeck_velocity =
                if given.stiction == 0.0 { first.stribeck_velocity } else { given.stribeck_velocity };
            *first = JointServo { stribeck_velocity, ..given };
        }
    }
    first
}

/// Fits `believed` to a few windows from several models and keeps the fit that is nearest to the data. The models are the `first`, which rests on the lags alone, the `given` one, and the given one with
/// a few of its numbers changed: a given model that lacks little is nearer to the solution than the first.
fn begin(
    fit: &Problem,
    (first, given): (&ServoArm, Option<&ServoArm>),
    believed: &[Unknown],
    progress: &mut dyn FnMut(usize, f64),
) -> Fitted {
    let mut nearest = fit.begin(first, believed, progress);
    let Some(given) = given else { return nearest };
    let noise = nearest.noise.clone();
    let mut least = lost(fit, &nearest.model, &noise);
    let changed = fit.one_by_one(given, believed, named_from(given.joints.len()));
    for start in std::iter::once(given).chain(&changed) {
        let other = fit.begin(start, believed, progress);
        let of_other = lost(fit, &other.model, &noise);
        if of_other < least {
            (nearest, least) = (other, of_other);
        }
    }
    nearest
}

/// Measured minus simulated positions of all recordings.
pub fn deviations_of(model: &ServoArm, tracks: &[Track]) -> Deviations {
    let threads = std::thread::available_parallelism().map_or(1, usize::from);
    freeplay_servo::each(tracks.len(), threads, |index| {
        deviations(&tracks[index], &simulated(model, &tracks[index]))
    })
}

/// What plain lags and filters without a name leave.
pub fn rivals(fit: &[Rows], tracks: &[Track], sights: &[Sight]) -> (Deviations, Deviations) {
    let lags: Vec<f64> = sights.iter().map(|sight| sight.lag).collect();
    let filters = Filters::fit(tracks, fit, &lags);
    let lagged = tracks.iter().map(|track| deviations(track, &late(track, &lags)));
    let filtered = tracks.iter().map(|track| {
        let column = |joint: usize| {
            (0..track.stamps.len()).map(|row| filters.position(track, joint, row)).collect::<Vec<f64>>()
        };
        deviations(track, &(0..lags.len()).map(column).collect::<Vec<_>>())
    });
    (lagged.collect(), filtered.collect())
}

/// The events of all recordings under the fitted model.
fn events(tracks: &[Track], fitted: &Fitted, is_known: &[bool], sights: &[Sight]) -> Vec<Event> {
    let ticks: Vec<f64> = sights.iter().map(|sight| sight.tick).collect();
    let judging = Judging { model: &fitted.model, noise: &fitted.noise, is_known, ticks: &ticks, tracks };
    let whole: Vec<Rows> =
        tracks.iter().enumerate().map(|(index, track)| (index, 0..track.stamps.len())).collect();
    let problem = problem(tracks, &whole, sights, f64::INFINITY).forgetting(&fitted.model);
    let residuals = problem.residuals(&fitted.model);
    let windows = problem.windows.iter().zip(&residuals);
    windows.flat_map(|((index, rows), residual)| judging.events(*index, rows, residual)).collect()
}

/// The events of all recordings under the fitted model where its joints end at the stops that are found: what a known stop explains is no other event.
fn with_stops(tracks: &[Track], fitted: &Fitted, is_known: &[bool], sights: &[Sight]) -> Vec<Event> {
    let mut fitted = fitted.clone();
    let mut stops: Vec<Event> = Vec::new();
    loop {
        let found = events(tracks, &fitted, is_known, sights);
        let new: Vec<Event> = found.iter().filter(|event| stop(&mut fitted.model, event)).cloned().collect();
        if new.is_empty() {
            return stops.into_iter().chain(found).collect();
        }
        stops.extend(new);
    }
}

/// Ends a joint of `model` where `event` found it to rest; whether that is a stop that the model has not had.
fn stop(model: &mut ServoArm, event: &Event) -> bool {
    let What::Stop { joint, position, is_above } = event.what else { return false };
    let end = &mut model.joints[joint].stops[usize::from(is_above)];
    let is_new = end.is_infinite();
    if is_new {
        *end = position;
    }
    is_new
}

/// Whether the same rows of two tracks were measured.
fn is_same(a: &Track, b: &Track) -> bool {
    let rows = |track: &Track| track.measured.iter().flatten().map(|q| q.is_finite()).collect::<Vec<bool>>();
    rows(a) == rows(b)
}

/// `tracks` without what was measured during `events`.
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
