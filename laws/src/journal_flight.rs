//! A journal in its bearing when its load reverses: it leaves the wall, flies, reaches the wall elsewhere and slides to its rest position.
//!
//! Law: with d the journal's offset across the axis, b the force that the bearing carries while the journal rests, and m the mass of all
//! links beyond the joint, m d̈ = −b + f; the wall's force f is zero for |d| < c + δ. At |d| = c + δ, δ = (F_N/K)^(2/3), the wall absorbs
//! the outward part of ḋ and rubs with μ against the sliding. Along the wall a journal then swings about the force's direction as a
//! pendulum of the length c, with [`DAMPING`] of the critical damping. Units: m, s, N, kg.
//! Source: Erkaya 2018, Eqs. 1–7, for a wall as rigid as the recording's period is long. Departure: no bounces. On generated recordings of
//! vertical axes whose journals had restitutions of 0.6 to 0.9, neither the true restitution nor 0.3 improved the course (decision 0028): a
//! recorded motion does not predict when bouncing ends, and the mean of many bounces is the wall. The deviation by bounces is part of the
//! uncertainty of the course.

use crate::Clearance;

/// Parts of a sample's period; contact with the wall occurs at the end of a part.
const PARTS: u32 = 16;
/// Damping of the swing along the wall, share of the critical damping: the total effect of bouncing and rubbing in real journals.
const DAMPING: f64 = 0.1;

/// A journal with its mass, in a bearing with a rigid wall.
#[derive(Clone, Copy, Debug)]
pub(crate) struct JournalFlight {
    clearance: Clearance,
    /// Mass beyond the joint, kg.
    mass: f64,
    /// Offset from the bearing's centre, m, and its rate of change, m/s.
    place: [f64; 2],
    rate: [f64; 2],
    /// The restitution at the wall.
    bounce: f64,
}

fn dot(a: [f64; 2], b: [f64; 2]) -> f64 {
    a[0] * b[0] + a[1] * b[1]
}

impl JournalFlight {
    /// A journal at rest against the wall, while the bearing carries `force`, N.
    pub fn resting(clearance: Clearance, mass: f64, force: [f64; 2]) -> JournalFlight {
        let size = force[0].hypot(force[1]);
        let reach = clearance.clearance + clearance.normal.static_penetration(size);
        let place = if size > 0.0 { force.map(|b| -b * reach / size) } else { [0.0; 2] };
        // A journal without a mass reaches its rest position at once.
        JournalFlight { clearance, mass: mass.max(f64::MIN_POSITIVE), place, rate: [0.0; 2], bounce: 0.0 }
    }

    /// The same with this restitution.
    pub fn bouncing(self, bounce: f64) -> JournalFlight {
        JournalFlight { bounce, ..self }
    }

    /// Offset from the bearing's centre, m.
    pub fn place(&self) -> [f64; 2] {
        self.place
    }

    /// Advances by `step` s, over which the force b goes from the first to the second of `forces`, N, while the joint turns at `turning`
    /// rad/s.
    pub fn advance(&mut self, forces: [[f64; 2]; 2], turning: f64, step: f64) {
        let part = step / f64::from(PARTS);
        for k in 0..PARTS {
            let share = (f64::from(k) + 0.5) / f64::from(PARTS);
            let pull = [0, 1].map(|i| -(forces[0][i] + (forces[1][i] - forces[0][i]) * share) / self.mass);
            for (i, pull) in pull.into_iter().enumerate() {
                self.place[i] += (self.rate[i] + 0.5 * pull * part) * part;
                self.rate[i] += pull * part;
            }
            self.meet_the_wall(pull, turning, part);
        }
    }

    fn meet_the_wall(&mut self, pull: [f64; 2], turning: f64, part: f64) {
        let eccentricity = self.place[0].hypot(self.place[1]);
        if eccentricity < self.clearance.clearance {
            return;
        }
        let normal = self.place.map(|x| x / eccentricity);
        let tangent = [normal[1], -normal[0]];
        let pressing = dot(pull, normal).max(0.0);
        let reach = self.clearance.clearance + self.clearance.normal.static_penetration(self.mass * pressing);
        self.place = normal.map(|n| n * reach.min(eccentricity));
        let (outwards, along) = (dot(self.rate, normal), dot(self.rate, tangent));
        if outwards <= 0.0 {
            return;
        }
        let sliding = along + self.clearance.journal_radius() * turning;
        let rubbed = along - self.clearance.friction.coefficient(sliding) * outwards;
        let swing = (pressing / reach).sqrt();
        let along = rubbed * (-2.0 * DAMPING * swing * part).exp();
        self.rate = [0, 1].map(|i| along * tangent[i] - self.bounce * outwards * normal[i]);
    }
}

