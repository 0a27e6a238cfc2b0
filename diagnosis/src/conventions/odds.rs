//! The odds of one change of a reading against the best reading without it.

use super::change::{Change, FURTHER, RARE};
use super::kinds::another_arm::UNEXPLAINED;
use super::outcome::Outcome;
use super::problem::{FLOOR, GEOMETRY, Links, Problem};
use crate::sorting::sort_falling;

/// The odds of each change in the best set of changes, against the best set without that change.
pub(super) struct ChangeOdds<'p, 'a> {
    problem: &'p Problem<'a>,
    pub best: &'p Outcome,
    /// Mean square residual of each torque for an arm without mass.
    massless: Vec<f64>,
    /// The evidence of the set with the links of a data sheet; `None` without torques.
    by_sheet: Option<f64>,
}

impl<'p, 'a> ChangeOdds<'p, 'a> {
    /// The odds in the set `best` of `problem`, which must be possible.
    pub fn new(problem: &'p Problem<'a>, best: &'p Outcome) -> Self {
        let by_sheet = problem.with_links(best, Links::OfSheet);
        Self { problem, best, massless: massless(problem, best), by_sheet }
    }

    /// Log odds against `other` if the masses of the model's links have the tolerance of a data sheet. Where large terms cancel, as in a joint that no motor
    /// drives, a few per cent of a mass look like another unit. Infinite without torques.
    pub fn by_sheet(&self, other: &Outcome) -> f64 {
        let other = self.problem.with_links(other, Links::OfSheet);
        self.by_sheet.zip(other).map_or(f64::INFINITY, |(best, other)| best - other)
    }

    /// Log odds against `other`, the best set without `change`, with rows weighted by their independence. The odds are even at most, unless the change removes
    /// most of the residual of `same`, which is this set without the change, in a channel that the set explains.
    ///
    /// The rival may also explain torques without the arm: a torque of friction alone reveals no reading, and a torque unrelated to the model fits any unit
    /// that suppresses the model. A torque unrelated to the arm is as rare as a wrong reading. Friction does reveal signs, since it never drives.
    /// Torques without gravity may consist of friction only.
    pub fn by_channels(&self, change: &Change, other: &Outcome, same: &Outcome) -> f64 {
        let Self { problem, best, massless: with, .. } = self;
        let joints = if problem.samples.has_torques() { problem.arm.dof() } else { 0 };
        let is_silent = matches!(
            change,
            Change::Compensated | Change::TorqueSign(_) | Change::CommonSign | Change::Direction { .. }
        );
        let silent = |c: usize| {
            let silent = with.get(c).filter(|_| !is_silent);
            silent.map_or(f64::INFINITY, |silent| silent.max(best.square(c)))
        };
        // Friction does not reveal the direction of joints, since a coupling has the friction of another joint: the function gives a change of positions no
        // credit for a reduction that it would also make for an arm without mass. Friction does reveal the time.
        let is_counting = change.is_of_positions() && !is_silent;
        let without_change = if is_counting { massless(problem, other) } else { Vec::new() };
        let by_friction = |c: usize, place: usize| {
            let both = with.get(c).zip(without_change.get(place));
            both.map_or(0.0, |(with, without)| (without - with).max(0.0))
        };
        // The index in `without` of the recorded channel c, whichever joint it belongs to; `None` if it is missing.
        let place = |without: &Outcome, c: usize| {
            without.sources.iter().position(|source| *source == best.sources[c])
        };
        let worth = |c: usize, left: f64| problem.log_likelihood(best.sources[c], left, best.floors[c]);
        let mut odds = other.price() - best.price();
        let mut by_silence = Vec::new();
        let is_explained = |left: f64| left <= UNEXPLAINED;
        let mut fall = 1.0_f64;
        for c in (0..best.likelihood.len()).filter(|c| best.left[*c].is_finite()) {
            let Some(at) = place(other, c) else { continue };
            let without = other.square(at);
            let without = (without - by_friction(c, at)).max(without.min(best.square(c)));
            odds += best.likelihood[c] - worth(c, without);
            if silent(c) < without {
                by_silence.push(worth(c, silent(c)) - worth(c, without));
            }
            if let Some(at) = place(same, c).filter(|_| is_explained(best.left[c])) {
                let without = same.square(at);
                let floor = FLOOR.powi(2) * if c < joints { 1.0 } else { GEOMETRY.powi(2) } * best.sizes[c];
                fall = fall.max((without.min(silent(c)) + floor) / (best.square(c) + floor));
            }
        }
        sort_falling(&mut by_silence, |gain| *gain);
        let prices = std::iter::once(-RARE.ln()).chain(std::iter::repeat(-FURTHER.ln()));
        odds -= by_silence.iter().zip(prices).map(|(gain, price)| (gain - price).max(0.0)).sum::<f64>();
        // The change removes most of a channel's residual: more than half of its variance.
        if fall > 2.0 { odds } else { odds.min(0.0) }
    }
}

