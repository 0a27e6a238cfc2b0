//! The film of oil in a bearing with clearance.
//!
//! Law: the pressurised side of the film (Gümbel 1925) exerts a force on a journal at the eccentricity e = c ε that turns at ω against the
//! bearing. Its components are along the normal n (outwards) and the tangent t (in the sense of ω), with C = μ L R³/c², w = ω − 2γ̇, k² =
//! (1 − ε²)[(w/(2ε̇))² + 1/ε²], A = (2 + ε²)(1 − ε²)^(3/2), B = (2 + ε²)(1 − ε²)^(1/2):
//!
//! - ε̇ > 0: F_r = −(6Cε̇/A)[4kε² + (2 + ε²)π(k + 3)/(k + 3/2)], F_t = (6πCεw/B)(k + 3)/(k + 3/2)
//! - ε̇ < 0: F_r = (6Cε̇/A)[4kε² − (2 + ε²)πk/(k + 3/2)], F_t = (6πCεw/B)k/(k + 3/2)
//!
//! μ \[Pa·s\] viscosity, L, R, c \[m\] length, radius and clearance of the bearing, γ the direction of the eccentricity.
//! Source: Pinkus & Sternlicht 1961, Theory of Hydrodynamic Lubrication, §8; Flores et al. 2006, Mech. Mach. Theory 41:247 (long bearing).
//! Departure: the sign of the last F_r makes F_r continuous at ε̇ = 0; it is often printed the other way.
//!
//! In terms of the rates p = ε̇ and s = εw/2 the law has no singularity: k|ε̇| = √(1 − ε²)·√(p² + s²)/ε, and the force is homogeneous
//! of degree one in (p, s).

use std::f64::consts::PI;

/// Eccentricity ratio of the thinnest film in the law.
pub const MAX_ECCENTRICITY_RATIO: f64 = 0.999;

/// A film of oil.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Film {
    /// Radial clearance c, m, > 0.
    pub clearance: f64,
    /// C = μ L R³/c², N·s.
    pub resistance: f64,
}

impl Film {
    /// The film of oil of `viscosity` (Pa·s) in a bearing of `length`, `radius` and `clearance`, m.
    pub fn new(viscosity: f64, length: f64, radius: f64, clearance: f64) -> Film {
        Film { clearance, resistance: viscosity * length * radius.powi(3) / clearance.powi(2) }
    }

    /// F_r and F_t, N, at the eccentricity ratio `eps` in (0, 1) with ε̇ = `rate` and εw/2 = `slip`, 1/s.
    pub fn force(&self, eps: f64, rate: f64, slip: f64) -> [f64; 2] {
        let gap = Gap::new(eps);
        let [inwards, along] = gap.force(rate, slip);
        let per_rate = 6.0 * self.resistance / gap.radial;
        [-per_rate * inwards, per_rate * along]
    }

    /// The rates ε̇ and εw/2, 1/s, at which the film carries the force `radial`, `tangential` (N): the inverse of [`Film::force`]. The
    /// direction of the force depends on the direction of the rates alone, and turns with it.
    pub fn rates(&self, eps: f64, radial: f64, tangential: f64) -> [f64; 2] {
        let size = length(radial, tangential);
        if size == 0.0 {
            return [0.0, 0.0];
        }
        let gap = Gap::new(eps);
        let [rate, slip] = gap.rates(-radial / size, tangential.abs() / size);
        let [inwards, along] = gap.force(rate, slip);
        let times = size * gap.radial / (6.0 * self.resistance * length(inwards, along));
        [times * rate, times * slip * tangential.signum()]
    }

    /// Force on the journal, N, in the plane's coordinates (e₂ = e₁ × axis), at `offset` (m) with `velocity` (m/s), turning at `turning`
    /// (rad/s) about the axis.
    pub fn push(&self, offset: [f64; 2], velocity: [f64; 2], turning: f64) -> [f64; 2] {
        let (eps, n, t) = self.place(offset);
        let rate = (velocity[0] * n[0] + velocity[1] * n[1]) / self.clearance;
        let whirl = (velocity[0] * t[0] + velocity[1] * t[1]) / self.clearance;
        let [radial, tangential] = self.force(eps, rate, 0.5 * eps * turning - whirl);
        [radial * n[0] + tangential * t[0], radial * n[1] + tangential * t[1]]
    }

    /// Velocity of a massless journal at `offset` under the `force`, m/s; not outwards at the thinnest film.
    pub fn drift(&self, offset: [f64; 2], force: [f64; 2], turning: f64) -> [f64; 2] {
        let (eps, n, t) = self.place(offset);
        let radial = force[0] * n[0] + force[1] * n[1];
        let tangential = force[0] * t[0] + force[1] * t[1];
        let [rate, slip] = self.rates(eps, radial, tangential);
        let rate = if eps >= MAX_ECCENTRICITY_RATIO * (1.0 - 1e-9) { rate.min(0.0) } else { rate };
        let whirl = 0.5 * eps * turning - slip;
        [0, 1].map(|i| self.clearance * (rate * n[i] + whirl * t[i]))
    }