#[cfg(test)]
mod tests {
    use std::f64::consts::PI;

    use super::{DAMPING, JournalFlight};
    use crate::{Clearance, ClearanceTable};

    const C: f64 = 5e-4;
    const MASS: f64 = 3.0;

    fn smooth() -> Clearance {
        let table = ClearanceTable { friction: 0.0, stiffness: Some(1e14), ..ClearanceTable::new(C) };
        Clearance::new(&table).expect("a clearance")
    }

    #[test]
    fn a_force_that_turns_round_takes_it_across_in_the_time_of_a_free_fall() {
        for (force, step) in [(6.0, 1e-3), (50.0, 1e-3), (6.0, 4e-3)] {
            let mut flight = JournalFlight::resting(smooth(), MASS, [force, 0.0]);
            let mut t = 0.0;
            while flight.place()[0] < C {
                flight.advance([[-force, 0.0]; 2], 0.0, step);
                t += step;
            }
            let expected = (4.0 * C * MASS / force).sqrt();
            println!("{force} N: {t:.4} s, closed form {expected:.4} s, margin {step} s");
            assert!((t - expected).abs() <= step);
            (0..10).for_each(|_| flight.advance([[-force, 0.0]; 2], 0.0, step));
            assert!((flight.place()[0] - C).abs() < 1e-8 && flight.place()[1].abs() < 1e-12);
        }
    }

    /// A journal that falls across its bearing and meets the wall with the restitution e rises to e² of its height of fall.
    #[test]
    fn it_bounces_as_high_as_its_restitution_says() {
        for restitution in [0.3, 0.6, 0.9] {
            let (force, step) = (6.0, 2e-5);
            let mut flight = JournalFlight::resting(smooth(), MASS, [force, 0.0]).bouncing(restitution);
            let (mut highest, mut has_met) = (0.0_f64, false);
            while !has_met || flight.rate[0] < 0.0 {
                flight.advance([[-force, 0.0]; 2], 0.0, step);
                has_met |= flight.rate[0] < 0.0;
                if has_met {
                    highest = highest.max(C - flight.place()[0]);
                }
            }
            let expected = restitution * restitution * 2.0 * C;
            println!("e = {restitution}: {highest:.3e} m, closed form {expected:.3e} m, margin 1 %");
            assert!((highest / expected - 1.0).abs() < 0.01);
        }
    }

    /// Along the wall it is a pendulum of length c in the field b/m.
    #[test]
    fn it_swings_along_the_wall_as_a_damped_pendulum() {
        let (force, step) = (12.0, 1e-3);
        let tilted = |angle: f64| [-force * angle.cos(), -force * angle.sin()];
        let mut flight = JournalFlight::resting(smooth(), MASS, tilted(0.05));
        let (mut t, mut last, mut crossings) = (0.0, 0.05, Vec::new());
        while crossings.len() < 3 {
            flight.advance([tilted(0.0); 2], 0.0, step);
            t += step;
            let angle = flight.place()[1].atan2(flight.place()[0]);
            if angle * last < 0.0 {
                crossings.push(t);
            }
            last = angle;
        }
        let natural = (force / (MASS * C)).sqrt();
        let expected = PI / (natural * (1.0 - DAMPING * DAMPING).sqrt());
        let half = 0.5 * (crossings[2] - crossings[0]);
        println!("half a period {half:.5} s, closed form {expected:.5} s, margin {step} s");
        assert!((half - expected).abs() <= step);
    }

    #[test]
    fn pressed_steadily_it_stays() {
        let mut flight = JournalFlight::resting(smooth(), MASS, [0.0, -8.0]);
        let before = flight.place();
        (0..100).for_each(|_| flight.advance([[0.0, -8.0]; 2], 0.0, 4e-3));
        let moved = (flight.place()[0] - before[0]).hypot(flight.place()[1] - before[1]);
        println!("moved {moved:.1e} m, margin 1e-9 m");
        assert!(moved < 1e-9);
    }

    #[test]
    fn without_a_mass_it_goes_over_at_once() {
        let mut flight = JournalFlight::resting(smooth(), 0.0, [1.0, 0.0]);
        flight.advance([[1.0, 0.0], [-1.0, 0.0]], 0.0, 1e-3);
        assert!(flight.place().iter().all(|x| x.is_finite()) && flight.place()[0] > 0.99 * C);
    }
}
