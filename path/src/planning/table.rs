//! The motion of the joints as a table, evaluated anywhere without allocation.

use std::fmt;

use crate::planning::laps::{Laps, Phase, SNAP};

/// Position, velocity and acceleration of all joints at one instant (rad or m, and per s, per s²).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sample<'a> {
    /// Positions.
    pub q: &'a [f64],
    /// Velocities.
    pub v: &'a [f64],
    /// Accelerations.
    pub a: &'a [f64],
}

/// The reference motion of an arm's joints.
///
/// Nodes hold (q, v, a) of the exact path. Between them lies the quintic polynomial that agrees with both neighbours in all three (Hermite
/// interpolation; error of q of order h⁶, of v h⁵, of a h⁴). Where the acceleration of the path jumps there are two nodes at the same time,
/// one with each limit, so that the polynomial on either side uses only its own limit. [`JointPath::plan`] makes the path; it is immutable.
#[derive(Clone)]
pub struct JointPath {
    dof: usize,
    rate: f64,
    laps: Laps,
    /// Times of the nodes within a lap, s; non-decreasing.
    times: Vec<f64>,
    /// q, v and a of all joints, for each node.
    values: Vec<f64>,
    peak_velocity: Vec<f64>,
    peak_acceleration: Vec<f64>,
}

impl JointPath {
    /// Wraps a table of nodes; the first and last two of them are distinct in time.
    pub(crate) fn new(dof: usize, rate: f64, laps: Laps, times: Vec<f64>, values: Vec<f64>) -> JointPath {
        let peak = |part: usize| {
            let rows = values.chunks_exact(3 * dof);
            rows.fold(vec![0.0_f64; dof], |mut peak, row| {
                for (p, x) in peak.iter_mut().zip(&row[part * dof..]) {
                    *p = p.max(x.abs());
                }
                peak
            })
        };
        let (peak_velocity, peak_acceleration) = (peak(1), peak(2));
        JointPath { dof, rate, laps, times, values, peak_velocity, peak_acceleration }
    }

    /// Time of the whole motion, s.
    pub fn duration(&self) -> f64 {
        self.laps.duration()
    }

    /// The laps.
    pub(crate) fn laps(&self) -> Laps {
        self.laps
    }

    /// The position at the end of a lap.
    pub(crate) fn lap_end(&self) -> &[f64] {
        &self.values[self.values.len() - 3 * self.dof..][..self.dof]
    }

    /// Number of joints.
    pub fn dof(&self) -> usize {
        self.dof
    }

    /// Number of ticks, at the rate given to [`JointPath::plan`], that cover the motion: the first tick at or after
    /// its end.
    pub fn ticks(&self) -> u64 {
        (self.duration() * self.rate - 1e-6).ceil().max(1.0) as u64
    }

    /// Largest speed of each joint over the nodes, rad/s or m/s.
    pub fn peak_velocity(&self) -> &[f64] {
        &self.peak_velocity
    }

    /// Largest magnitude of each joint's acceleration over the nodes, rad/s² or m/s².
    pub fn peak_acceleration(&self) -> &[f64] {
        &self.peak_acceleration
    }

    /// The first point of the motion, at t = 0, with the velocity of the motion (not at rest).
    pub fn start(&self) -> Sample<'_> {
        self.node(0)
    }

    /// Writes position, velocity and acceleration of the joints at time `t` in s.
    ///
    /// Where the acceleration jumps it is the limit from the right. Before 0 (and for NaN) the joints rest at the first point, after the
    /// duration at the last one, with zero velocity and acceleration.
    ///
    /// # Panics
    /// If a slice is shorter than [`JointPath::dof`]; the function fills longer ones from their beginning.
    pub fn at(&self, t: f64, q: &mut [f64], v: &mut [f64], a: &mut [f64]) {
        match self.laps.phase(t) {
            Phase::Before => self.hold(0, q, v, a),
            Phase::After => self.hold(self.times.len() - 1, q, v, a),
            Phase::Running(t) => self.interpolate(t, q, v, a),
        }
    }

    fn node(&self, index: usize) -> Sample<'_> {
        let row = &self.values[3 * self.dof * index..3 * self.dof * (index + 1)];
        let (q, rest) = row.split_at(self.dof);
        let (v, a) = rest.split_at(self.dof);
        Sample { q, v, a }
    }

    fn hold(&self, index: usize, q: &mut [f64], v: &mut [f64], a: &mut [f64]) {
        q[..self.dof].copy_from_slice(self.node(index).q);
        v[..self.dof].fill(0.0);
        a[..self.dof].fill(0.0);
    }

    fn interpolate(&self, t: f64, q: &mut [f64], v: &mut [f64], a: &mut [f64]) {
        let after = self.times.partition_point(|&node| node <= t + SNAP);
        let index = after.clamp(1, self.times.len() - 1) - 1;
        let (left, right) = (self.node(index), self.node(index + 1));
        let h = self.times[index + 1] - self.times[index];
        let u = ((t - self.times[index]) / h).clamp(0.0, 1.0);
        for j in 0..self.dof {
            let (from, to) = ([left.q[j], left.v[j], left.a[j]], [right.q[j], right.v[j], right.a[j]]);
            [q[j], v[j], a[j]] = quintic_hermite(from, to, h, u);
        }
    }
}

