//! A corner: the data of a passage's programme, and the cost of a course.

use freeplay_arm::Limits;
use freeplay_laws::ArmWithPlay;
use nalgebra::{DMatrix, DVector};

use crate::passage::PassageOptions;
use crate::passage_layout::{Layout, MILLI, second_difference, stencil};
use crate::passage_trajectory::{JournalContact, PassageTrajectory};
use crate::pin_force::PinForce;

/// Constant data of a passage, tick by tick.
pub struct Frame {
    /// Jacobian of the tool for joints and slides, 6 × (n + 2 plays).
    pub tool: DMatrix<f64>,
    /// Mass matrix of the arm with play.
    pub mass: DMatrix<f64>,
}

/// Data of the programme of one passage.
pub struct Corner<'a> {
    /// The arm with play.
    pub arm: &'a ArmWithPlay,
    /// The limits of its joints.
    pub limits: &'a [Limits],
    /// Constant data, tick by tick.
    pub frames: &'a [Frame],
    /// Weights of the tool's deviation, linear and angular, 1/mm² and 1/mrad².
    pub weights: [f64; 6],
    /// F_0, N: bearing forces before the corner.
    pub rest: &'a [f64],
    /// Options of the planning.
    pub options: PassageOptions,
    /// Weight of the deviation at each tick.
    pub emphasis: Vec<f64>,
}

impl Corner<'_> {
    pub(crate) fn layout(&self, course: &PassageTrajectory) -> Layout {
        Layout { joints: self.limits.len(), plays: self.arm.plays().len(), ticks: course.ticks() }
    }

    /// Raises the weights of ticks with large deviations of `course`, by the exponent `emphasis` of the options.
    pub fn emphasise(&mut self, course: &PassageTrajectory) {
        if self.options.emphasis > 0.0 {
            let left = |k: usize| self.deviation(course, k).rows(0, 3).norm();
            let all: Vec<f64> = (0..course.ticks()).map(left).collect();
            let most = all.iter().copied().fold(f64::MIN_POSITIVE, f64::max);
            let exponent = self.options.emphasis;
            self.emphasis = all.into_iter().map(|left| (left / most).powf(exponent).max(1e-4)).collect();
        }
    }

    /// The remaining deviation of the tool at tick `k`, mm and mrad.
    pub fn deviation(&self, course: &PassageTrajectory, k: usize) -> DVector<f64> {
        let moved = [course.corrections[k].as_slice(), &course.journals(k)].concat();
        &self.frames[k].tool * DVector::from_vec(moved) * MILLI
    }

    /// The displacement, mm, equivalent to the unexplained force of `contact`.
    pub(crate) fn equivalent_displacement(
        &self,
        course: &PassageTrajectory,
        k: usize,
        play: usize,
        contact: &JournalContact,
    ) -> f64 {
        self.per_newton(course, k, play) * contact.residual()
    }

    pub(crate) fn per_newton(&self, course: &PassageTrajectory, k: usize, play: usize) -> f64 {
        MILLI * course.radii[k][play] / self.rest[play]
    }

    /// The largest displacement equivalent to the unexplained forces of `course`, mm; infinite if a bearing would have to pull.
    pub fn unexplained(&self, course: &PassageTrajectory, pin: &mut PinForce) -> f64 {
        let mut most: f64 = 0.0;
        for k in 1..course.ticks() - 1 {
            let forces = course.forces(k, pin);
            for (index, play) in self.arm.plays().iter().enumerate() {
                let contact = course.contact(k, index, play, &forces);
                let side = if contact.normal_force > 0.0 {
                    self.equivalent_displacement(course, k, index, &contact).abs()
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
                let contact = course.contact(k, index, play, &forces);
                cost += 0.5 * weight * self.equivalent_displacement(course, k, index, &contact).powi(2);
                cost += self.options.missing_push * (self.options.least_push - contact.normal_force).max(0.0);
            }
        }
        cost
    }

    /// Derivative of the force along `direction` (coordinate of the arm with play, share) at tick `k` with respect to the
    /// accelerations.
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
                let [first, second] = course.displacement_derivative(tick, index);
                let moved = inertia[0] * first + inertia[1] * second;
                entries.push((layout.angle_index(tick, index), share * moved));
            }
        }
        entries
    }
}
