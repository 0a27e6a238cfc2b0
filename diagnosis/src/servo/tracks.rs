//! Recordings in the form of servo rollouts.

use freeplay_recording::Recording;
use freeplay_servo::{Commands, Track};

use crate::signals::grid::GAP_STEPS;
use crate::statistics::quantile;

/// Longest step of a rollout, s: a tenth of the time constants of arm servos (0.05 to 0.2 s), at which the error of the midpoint rule is about a hundredth.
const LONGEST_STEP: f64 = 0.01;

/// Returns true if `recording` has only commanded positions for a comparison with the measured ones.
pub fn commands_alone(recording: &Recording) -> bool {
    let has_links = recording.q_link.iter().any(Option::is_some);
    recording.q_ref.is_some() && recording.tau.is_none() && recording.tool.is_none() && !has_links
}

/// `recording` as a track. For a joint without commands the measured position stands in for the command.
pub fn track(recording: &Recording) -> Track {
    let commands = recording.q.iter().enumerate().map(|(joint, q)| {
        let commanded = recording.q_ref.as_ref().map(|columns| &columns[joint]);
        let commanded = commanded.filter(|column| column.iter().any(|value| value.is_finite()));
        Commands::new(&recording.t, commanded.unwrap_or(q))
    });
    Track {
        stamps: recording.t.clone(),
        measured: recording.q.clone(),
        commands: commands.collect(),
        loads: Vec::new(),
    }
}

/// Thins `track` so that its rows are at least `spacing` s apart, if it has enough rows; the commands stay complete.
pub fn thinned(track: &Track, spacing: f64) -> Track {
    let stride = ((spacing / median_step(track)) * (1.0 + 1e-6)).floor();
    if !(stride >= 2.0 && stride.is_finite()) {
        return track.clone();
    }
    let pick = |column: &Vec<f64>| column.iter().step_by(stride as usize).copied().collect();
    Track {
        stamps: pick(&track.stamps),
        measured: track.measured.iter().map(pick).collect(),
        commands: track.commands.clone(),
        loads: track.loads.iter().step_by(stride as usize).copied().collect(),
    }
}

/// Median of the steps between the stamps of `track`, s.
pub fn median_step(track: &Track) -> f64 {
    quantile(track.stamps.windows(2).map(|pair| pair[1] - pair[0]).collect(), 0.5)
}

/// Distance between rows for the measurement of lags, s: lags are resolved between rows, as the commands are, and closer rows only cost time.
pub(super) const FOR_LAGS: f64 = 0.02;

/// `track`, thinned for the measurement of lags.
pub fn for_lags(track: &Track) -> Track {
    thinned(track, FOR_LAGS)
}

/// Rows per lag that a fit needs: the response of a servo ends after a few lags, and rows in between add hardly any information.
const ROWS: f64 = 3.0;

/// `track`, thinned for a fit of servos with lags of `lag` s or more.
pub fn for_fit(track: &Track, lag: f64) -> Track {
    thinned(track, (lag / ROWS).min(FOR_LAGS))
}

/// Longest step between two stamps of `track` that is no gap, s.
pub fn longest_gap(track: &Track) -> f64 {
    GAP_STEPS * median_step(track)
}

/// Longest step of a rollout along `track`, s: at least two between two rows, so that a delay of part of a row acts.
pub fn rollout_step(track: &Track) -> f64 {
    LONGEST_STEP.min(0.5 * median_step(track) * (1.0 + 1e-3))
}