impl fmt::Debug for JointPath {
    /// Omits the table.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("JointPath")
            .field("dof", &self.dof)
            .field("rate", &self.rate)
            .field("laps", &self.laps)
            .field("nodes", &self.times.len())
            .field("peak_velocity", &self.peak_velocity)
            .field("peak_acceleration", &self.peak_acceleration)
            .finish()
    }
}

/// The quintic with value and two derivatives `from` at u = 0 and `to` at u = 1, over `h` seconds; with derivatives.
fn quintic_hermite(from: [f64; 3], to: [f64; 3], h: f64, u: f64) -> [f64; 3] {
    let (c1, c2) = (from[1] * h, from[2] * h * h / 2.0);
    // Error of the parabola through `from` at the end, in value, slope and curvature.
    let d0 = to[0] - from[0] - c1 - c2;
    let d1 = to[1] * h - c1 - 2.0 * c2;
    let d2 = to[2] * h * h - 2.0 * c2;
    let c3 = 10.0 * d0 - 4.0 * d1 + d2 / 2.0;
    let c4 = -15.0 * d0 + 7.0 * d1 - d2;
    let c5 = 6.0 * d0 - 3.0 * d1 + d2 / 2.0;
    let q = from[0] + u * (c1 + u * (c2 + u * (c3 + u * (c4 + u * c5))));
    let v = c1 + u * (2.0 * c2 + u * (3.0 * c3 + u * (4.0 * c4 + u * 5.0 * c5)));
    let a = 2.0 * c2 + u * (6.0 * c3 + u * (12.0 * c4 + u * 20.0 * c5));
    [q, v / h, a / (h * h)]
}

#[cfg(test)]
mod tests {
    use super::{JointPath, quintic_hermite};
    use crate::planning::laps::Laps;

    #[test]
    fn reproduces_a_quintic() {
        let p = |t: f64| {
            let c = [0.3, -1.0, 0.7, 2.0, -0.4, 0.9];
            let q = c.iter().rev().fold(0.0, |sum, c| sum * t + c);
            let v = (1..6).rev().fold(0.0, |sum, k| sum * t + k as f64 * c[k]);
            let a = (2..6).rev().fold(0.0, |sum, k| sum * t + (k * (k - 1)) as f64 * c[k]);
            [q, v, a]
        };
        let (t0, h) = (0.4, 0.7);
        let mut worst = 0.0_f64;
        for u in [0.0, 0.13, 0.5, 0.99, 1.0] {
            let found = quintic_hermite(p(t0), p(t0 + h), h, u);
            let expected = p(t0 + u * h);
            assert!(expected.iter().all(|x| x.abs() > 1e-3));
            worst = found.iter().zip(expected).fold(worst, |w, (a, b)| w.max((a - b).abs()));
        }
        println!("worst error {worst:.1e}, allowed 1e-12");
        assert!(worst < 1e-12);
    }

    /// q = ½|t − 1| (t − 1) + 1: the acceleration jumps from −1 to 1 at t = 1.
    fn kinked(count: u32) -> JointPath {
        let times = vec![0.0, 1.0, 1.0, 2.0];
        let values = vec![0.5, 1.0, -1.0, 1.0, 0.0, -1.0, 1.0, 0.0, 1.0, 1.5, 1.0, 1.0];
        JointPath::new(1, 1000.0, Laps { lap: 2.0, count }, times, values)
    }

    fn at(path: &JointPath, t: f64) -> [f64; 3] {
        let (mut q, mut v, mut a) = ([9.0], [9.0], [9.0]);
        path.at(t, &mut q, &mut v, &mut a);
        [q[0], v[0], a[0]]
    }

    #[test]
    fn a_jump_of_the_acceleration_leaves_no_trace_beside_it() {
        let path = kinked(1);
        let left = at(&path, 0.999);
        assert!(
            (left[1] - 0.001).abs() < 1e-14 && (left[2] + 1.0).abs() < 1e-13,
            "left of the kink: {left:?}"
        );
        assert_eq!(at(&path, 1.0)[2], 1.0, "the limit from the right");
        assert_eq!(
            at(&path, 1.0 - 1e-12)[2],
            1.0,
            "a time that rounding put just below counts as on the kink"
        );
        assert!((at(&path, 1.5)[2] - 1.0).abs() < 1e-13);
    }

    #[test]
    fn holds_its_end_points_and_knows_its_extent() {
        let path = kinked(3);
        assert_eq!((path.duration(), path.dof(), path.ticks()), (6.0, 1, 6000));
        assert_eq!(path.start().q, [0.5]);
        assert_eq!((path.peak_velocity(), path.peak_acceleration()), ([1.0].as_slice(), [1.0].as_slice()));
        assert_eq!(at(&path, -0.1), [0.5, 0.0, 0.0]);
        assert_eq!(at(&path, f64::NAN), [0.5, 0.0, 0.0]);
        assert_eq!(at(&path, 0.0), [0.5, 1.0, -1.0]);
        assert_eq!(at(&path, 6.0), [1.5, 1.0, 1.0]);
        assert_eq!(at(&path, 6.1), [1.5, 0.0, 0.0]);
        assert_eq!(at(&path, 2.25), at(&path, 0.25), "laps repeat exactly");
        assert_eq!(at(&path, 4.0), at(&path, 0.0), "the seam belongs to the lap that begins");
    }
}
