//! Events of an arm that no servo explains: a stop at the end of a joint, and contact with something. Both cause a steady deviation for some time.

use std::ops::Range;

use freeplay_arm::{Workspace, forward_kinematics, jacobian, rnea};
use freeplay_servo::{Noise, ServoArm, Track};
use nalgebra::{DMatrix, DVector};

/// Averaging time of deviations, s: longer than a servo's lag, so that the errors of a fit in fast motion average out.
const STEADY: f64 = 0.5;
/// A steady deviation beyond this multiple of the noise is an event: under Student's t, which weights the noise, one row in 2000 is larger, and the mean of
/// half a second far more rarely.
const BEYOND: f64 = 10.0;
/// Compliance of a stop: a joint at a stop moves by less than this share of its deviation, since the stop is stiff against the servo.
const GIVES: f64 = 0.25;

/// An event of the arm.
#[derive(Clone, Debug, PartialEq)]
pub struct Event {
    /// Index of the recording.
    pub recording: usize,
    /// Its rows.
    pub rows: Range<usize>,
    /// Begin and end, s.
    pub time: [f64; 2],
    /// The kind of event.
    pub what: What,
}

/// The kind of an event.
#[derive(Clone, Debug, PartialEq)]
pub enum What {
    /// The joint rests at the end of its range, at a position in rad (m), above (else below) which it can't move.
    Stop {
        /// Index of the joint.
        joint: usize,
        /// Position of the stop.
        position: f64,
        /// True if the stop is at the upper end.
        is_above: bool,
    },
    /// The arm touches something.
    Contact {
        /// The deviating joints.
        joints: Vec<usize>,
        /// Mean position of the tool, base frame, m.
        point: [f64; 3],
        /// Mean force on the tool, base frame, N, if the stiffness of the servos is known.
        force: Option<[f64; 3]>,
    },
}

/// Least share of the mean in the root mean square of a steady deviation. Fast motion that a model misses changes its sign.
const LASTS: f64 = 0.5;

/// Mean and root mean square of each column of `values`, `[row][column]` on rows of `stamps`, over [`STEADY`] about each row.
fn steady(stamps: &[f64], values: &[f64], columns: usize) -> Vec<Vec<[f64; 2]>> {
    let of_column = |column: usize| {
        let r = values.iter().skip(column).step_by(columns).map(|r| if r.is_nan() { 0.0 } else { *r });
        let mut sums = vec![[0.0, 0.0]];
        let mut sum = [0.0, 0.0];
        sums.extend(r.map(|r| {
            sum = [sum[0] + r, sum[1] + r * r];
            sum
        }));
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
                let [mean, square] = [0, 1].map(|of| (sums[to][of] - sums[from][of]) / (to - from) as f64);
                [mean, square.max(0.0).sqrt()]
            })
            .collect()
    };
    (0..columns).map(of_column).collect()
}