    /// Position of a massless journal at `offset` after `time` s under `force` while turning at `turning`: Heun's method in steps that are
    /// short against the remaining film and against the bearing. If the journal turns back within a step, it has passed an equilibrium with
    /// the force; the method puts it there.
    pub fn carried(&self, mut offset: [f64; 2], force: [f64; 2], turning: f64, time: f64) -> [f64; 2] {
        /// Largest change in a step, as a share of the remaining film, and of the clearance.
        const SHARE: f64 = 0.1;
        const MOST_STEPS: usize = 400;
        let mut left = time;
        for _ in 0..MOST_STEPS {
            if left <= 0.0 {
                break;
            }
            let first = self.drift(offset, force, turning);
            let (_, n, t) = self.place(offset);
            let outwards = (first[0] * n[0] + first[1] * n[1]).abs();
            let around = (first[0] * t[0] + first[1] * t[1]).abs();
            let film = self.clearance - length(offset[0], offset[1]);
            let step = left.min(SHARE * film / outwards).min(SHARE * self.clearance / around);
            let second = self.drift(self.inside([0, 1].map(|i| offset[i] + step * first[i])), force, turning);
            let turned_back = first[0] * second[0] + first[1] * second[1] < 0.0;
            let (before, after) = (length(first[0], first[1]), length(second[0], second[1]));
            let moved = if turned_back {
                first.map(|v| v * step * before / (before + after))
            } else {
                [0, 1].map(|i| 0.5 * step * (first[i] + second[i]))
            };
            offset = self.inside([0, 1].map(|i| offset[i] + moved[i]));
            left -= step;
        }
        offset
    }

    fn inside(&self, offset: [f64; 2]) -> [f64; 2] {
        let e = length(offset[0], offset[1]);
        let most = MAX_ECCENTRICITY_RATIO * self.clearance;
        if e > most { offset.map(|x| x * most / e) } else { offset }
    }

    /// Eccentricity ratio, clamped away from 0 and 1, normal and tangent axis × n = (n₂, −n₁).
    fn place(&self, offset: [f64; 2]) -> (f64, [f64; 2], [f64; 2]) {
        let e = length(offset[0], offset[1]);
        let n = if e > 0.0 { [offset[0] / e, offset[1] / e] } else { [1.0, 0.0] };
        ((e / self.clearance).clamp(1e-6, MAX_ECCENTRICITY_RATIO), n, [n[1], -n[0]])
    }
}

/// The remaining gap at one eccentricity.
struct Gap {
    /// ε² and 1 − ε².
    square: f64,
    open: f64,
    /// √(1 − ε²)/ε.
    wedge: f64,
    /// A.
    radial: f64,
}

impl Gap {
    fn new(eps: f64) -> Self {
        let (square, open) = (eps * eps, 1.0 - eps * eps);
        let root = open.sqrt();
        Self { square, open, wedge: root / eps, radial: (2.0 + square) * open * root }
    }

    /// A/(6C) times −F_r and F_t with ε̇ = `rate` and εw/2 = `slip`.
    fn force(&self, rate: f64, slip: f64) -> [f64; 2] {
        // k|ε̇|, and (k + 3)/(k + 3/2) or k/(k + 3/2) multiplied through by |ε̇|.
        let k_rate = self.wedge * length(rate, slip);
        let (more, sign) = if rate >= 0.0 { (3.0, 1.0) } else { (0.0, -1.0) };
        let below = k_rate + 1.5 * rate.abs();
        let part = if below > 0.0 { (k_rate + more * rate.abs()) / below } else { 1.0 };
        let squeeze = (2.0 + self.square) * PI * rate.abs() * part;
        [4.0 * self.square * k_rate + sign * squeeze, 2.0 * PI * self.open * slip * part]
    }

    /// The rates, of any size, at which the force on the film has the direction (`inwards`, `along`), a vector of length 1 with `along` ≥
    /// 0.
    ///
    /// A thin film yields along the wall 1/(1 − ε²) times as easily as across it: in rates scaled by this factor the force is nearly
    /// parallel to the rates, and Newton's method starts from there. Its unknown y is the share of the scaled rate across the film. Its
    /// equation, multiplied by the denominator of [`Gap::force`], has no singularity. The root lies between y = 0 and y = 1; the method
    /// halves a step that leaves the bracket.
    fn rates(&self, inwards: f64, along: f64) -> [f64; 2] {
        /// Newton's method squares its error: after a step as small as this the error is below rounding.
        const CLOSE: f64 = 1e-8;
        const MOST_STEPS: usize = 60;
        let Self { square, open, wedge: k, .. } = *self;
        let outwards = 2.0 * PI * open * inwards > 4.0 * square * k * along;
        let (more, sign) = if outwards { (3.0, 1.0) } else { (0.0, -1.0) };
        let [radial, tangential, across] =
            [4.0 * square * k * along, 2.0 * PI * open * inwards, sign * (2.0 + square) * PI * along];
        // The cross product of the film's force at y with the wanted direction, times a positive factor, and its derivative by y: at the
        // root both have the same direction.
        let off = |y: f64| {
            let (u, s) = (open * y, 1.0 - y);
            let l = length(u, s);
            let dl = (open * u - s) / l;
            let (below, dbelow) = (k * l + 1.5 * u, k * dl + 1.5 * open);
            let (part, dpart) = (k * l + more * u, k * dl + more * open);
            let value = radial * l * below + across * u * part - tangential * s * part;
            let slope = radial * (dl * below + l * dbelow) + across * (open * part + u * dpart)
                - tangential * (s * dpart - part);
            [value, slope]
        };
        let (mut least, mut most) = (0.0, 1.0);
        let mut y = inwards.abs() / (inwards.abs() + along);
        for _ in 0..MOST_STEPS {
            let [value, slope] = off(y);
            if sign * value > 0.0 {
                most = y
            } else {
                least = y
            }
            let newton = y - value / slope;
            let next = if newton >= least && newton <= most { newton } else { f64::midpoint(least, most) };
            let step = (next - y).abs();
            y = next;
            if step < CLOSE {
                break;
            }
        }
        [sign * open * y, 1.0 - y]
    }
}

/// Length of a vector; its squares must neither overflow nor underflow.
fn length(x: f64, y: f64) -> f64 {
    (x * x + y * y).sqrt()
}
