//! Selection of rows: without long rest, and within memory and time limits.

use std::ops::Range;

use freeplay_recording::Recording;

use crate::signals::long::WINDOWS;

/// Most samples times joints of one diagnosis; longer recordings are thinned to windows. The time of a search grows with this number: one minute of an arm with
/// seven joints at 1 kHz stays whole.
const MOST_NUMBERS: usize = 420_000;
/// Share of the greatest span of a joint within which all joints rest: more than noise and creep of a standing arm, less than any intended motion.
const REST: f64 = 0.01;
/// Sampling interval for the detection of rest, s: noise is no distance within it, and a motion has several samples.
const LOOK_S: f64 = 0.1;
/// Length of rest that stays in the recording, s: it costs little time, so that a cut would not be worth a note.
const SHORT_REST_S: f64 = 2.0;

/// `recordings` without long rest at their ends, within the limits of memory and time; the function adds the omissions to `notes`.
pub(crate) fn bounded(recordings: &[Recording], notes: &mut Vec<String>) -> Vec<Recording> {
    let joints = recordings.first().map_or(1, |recording| recording.joints().max(1));
    let most = MOST_NUMBERS / joints / recordings.len().max(1);
    let bound = |whole: &Recording| {
        let moving = moving(whole, notes);
        thinned(whole, moving, most, notes)
    };
    recordings.iter().map(bound).collect()
}

/// The rows of `recording` without long rest at its ends, where every joint stays within [`REST`] of its position at that end. At rest, dry friction may hold
/// any part of a torque, and a creeping joint holds no information about a moving one.
fn moving(recording: &Recording, notes: &mut Vec<String>) -> Range<usize> {
    let (whole, last) = (0..recording.len(), recording.len().saturating_sub(1));
    let span = |q: &Vec<f64>| {
        let (least, most) = q.iter().fold((f64::MAX, f64::MIN), |(a, b), q| (a.min(*q), b.max(*q)));
        most - least
    };
    let near = REST * recording.q.iter().map(span).fold(0.0, f64::max);
    let leaves = |q: &Vec<f64>| q.iter().position(|at| (at - q[0]).abs() > near);
    let comes = |q: &Vec<f64>| q.iter().rposition(|at| (at - q[last]).abs() > near);
    let first = recording.q.iter().filter_map(leaves).min();
    let end = recording.q.iter().filter_map(comes).max();
    let (Some(first), Some(end)) = (first, end) else { return whole };
    let t = &recording.t;
    let quiet = |range: Range<usize>| {
        let long = t[range.end] - t[range.start];
        let rests = long > SHORT_REST_S && recording.q.iter().all(|q| way(t, q, range.clone()) <= 2.0 * near);
        if rests { long } else { 0.0 }
    };
    let rest = [quiet(0..first), quiet(end..last)];
    if first >= end || rest == [0.0; 2] {
        return whole;
    }
    // Two looks on either side of the motion keep a slow start whole.
    let from = t.partition_point(|at| *at < t[0] + rest[0] - 2.0 * LOOK_S);
    let to = t.partition_point(|at| *at <= t[last] - rest[1] + 2.0 * LOOK_S);
    let ends = [("first", rest[0], t[from] - t[0]), ("last", rest[1], t[last] - t[to - 1])];
    let rests: Vec<String> = ends
        .into_iter()
        .filter(|(_, rest, _)| *rest > 0.0)
        .map(|(end, _, left_out)| format!("the {end} {left_out:.1} s"))
        .collect();
    notes.push(format!(
        "{}: the arm rests for {}; the diagnosis leaves this out",
        file_name(recording),
        rests.join(" and ")
    ));
    from..to
}

/// Distance that `q` travels within `range`, sampled every [`LOOK_S`]: small oscillations are no rest, and noise is no distance.
fn way(t: &[f64], q: &[f64], range: Range<usize>) -> f64 {
    let (mut way, mut seen) = (0.0, range.start);
    for k in range {
        if t[k] - t[seen] >= LOOK_S {
            way += (q[k] - q[seen]).abs();
            seen = k;
        }
    }
    way
}

/// The rows `moving` of `recording`, or evenly spread windows of them if they are too many.
fn thinned(recording: &Recording, moving: Range<usize>, most: usize, notes: &mut Vec<String>) -> Recording {
    let (all, long) = (moving.len(), most / WINDOWS);
    if all <= most || long == 0 {
        return rows(recording, std::slice::from_ref(&moving));
    }
    let window = |k: usize| {
        let begin = moving.start + k * (all - long) / (WINDOWS - 1);
        begin..begin + long
    };
    let windows: Vec<Range<usize>> = (0..WINDOWS).map(window).collect();
    notes.push(format!(
        "{} is long ({all} samples): the diagnosis uses {WINDOWS} evenly spread windows of {long} samples",
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

    use super::{MOST_NUMBERS, bounded};

    fn made(samples: u32, q: impl Fn(f64) -> f64) -> Recording {
        let t: Vec<f64> = (0..samples).map(|k| f64::from(k) * 0.001).collect();
        let q = t.iter().map(|t| q(*t)).collect();
        Recording::new(Path::new("made.csv"), vec![("t".into(), t), ("q1".into(), q)]).expect("a recording")
    }

    /// Two seconds of motion between 2.5 s of rest and five and a half.
    #[test]
    fn long_rest_at_the_ends_is_left_out() {
        let swing = |t: f64| 0.5 - 0.5 * ((t - 2.5).clamp(0.0, 2.0) * std::f64::consts::PI).cos();
        let mut notes = Vec::new();
        let kept = bounded(&[made(10_000, swing)], &mut notes).remove(0).t;
        let (first, last) = (kept[0], kept[kept.len() - 1]);
        println!("{first:.3} to {last:.3} s");
        assert!(first > 2.2 && first < 2.5 && last > 4.5 && last < 4.8);
        assert_eq!(notes.len(), 1, "{notes:?}");
    }

    #[test]
    fn small_motions_are_no_rest() {
        let swing = |t: f64| if t < 5.0 { t.sin() } else { 5f64.sin() + 4e-3 * (6.0 * (t - 5.0)).sin() };
        let mut notes = Vec::new();
        let kept = bounded(&[made(10_000, swing)], &mut notes).remove(0);
        assert_eq!((kept.t.last(), notes.len()), (Some(&9.999), 0));
    }

    #[test]
    fn a_long_recording_stays_in_bounds_and_keeps_its_ends() {
        let long = made(1_000_000, f64::sin);
        let mut notes = Vec::new();
        let kept = bounded(std::slice::from_ref(&long), &mut notes).remove(0);
        println!("{} of {} samples", kept.len(), long.len());
        assert!(kept.len() <= MOST_NUMBERS && kept.len() > MOST_NUMBERS / 2);
        assert_eq!((kept.t.first(), kept.t.last()), (long.t.first(), long.t.last()));
        assert_eq!(notes.len(), 1);
    }
}
