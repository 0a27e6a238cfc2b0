//! The initial guess of a fit: the lag of each joint by cross-correlation, and a linear regression of the servo's error.

use freeplay_arm::{Arm, JointKind, Workspace, crba, gravity_torque};
use nalgebra::{DMatrix, Matrix3, Vector3};

use crate::joint::JointServo;
use crate::track::{REACH, Track};

/// Longest lag of the search, s: industrial controllers answer after up to 0.15 s, small servos after 0.1 s.
const LONGEST_LAG: f64 = 1.0;
/// The load determines a stiffness if its coefficient differs from zero by this many standard deviations.
const SIGNIFICANT: f64 = 3.0;

/// Estimates for one joint from the data, before any rollout.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sight {
    /// Delay of the measured position after the command, s.
    pub lag: f64,
    /// Root of the mean square of command minus measured position, rad (m).
    pub error: f64,
    /// Stiffness from the droop under load, N·m/rad, if the load determines it.
    pub stiffness: Option<f64>,
    /// Sliding friction over stiffness, rad.
    pub coulomb: f64,
    /// Resolution of the measured positions, rad (m).
    pub tick: f64,
}

/// Delay of column `joint` of `tracks` after its command, s: the shift of the command whose increments fit the measured ones best. A droop
/// under load has no increments, so that it does not count as a lag.
pub fn lag(tracks: &[Track], joint: usize) -> f64 {
    let error = |shift: f64| -> f64 {
        let of_track = |track: &Track| -> f64 {
            let (t, q) = (track.stamps.windows(2 * REACH + 1), track.measured[joint].windows(2 * REACH + 1));
            let command = |t: f64| track.commands[joint].between(t - shift);
            let off = |(t, q): (&[f64], &[f64])| {
                let (from, to) = (0, 2 * REACH);
                q[to] - q[from] - (command(t[to]) - command(t[from]))
            };
            t.zip(q).map(off).filter(|off| off.is_finite()).map(|off| off * off).sum()
        };
        tracks.iter().map(of_track).sum()
    };
    // A coarse grid, then a golden-section search about its best point.
    let step = 0.02;
    let coarse = (0..=(LONGEST_LAG / step) as usize).map(|index| index as f64 * step);
    let best = coarse.map(|shift| (shift, error(shift))).min_by(|a, b| a.1.total_cmp(&b.1));
    let best = best.map_or(0.0, |(shift, _)| shift);
    golden_section([(best - step).max(0.0), best + step], error)
}

/// The minimum of `of` between two bounds, to a hundredth of their distance (Kiefer 1953).
pub fn golden_section([mut low, mut high]: [f64; 2], of: impl Fn(f64) -> f64) -> f64 {
    let ratio = 0.5 * (5.0_f64.sqrt() - 1.0);
    let end = 0.01 * (high - low);
    while high - low > end {
        let (left, right) = (high - ratio * (high - low), low + ratio * (high - low));
        if of(left) < of(right) { high = right } else { low = left }
    }
    0.5 * (low + high)
}

/// The estimates from `tracks` for each joint of `arm`.
pub fn sights(arm: &Arm, tracks: &[Track]) -> Vec<Sight> {
    let mut sums = vec![Sums::default(); arm.dof()];
    let lags: Vec<f64> = (0..arm.dof()).map(|joint| lag(tracks, joint)).collect();
    let speeds: Vec<f64> = (0..arm.dof()).map(|joint| usual_speed(tracks, joint)).collect();
    let mut workspace = Workspace::new(arm);
    let (mut q, mut load) = (vec![0.0; arm.dof()], vec![0.0; arm.dof()]);
    for track in tracks {
        for row in REACH..track.stamps.len().saturating_sub(REACH) {
            (0..arm.dof()).for_each(|joint| q[joint] = track.measured[joint][row]);
            if q.iter().any(|q| q.is_nan()) {
                continue;
            }
            gravity_torque(arm, &mut workspace, &q, &mut load);
            for joint in 0..arm.dof() {
                let (before, after) = (row - REACH, row + REACH);
                let v = (track.measured[joint][after] - track.measured[joint][before])
                    / (track.stamps[after] - track.stamps[before]);
                let error = track.commands[joint].between(track.stamps[row] - lags[joint]) - q[joint];
                sums[joint].add(Vector3::new(load[joint], v.signum(), v), error, v.abs() > speeds[joint]);
            }
        }
    }
    (0..arm.dof()).map(|joint| sums[joint].sight(lags[joint], tick(tracks, joint))).collect()
}

