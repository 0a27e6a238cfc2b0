//! The law of a joint's servo with measured torque: linear in all parameters but the delay of the commands.

use std::ops::Range;

use freeplay_recording::Recording;
use freeplay_servo::{Commands, JointServo, golden_section};
use nalgebra::{Matrix3, Matrix4, Vector3, Vector4};

use super::scores::BLOCK;
use super::tracks::FOR_LAGS;
use crate::signals::motion::Treatment;
use crate::statistics::Moments;

/// Step of the trial delays, s, before a line search between the neighbours of the best: a quarter of the shortest lag of a servo.
const APART: f64 = 0.005;

/// The columns of a recording for the law of one joint, on the kept points of the treatment.
pub struct Sheet<'a> {
    recording: &'a Recording,
    treatment: &'a Treatment,
    commands: Commands,
    q: Vec<f64>,
    v: Vec<f64>,
    a: Vec<f64>,
    torque: Vec<f64>,
    /// Groups of rows before the cut, for the fit, and after the cut.
    fit: Vec<Range<usize>>,
    test: Vec<Range<usize>>,
}

impl<'a> Sheet<'a> {
    /// The sheet of `joint` of `recording`, cut at the time `cut`, s; `None` if a column or a sample is missing.
    pub fn of(recording: &'a Recording, treatment: &'a Treatment, joint: usize, cut: f64) -> Option<Self> {
        let commanded = recording.q_ref.as_ref()?.get(joint)?;
        let torque = recording.tau.as_ref()?.get(joint)?;
        let is_whole = |column: &Vec<f64>| column.iter().all(|x| x.is_finite());
        if ![commanded, torque, &recording.q[joint]].into_iter().all(is_whole) {
            return None;
        }
        let [q, v, a] = treatment.smooth_with_derivatives(recording, &recording.q[joint]);
        let times = treatment.times();
        let groups = treatment.stretches().into_iter().filter(|rows| rows.len() > 1).flat_map(|rows| {
            let step = (times[rows.end - 1] - times[rows.start]) / (rows.len() - 1) as f64;
            let long = ((BLOCK / step.max(f64::EPSILON)) as usize).max(1);
            rows.clone().step_by(long).map(move |begin| begin..rows.end.min(begin + long))
        });
        // The low-pass smears rows across the cut: rows near the cut belong to neither part.
        let guard = treatment.filter().settling_time();
        let (mut fit, mut test) = (Vec::new(), Vec::new());
        for group in groups {
            if times[group.end - 1] < cut {
                fit.push(group);
            } else if times[group.start] > cut + guard {
                test.push(group);
            }
        }
        let torque = treatment.smooth(recording, torque);
        let commands = Commands::new(&recording.t, commanded);
        Some(Self { recording, treatment, commands, q, v, a, torque, fit, test })
    }

    /// The command with a delay of `delay` s, filtered like all columns. Each row is the mean of the held command from halfway to the row before to halfway to
    /// the next, so that it changes smoothly with the delay.
    fn command(&self, delay: f64) -> Vec<f64> {
        let t = &self.recording.t;
        let servo = JointServo { delay, ..JointServo::stiff(1.0) };
        let mut cursor = 0;
        let mean = |row: usize| {
            let from = 0.5 * (t[row] + t[row.saturating_sub(1)]);
            let to = 0.5 * (t[row] + t[(row + 1).min(t.len() - 1)]);
            self.commands.mean(&mut cursor, &servo, from, to)
        };
        let column: Vec<f64> = (0..t.len()).map(mean).collect();
        self.treatment.smooth(self.recording, &column)
    }

    /// Position and velocity in `row` at the time of its torque, for encoders with a delay of `late` s behind the torques: a second-order expansion, since the
    /// delay is short against a filtered motion.
    fn motion(&self, row: usize, late: f64) -> (f64, f64) {
        let (q, v, a) = (self.q[row], self.v[row], self.a[row]);
        (q + late * v + 0.5 * late * late * a, v + late * a)
    }
}

/// The law of a joint: τ = k (u(t − d) − q) − c q̇ + b.
#[derive(Clone, Copy, Debug)]
pub struct TorqueLaw {
    /// k, c and d with their standard deviations.
    pub stiffness: (f64, f64),
    pub damping: (f64, f64),
    pub delay: (f64, f64),
    /// Root mean square residual of the torques before the cut, and of those after it.
    pub left: f64,
    pub left_in_test: f64,
    /// Standard deviation of the torques after the cut.
    pub size_in_test: f64,
}

