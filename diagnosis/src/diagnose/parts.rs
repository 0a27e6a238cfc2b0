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
/// Parts of that which are held out in turn, too.
const TURNS: usize = 2;
/// Share of the greatest span of a joint within which all of them rest.
const REST: f64 = 0.01;
/// Time between two looks at a joint that may rest, s.
const LOOK_S: f64 = 0.1;
/// Rest that is left where it is, s.
const SHORT_REST_S: f64 = 2.0;
/// Samples between fit and held-out data belong to neither: s.
const GUARD_S: f64 = 0.2;

/// Recordings to fit and recordings to be judged on.
pub(crate) struct Parts {
    /// What the fit rests on.
    pub fitted: Vec<Recording>,
    /// What takes no part in it.
    pub held: Vec<Recording>,
    /// Other partings of the same recordings: what is fitted and what is held out.
    pub turns: Vec<[Vec<Recording>; 2]>,
    /// All of the recordings, if of each a part takes no part in the fit.
    pub whole: Vec<Recording>,
    /// How they were parted, in words.
    pub how: String,
    /// What was left out, one sentence each.
    pub notes: Vec<String>,
}

/// What of several recordings takes no part in the fit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Held {
    /// The one with this number.
    Recording(usize),
    /// The last 30 % of each.
    Ends,
}

impl Parts {
    /// Parts `recordings`; of an only one the end is held out whatever `held` says. Long rest at the ends of a recording belongs to neither part.
    pub fn of(recordings: &[Recording], held: Held) -> Self {
        let joints = recordings.first().map_or(1, |recording| recording.joints().max(1));
        let most = MOST_SAMPLES.max(MOST_NUMBERS / joints);
        let (mut notes, share) = (Vec::new(), most / recordings.len().max(1));
        let mut all: Vec<Recording> = recordings
            .iter()
            .map(|whole| thinned(whole, moving(whole, &mut notes), share, &mut notes))
            .collect();
        if let (Held::Recording(held), true) = (held, all.len() > 1) {
            let held = all.remove(held.min(all.len() - 1));
            let how = format!("recording {}, not used for the fit", file_name(&held));
            return Self { fitted: all, held: vec![held], turns: Vec::new(), whole: Vec::new(), how, notes };
        }
        let turn = |turn: usize| FITTED / TURNS as f64 * turn as f64;
        let [fitted, held] = all_parted(&all, FITTED..1.0);
        let of_each = if all.len() > 1 { " of each recording" } else { "" };
        Self {
            fitted,
            held,
            turns: (0..TURNS).map(|k| all_parted(&all, turn(k)..turn(k + 1))).collect(),
            how: format!("the last 30 %{of_each}, not used to find what is missing"),
            whole: all,
            notes,
        }
    }
}

/// `recordings` without the shares `held` of their times, and what is within these.
fn all_parted(recordings: &[Recording], held: Range<f64>) -> [Vec<Recording>; 2] {
    let of = |recording: &Recording| {
        let (begin, end) = (recording.t[0], recording.t[recording.len() - 1]);
        let at = |share: f64| if share < 1.0 { begin + share * (end - begin) } else { end };
        parted(recording, at(held.start)..at(held.end))
    };
    let parts = recordings.iter().map(of).map(|[fitted, held]| (fitted, held));
    <[Vec<Recording>; 2]>::from(parts.unzip())
}

/// `recording` without the times `held`, and what is within these but for a guard towards its neighbours.
fn parted(recording: &Recording, held: Range<f64>) -> [Recording; 2] {
    let t = &recording.t;
    let at = |time: f64| t.partition_point(|t| *t < time);
    let (first, last) = (t[0], t[t.len() - 1]);
    let (before, from) =
        if held.start > first { (0..at(held.start), at(held.start + GUARD_S)) } else { (0..0, 0) };
    let (after, to) = if held.end < last {
        (at(held.end)..t.len(), at(held.end - GUARD_S))
    } else {
        (t.len()..t.len(), t.len())
    };
    let around: Vec<Range<usize>> = [before, after].into_iter().filter(|range| !range.is_empty()).collect();
    [rows(recording, &around), rows(recording, std::slice::from_ref(&(from..to.max(from))))]
}

/// The rows of `recording` without long rest at its ends, where every joint stays within [`REST`] of where it is at that end: dry friction may hold any part
/// of a torque then, and a creeping joint tells nothing of a moving one.
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
    let from = t.partition_point(|at| *at < t[0] + rest[0] - GUARD_S);
    let to = t.partition_point(|at| *at <= t[last] - rest[1] + GUARD_S);
    notes.push(format!(
        "{}: the arm rests for the first {:.1} s and the last {:.1} s; that is left out",
        file_name(recording),
        t[from] - t[0],
        t[last] - t[to - 1]
    ));
    from..to
}

/// The way that `q` goes within `range`, seen every [`LOOK_S`]: small motions to and fro are no rest, and noise is no way.
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

