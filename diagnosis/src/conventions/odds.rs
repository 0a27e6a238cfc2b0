//! The odds of one change of a reading against the best reading without it.

use super::change::{Change, FURTHER, RARE};
use super::kinds::another_arm::UNEXPLAINED;
use super::outcome::Outcome;
use super::problem::{FLOOR, GEOMETRY, Links, Problem};

/// Log odds of `best` against `other` where the masses of the model's links are what a data sheet says, within its tolerance: where large terms
/// cancel, as in a joint that no motor drives, a few per cent of a mass look like another unit. No bound where there are no torques.
pub(super) fn by_sheet(problem: &Problem, best: &Outcome, other: &Outcome) -> f64 {
    let worth = |outcome| problem.with_links(outcome, Links::OfSheet);
    worth(best).zip(worth(other)).map_or(f64::INFINITY, |(best, other)| best - other)
}

/// Log odds of `best` against `other`, the best set without `change`, rows counting as far as they are independent; even odds at most, unless the change
/// takes away most of what is left of `same`, which is `best` without it, in a channel that `best` explains.
///
/// The rival may also leave torques without the arm: a torque of friction alone shows no reading, and one that has little to do with the model fits a
/// unit that silences the model. That a torque shows nothing of the arm is as rare as a wrong reading. Friction speaks of signs itself, since it never
/// drives; torques without gravity may hold nothing else.
pub(super) fn by_channels(
    problem: &Problem,
    change: &Change,
    best: &Outcome,
    [other, same]: [&Outcome; 2],
    joints: usize,
) -> f64 {
    let is_silent = matches!(change, Change::Compensated | Change::TorqueSign(_) | Change::Direction { .. });
    let massless = |outcome: &Outcome| {
        if is_silent || joints == 0 { Vec::new() } else { problem.without_arm(&outcome.changes) }
    };
    let [with, without_change] = [best, other].map(massless);
    let silent = |c: usize| with.get(c).map_or(f64::INFINITY, |silent| silent.max(best.square(c)));
    // What a change of the positions takes away of channel c, the rival's channel `place`, where the arm has no mass: a coupling has the friction of
    // another joint, so that friction does not tell which is which. It tells the time.
    let by_friction = |c: usize, place: usize| match (with.get(c), without_change.get(place)) {
        (Some(with), Some(without)) if change.is_of_positions() => (without - with).max(0.0),
        _ => 0.0,
    };
    // What is left of the recorded channel c of `best`, whichever joint `without` gives it to; it may leave it out.
    let place =
        |without: &Outcome, c: usize| without.sources.iter().position(|source| *source == best.sources[c]);
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
    by_silence.sort_by(|a, b| b.total_cmp(a));
    let prices = std::iter::once(-RARE.ln()).chain(std::iter::repeat(-FURTHER.ln()));
    odds -= by_silence.iter().zip(prices).map(|(gain, price)| (gain - price).max(0.0)).sum::<f64>();
    // Most of what was left of a channel is gone: more than half of its variance.
    if fall > 2.0 { odds } else { odds.min(0.0) }
}

#[cfg(test)]
mod tests {
    use freeplay_arm::{Arm, Workspace, paper_arm, rnea};

    use super::super::change::Physics;
    use super::super::samples::{Samples, made};
    use super::*;

    const SURE: f64 = 6.9;

    /// Inverse dynamics of `arm`.
    fn rigid(arm: &Arm) -> impl Fn([&[f64]; 3], &mut [f64]) {
        move |[q, v, a], torque| rnea(arm, &mut Workspace::new(arm), q, v, a, torque)
    }

    /// A wrist whose friction follows two joints speaks for a coupling, not for another way of counting.
    #[test]
    fn friction_does_not_tell_how_joints_are_counted() {
        let arm = paper_arm().arm;
        let n = arm.dof();
        let of_arm = rigid(&arm);
        let recording = made(n, |motion, torque| {
            of_arm(motion, torque);
            torque[n - 1] = 5.0 * (motion[1][n - 1] + motion[1][n - 2]).signum();
        });
        let samples = Samples::new(&recording, &recording.q).expect("rows");
        let problem = Problem::new(&arm, &samples, 1, FLOOR);
        let change = Change::Relative { joint: n - 1, other: n - 2, factor: -1.0 };
        let [best, other] = [vec![change], Vec::new()].map(|changes| problem.outcome(&changes));
        let odds = by_channels(&problem, &change, &best, [&other, &other], n);
        let gain = best.evidence - other.evidence;
        println!("evidence {gain:.1}, odds {odds:.1}");
        assert!(gain > SURE && odds < SURE);
    }

    /// Links that are 15 % heavier are no other unit, however well a unit would make up for them.
    #[test]
    fn masses_within_a_data_sheet_are_no_other_unit() {
        let arm = paper_arm().arm;
        let n = arm.dof();
        let of_arm = rigid(&arm);
        let recording = made(n, |motion, torque| {
            of_arm(motion, torque);
            torque.iter_mut().for_each(|torque| *torque *= 1.15);
        });
        let samples = Samples::new(&recording, &recording.q).expect("rows");
        let problem = Problem::new(&arm, &samples, 1, FLOOR);
        let [best, other] = [vec![Change::CommonScale], Vec::new()].map(|changes| problem.outcome(&changes));
        let (gain, odds) = (best.evidence - other.evidence, by_sheet(&problem, &best, &other));
        println!("evidence {gain:.1}, odds {odds:.1}");
        assert!(gain > SURE && odds < SURE);
    }

    /// Friction alone leaves of each torque what the arm asks for, and nothing of a torque of friction.
    #[test]
    fn friction_explains_torques_of_friction() {
        let arm = paper_arm().arm;
        let n = arm.dof();
        let of_arm = rigid(&arm);
        let recording = made(n, |motion, torque| {
            of_arm(motion, torque);
            torque[n - 1] = 5.0 * motion[1][n - 1].signum();
        });
        let samples = Samples::new(&recording, &recording.q).expect("rows");
        let problem = Problem::new(&arm, &samples, 1, FLOOR);
        let changes = [Change::Scale(1), Change::AnyGravity, Change::Beside(Physics::Payload)];
        let left = problem.without_arm(&changes);
        let outcome = problem.outcome(&[]);
        println!("left {left:?} of {:?}", outcome.sizes);
        assert!(left[1] > 0.1 * outcome.sizes[1]);
        assert!(left[n - 1] < 0.02 * outcome.sizes[n - 1]);
    }
}
