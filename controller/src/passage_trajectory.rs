//! A course through a corner: the corrections of the joints and the contact angles of the journals, tick by tick.
//!
//! On a course every journal touches its bearing, displaced by d = r (cos φ, sin φ) at the angle φ in the plane of its slides. The
//! radius r, clearance plus penetration, is given. Derivatives are centred differences over a tick; a torque or an acceleration
//! that is held for a tick has the same effect on the motion.

use freeplay_laws::{Clearance, Play};

use crate::compensation::Motion;
use crate::pin_force::PinForce;

/// Motion of joints or journals at one tick, with its own storage: positions, velocities, accelerations.
#[derive(Clone, Debug)]
pub struct Instant {
    /// Positions.
    pub q: Vec<f64>,
    /// Velocities.
    pub v: Vec<f64>,
    /// Accelerations.
    pub a: Vec<f64>,
}

impl Instant {
    /// Computes the motion by centred differences of three values a tick of `period` seconds apart.
    pub fn centred(values: [&[f64]; 3], period: f64) -> Instant {
        let [before, now, after] = values;
        let each = |of: fn(f64, f64, f64) -> f64, scale: f64| {
            (0..now.len()).map(|i| of(before[i], now[i], after[i]) * scale).collect()
        };
        Instant {
            q: now.to_vec(),
            v: each(|before, _, after| after - before, 0.5 / period),
            a: each(|before, now, after| after - 2.0 * now + before, 1.0 / (period * period)),
        }
    }

    /// The instant as a [`Motion`].
    pub fn as_motion(&self) -> Motion<'_> {
        Motion { q: &self.q, v: &self.v, a: &self.a }
    }
}

/// The course; row k belongs to the k-th tick of the passage.
#[derive(Clone, Debug)]
pub struct PassageTrajectory {
    /// Time of a tick, s.
    pub period: f64,
    /// Reference positions of the joints, rad (m).
    pub reference: Vec<Vec<f64>>,
    /// Corrections Δq of the joints, rad (m).
    pub corrections: Vec<Vec<f64>>,
    /// Angles φ of the journals, rad, one for each joint with play; without jumps of a turn.
    pub angles: Vec<Vec<f64>>,
    /// Radii r of the journals, m.
    pub radii: Vec<Vec<f64>>,
}

/// A change of a course.
pub struct Change {
    /// δΔq, rad (m), tick by tick.
    pub corrections: Vec<Vec<f64>>,
    /// δφ, rad, tick by tick.
    pub angles: Vec<Vec<f64>>,
}

impl Change {
    /// The largest change of an angle, rad.
    pub fn largest_turn(&self) -> f64 {
        self.angles.iter().flatten().fold(0.0, |most, turn| turn.abs().max(most))
    }
}

/// Contact of one journal with its bearing on a course.
#[derive(Clone, Copy, Debug)]
pub struct JournalContact {
    /// Normal n = (cos φ, sin φ), towards the bearing's wall.
    pub normal: [f64; 2],
    /// Tangent t = (sin φ, −cos φ).
    pub tangent: [f64; 2],
    /// Force of the bearing on the journal, −nᵀb, N; if negative, the bearing would have to pull.
    pub normal_force: f64,
    /// Force of the bearing along the tangent, tᵀb, N.
    pub tangential_force: f64,
    /// Signed friction coefficient μ(v_T) and its slope dμ/dv_T, s/m.
    pub friction: [f64; 2],
}

impl JournalContact {
    /// tᵀb + μ F_N, N: the tangential force beyond friction. It is zero on a physically possible course.
    pub fn residual(&self) -> f64 {
        self.tangential_force + self.friction[0] * self.normal_force
    }

    /// Moment of the contact's friction on the joint, N·m, for a journal in `clearance`.
    pub fn moment(&self, clearance: &Clearance) -> f64 {
        -self.friction[0] * self.normal_force.max(0.0) * clearance.journal_radius()
    }
}

impl PassageTrajectory {
    /// Number of ticks.
    pub fn ticks(&self) -> usize {
        self.reference.len()
    }

    /// Displacements of the journals at tick `k`, m: two for each joint with play.
    pub fn journals(&self, k: usize) -> Vec<f64> {
        let sides = self.angles[k].iter().zip(&self.radii[k]);
        sides.flat_map(|(angle, radius)| [radius * angle.cos(), radius * angle.sin()]).collect()
    }