/// The rows `moving` of `recording`, or windows of them spread evenly if they are too many.
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

    use super::{Held, MOST_NUMBERS, Parts};

    fn recording(samples: usize) -> Recording {
        let t: Vec<f64> = (0..samples).map(|k| k as f64 * 0.001).collect();
        let q = t.iter().map(|t| t.sin()).collect();
        Recording::new(Path::new("made.csv"), vec![("t".into(), t), ("q1".into(), q)]).expect("a recording")
    }

    #[test]
    fn the_end_of_one_recording_is_held_out() {
        let parts = Parts::of(&[recording(10_000)], Held::Ends);
        let (fitted, held) = (&parts.fitted[0], &parts.held[0]);
        assert_eq!((fitted.len(), held.len()), (7000, 2800));
        assert!(held.t[0] - fitted.t[fitted.len() - 1] > 0.2);
    }

    #[test]
    fn the_end_of_each_recording_can_be_held_out() {
        let parts = Parts::of(&[recording(10_000), recording(5_000)], Held::Ends);
        let lengths = |all: &[Recording]| all.iter().map(Recording::len).collect::<Vec<_>>();
        assert_eq!((lengths(&parts.fitted), lengths(&parts.held)), (vec![7000, 3500], vec![2800, 1300]));
        assert_eq!((parts.turns.len(), lengths(&parts.whole)), (2, vec![10_000, 5_000]));
    }

    /// Each sample is held out once but for the guards; what is fitted meanwhile keeps away from it.
    #[test]
    fn every_part_of_one_recording_is_held_out_in_turn() {
        let whole = recording(10_000);
        let parts = Parts::of(std::slice::from_ref(&whole), Held::Ends);
        let partings = parts.turns.iter().map(|[fitted, held]| (&fitted[0], &held[0]));
        let all: Vec<_> = partings.chain([(&parts.fitted[0], &parts.held[0])]).collect();
        let mut held_out = 0;
        for (fitted, held) in &all {
            let (from, to) = (held.t[0], held.t[held.len() - 1]);
            let near = fitted.t.iter().map(|t| (from - t).max(t - to)).fold(f64::INFINITY, f64::min);
            println!(
                "{} fitted, {} held out from {from:.3} to {to:.3} s, {near:.3} s apart",
                fitted.len(),
                held.len()
            );
            assert!(near > 0.19 && fitted.len() + held.len() >= whole.len() - 402);
            held_out += held.len();
        }
        assert_eq!(all.len(), 3);
        assert!(held_out <= whole.len() && held_out >= whole.len() - 804, "{held_out}");
        assert_eq!(parts.whole.iter().map(Recording::len).collect::<Vec<_>>(), [whole.len()]);
    }

    /// Two seconds of motion between 2.5 s of rest and five and a half: the end of the motion is held out.
    #[test]
    fn rest_is_no_test_of_a_fit() {
        let t: Vec<f64> = (0..10_000).map(|k| f64::from(k) * 0.001).collect();
        let q =
            t.iter().map(|t| 0.5 - 0.5 * ((t - 2.5).clamp(0.0, 2.0) * std::f64::consts::PI).cos()).collect();
        let still = vec![0.3; t.len()];
        let columns = vec![("t".into(), t), ("q1".into(), q), ("q2".into(), still)];
        let parts =
            Parts::of(&[Recording::new(Path::new("made.csv"), columns).expect("a recording")], Held::Ends);
        let (fitted, held) = (&parts.fitted[0].t, &parts.held[0].t);
        println!(
            "fit {:?} to {:?} s, held out {:?} to {:?} s",
            fitted[0],
            fitted.last(),
            held[0],
            held.last()
        );
        assert!(fitted[0] > 2.2 && fitted[0] < 2.5 && fitted.last() > Some(&3.7), "2.5 s + 0.7 · 2 s, about");
        assert!(held[0] < 4.3 && held.last() > Some(&4.5) && held.last() < Some(&4.8));
        assert_eq!(parts.notes.len(), 1, "{:?}", parts.notes);
    }

    #[test]
    fn small_motions_are_no_rest() {
        let t: Vec<f64> = (0..10_000).map(|k| f64::from(k) * 0.001).collect();
        let q =
            t.iter().map(|t| if *t < 5.0 { t.sin() } else { 5f64.sin() + 4e-3 * (6.0 * (t - 5.0)).sin() });
        let columns = vec![("q1".into(), q.collect()), ("t".into(), t)];
        let parts =
            Parts::of(&[Recording::new(Path::new("made.csv"), columns).expect("a recording")], Held::Ends);
        assert_eq!((parts.held[0].t.last(), parts.notes.len()), (Some(&9.999), 0));
    }

    #[test]
    fn a_long_recording_stays_in_bounds_and_keeps_its_ends() {
        let long = recording(1_000_000);
        let parts = Parts::of(std::slice::from_ref(&long), Held::Ends);
        let count = parts.fitted[0].len() + parts.held[0].len();
        println!("{count} of {} samples", long.len());
        assert!(count <= MOST_NUMBERS && count > MOST_NUMBERS / 2);
        assert_eq!(parts.held[0].t.last(), long.t.last());
        assert_eq!(parts.notes.len(), 1);
    }
}
