//! Recordings as the rollouts of servos take them.

use freeplay_recording::Recording;
use freeplay_servo::{Commands, Track};

/// Steps of the stamps beyond which a recording has a gap, in medians: what came in between is not known.
const GAP_STEPS: f64 = 5.0;
/// Longest step of a rollout, s: a tenth of the time constants that servos of arms have (0.05 to 0.2 s), at which the midpoint rule
/// is right to about a hundredth.
const LONGEST_STEP: f64 = 0.01;

/// Whether commanded positions are all that `recording` has to compare the measured ones with.
pub fn commands_alone(recording: &Recording) -> bool {
    let has_links = recording.q_link.iter().any(Option::is_some);
    recording.q_ref.is_some() && recording.tau.is_none() && recording.tool.is_none() && !has_links
}

/// `recording` as a track. A joint without commands is taken to follow itself.
pub fn track(recording: &Recording) -> Track {
    let commands = recording.q.iter().enumerate().map(|(joint, q)| {
        let commanded = recording.q_ref.as_ref().map(|columns| &columns[joint]);
        let commanded = commanded.filter(|column| column.iter().any(|value| value.is_finite()));
        Commands::new(&recording.t, commanded.unwrap_or(q))
    });
    Track { stamps: recording.t.clone(), measured: recording.q.clone(), commands: commands.collect() }
}

/// Longest step between two stamps of `recording` that is no gap, s.
pub fn longest_gap(recording: &Recording) -> f64 {
    GAP_STEPS * recording.median_step()
}

/// Longest step of a rollout along `recording`, s: at least two between two samples, so that a delay of part of a sample acts.
pub fn rollout_step(recording: &Recording) -> f64 {
    LONGEST_STEP.min(0.5 * recording.median_step() * (1.0 + 1e-3))
}
