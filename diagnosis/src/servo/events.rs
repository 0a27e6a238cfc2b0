//! What happens to an arm that no servo explains: a stop at the end of a joint, contact with something. Both show as a steady deviation for a while.

use std::ops::Range;

use freeplay_arm::{Workspace, forward_kinematics, jacobian};
use freeplay_servo::{Noise, ServoArm, Track};
use nalgebra::{DMatrix, DVector};

/// Time over which deviations are averaged, s: longer than a servo's lag, so that what a fit misses of quick motion averages out.
const STEADY: f64 = 0.5;
/// A deviation is none of the servo's where its mean is so many times what all but the worst hundredth of the fit's part leaves.
const BEYOND: f64 = 3.0;
/// Share of the fit's part that is taken for usual; a contact in it is rarer.
const USUAL: f64 = 0.99;
/// Ticks within which a joint at a stop stays: it gives a little, and the encoder rounds.
const STILL: f64 = 4.0;

/// Something that happened to the arm.
#[derive(Clone, Debug, PartialEq)]
pub struct Event {
    /// Index of the recording.
    pub recording: usize,
    /// Its rows.
    pub rows: Range<usize>,
    /// From when to when, s.
    pub time: [f64; 2],
    /// What it is.
    pub what: What,
}

/// What an event is.
#[derive(Clone, Debug, PartialEq)]
pub enum What {
    /// The joint rests at the end of all that it reaches, at a position in rad (m), above (else below) which it can't go.
    Stop {
        /// Index of the joint.
        joint: usize,
        /// Where.
        position: f64,
        /// The stop is above.
        is_above: bool,
    },
    /// The arm touches something.
    Contact {
        /// Joints that are off.
        joints: Vec<usize>,
        /// Mean position of the tool, base frame, m.
        point: [f64; 3],
        /// Mean force on the tool, base frame, N, where the servos' stiffness is known.
        force: Option<[f64; 3]>,
    },
}

/// Mean of each joint's deviation `residual` (`[row][joint]` on rows of `stamps`) over [`STEADY`] about each row.
fn steady(stamps: &[f64], residual: &[f64], joints: usize) -> Vec<Vec<f64>> {
    let column = |joint: usize| {
        let r: Vec<f64> =
            residual.iter().skip(joint).step_by(joints).map(|r| if r.is_nan() { 0.0 } else { *r }).collect();
        let mut sums = vec![0.0; r.len() + 1];
        r.iter().enumerate().for_each(|(row, r)| sums[row + 1] = sums[row] + r);
        let (mut from, mut to) = (0, 0);
        stamps
            .iter()
            .map(|t| {
                while stamps[from] < t - 0.5 * STEADY {
                    from += 1;
                }
                while to < stamps.len() && stamps[to] <= t + 0.5 * STEADY {
                    to += 1;
                }
                (sums[to] - sums[from]) / (to - from) as f64
            })
            .collect()
    };
    (0..joints).map(column).collect()
}

/// The steady deviation of each joint that the fit's part, `residuals` of windows of `tracks`, usually leaves; not less than its noise.
pub fn usual(
    tracks: &[Track],
    windows: &[(usize, Range<usize>)],
    residuals: &[Vec<f64>],
    noise: &Noise,
) -> Vec<f64> {
    let joints = noise.size.len();
    let mut all = vec![Vec::new(); joints];
    for ((track, rows), residual) in windows.iter().zip(residuals) {
        for (all, column) in
            all.iter_mut().zip(steady(&tracks[*track].stamps[rows.clone()], residual, joints))
        {
            all.extend(column.into_iter().map(f64::abs));
        }
    }
    let quantile = |mut all: Vec<f64>| {
        all.sort_by(f64::total_cmp);
        all.get((USUAL * all.len() as f64) as usize).copied().unwrap_or(0.0)
    };
    all.into_iter().zip(&noise.size).map(|(all, size)| quantile(all).max(*size)).collect()
}

/// What the events of a recording are judged by.
pub struct Judging<'a> {
    /// The fitted model.
    pub model: &'a ServoArm,
    /// What it usually leaves, see [`usual`].
    pub usual: &'a [f64],
    /// Whether the stiffness of each joint is known.
    pub is_known: &'a [bool],
    /// Step of each encoder, rad (m).
    pub ticks: &'a [f64],
    /// All recordings.
    pub tracks: &'a [Track],
}