/// The data for judging the events of a recording.
pub struct Judging<'a> {
    /// The fitted model.
    pub model: &'a ServoArm,
    /// Its usual residual.
    pub noise: &'a Noise,
    /// True for joints with known stiffness.
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
        let joints = self.model.joints.len();
        let steady = steady(&track.stamps[rows.clone()], residual, joints);
        let held = self::steady(&track.stamps[rows.clone()], &self.held_off(track, rows), joints);
        let is_off = |joint: usize, row: usize| {
            let [mean, rms] = steady[joint][row];
            mean.abs() > (BEYOND * self.noise.size[joint]).max(LASTS * rms)
        };
        let beyond_friction = |joint: usize, row: usize| {
            let servo = &self.model.joints[joint];
            held[joint][row][0].abs() - (servo.coulomb + servo.stiction) / servo.stiffness
        };
        // The rows that the simulation explains show the error of the static balance without any contact.
        let wrong: Vec<f64> = (0..joints)
            .map(|joint| {
                let explained = (0..rows.len()).filter(|row| !is_off(joint, *row));
                explained.map(|row| beyond_friction(joint, row)).fold(self.noise.size[joint], f64::max)
            })
            .collect();
        let is_held = |joint: usize, row: usize| beyond_friction(joint, row) > wrong[joint];
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
            // Deviations with a pause shorter than the averaging time are one event.
            while row < rows.len()
                && track.stamps[rows.start + row] - track.stamps[rows.start + last] <= STEADY
            {
                if any(row) {
                    last = row;
                }
                row += 1;
            }
            let is_in_it =
                |joint: &usize| (begin..=last).any(|row| is_off(*joint, row) && is_held(*joint, row));
            let off: Vec<usize> = (0..joints).filter(is_in_it).collect();
            let of_event = rows.start + begin..rows.start + last + 1;
            let time = [track.stamps[of_event.start], track.stamps[of_event.end - 1]];
            if off.is_empty() || time[1] - time[0] < STEADY {
                continue;
            }
            let from = (of_event.start - rows.start) * joints..(of_event.end - rows.start) * joints;
            let what = self.stop(track, &of_event, &off, &residual[from.clone()]);
            let what = what.unwrap_or_else(|| self.contact(track, &of_event, off, &residual[from]));
            events.push(Event { recording: index, rows: of_event, time, what });
        }
        events
    }

    /// Deviation of each joint from the balance of servo, load and inertia, `[row][joint]`, rad (m). Friction can hold a joint off by up to its amount over the
    /// stiffness, and the history decides where in that band the joint rests. A larger deviation needs another cause.
    fn held_off(&self, track: &Track, rows: &Range<usize>) -> Vec<f64> {
        let arm = &self.model.arm;
        let mut workspace = Workspace::new(arm);
        let [mut q, mut v, mut a, mut load] = [0; 4].map(|_| vec![0.0; arm.dof()]);
        let mut all = Vec::with_capacity(rows.len() * arm.dof());
        for row in rows.clone() {
            let (before, after) = (row.saturating_sub(1), (row + 1).min(track.stamps.len() - 1));
            let [t, t_before, t_after] = [row, before, after].map(|row| track.stamps[row]);
            for joint in 0..arm.dof() {
                let at = |row: usize| track.measured[joint][row];
                q[joint] = at(row);
                v[joint] = (at(after) - at(before)) / (t_after - t_before);
                // Over an event these accelerations average to the change of speed, whatever the encoder's steps are.
                let is_inside = before < row && row < after;
                let slopes =
                    [(at(after) - q[joint]) / (t_after - t), (q[joint] - at(before)) / (t - t_before)];
                a[joint] = if is_inside { (slopes[0] - slopes[1]) * 2.0 / (t_after - t_before) } else { 0.0 };
            }
            rnea(arm, &mut workspace, &q, &v, &a, &mut load);
            all.extend(self.model.joints.iter().enumerate().map(|(joint, servo)| {
                let error = track.commands[joint].at(servo, t) - q[joint];
                let needed = load[joint] + servo.rotor_inertia * a[joint];
                (servo.torque(error, v[joint]) - needed) / servo.stiffness
            }));
        }
        all
    }

    /// The stop at which a joint rests that deviates far more than all others. The function uses the middle half of the event, since the mean at its ends
    /// includes the motion.
    fn stop(&self, track: &Track, rows: &Range<usize>, off: &[usize], residual: &[f64]) -> Option<What> {
        let quarter = rows.len() / 4;
        let middle = quarter..rows.len() - quarter;
        let joints = self.model.joints.len();
        let mean_of = |joint: usize| {
            let r = middle.clone().map(|row| residual[row * joints + joint]).filter(|r| r.is_finite());
            (r.sum::<f64>() / middle.len().max(1) as f64).abs()
        };
        let joint = off.iter().copied().max_by(|a, b| mean_of(*a).total_cmp(&mean_of(*b)))?;
        // The other joints deviate by the load that the stop takes over from them.
        if off.iter().any(|other| *other != joint && mean_of(*other) > GIVES * mean_of(joint)) {
            return None;
        }
        let deviation = |row: usize| residual[row * joints + joint];
        let inside: Vec<(f64, f64)> = middle
            .clone()
            .map(|row| (track.measured[joint][rows.start + row], deviation(row)))
            .filter(|(q, r)| q.is_finite() && r.is_finite())
            .collect();
        let mean = inside.iter().map(|(_, r)| r).sum::<f64>() / inside.len().max(1) as f64;
        // The measured position stays below the simulated one: the stop is at the upper end.
        let is_above = mean < 0.0;
        let outwards = |q: f64| if is_above { q } else { -q };
        let most = |all: &mut dyn Iterator<Item = f64>| all.map(outwards).fold(f64::NEG_INFINITY, f64::max);
        let end = most(&mut inside.iter().map(|(q, _)| *q));
        let begin = inside.iter().map(|(q, _)| outwards(*q)).fold(f64::INFINITY, f64::min);
        let rests = end - begin <= GIVES * mean.abs() + self.ticks[joint];
        let columns = self.tracks.iter().flat_map(|track| track.measured[joint].iter().copied());
        let is_end = most(&mut columns.filter(|q| q.is_finite())) <= end + GIVES * mean.abs();
        (rests && is_end).then_some(What::Stop { joint, position: outwards(end), is_above })
    }

    /// A contact with the deviations `residual`: the torques of the servos against it are Jᵀ f.
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
        let is_strong_evidence = joints.iter().all(|joint| self.is_known[*joint]);
        let force = force.filter(|force| is_strong_evidence && force.iter().all(|f| f.is_finite()));
        What::Contact {
            joints,
            point: point.map(|sum: f64| sum / f64::max(count, 1.0)),
            force: force.map(|force| [force[0], force[1], force[2]]),
        }
    }
}
