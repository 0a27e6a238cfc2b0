//! Three parts of the data: the fit part for the servos, the choice part for deciding on their parameters, and the test part, which no earlier step uses.

use std::ops::Range;

use freeplay_recording::Recording;
use freeplay_servo::{Problem, Sight, Track};

use super::tracks::{longest_gap, rollout_step};

/// Longest window of a rollout, s: many times the lag of a servo, so that its start costs little, and short enough that a diverging window is one of many.
pub const WINDOW: f64 = 20.0;
/// Shares of a single recording for fit and choice; the rest is the test part.
const SHARES: [f64; 2] = [0.6, 0.8];

/// Rows of a recording.
pub type Rows = (usize, Range<usize>);

/// The rows of each part.
pub struct Parts {
    /// Rows for the fit of the servos.
    pub fit: Vec<Rows>,
    /// Rows for the choice.
    pub choice: Vec<Rows>,
    /// Rows for the test.
    pub test: Vec<Rows>,
    /// The test part, in words.
    pub words: String,
}

impl Parts {
    /// Splits the recordings. Of three recordings or more the last is the test part and the one before the choice part. Of two the last is the test part and
    /// the end of the first the choice part. A single one is cut in three by its rows with motion.
    pub fn of(recordings: &[Recording], tracks: &[Track]) -> Parts {
        let whole = |index: usize| (index, 0..tracks[index].stamps.len());
        let name = |index: usize| {
            recordings[index]
                .origin
                .file_name()
                .map_or_else(String::new, |name| name.to_string_lossy().into_owned())
        };
        let count = tracks.len();
        let last = count - 1;
        match count {
            1 => {
                let [first, second] = cuts(&tracks[0]);
                let rows = tracks[0].stamps.len();
                Parts {
                    fit: vec![(0, 0..first)],
                    choice: vec![(0, first..second)],
                    test: vec![(0, second..rows)],
                    words: format!("the last fifth of {}, which neither fit nor choice used", name(0)),
                }
            }
            2 => {
                let cut = cuts(&tracks[0])[1];
                Parts {
                    fit: vec![(0, 0..cut)],
                    choice: vec![(0, cut..tracks[0].stamps.len())],
                    test: vec![whole(1)],
                    words: format!("{}, which neither fit nor choice used", name(1)),
                }
            }
            _ => Parts {
                fit: (0..last - 1).map(whole).collect(),
                choice: vec![whole(last - 1)],
                test: vec![whole(last)],
                words: format!("{}, which neither fit nor choice used", name(last)),
            },
        }
    }
}

/// Rows at which the [`SHARES`] of a track's moving rows have passed.
fn cuts(track: &Track) -> [usize; 2] {
    SHARES.map(|share| moving_cut(track, share))
}

/// The row at which `share` of a track's moving rows has passed.
pub fn moving_cut(track: &Track, share: f64) -> usize {
    let rows = track.stamps.len();
    let moves = |row: usize| track.measured.iter().any(|q| row > 0 && q[row] != q[row - 1]);
    let moving: Vec<usize> = (0..rows).filter(|row| moves(*row)).collect();
    let at = (share * moving.len() as f64) as usize;
    moving.get(at).copied().unwrap_or((share * rows as f64) as usize)
}

/// The problem of `parts` of `tracks`, in windows of at most `longest` s.
pub fn problem<'a>(tracks: &'a [Track], parts: &[Rows], sights: &[Sight], longest: f64) -> Problem<'a> {
    let windows = parts.iter().flat_map(|(index, part)| {
        let gap = longest_gap(&tracks[*index]);
        let windows = tracks[*index].windows(gap, longest).into_iter();
        let inside = windows.map(|rows| rows.start.max(part.start)..rows.end.min(part.end));
        inside.filter(|rows| rows.len() > 1).map(|rows| (*index, rows)).collect::<Vec<_>>()
    });
    let steps = tracks.iter().map(rollout_step);
    Problem {
        tracks,
        windows: windows.collect(),
        counted: Vec::new(),
        rounding: sights.iter().map(|sight| rounding(sight.tick)).collect(),
        longest_step: steps.fold(f64::INFINITY, f64::min),
        threads: std::thread::available_parallelism().map_or(1, usize::from),
    }
}

/// Standard deviation of rounding to a `tick`; for a tick of zero, that of double precision.
pub fn rounding(tick: f64) -> f64 {
    (tick / 12.0_f64.sqrt()).max(f64::EPSILON)
}