impl TorqueLaw {
    /// The least-squares law on the rows of `sheets` before the cut. Trial delays end a little beyond `lag`, s; the encoders have a delay of `late` s behind
    /// the torques. `None` if nothing moves or no rows remain for the test.
    pub fn fit(sheets: &[Sheet], lag: f64, late: f64) -> Option<Self> {
        let loss = |delay: f64| Line::fit(sheets, delay, late).map_or(f64::INFINITY, |line| line.left);
        // The lag has the resolution of these steps; a minimum at an end of the range would be no minimum.
        let steps = ((lag + 2.0 * FOR_LAGS) / APART).ceil().max(2.0) as usize;
        let tried = (0..=steps).map(|step| step as f64 * APART - FOR_LAGS).map(|delay| (delay, loss(delay)));
        let (best, least) = tried.min_by(|a, b| a.1.total_cmp(&b.1))?;
        if !least.is_finite() {
            return None;
        }
        let delay = golden_section([best - APART, best + APART], loss);
        let line = Line::fit(sheets, delay, late)?;
        let [k, c, d] = line.deviations(sheets, delay, late)?;
        let (left_in_test, size_in_test) = line.in_test(sheets, delay, late)?;
        Some(Self {
            stiffness: (line.values[0], k),
            damping: (line.values[1], c),
            delay: (delay, d),
            left: line.left,
            left_in_test,
            size_in_test,
        })
    }
}

/// The least-squares line for one delay: stiffness, damping, constant, and the root mean square residual.
struct Line {
    values: Vector3<f64>,
    left: f64,
}

impl Line {
    fn fit(sheets: &[Sheet], delay: f64, late: f64) -> Option<Self> {
        let (mut normal, mut right) = (Matrix3::zeros(), Vector3::zeros());
        let (mut square, mut count) = (0.0, 0.0);
        for sheet in sheets {
            let command = sheet.command(delay);
            for row in sheet.fit.iter().cloned().flatten() {
                let (q, v) = sheet.motion(row, late);
                let columns = Vector3::new(command[row] - q, -v, 1.0);
                normal += columns * columns.transpose();
                right += columns * sheet.torque[row];
                square += sheet.torque[row].powi(2);
                count += 1.0;
            }
        }
        let values = normal.cholesky()?.solve(&right);
        let left = (square - values.dot(&right)).max(0.0) / count;
        Some(Self { values, left: left.sqrt() })
    }

    /// Residual torque in `row` of `sheet`, and the columns of the line.
    fn left_in(&self, sheet: &Sheet, command: &[f64], row: usize, late: f64) -> (f64, Vector3<f64>) {
        let (q, v) = sheet.motion(row, late);
        let columns = Vector3::new(command[row] - q, -v, 1.0);
        (sheet.torque[row] - self.values.dot(&columns), columns)
    }

    /// Root mean square residual after the cut, and standard deviation of the torques there; `None` without rows there.
    fn in_test(&self, sheets: &[Sheet], delay: f64, late: f64) -> Option<(f64, f64)> {
        let (mut left, mut torques) = (Vec::new(), Vec::new());
        for sheet in sheets {
            let command = sheet.command(delay);
            for row in sheet.test.iter().cloned().flatten() {
                left.push(self.left_in(sheet, &command, row, late).0);
                torques.push(sheet.torque[row]);
            }
        }
        (!left.is_empty()).then(|| (Moments::of(&left).rms, Moments::of(&torques).std))
    }

    /// Standard deviations of stiffness, damping and delay from the scatter between groups of rows (White 1982, Econometrica 50:1).
    fn deviations(&self, sheets: &[Sheet], delay: f64, late: f64) -> Option<[f64; 3]> {
        let reach = 0.1 * APART;
        let (mut hessian, mut scatter, mut groups) = (Matrix4::zeros(), Matrix4::zeros(), 0.0);
        for sheet in sheets {
            let [before, command, after] = [-reach, 0.0, reach].map(|by| sheet.command(delay + by));
            for group in &sheet.fit {
                let mut score = Vector4::zeros();
                for row in group.clone() {
                    let (left, columns) = self.left_in(sheet, &command, row, late);
                    let slope = columns.push(self.values[0] * (after[row] - before[row]) / (2.0 * reach));
                    score += slope * left;
                    hessian += slope * slope.transpose();
                }
                scatter += score * score.transpose();
                groups += 1.0;
            }
        }
        let inverse = hessian.try_inverse()?;
        let few = groups / f64::max(groups - hessian.nrows() as f64, 1.0);
        let covariance = inverse * scatter * inverse * few;
        Some([0, 1, 3].map(|i| covariance[(i, i)].max(0.0).sqrt()))
    }
}
