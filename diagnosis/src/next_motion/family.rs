//! The family of motions that a search chooses from: a few harmonics for each joint, from rest to rest.
//!
//! qⱼ(t) = mⱼ + Σₖ aⱼₖ sin kθ + bⱼₖ (cos kθ − 1), θ = 2π n S(t/T), S(x) = 10x³ − 15x⁴ + 6x⁵: a Fourier series of `n` cycles (Swevers et al. 1997, IEEE Trans.
//! Robot. Autom. 13:730). The phase is slow at both ends, so that the motion starts and ends at rest in the posture m and includes every speed from zero up.

use std::f64::consts::TAU;

use freeplay_laws::Trajectory;

/// Harmonics of each joint: fewer reach fewer combinations of position, speed and acceleration; the five of Swevers et al. need more candidates.
pub(super) const HARMONICS: usize = 3;

/// A motion of all joints.
#[derive(Clone, Debug, PartialEq)]
pub struct Fourier {
    /// Duration T, s.
    pub duration: f64,
    /// Cycles n of the slowest harmonic.
    pub cycles: f64,
    /// The posture at both ends, by joint, rad (m).
    pub posture: Vec<f64>,
    /// Coefficients (aⱼₖ, bⱼₖ) of each joint, rad (m).
    pub waves: Vec<[(f64, f64); HARMONICS]>,
}

impl Fourier {
    /// The same motion with all coefficients `factor` times as large.
    pub(super) fn scaled(&self, factor: f64) -> Fourier {
        let scaled = |wave: &[(f64, f64); HARMONICS]| wave.map(|(a, b)| (factor * a, factor * b));
        Fourier { waves: self.waves.iter().map(scaled).collect(), ..self.clone() }
    }

    /// Position, velocity and acceleration of `joint` at the time `t`, s.
    pub fn at(&self, joint: usize, t: f64) -> [f64; 3] {
        let [phase, rate, second] = self.phase((t / self.duration).clamp(0.0, 1.0));
        let (mut q, mut first, mut curve) = (self.posture[joint], 0.0, 0.0);
        for (k, (a, b)) in self.waves[joint].iter().enumerate() {
            let k = (k + 1) as f64;
            let (sin, cos) = (k * phase).sin_cos();
            q += a * sin + b * (cos - 1.0);
            first += k * (a * cos - b * sin);
            curve -= k * k * (a * sin + b * cos);
        }
        [q, first * rate, curve * rate * rate + first * second]
    }

    /// θ and its derivatives with respect to time at the share `x` of the duration.
    fn phase(&self, x: f64) -> [f64; 3] {
        let whole = TAU * self.cycles;
        let s = x * x * x * (10.0 - 15.0 * x + 6.0 * x * x);
        let first = 30.0 * x * x * (1.0 - x) * (1.0 - x);
        let second = 60.0 * x * (1.0 - x) * (1.0 - 2.0 * x);
        [whole * s, whole * first / self.duration, whole * second / self.duration.powi(2)]
    }

    /// The motion sampled at `rate` Hz.
    pub fn trajectory(&self, rate: f64) -> Trajectory {
        let samples = (self.duration * rate).round().max(2.0) as usize + 1;
        let mut motion = Trajectory {
            t: (0..samples).map(|k| k as f64 / rate).collect(),
            stretches: std::iter::once(0..samples).collect(),
            ..Trajectory::default()
        };
        for joint in 0..self.posture.len() {
            let (mut q, mut v, mut a) = (Vec::new(), Vec::new(), Vec::new());
            for t in &motion.t {
                let [at, speed, acceleration] = self.at(joint, *t);
                q.push(at);
                v.push(speed);
                a.push(acceleration);
            }
            motion.q.push(q);
            motion.v.push(v);
            motion.a.push(a);
        }
        motion
    }
}

#[cfg(test)]
mod tests {
    use super::Fourier;

    fn motion() -> Fourier {
        let waves = vec![[(0.3, -0.1), (0.05, 0.2), (-0.1, 0.02)], [(0.0, 0.4), (0.1, 0.0), (0.0, 0.0)]];
        Fourier { duration: 5.0, cycles: 2.0, posture: vec![0.4, -1.0], waves }
    }

    /// Velocity and acceleration against central differences, whose error is of second order in the step.
    #[test]
    fn derivatives_are_those_of_the_position() {
        let (motion, h) = (motion(), 1e-4);
        let mut worst = [0.0_f64; 2];
        let mut largest = [0.0_f64; 2];
        for k in 1..500 {
            let t = 0.01 * f64::from(k) - 0.005;
            for joint in 0..2 {
                let [before, at, after] = [t - h, t, t + h].map(|t| motion.at(joint, t)[0]);
                let [_, v, a] = motion.at(joint, t);
                let off = [v - (after - before) / (2.0 * h), a - (after - 2.0 * at + before) / (h * h)];
                worst = [worst[0].max(off[0].abs()), worst[1].max(off[1].abs())];
                largest = [largest[0].max(v.abs()), largest[1].max(a.abs())];
            }
        }
        println!("off by {worst:?} of {largest:?}");
        assert!(largest[0] > 0.5 && largest[1] > 1.0);
        assert!(worst[0] < 1e-6 * largest[0] && worst[1] < 1e-5 * largest[1]);
    }

    #[test]
    fn it_begins_and_ends_at_rest_in_its_posture() {
        let motion = motion();
        for joint in 0..2 {
            for t in [0.0, 5.0] {
                let [q, v, a] = motion.at(joint, t);
                println!("joint {joint}, {t} s: {q} {v:.1e} {a:.1e}");
                assert!((q - motion.posture[joint]).abs() < 1e-12 && v.abs() < 1e-12 && a.abs() < 1e-12);
            }
        }
    }
}