impl Judging<'_> {
    /// The events of the recording number `index`, whose deviations from the start of `rows` on are `residual`.
    pub fn events(&self, index: usize, rows: &Range<usize>, residual: &[f64]) -> Vec<Event> {
        let track = &self.tracks[index];
        let joints = self.usual.len();
        let steady = steady(&track.stamps[rows.clone()], residual, joints);
        let is_off = |joint: usize, row: usize| steady[joint][row].abs() > BEYOND * self.usual[joint];
        let any = |row: usize| (0..joints).any(|joint| is_off(joint, row));
        let mut events = Vec::new();
        let mut row = 0;
        while row < rows.len() {
            if !any(row) {
                row += 1;
                continue;
            }
            let begin = row;
            let mut last = row;
            // Deviations that pause for less than the time of the mean are one event.
            while row < rows.len()
                && track.stamps[rows.start + row] - track.stamps[rows.start + last] <= STEADY
            {
                if any(row) {
                    last = row;
                }
                row += 1;
            }
            let off: Vec<usize> =
                (0..joints).filter(|joint| (begin..=last).any(|row| is_off(*joint, row))).collect();
            let of_event = rows.start + begin..rows.start + last + 1;
            let time = [track.stamps[of_event.start], track.stamps[of_event.end - 1]];
            let from = (of_event.start - rows.start) * joints..(of_event.end - rows.start) * joints;
            let what = self.stop(track, &of_event, &off, &residual[from.clone()]);
            let what = what.unwrap_or_else(|| self.contact(track, &of_event, off, &residual[from]));
            events.push(Event { recording: index, rows: of_event, time, what });
        }
        events
    }

    /// The stop that the only joint that is off rests at, in the middle half of the event: at its ends the mean sees the motion, too.
    fn stop(&self, track: &Track, rows: &Range<usize>, off: &[usize], residual: &[f64]) -> Option<What> {
        let [joint] = *off else { return None };
        let quarter = rows.len() / 4;
        let middle = rows.start + quarter..rows.end - quarter;
        let mut q: Vec<f64> =
            middle.map(|row| track.measured[joint][row]).filter(|q| q.is_finite()).collect();
        q.sort_by(f64::total_cmp);
        let position = *q.get(q.len() / 2)?;
        let mean =
            residual.iter().skip(joint).step_by(self.usual.len()).filter(|r| r.is_finite()).sum::<f64>();
        // The measured position stays below what is simulated: the stop is above.
        let is_above = mean < 0.0;
        let within = STILL * self.ticks[joint];
        let rests = q.iter().filter(|q| (*q - position).abs() <= within).count() * 10 >= q.len() * 9;
        let beyond = |q: f64| if is_above { q - position } else { position - q };
        let all = self.tracks.iter().flat_map(|track| &track.measured[joint]);
        let is_end = all.filter(|q| q.is_finite()).all(|q| beyond(*q) <= within);
        (rests && is_end).then_some(What::Stop { joint, position, is_above })
    }

    /// A contact that leaves the deviations `residual`: what the servos of the joints give against it is Jᵀ f.
    fn contact(&self, track: &Track, rows: &Range<usize>, joints: Vec<usize>, residual: &[f64]) -> What {
        let arm = &self.model.arm;
        let n = arm.dof();
        let mut workspace = Workspace::new(arm);
        let mut jacobian_here = DMatrix::zeros(6, n);
        let (mut normal, mut right) = (DMatrix::zeros(3, 3), DVector::zeros(3));
        let (mut point, mut count) = ([0.0; 3], 0.0);
        for (offset, row) in rows.clone().enumerate() {
            let q: Vec<f64> = (0..n).map(|joint| track.measured[joint][row]).collect();
            let r = &residual[offset * n..(offset + 1) * n];
            if q.iter().chain(r).any(|x| x.is_nan()) {
                continue;
            }
            let tool = forward_kinematics(arm, &mut workspace, &q).translation.vector;
            (0..3).for_each(|axis| point[axis] += tool[axis]);
            count += 1.0;
            jacobian(arm, &mut workspace, &q, &mut jacobian_here);
            let columns = jacobian_here.rows(0, 3);
            let torque = |joint: usize| self.model.joints[joint].stiffness * r[joint];
            for joint in (0..n).filter(|joint| self.is_known[*joint]) {
                normal += columns.column(joint) * columns.column(joint).transpose();
                right += columns.column(joint) * torque(joint);
            }
        }
        let force = normal.clone().try_inverse().map(|inverse| inverse * right);
        let is_told = joints.iter().all(|joint| self.is_known[*joint]);
        let force = force.filter(|force| is_told && force.iter().all(|f| f.is_finite()));
        What::Contact {
            joints,
            point: point.map(|sum: f64| sum / f64::max(count, 1.0)),
            force: force.map(|force| [force[0], force[1], force[2]]),
        }
    }
}