/// Root of the mean square of the speed of `joint`, rad/s (m/s).
fn usual_speed(tracks: &[Track], joint: usize) -> f64 {
    let (mut sum, mut count) = (0.0, 0.0);
    for track in tracks {
        for (t, q) in track.stamps.windows(2 * REACH + 1).zip(track.measured[joint].windows(2 * REACH + 1)) {
            let v = (q[2 * REACH] - q[0]) / (t[2 * REACH] - t[0]);
            if v.is_finite() {
                sum += v * v;
                count += 1.0;
            }
        }
    }
    if count > 0.0 { f64::sqrt(sum / count) } else { 0.0 }
}

/// Least change of a measured position, rad (m).
fn tick(tracks: &[Track], joint: usize) -> f64 {
    let changes = tracks
        .iter()
        .flat_map(|track| track.measured[joint].windows(2).map(|pair| (pair[1] - pair[0]).abs()));
    let least = changes.filter(|change| *change > 0.0).fold(f64::INFINITY, f64::min);
    if least.is_finite() { least } else { 0.0 }
}

/// Normal equations of error = load/k + (F/k) sign v + c v, with the command delayed by the lag, on rows with enough motion; commands and
/// encoder have the same zero.
#[derive(Clone, Copy, Debug, Default)]
struct Sums {
    matrix: Matrix3<f64>,
    right: Vector3<f64>,
    square: f64,
    moving: f64,
    all: f64,
    all_square: f64,
}

impl Sums {
    fn add(&mut self, columns: Vector3<f64>, error: f64, is_moving: bool) {
        self.all += 1.0;
        self.all_square += error * error;
        if is_moving {
            self.matrix += columns * columns.transpose();
            self.right += columns * error;
            self.square += error * error;
            self.moving += 1.0;
        }
    }

    fn sight(&self, lag: f64, tick: f64) -> Sight {
        let error = if self.all > 0.0 { (self.all_square / self.all).sqrt() } else { 0.0 };
        let none = Sight { lag, error, stiffness: None, coulomb: 0.0, tick };
        let Some(inverse) = self.matrix.try_inverse() else { return none };
        let solution = inverse * self.right;
        let left = (self.square - solution.dot(&self.right)).max(0.0) / (self.moving - 3.0).max(1.0);
        let deviation = (left * inverse[(0, 0)]).max(0.0).sqrt();
        let droop = solution[0] * (self.matrix[(0, 0)] / self.moving.max(1.0)).sqrt();
        let is_told = solution[0] > SIGNIFICANT * deviation && droop > tick && solution[0].is_finite();
        Sight {
            stiffness: is_told.then(|| 1.0 / solution[0]),
            coulomb: solution[1].clamp(0.0, error.max(0.0)),
            ..none
        }
    }
}

/// Initial servos for a fit of `arm`, from `sights`; `delays` is the share of each lag that is delay. If the load of a joint does not
/// determine its stiffness, it gets the median of the others. If there is none, it gets the stiffness with which its inertia answers within
/// the lag.
pub fn servos(arm: &Arm, sights: &[Sight], delays: &[f64]) -> Vec<JointServo> {
    let mut told: Vec<f64> = sights.iter().filter_map(|sight| sight.stiffness).collect();
    told.sort_by(f64::total_cmp);
    let median = told.get(told.len() / 2).copied();
    let mut mass = DMatrix::zeros(arm.dof(), arm.dof());
    crba(arm, &mut Workspace::new(arm), &vec![0.0; arm.dof()], &mut mass);
    let servo = |(joint, (sight, share)): (usize, (&Sight, &f64))| {
        let answering = mass[(joint, joint)] / sight.lag.max(1e-3).powi(2);
        let stiffness = sight.stiffness.or(median).unwrap_or(answering);
        JointServo {
            damping: stiffness * sight.lag * (1.0 - share),
            delay: sight.lag * share,
            coulomb: stiffness * sight.coulomb,
            stribeck_velocity: stribeck_velocity(arm.joints()[joint].kind),
            ..JointServo::stiff(stiffness)
        }
    };
    sights.iter().zip(delays).enumerate().map(servo).collect()
}

/// A usual Stribeck velocity, rad/s (m/s): the middle of the range of Armstrong-Hélouvry 1991, Control of Machines with Friction, §4, for
/// greased gears of arms (0.01 to 0.1 rad/s); a tenth of the number for prismatic joints. Positions at the rates of servos do not
/// distinguish it from viscous friction, so that it is not fitted.
fn stribeck_velocity(kind: JointKind) -> f64 {
    match kind {
        JointKind::Revolute => 0.03,
        JointKind::Prismatic => 0.003,
    }
}
