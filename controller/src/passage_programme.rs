//! One step of planning a passage: the quadratic programme that a course is improved by.
//!
//! Around a course, for changes δΔq of the corrections and δφ of the journals' angles,
//!
//! `min Σ_k ½‖e_k‖²_W + ε_a/2 ‖Δq̈_k‖² + w/2 ‖y_k‖² + γ s_k + λ/2 ‖δφ_k‖²` subject to
//!
//! - tool: `e = J_p Δq + J_s d(φ)`, what is left of the deviation (with the orientation's share as in the compensation),
//! - contact: `y = r (tᵀ b + μ F_N)/F_0`, the force across the normal that friction does not explain, as the displacement that it
//!   would cause; zero on a course that physics allows,
//! - push: `−nᵀ b ≥ F_min − s`, `s ≥ 0`,
//! - the limits of the joints' position, speed, acceleration and torque, where the course is past half of them.
//!
//! All are taken to first order; b changes with the accelerations by the mass matrix, with φ by the turning of n and t, with φ̇ by
//! friction. Lengths are in mm, corrections in mrad, forces in N.

use std::collections::BTreeSet;

use freeplay_arm::Limits;
use freeplay_laws::ArmWithPlay;
use nalgebra::{DMatrix, DVector};

use crate::passage::PassageOptions;
use crate::passage_layout::{Layout, MILLI, second_difference, stencil};
use crate::passage_limits::Watch;
use crate::passage_trajectory::{JournalContact, PassageTrajectory};
use crate::pin_force::PinForce;
use crate::sparse_programme::{Row, SparseProgramme};

/// λ, mm²: weight of the change of an angle.
const DAMPING: f64 = 1e-3;

/// What of a passage does not change while it is planned, tick by tick.
pub struct Frame {
    /// Jacobian of the tool for joints and slides, 6 × (n + 2 plays).
    pub tool: DMatrix<f64>,
    /// Mass matrix of the arm with play.
    pub mass: DMatrix<f64>,
}

/// All that the programme of one passage is made from.
pub struct Corner<'a> {
    /// The arm with play.
    pub arm: &'a ArmWithPlay,
    /// The limits of its joints.
    pub limits: &'a [Limits],
    /// What does not change, tick by tick.
    pub frames: &'a [Frame],
    /// Weights of the tool's deviation, linear and angular, 1/mm² and 1/mrad².
    pub weights: [f64; 6],
    /// F_0, N: what the bearings push with before the corner.
    pub rest: &'a [f64],
    /// What it is judged by.
    pub options: PassageOptions,
    /// How much the deviation of each tick counts.
    pub emphasis: Vec<f64>,
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