    /// Derivative of the displacement of journal `play` at tick `k` with respect to its angle, m.
    pub fn displacement_derivative(&self, k: usize, play: usize) -> [f64; 2] {
        let (sin, cos) = self.angles[k][play].sin_cos();
        [-self.radii[k][play] * sin, self.radii[k][play] * cos]
    }

    /// This course with the angles turned by up to `turn`, rad, in the middle, and unchanged at the ends.
    pub fn detoured(mut self, turn: f64) -> PassageTrajectory {
        let ticks = self.angles.len();
        for (k, row) in self.angles.iter_mut().enumerate() {
            // The first three derivatives of sin⁴ vanish at the ends.
            let share = (std::f64::consts::PI * k as f64 / (ticks - 1) as f64).sin().powi(4);
            row.iter_mut().for_each(|angle| *angle += turn * share);
        }
        self
    }

    /// This course with `share` of `change` added.
    pub fn moved(&self, change: &Change, share: f64) -> PassageTrajectory {
        let add = |rows: &[Vec<f64>], changes: &[Vec<f64>]| -> Vec<Vec<f64>> {
            let pairs = rows.iter().zip(changes);
            pairs
                .map(|(row, change)| row.iter().zip(change).map(|(x, dx)| x + share * dx).collect())
                .collect()
        };
        PassageTrajectory {
            corrections: add(&self.corrections, &change.corrections),
            angles: add(&self.angles, &change.angles),
            ..self.clone()
        }
    }

    /// Motion of the joints, correction included, at tick `k`, neither the first nor the last.
    pub fn joints_at(&self, k: usize) -> Instant {
        let rows = [k - 1, k, k + 1].map(|k| self.joints(k));
        Instant::centred([&rows[0], &rows[1], &rows[2]], self.period)
    }

    /// Motion of the reference at tick `k`, neither the first nor the last.
    pub fn reference_at(&self, k: usize) -> Instant {
        let rows = [k - 1, k, k + 1].map(|k| self.reference[k].as_slice());
        Instant::centred(rows, self.period)
    }

    /// Motion of the journals at tick `k`, neither the first nor the last.
    pub fn journals_at(&self, k: usize) -> Instant {
        let rows = [k - 1, k, k + 1].map(|k| self.journals(k));
        Instant::centred([&rows[0], &rows[1], &rows[2]], self.period)
    }

    fn joints(&self, k: usize) -> Vec<f64> {
        self.reference[k].iter().zip(&self.corrections[k]).map(|(q, correction)| q + correction).collect()
    }

    /// The forces along all coordinates of the arm with play at tick `k`, neither the first nor the last, N or N·m.
    pub fn forces(&self, k: usize, pin: &mut PinForce) -> Vec<f64> {
        pin.forces(self.joints_at(k).as_motion(), self.journals_at(k).as_motion()).to_vec()
    }

    /// Contact of the journal `index`, that of `play`, at tick `k` under `forces`, those of [`Self::forces`].
    pub fn contact(&self, k: usize, index: usize, play: &Play, forces: &[f64]) -> JournalContact {
        let (sin, cos) = self.angles[k][index].sin_cos();
        let (normal, tangent) = ([cos, sin], [sin, -cos]);
        let b = play.slides.map(|slide| forces[slide]);
        let along = |direction: [f64; 2]| direction[0] * b[0] + direction[1] * b[1];
        let [before, after] =
            [k - 1, k + 1].map(|k| self.reference[k][play.joint] + self.corrections[k][play.joint]);
        let turning = (after - before) / (2.0 * self.period);
        let rolling = (self.angles[k + 1][index] - self.angles[k - 1][index]) / (2.0 * self.period);
        let sliding = play.clearance.journal_radius() * turning - self.radii[k][index] * rolling;
        JournalContact {
            normal,
            tangent,
            normal_force: -along(normal),
            tangential_force: along(tangent),
            friction: friction(&play.clearance, sliding),
        }
    }
}

/// Signed friction coefficient at the sliding speed `v`, m/s, and its slope by a central difference.
fn friction(clearance: &Clearance, v: f64) -> [f64; 2] {
    const STEP: f64 = 1e-5;
    let at = |v: f64| clearance.friction.coefficient(v);
    [at(v), (at(v + STEP) - at(v - STEP)) / (2.0 * STEP)]
}
