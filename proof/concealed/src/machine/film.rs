//! A journal in its bearing, in oil: Reynolds' film of a long bearing.
//!
//! The model integrates the pressure of Sommerfeld's solution, squeeze included, counted from the widest gap, around the bearing wherever it is positive
//! (Gümbel's condition), point by point. The catalogue uses the closed form of Pinkus & Sternlicht (1961). It agrees for a resting journal (a test). For a
//! journal that is pushed in fast it is 15 to 25 % weaker, and it pulls back a journal that leaves fast, where this film has broken. The viscosity means the
//! same.

use super::dry_bearing::{Push, RADIUS};

/// Length of the bearing, m.
const LENGTH: f64 = 0.040;
/// Points around the bearing.
const POINTS: usize = 48;
/// Least thickness of the film as a share of the clearance: the height of the roughness.
const LEAST: f64 = 0.02;

/// A bearing with oil in its clearance.
#[derive(Clone, Debug)]
pub(crate) struct OilBearing {
    clearance: f64,
    /// 6 μ (R/c)² R L, the factor of pressures over 1/s when integrated, N·s.
    factor: f64,
    circle: Vec<[f64; 2]>,
}

impl OilBearing {
    /// The bearing with radial clearance (m) and viscosity (Pa·s).
    pub fn new(clearance: f64, viscosity: f64) -> Self {
        let circle = (0..POINTS)
            .map(|k| {
                let (sin, cos) = (std::f64::consts::TAU * (k as f64 + 0.5) / POINTS as f64).sin_cos();
                [sin, cos]
            })
            .collect();
        Self { clearance, factor: 6.0 * viscosity * (RADIUS / clearance).powi(2) * RADIUS * LENGTH, circle }
    }

    /// Force and moment of the film on a journal at `x` that moves with `u` and turns with `spin` against the bearing.
    pub fn push(&self, x: [f64; 2], u: [f64; 2], spin: f64) -> Push {
        let distance = x[0].hypot(x[1]).max(1e-9 * self.clearance);
        let normal = [x[0] / distance, x[1] / distance];
        let ratio = (distance / self.clearance).min(1.0 - LEAST);
        let growth = (u[0] * normal[0] + u[1] * normal[1]) / self.clearance;
        let turning = (u[1] * normal[0] - u[0] * normal[1]) / distance;
        let (radial, across) = self.film(ratio, growth, spin - 2.0 * turning);
        let mut force = [radial * normal[0] - across * normal[1], radial * normal[1] + across * normal[0]];
        // At a film as thin as the roughness the metal carries the load: a stiff wall.
        let depth = distance - self.clearance * (1.0 - LEAST);
        if depth > 0.0 {
            let wall = 2e7 * depth;
            force[0] -= wall * normal[0];
            force[1] -= wall * normal[1];
        }
        Push { force, moment: 0.0 }
    }

    /// Force on the journal along the line of centres and across it (a quarter turn on), N, at the eccentricity ratio `ratio`,
    /// growing with `growth` 1/s, for the effective speed of rotation `spin`, rad/s. The angle runs from the widest gap: film
    /// 1 + ε cos θ.
    fn film(&self, ratio: f64, growth: f64, spin: f64) -> (f64, f64) {
        let (mut radial, mut across) = (0.0, 0.0);
        let wedge = spin * ratio / (2.0 + ratio * ratio);
        let closed = 1.0 / ((1.0 + ratio) * (1.0 + ratio));
        let squeeze = if ratio > 1e-6 { growth / ratio } else { 0.0 };
        for [sin, cos] in &self.circle {
            // θ = 0 is at the thickest film, opposite to the journal's displacement.
            let film = 1.0 + ratio * cos;
            let inverse = 1.0 / (film * film);
            let pressure = wedge * sin * (1.0 + film) * inverse + squeeze * (inverse - closed);
            let positive = pressure.max(0.0);
            radial += positive * cos;
            across += positive * sin;
        }
        let weight = self.factor * std::f64::consts::TAU / POINTS as f64;
        (radial * weight, across * weight)
    }
}

#[cfg(test)]
mod tests {
    use super::OilBearing;

    /// A journal that rests against a steady load: the forces of the half-Sommerfeld film in closed form, for
    /// 0.4 Pa·s, a clearance of 0.2 mm and 20 rad/s at half eccentricity.
    #[test]
    fn a_resting_journal_has_the_closed_forms_forces() {
        let film = OilBearing::new(2e-4, 0.4);
        let (radial, across) = film.film(0.5, 0.0, 20.0);
        println!("radial {radial:.2} N (−14.23), across {across:.2} N (38.70)");
        assert!((radial + 14.23).abs() < 0.05 && (across - 38.70).abs() < 0.03);
    }

    /// The film resists a journal that is pushed in, and lets go of one that is pulled out.
    #[test]
    fn the_film_resists_approach_only() {
        let film = OilBearing::new(2e-4, 0.4);
        let (inwards, outwards) = (film.film(0.5, 10.0, 0.0).0, film.film(0.5, -10.0, 0.0).0);
        println!("approach {inwards:.1} N, departure {outwards:.1} N");
        assert!(inwards < -200.0 && outwards == 0.0);
    }
}
