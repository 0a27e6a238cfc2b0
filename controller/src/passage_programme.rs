//! One step of planning a passage: a quadratic programme that improves its trajectory.
//!
//! Around a course, for changes δΔq of the corrections and δφ of the journals' angles,
//!
//! `min Σ_k ½‖e_k‖²_W + ε_a/2 ‖Δq̈_k‖² + w/2 ‖y_k‖² + γ s_k + λ/2 ‖δφ_k‖²` subject to
//!
//! - tool: `e = J_p Δq + J_s d(φ)`, the remaining deviation (with the orientation's share as in the compensation),
//! - contact: `y = r (tᵀ b + μ F_N)/F_0`, the tangential force beyond friction, expressed as a displacement; zero on a physical
//!   course,
//! - push: `−nᵀ b ≥ F_min − s`, `s ≥ 0`,
//! - the limits of the joints' position, speed, acceleration and torque, where the course is past half of them.
//!
//! The programme is linear in the changes: b depends on the accelerations through the mass matrix, on φ through the directions n and t,
//! and on φ̇ through friction. Lengths are in mm, corrections in mrad, forces in N.

use std::collections::BTreeSet;

use crate::passage_corner::Corner;
use crate::passage_layout::{Layout, MILLI, second_difference};
use crate::passage_limits::Watch;
use crate::passage_trajectory::{Change, PassageTrajectory};
use crate::pin_force::PinForce;
use crate::sparse_programme::{Row, SparseProgramme};

/// λ, mm²: weight of the change of an angle.
const DAMPING: f64 = 1e-3;

impl Corner<'_> {
    /// The programme around `course`, with w = `weight`. The function adds the limits that the course comes near to `watched`.
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

    /// Unpacks `solution`, that of the programme around `course`, into a change of the course.
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
        // A small cost keeps every variable determined: a variable in no other term would make the minimiser ambiguous.
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
                let [first, second] = course.displacement_derivative(k, play);
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
        let contact = course.contact(k, index, play, forces);
        let [mu, slope] = contact.friction;
        let along = |direction: [f64; 2]| [(play.slides[0], direction[0]), (play.slides[1], direction[1])];
        let [n, t] = [contact.normal, contact.tangent];
        let mut across = self.force_row(course, layout, k, &along([t[0] - mu * n[0], t[1] - mu * n[1]]));
        let mut push = self.force_row(course, layout, k, &along([-n[0], -n[1]]));
        if layout.is_free(k) {
            across.push((layout.angle_index(k, index), mu * contact.tangential_force - contact.normal_force));
            push.push((layout.angle_index(k, index), contact.tangential_force));
        }
        let rolling = slope * contact.normal_force * course.radii[k][index] / (2.0 * course.period);
        for (tick, share) in [(k + 1, -rolling), (k - 1, rolling)] {
            if layout.is_free(tick) {
                across.push((layout.angle_index(tick, index), share));
            }
        }
        let scale = self.per_newton(course, k, index);
        let mut entries: Vec<_> = across.into_iter().map(|(at, value)| (at, scale * value)).collect();
        entries.push((layout.lateral_index(k, index), -1.0));
        programme.equal(Row { entries, bound: -self.equivalent_displacement(course, k, index, &contact) });
        programme.add_square(weight, 0.0, &[(layout.lateral_index(k, index), 1.0)]);
        let slack = layout.slack_index(k, index);
        let mut entries: Vec<_> = push.into_iter().map(|(at, value)| (at, -value)).collect();
        entries.push((slack, -1.0));
        programme.at_most(Row { entries, bound: contact.normal_force - self.options.least_push });
        programme.at_most(Row { entries: vec![(slack, -1.0)], bound: 0.0 });
        programme.add_linear(slack, self.options.missing_push);
    }
}