/// Mean square residual of each torque under `outcome` for an arm without mass; empty without torques.
fn massless(problem: &Problem, outcome: &Outcome) -> Vec<f64> {
    if problem.samples.has_torques() { problem.without_arm(&outcome.changes) } else { Vec::new() }
}

#[cfg(test)]
mod tests {
    use freeplay_arm::{Arm, Workspace, rnea};
    use freeplay_model::paper_arm;

    use super::super::change::Physics;
    use super::super::samples::{Samples, made};
    use super::*;

    const SURE: f64 = 6.9;

    /// Calls `check` with the problem of a recording whose torques are those of the arm, modified by `change`, which receives the speeds.
    fn recorded(change: impl Fn(&[f64], &mut [f64]), check: impl FnOnce(&Problem, usize)) {
        let arm: Arm = paper_arm().arm;
        let recording = made(arm.dof(), |[q, v, a], torque| {
            rnea(&arm, &mut Workspace::new(&arm), q, v, a, torque);
            change(v, torque);
        });
        let samples = Samples::new(&recording, &recording.q).expect("rows");
        check(&Problem::new(&arm, &samples, 1, FLOOR), arm.dof());
    }

    /// A wrist whose friction follows two joints is evidence for a coupling, not for other coordinates of the joints.
    #[test]
    fn friction_does_not_tell_how_joints_are_counted() {
        let coupled = |v: &[f64], torque: &mut [f64]| {
            torque[v.len() - 1] = 5.0 * (v[v.len() - 1] + v[v.len() - 2]).signum();
        };
        recorded(coupled, |problem, n| {
            let change = Change::Relative { joint: n - 1, other: n - 2, factor: -1.0 };
            let [best, other] = [vec![change], Vec::new()].map(|changes| problem.outcome(&changes));
            let odds = ChangeOdds::new(problem, &best).by_channels(&change, &other, &other);
            let gain = best.evidence - other.evidence;
            println!("evidence {gain:.1}, odds {odds:.1}");
            assert!(gain > SURE && odds < SURE);
        });
    }

    /// Links that are 15 % heavier are no other unit, even if a unit would compensate for them.
    #[test]
    fn masses_within_a_data_sheet_are_no_other_unit() {
        let heavier = |_: &[f64], torque: &mut [f64]| torque.iter_mut().for_each(|torque| *torque *= 1.15);
        recorded(heavier, |problem, _| {
            let [best, other] =
                [vec![Change::CommonScale], Vec::new()].map(|changes| problem.outcome(&changes));
            let odds = ChangeOdds::new(problem, &best).by_sheet(&other);
            let gain = best.evidence - other.evidence;
            println!("evidence {gain:.1}, odds {odds:.1}");
            assert!(gain > SURE && odds < SURE);
        });
    }

    /// For an arm without mass, friction leaves the arm's part of each torque, and nothing of a torque of friction.
    #[test]
    fn friction_explains_torques_of_friction() {
        let rubbing = |v: &[f64], torque: &mut [f64]| torque[v.len() - 1] = 5.0 * v[v.len() - 1].signum();
        recorded(rubbing, |problem, n| {
            let changes = [Change::Scale(1), Change::AnyGravity, Change::Beside(Physics::Payload)];
            let left = problem.without_arm(&changes);
            let outcome = problem.outcome(&[]);
            println!("left {left:?} of {:?}", outcome.sizes);
            assert!(left[1] > 0.1 * outcome.sizes[1]);
            assert!(left[n - 1] < 0.02 * outcome.sizes[n - 1]);
        });
    }
}