impl Corner<'_> {
    fn layout(&self, course: &PassageTrajectory) -> Layout {
        Layout { joints: self.limits.len(), plays: self.arm.plays().len(), ticks: course.ticks() }
    }

    /// Lets large deviations of `course` count more than small ones, as far as the options say.
    pub fn emphasise(&mut self, course: &PassageTrajectory) {
        if self.options.emphasis > 0.0 {
            let left = |k: usize| self.deviation(course, k).rows(0, 3).norm();
            let all: Vec<f64> = (0..course.ticks()).map(left).collect();
            let most = all.iter().copied().fold(f64::MIN_POSITIVE, f64::max);
            let exponent = self.options.emphasis;
            self.emphasis = all.into_iter().map(|left| (left / most).powf(exponent).max(1e-4)).collect();
        }
    }

    /// What is left of the deviation of the tool at tick `k`, mm and mrad.
    pub fn deviation(&self, course: &PassageTrajectory, k: usize) -> DVector<f64> {
        let moved = [course.corrections[k].as_slice(), &course.journals(k)].concat();
        &self.frames[k].tool * DVector::from_vec(moved) * MILLI
    }

    /// The displacement, mm, that the unexplained force of `meeting` would cause.
    fn side(&self, course: &PassageTrajectory, k: usize, play: usize, meeting: &JournalContact) -> f64 {
        self.per_newton(course, k, play) * meeting.residual()
    }

    fn per_newton(&self, course: &PassageTrajectory, k: usize, play: usize) -> f64 {
        MILLI * course.radii[k][play] / self.rest[play]
    }

    /// The largest displacement that the forces of `course` leave unexplained, mm; infinite where a bearing would have to pull.
    pub fn unexplained(&self, course: &PassageTrajectory, pin: &mut PinForce) -> f64 {
        let mut most: f64 = 0.0;
        for k in 1..course.ticks() - 1 {
            let forces = course.forces(k, pin);
            for (index, play) in self.arm.plays().iter().enumerate() {
                let meeting = course.meeting(k, index, play, &forces);
                let side = if meeting.push > 0.0 {
                    self.side(course, k, index, &meeting).abs()
                } else {
                    f64::INFINITY
                };
                most = most.max(side);
            }
        }
        most
    }

    /// The cost of a course, with w = `weight`.
    pub fn cost(&self, course: &PassageTrajectory, pin: &mut PinForce, weight: f64) -> f64 {
        let mut cost = 0.0;
        for k in 1..course.ticks() - 1 {
            let left = self.deviation(course, k);
            cost +=
                0.5 * self.emphasis[k] * left.iter().zip(self.weights).map(|(e, w)| w * e * e).sum::<f64>();
            let corrected = course.joints_at(k).a.into_iter().zip(course.reference_at(k).a);
            cost += 0.5
                * self.options.acceleration
                * corrected.map(|(a, reference)| (a - reference).powi(2)).sum::<f64>();
            let forces = course.forces(k, pin);
            for (index, play) in self.arm.plays().iter().enumerate() {
                let meeting = course.meeting(k, index, play, &forces);
                cost += 0.5 * weight * self.side(course, k, index, &meeting).powi(2);
                cost += self.options.missing_push * (self.options.least_push - meeting.push).max(0.0);
            }
        }
        cost
    }

    /// The programme around `course`, with w = `weight`; limits that the course comes near to are added to `watched`.
    pub fn programme(
        &self,
        course: &PassageTrajectory,
        pin: &mut PinForce,
        weight: f64,
        watched: &mut BTreeSet<Watch>,
    ) -> SparseProgramme {
        let layout = self.layout(course);
        let mut programme = SparseProgramme::new(layout.ticks * layout.width());
        for k in 0..layout.ticks {
            self.add_tool(course, &layout, k, &mut programme);
        }
        for k in 1..layout.ticks - 1 {
            let forces = course.forces(k, pin);
            self.add_acceleration(course, &layout, k, &mut programme);
            for index in 0..layout.plays {
                self.add_contact(course, &layout, (k, index), weight, &forces, &mut programme);
            }
            self.add_limits(course, &layout, k, &forces, watched, &mut programme);
        }
        programme
    }

    /// The change that `solution` of the programme around `course` says.
    pub fn change(&self, course: &PassageTrajectory, solution: &[f64]) -> Change {
        let layout = self.layout(course);
        let ticks = 0..layout.ticks;
        let row = |k: usize, width: usize, scale: f64, place: &dyn Fn(usize, usize) -> usize| {
            (0..width).map(|i| if layout.is_free(k) { solution[place(k, i)] * scale } else { 0.0 }).collect()
        };
        Change {
            corrections: ticks
                .clone()
                .map(|k| row(k, layout.joints, 1.0 / MILLI, &|k, i| layout.joint(k, i)))
                .collect(),
            angles: ticks.map(|k| row(k, layout.plays, 1.0, &|k, i| layout.angle_index(k, i))).collect(),
        }
    }

    fn add_tool(
        &self,
        course: &PassageTrajectory,
        layout: &Layout,
        k: usize,
        programme: &mut SparseProgramme,
    ) {
        // A variable that no term touches would make the programme's minimum not unique.
        for i in 0..layout.width() {
            programme.add_square(1e-9, 0.0, &[(layout.joint(k, i), 1.0)]);
        }
        if !layout.is_free(k) {
            return;
        }
        let (left, tool) = (self.deviation(course, k), &self.frames[k].tool);
        for (row, weight) in self.weights.into_iter().enumerate().filter(|(_, weight)| *weight > 0.0) {
            let joints = (0..layout.joints).map(|i| (layout.joint(k, i), tool[(row, i)]));
            let turns = (0..layout.plays).map(|play| {
                let at = layout.joints + 2 * play;
                let [first, second] = course.swing(k, play);
                let moved = tool[(row, at)] * first + tool[(row, at + 1)] * second;
                (layout.angle_index(k, play), MILLI * moved)
            });
            programme.add_square(
                weight * self.emphasis[k],
                left[row],
                &joints.chain(turns).collect::<Vec<_>>(),
            );
        }
        for play in 0..layout.plays {
            programme.add_square(DAMPING, 0.0, &[(layout.angle_index(k, play), 1.0)]);
        }
    }

    fn add_acceleration(
        &self,
        course: &PassageTrajectory,
        layout: &Layout,
        k: usize,
        programme: &mut SparseProgramme,
    ) {
        let (joints, reference) = (course.joints_at(k), course.reference_at(k));
        for i in 0..layout.joints {
            let entries = second_difference(course, layout, k, i);
            programme.add_square(self.options.acceleration, joints.a[i] - reference.a[i], &entries);
        }
    }

    /// How the force along `direction` (coordinate of the arm with play, share) at tick `k` changes with the accelerations.
    pub(crate) fn force_row(
        &self,
        course: &PassageTrajectory,
        layout: &Layout,
        k: usize,
        direction: &[(usize, f64)],
    ) -> Vec<(usize, f64)> {
        let mass = &self.frames[k].mass;
        let felt = |coordinate: usize| {
            direction.iter().map(|&(row, share)| share * mass[(row, coordinate)]).sum::<f64>()
        };
        let mut entries = Vec::new();
        for i in 0..layout.joints {
            let inertia = felt(self.arm.joint(i));
            entries
                .extend(second_difference(course, layout, k, i).into_iter().map(|(at, c)| (at, c * inertia)));
        }
        for (index, play) in self.arm.plays().iter().enumerate() {
            let inertia = play.slides.map(felt);
            for (tick, share) in
                stencil(course.period, k).into_iter().filter(|&(tick, _)| layout.is_free(tick))
            {
                let [first, second] = course.swing(tick, index);
                let moved = inertia[0] * first + inertia[1] * second;
                entries.push((layout.angle_index(tick, index), share * moved));
            }
        }
        entries
    }

    fn add_contact(
        &self,
        course: &PassageTrajectory,
        layout: &Layout,
        (k, index): (usize, usize),
        weight: f64,
        forces: &[f64],
        programme: &mut SparseProgramme,
    ) {
        let play = &self.arm.plays()[index];
        let meeting = course.meeting(k, index, play, forces);
        let [mu, slope] = meeting.friction;
        let along = |direction: [f64; 2]| [(play.slides[0], direction[0]), (play.slides[1], direction[1])];
        let [n, t] = [meeting.normal, meeting.tangent];
        let mut across = self.force_row(course, layout, k, &along([t[0] - mu * n[0], t[1] - mu * n[1]]));
        let mut push = self.force_row(course, layout, k, &along([-n[0], -n[1]]));
        if layout.is_free(k) {
            across.push((layout.angle_index(k, index), mu * meeting.across - meeting.push));
            push.push((layout.angle_index(k, index), meeting.across));
        }
        let rolling = slope * meeting.push * course.radii[k][index] / (2.0 * course.period);
        for (tick, share) in [(k + 1, -rolling), (k - 1, rolling)] {
            if layout.is_free(tick) {
                across.push((layout.angle_index(tick, index), share));
            }
        }
        let scale = self.per_newton(course, k, index);
        let mut entries: Vec<_> = across.into_iter().map(|(at, value)| (at, scale * value)).collect();
        entries.push((layout.lateral_index(k, index), -1.0));
        programme.equal(Row { entries, bound: -self.side(course, k, index, &meeting) });
        programme.add_square(weight, 0.0, &[(layout.lateral_index(k, index), 1.0)]);
        let slack = layout.slack_index(k, index);
        let mut entries: Vec<_> = push.into_iter().map(|(at, value)| (at, -value)).collect();
        entries.push((slack, -1.0));
        programme.at_most(Row { entries, bound: meeting.push - self.options.least_push });
        programme.at_most(Row { entries: vec![(slack, -1.0)], bound: 0.0 });
        programme.add_linear(slack, self.options.missing_push);
    }
}
