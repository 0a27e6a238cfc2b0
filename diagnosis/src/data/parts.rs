//! The three parts of the data: the search uses the fit part, the choice between the best few answers also uses the choice part, and only the report uses the
//! test part.

use crate::data::linearised::LinearisedRecording;
use crate::statistics::SHARES;

/// A part of the data.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Part {
    /// The part for the search.
    Fit,
    /// The part for the choice between the best few answers.
    Choice,
    /// The part for the report alone.
    Test,
    /// A guard between two parts: rows that the low-pass smears from one into the other.
    Guard,
}

impl Part {
    /// All of them.
    pub const ALL: [Self; 4] = [Self::Fit, Self::Choice, Self::Test, Self::Guard];
}

/// The part of each row of `recordings`, and the division in words. Each recording is cut in time, by its rows with motion, since one motion need not show the same
/// effects as another.
pub(crate) fn parts_of(recordings: &[LinearisedRecording], counts: &[Vec<f64>]) -> (Vec<Vec<Part>>, String) {
    let channels_per_recording = recordings.first().map_or(0, |recording| recording.channels.len());
    let cut_at = |index: usize| {
        cut(&recordings[index], &counts[index * channels_per_recording..(index + 1) * channels_per_recording])
    };
    let of = if recordings.len() > 1 { "each" } else { "the" };
    let how = format!(
        "the last 30 % of {of} recording (no law was fitted to it; it only decided which laws remain)"
    );
    ((0..recordings.len()).map(cut_at).collect(), how)
}

/// The file name of `recording`.
pub(crate) fn file_name(recording: &LinearisedRecording) -> String {
    let origin = &recording.prepared.raw.origin;
    origin.file_name().map_or_else(String::new, |name| name.to_string_lossy().into_owned())
}

/// Cuts the rows of `recording` at the [`SHARES`] of its rows that count in any channel.
fn cut(recording: &LinearisedRecording, counts: &[Vec<f64>]) -> Vec<Part> {
    let motion = recording.motion();
    let weight = |row: usize| counts.iter().map(|counts| counts[row]).sum::<f64>();
    let all: f64 = (0..motion.len()).map(weight).sum();
    let mut seen = 0.0;
    let mut parts: Vec<Part> = (0..motion.len())
        .map(|row| {
            seen += weight(row);
            match seen / all.max(1.0) {
                share if share <= SHARES[0] => Part::Fit,
                share if share <= SHARES[1] => Part::Choice,
                _ => Part::Test,
            }
        })
        .collect();
    // Rows on both sides of a cut share smeared data.
    let span = recording.prepared.treatment.filter().settling_time();
    let cuts: Vec<f64> =
        (1..parts.len()).filter(|&row| parts[row] != parts[row - 1]).map(|row| motion.t[row]).collect();
    for (part, t) in parts.iter_mut().zip(&motion.t) {
        if cuts.iter().any(|cut| (t - cut).abs() < 0.5 * span) {
            *part = Part::Guard;
        }
    }
    parts
}
