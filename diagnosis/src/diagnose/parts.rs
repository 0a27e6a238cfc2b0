//! Parts of recordings: what a fit rests on, what is held out, and no more than memory and time allow.

use std::ops::Range;

use freeplay_recording::Recording;

/// Most samples that one diagnosis works on, and most of them times joints if that is more; what is longer is thinned to windows.
const MOST_SAMPLES: usize = 60_000;
const MOST_NUMBERS: usize = 300_000;
/// Windows that a long recording is thinned to.
const WINDOWS: usize = 8;
/// Share of a single recording that the fit rests on.
const FITTED: f64 = 0.7;
/// Samples between fit and held-out data belong to neither: s.
const GUARD_S: f64 = 0.2;

/// Recordings to fit and recordings to be judged on.
pub(crate) struct Parts {
    /// What the fit rests on.
    pub fitted: Vec<Recording>,
    /// What takes no part in it.
    pub held: Vec<Recording>,
    /// How they were parted, in words.
    pub how: String,
    /// What was left out, one sentence each.
    pub notes: Vec<String>,
}

impl Parts {
    /// Parts `recordings`: the last of several is held out, else the last 30 % of the only one.
    pub fn of(recordings: &[Recording]) -> Self {
        let joints = recordings.first().map_or(1, |recording| recording.joints().max(1));
        let most = MOST_SAMPLES.max(MOST_NUMBERS / joints);
        let (mut notes, share) = (Vec::new(), most / recordings.len().max(1));
        let mut all: Vec<Recording> =
            recordings.iter().map(|whole| thinned(whole, share, &mut notes)).collect();
        if all.len() > 1 {
            let held: Vec<Recording> = all.pop().into_iter().collect();
            let name = held.first().map_or_else(String::new, file_name);
            return Self { fitted: all, held, how: format!("recording {name}, not used for the fit"), notes };
        }
        let Some(only) = all.pop() else {
            return Self { fitted: Vec::new(), held: Vec::new(), how: String::new(), notes };
        };
        let (begin, end) = (only.t[0], only.t[only.len() - 1]);
        let parting = begin + FITTED * (end - begin);
        let before = only.t.partition_point(|t| *t < parting);
        let after = only.t.partition_point(|t| *t < parting + GUARD_S);
        Self {
            fitted: vec![rows(&only, std::slice::from_ref(&(0..before)))],
            held: vec![rows(&only, std::slice::from_ref(&(after..only.len())))],
            how: "the last 30 %, not used for the fit".to_owned(),
            notes,
        }
    }
}

/// `recording`, or windows of it spread evenly if it is too long.
fn thinned(recording: &Recording, most: usize, notes: &mut Vec<String>) -> Recording {
    let (all, long) = (recording.len(), most / WINDOWS);
    if all <= most || long == 0 {
        return recording.clone();
    }
    let window = |k: usize| {
        let begin = k * (all - long) / (WINDOWS - 1);
        begin..begin + long
    };
    let windows: Vec<Range<usize>> = (0..WINDOWS).map(window).collect();
    notes.push(format!(
        "{} is long ({all} samples): {WINDOWS} windows of {long} samples, spread evenly, stand for it",
        file_name(recording)
    ));
    rows(recording, &windows)
}

/// The name of the file that a recording comes from.
pub(crate) fn file_name(recording: &Recording) -> String {
    recording.origin.file_name().map_or_else(String::new, |name| name.to_string_lossy().into_owned())
}

/// The rows `ranges` of `recording`.
fn rows(recording: &Recording, ranges: &[Range<usize>]) -> Recording {
    let column = |whole: &Vec<f64>| -> Vec<f64> {
        ranges.iter().flat_map(|range| whole[range.clone()].iter().copied()).collect()
    };
    let columns = |whole: &Vec<Vec<f64>>| whole.iter().map(column).collect();
    Recording {
        origin: recording.origin.clone(),
        t: column(&recording.t),
        q: columns(&recording.q),
        qd: recording.qd.as_ref().map(columns),
        tau: recording.tau.as_ref().map(columns),
        q_ref: recording.q_ref.as_ref().map(columns),
        q_link: recording.q_link.iter().map(|link| link.as_ref().map(column)).collect(),
        tool: recording.tool.as_ref().map(|tool| tool.each_ref().map(column)),
        ..Recording::default()
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use freeplay_recording::Recording;

    use super::{MOST_NUMBERS, Parts};

    fn recording(samples: usize) -> Recording {
        let t: Vec<f64> = (0..samples).map(|k| k as f64 * 0.001).collect();
        let q = t.iter().map(|t| t.sin()).collect();
        Recording::new(Path::new("made.csv"), vec![("t".into(), t), ("q1".into(), q)]).expect("a recording")
    }

    #[test]
    fn the_end_of_one_recording_is_held_out() {
        let parts = Parts::of(&[recording(10_000)]);
        let (fitted, held) = (&parts.fitted[0], &parts.held[0]);
        assert_eq!((fitted.len(), held.len()), (7000, 2800));
        assert!(held.t[0] - fitted.t[fitted.len() - 1] > 0.2);
    }

    #[test]
    fn a_long_recording_stays_in_bounds_and_keeps_its_ends() {
        let long = recording(1_000_000);
        let parts = Parts::of(std::slice::from_ref(&long));
        let count = parts.fitted[0].len() + parts.held[0].len();
        println!("{count} of {} samples", long.len());
        assert!(count <= MOST_NUMBERS && count > MOST_NUMBERS / 2);
        assert_eq!(parts.held[0].t.last(), long.t.last());
        assert_eq!(parts.notes.len(), 1);
    }
}
