//! Motions of prescribed joints.

use freeplay_path::JointPath;

/// A motion of all joints of the nominal arm over time.
pub trait Motion {
    /// Writes position (rad, m), velocity and acceleration of every joint at the simulated time `t`, s.
    fn at(&self, t: f64, q: &mut [f64], v: &mut [f64], a: &mut [f64]);
}

impl Motion for JointPath {
    fn at(&self, t: f64, q: &mut [f64], v: &mut [f64], a: &mut [f64]) {
        JointPath::at(self, t, q, v, a);
    }
}

/// One tick of motion between two states of the joints, by the quintic with the given position, velocity and acceleration at both ends.
#[derive(Clone, Debug)]
pub struct Hermite {
    start: f64,
    duration: f64,
    ends: [Vec<[f64; 3]>; 2],
}

impl Hermite {
    /// A motion of `dof` joints at rest at zero.
    pub fn new(dof: usize) -> Self {
        Self { start: 0.0, duration: 1.0, ends: [vec![[0.0; 3]; dof], vec![[0.0; 3]; dof]] }
    }

    /// Sets the initial state at time `start`, s, as \[q, v, a\] of each joint, and the duration, s.
    pub fn begin(&mut self, start: f64, duration: f64, from: impl Iterator<Item = [f64; 3]>) {
        (self.start, self.duration) = (start, duration);
        self.ends[0].iter_mut().zip(from).for_each(|(end, state)| *end = state);
    }

    /// Sets the final state, as \[q, v, a\] of each joint.
    pub fn finish(&mut self, to: impl Iterator<Item = [f64; 3]>) {
        self.ends[1].iter_mut().zip(to).for_each(|(end, state)| *end = state);
    }
}

impl Motion for Hermite {
    fn at(&self, t: f64, q: &mut [f64], v: &mut [f64], a: &mut [f64]) {
        let (h, s) = (self.duration, ((t - self.start) / self.duration).clamp(0.0, 1.0));
        for (joint, (from, to)) in self.ends[0].iter().zip(&self.ends[1]).enumerate() {
            [q[joint], v[joint], a[joint]] = quintic(h, s, *from, *to);
        }
    }
}

/// The quintic from `from` to `to` (\[q, v, a\]) over the duration `h`, at the fraction `s` of it.
pub(crate) fn quintic(h: f64, s: f64, from: [f64; 3], to: [f64; 3]) -> [f64; 3] {
    // Coefficients of q(s) = Σ cᵢ sⁱ; the last three from the conditions at s = 1.
    let [c0, c1, c2] = [from[0], from[1] * h, 0.5 * from[2] * h * h];
    let d0 = to[0] - (c0 + c1 + c2);
    let d1 = to[1] * h - (c1 + 2.0 * c2);
    let d2 = to[2] * h * h - 2.0 * c2;
    let c3 = 10.0 * d0 - 4.0 * d1 + 0.5 * d2;
    let c4 = -15.0 * d0 + 7.0 * d1 - d2;
    let c5 = 6.0 * d0 - 3.0 * d1 + 0.5 * d2;
    [
        c0 + s * (c1 + s * (c2 + s * (c3 + s * (c4 + s * c5)))),
        (c1 + s * (2.0 * c2 + s * (3.0 * c3 + s * (4.0 * c4 + s * 5.0 * c5)))) / h,
        (2.0 * c2 + s * (6.0 * c3 + s * (12.0 * c4 + s * 20.0 * c5))) / (h * h),
    ]
}

/// Braking joints: each slows down at a constant rate to rest and stays there.
#[derive(Clone, Debug)]
pub struct Braking {
    start: f64,
    from: Vec<[f64; 2]>,
    rate: Vec<f64>,
}

impl Braking {
    /// Brakes for `rate.len()` joints, each slowing down at its `rate`, rad/s² or m/s², > 0.
    pub fn new(rate: Vec<f64>) -> Self {
        Self { start: 0.0, from: vec![[0.0; 2]; rate.len()], rate }
    }

    /// Closes the brakes at the time `start`, s, with the joints at the positions and velocities `from`.
    pub fn close(&mut self, start: f64, from: impl Iterator<Item = [f64; 2]>) {
        self.start = start;
        self.from.iter_mut().zip(from).for_each(|(kept, state)| *kept = state);
    }
}

impl Motion for Braking {
    fn at(&self, t: f64, q: &mut [f64], v: &mut [f64], a: &mut [f64]) {
        for (joint, (&[q0, v0], &rate)) in self.from.iter().zip(&self.rate).enumerate() {
            let stop = v0.abs() / rate;
            let elapsed = (t - self.start).clamp(0.0, stop);
            let slowing = -rate.copysign(v0);
            let standing = t - self.start >= stop;
            q[joint] = q0 + elapsed * (v0 + 0.5 * slowing * elapsed);
            v[joint] = if standing { 0.0 } else { v0 + slowing * elapsed };
            a[joint] = if standing { 0.0 } else { slowing };
        }
    }
}

#[cfg(test)]
mod tests {
    use super::{Braking, Hermite, Motion};

    fn read(motion: &dyn Motion, t: f64) -> [f64; 3] {
        let (mut q, mut v, mut a) = ([0.0], [0.0], [0.0]);
        motion.at(t, &mut q, &mut v, &mut a);
        [q[0], v[0], a[0]]
    }

    #[test]
    fn a_quintic_is_reproduced_exactly() {
        let poly = |t: f64| {
            [
                1.0 + t - 2.0 * t.powi(3) + 0.7 * t.powi(5),
                1.0 - 6.0 * t * t + 3.5 * t.powi(4),
                -12.0 * t + 14.0 * t.powi(3),
            ]
        };
        let mut motion = Hermite::new(1);
        motion.begin(0.2, 0.5, [poly(0.2)].into_iter());
        motion.finish([poly(0.7)].into_iter());
        for step in 0..=10 {
            let t = 0.2 + 0.05 * f64::from(step);
            for (got, want) in read(&motion, t).into_iter().zip(poly(t)) {
                println!("t = {t:.2}: margin {:.1e}", (got - want).abs());
                assert!((got - want).abs() < 1e-12);
            }
        }
    }

    #[test]
    fn a_braking_joint_stops_and_stays() {
        let mut brakes = Braking::new(vec![10.0]);
        brakes.close(1.0, [[0.5, -2.0]].into_iter());
        assert_eq!(read(&brakes, 1.0), [0.5, -2.0, 10.0]);
        let stopped = read(&brakes, 1.25);
        assert!((stopped[0] - (0.5 - 2.0 * 2.0 / 20.0)).abs() < 1e-15, "{stopped:?}");
        assert_eq!(read(&brakes, 5.0), stopped);
        assert_eq!(stopped[1..], [0.0, 0.0]);
    }
}
