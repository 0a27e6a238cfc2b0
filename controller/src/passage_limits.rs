//! The limits of the joints as rows of a passage's programme; a limit gets a row if the course uses more than half of it.

use std::collections::BTreeSet;

use crate::passage_corner::Corner;
use crate::passage_layout::{Layout, MILLI, second_difference};
use crate::passage_trajectory::PassageTrajectory;
use crate::sparse_programme::{Row, SparseProgramme};

/// Share of a limit above which the programme contains it.
const WATCHED: f64 = 0.5;

/// A limit that the course approaches: tick, joint.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Watch {
    /// Position limit.
    Position(usize, usize),
    /// Speed limit.
    Speed(usize, usize),
    /// Acceleration limit.
    Acceleration(usize, usize),
    /// Torque limit.
    Torque(usize, usize),
}

impl Corner<'_> {
    /// Adds the rows of the limits at tick `k` under `forces`. The function adds the limits that the course comes near to
    /// `watched`.
    pub(crate) fn add_limits(
        &self,
        course: &PassageTrajectory,
        layout: &Layout,
        k: usize,
        forces: &[f64],
        watched: &mut BTreeSet<Watch>,
        programme: &mut SparseProgramme,
    ) {
        let (joints, reference) = (course.joints_at(k), course.reference_at(k));
        for (i, limits) in self.limits.iter().enumerate() {
            let middle = 0.5 * (limits.lower + limits.upper);
            let (offset, range) = (joints.q[i] - middle, 0.5 * (limits.upper - limits.lower));
            let torque = forces[self.arm.joint(i)];
            let half = 0.5 / course.period / MILLI;
            let speed = || [(k - 1, -half), (k + 1, half)];
            let free = |at: &[(usize, f64)]| -> Vec<(usize, f64)> {
                let kept = at.iter().filter(|&&(tick, _)| layout.is_free(tick));
                kept.map(|&(tick, share)| (layout.joint(tick, i), share)).collect()
            };
            let mut watch =
                |watch: Watch, value: f64, own: f64, limit: f64, entries: &dyn Fn() -> Vec<(usize, f64)>| {
                    if limit.is_finite() && (value.abs() > WATCHED * limit || watched.contains(&watch)) {
                        watched.insert(watch);
                        bound(programme, value, limit.max(own.abs()), &entries());
                    }
                };
            let own = reference.q[i] - middle;
            watch(Watch::Position(k, i), offset, own, range, &|| free(&[(k, 1.0 / MILLI)]));
            watch(Watch::Speed(k, i), joints.v[i], reference.v[i], limits.velocity, &|| free(&speed()));
            watch(Watch::Acceleration(k, i), joints.a[i], reference.a[i], limits.acceleration, &|| {
                second_difference(course, layout, k, i)
            });
            watch(Watch::Torque(k, i), torque, 0.0, limits.effort, &|| {
                self.force_row(course, layout, k, &[(self.arm.joint(i), 1.0)])
            });
        }
    }
}

/// Adds the constraint that `value`, changed by `entries`, stays within ±`limit`.
fn bound(programme: &mut SparseProgramme, value: f64, limit: f64, entries: &[(usize, f64)]) {
    for sign in [1.0, -1.0] {
        let entries = entries.iter().map(|&(at, share)| (at, sign * share / limit)).collect();
        programme.at_most(Row { entries, bound: 1.0 - sign * value / limit });
    }
}
