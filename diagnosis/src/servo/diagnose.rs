//! From recordings of commanded and measured positions to a diagnosis.

use freeplay_model::ArmFile;
use freeplay_recording::Recording;
use freeplay_servo::{ServoArm, Sight, Track, sights};

use super::black_box::Filters;
use super::compare::{late, simulated};
use super::conclude::Conclusion;
use super::findings::Numbers;
use super::parts::{Parts, Rows, WINDOW, problem};
use super::recorded::{Found, Recorded};
use super::scores::{Deviations, deviations};
use super::search::changes;
use super::servos::servos;
use super::tracks::{for_fit, for_lags, track};
use crate::report::diagnosis::Diagnosis;
use crate::report::settings::{DiagnoseError, DiagnoseSettings};
use crate::statistics::FEWEST_ROWS;

/// Identifies the servos of the arm of `file` in `recordings` of commanded and measured positions.
///
/// # Errors
/// [`DiagnoseError::Law`]: the effects of `file` are invalid.
pub fn diagnose(
    file: &ArmFile,
    recordings: &[Recording],
    settings: &DiagnoseSettings,
    progress: &mut dyn FnMut(&str),
) -> Result<Diagnosis, DiagnoseError> {
    progress("measuring the lag of the positions behind their commands");
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
    let has_fit = !problem(&tracks, &parts.fit, &seen, WINDOW).windows.is_empty();
    if !has_fit || parts.test.iter().all(|(_, rows)| rows.len() < FEWEST_ROWS) {
        return Ok(Conclusion::insufficient(
            file,
            settings,
            "they are too short for a fit, a choice and a test",
        ));
    }
    let tolerances = &settings.tolerances;
    let recorded =
        Recorded { file, tracks: &tracks, parts: &parts, sights: &seen, moves: &moves, tolerances };
    let found = match &given {
        Some(given) => changes(&recorded, given, progress),
        None => servos(&recorded, progress),
    };
    let Found { fitted, unknowns, .. } = &found;
    progress("testing on data that no fit has used");
    let numbers = Numbers { file, fitted, unknowns, sights: &seen, tolerances };
    let [_, choice] = recorded.fit_and_choice(&found.undisturbed, &fitted.model);
    let rival = rivals(&parts.fit, &tracks, &seen);
    let stops = given.as_ref().map(|given| given.joints.iter().map(|joint| joint.stops).collect::<Vec<_>>());
    let events = recorded.events_beside_stops(fitted, unknowns, stops.as_deref());
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
        burdened: &found.burdened,
        changes: found.changes.as_deref(),
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

/// The least lag of a joint, without lags that the encoder's rounding hides, s.
pub fn quickest(sights: &[Sight]) -> f64 {
    let late = sights.iter().filter(|sight| sight.error > sight.tick && sight.lag > 0.0);
    late.map(|sight| sight.lag).fold(f64::INFINITY, f64::min)
}

/// Returns true if the command of `joint` moves in `parts`.
pub fn moves(tracks: &[Track], parts: &[Rows], joint: usize) -> bool {
    parts.iter().any(|(index, rows)| {
        let track = &tracks[*index];
        let first = track.commands[joint].held(track.stamps[rows.start]);
        rows.clone().any(|row| track.commands[joint].held(track.stamps[row]) != first)
    })
}

/// Measured minus simulated positions of all recordings.
pub fn deviations_of(model: &ServoArm, tracks: &[Track]) -> Deviations {
    let threads = std::thread::available_parallelism().map_or(1, usize::from);
    freeplay_servo::each(tracks.len(), threads, |index| {
        deviations(&tracks[index], &simulated(model, &tracks[index]))
    })
}

/// Residuals of plain lags and of nameless filters.
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
