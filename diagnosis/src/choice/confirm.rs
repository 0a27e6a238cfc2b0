//! The confirmation: with more data the program refines the findings together, tries others in their place, and continues the search from the best.

use crate::evidence::nameless::most_in_single_channels;
use crate::evidence::system::all_but;
use crate::search::moves::{EffectSet, Search, WORTH};
use crate::search::tried::tried;
use crate::sorting::sort_rising;
use crate::statistics::MOST_ROUNDS;

/// The answer that the search reaches from `members` when no replacement of a finding is more probable, neither another law nor several. `None` if the system
/// is singular.
pub(crate) fn confirmed(
    search: &mut Search,
    members: Vec<usize>,
    progress: &mut dyn FnMut(&str),
) -> Option<EffectSet> {
    let mut now = compared(search, members, progress)?;
    while with_several(search, &mut now, progress)? {
        while with_another(search, &mut now, progress)? {}
    }
    Some(now)
}

/// The answer that the search reaches from `members` when no other law in the place of a finding is more probable. `None` if the system is singular.
pub(crate) fn compared(
    search: &mut Search,
    members: Vec<usize>,
    progress: &mut dyn FnMut(&str),
) -> Option<EffectSet> {
    let members = search.improve(members, progress)?.members;
    let mut now = grown(search, members, progress)?;
    while with_another(search, &mut now, progress)? {}
    Some(now)
}

/// Replaces a member of `now` by another law if that is more probable, and returns true; otherwise the search returns to `now`.
fn with_another(search: &mut Search, now: &mut EffectSet, progress: &mut dyn FnMut(&str)) -> Option<bool> {
    let fit = search.system.fit_within_tolerances(&now.members)?;
    let mut others = tried(search, &fit);
    others.retain(|other| other.against < -WORTH);
    sort_rising(&mut others, |other| other.against);
    for other in others {
        progress("replacing each finding by other effects");
        let rest = all_but(&now.members, other.place);
        let there = grown(search, [rest, vec![other.index]].concat(), progress)?;
        // When this law looked more probable, the other members still had the parameters that suit the old finding.
        if search.same_effects(&there.members, &now.members) {
            *now = search.made_consistent(now)?;
        } else if taken_over(search, now, there)? {
            return Some(true);
        }
    }
    Some(false)
}

/// Replaces a member of `now` by all laws that the search finds without it, if that is more probable, and returns true; otherwise the search returns to `now`.
///
/// One law of several channels can stand for several laws with one channel each. No single one of these is worth the change, so that [`with_another`] does not
/// find them. If even nameless shapes explain less than the law, several such laws can't replace it.
fn with_several(search: &mut Search, now: &mut EffectSet, progress: &mut dyn FnMut(&str)) -> Option<bool> {
    for place in 0..now.members.len() {
        let member = now.members[place];
        let data = search.system.data;
        let channels = &search.system.candidate(member).channels;
        let is_alike = |&c: &usize| data.kind(c) == data.kind(channels[0]);
        if channels.iter().all(is_alike) {
            continue;
        }
        let others = all_but(&now.members, place);
        let system = &search.system;
        let (with, without) =
            (system.fit_within_tolerances(&now.members)?, system.fit_within_tolerances(&others)?);
        if most_in_single_channels(system, &system.residual(&without)) < with.value - without.value {
            continue;
        }
        progress("replacing one finding by several effects");
        let available = search.available.clone();
        search.leave_out(&[member]);
        let there = grown(search, others, progress)?;
        search.available = available;
        if taken_over(search, now, there)? {
            return Some(true);
        }
    }
    Some(false)
}

/// If `there`, the state of the search, is more probable than `now`, it becomes `now`, and the function returns true; otherwise the search returns to `now`.
fn taken_over(search: &mut Search, now: &mut EffectSet, there: EffectSet) -> Option<bool> {
    let is_better = there.evidence > now.evidence + WORTH;
    *now = if is_better { there } else { search.made_consistent(now)? };
    Some(is_better)
}

/// The most probable of `members` in their best forms and of the answers that the search finds from there, each with converged parameters; `None` if the system
/// is singular.
///
/// Each answer changes the weights of the rows, and with other weights the search may find other effects. It ends when a set of effects returns.
fn grown(search: &mut Search, members: Vec<usize>, progress: &mut dyn FnMut(&str)) -> Option<EffectSet> {
    let mut last = search.polished(members)?;
    let mut met = vec![last.clone()];
    for _ in 0..MOST_ROUNDS {
        let better = search.improve(last.members, progress)?;
        last = search.made_consistent(&better)?;
        let comes_back = met.iter().any(|known| search.same_effects(&known.members, &last.members));
        met.push(last.clone());
        if comes_back {
            break;
        }
    }
    let best = met.into_iter().max_by(|a, b| a.evidence.total_cmp(&b.evidence))?;
    if search.same_effects(&best.members, &last.members) { Some(last) } else { search.made_consistent(&best) }
}

/// The better of `answer` and the result of the search with fit and choice part together, by evidence; `None` if the system is singular.
pub(crate) fn searched_again(
    search: &mut Search,
    answer: &EffectSet,
    progress: &mut dyn FnMut(&str),
) -> Option<EffectSet> {
    search.system.reset_robust_weights()?;
    search.visited.clear();
    let again = search.run(&[], progress)?;
    let again = compared(search, again.members, progress)?;
    search.system.reset_robust_weights()?;
    let known = search.with_best_shares(answer.members.clone())?;
    let there = search.with_best_shares(again.members.clone())?;
    let best = if there.evidence > known.evidence + WORTH { again } else { known };
    search.made_consistent(&best)
}

#[cfg(test)]
mod tests {
    use freeplay_arm::{Arm, JointFriction, JointKind};

    use super::with_several;
    use crate::data::linearised::{LinearisedRecording, PreparedRecording};
    use crate::data::stacked::Data;
    use crate::data::tolerance::Tolerances;
    use crate::made::{arm, columns_along, even, link, recording, sines, without};
    use crate::search::moves::Search;
    use crate::signals::motion::Settings;

    /// The second joint turns in proportion to the first, plus a slow motion.
    fn alike(arm: &Arm, t: f64) -> [Vec<f64>; 3] {
        let mut motion = sines(arm, t);
        let (sin, cos) = (0.9 * t).sin_cos();
        for (column, more) in motion.iter_mut().zip([0.08 * sin, 0.072 * cos, -0.0648 * sin]) {
            column[1] = column[0] + more;
        }
        motion
    }

    #[test]
    fn the_frictions_of_two_joints_take_the_place_of_a_coupling() {
        let [first, second] =
            ["first", "second"].map(|name| link(name, JointKind::Revolute, JointFriction::default()));
        let arm = arm(vec![first, second]);
        let friction = |joint: usize, v: f64| [1.0, 0.8][joint] * v.signum() + [0.6, 0.9][joint] * v;
        let made = recording(without(columns_along(alike, &arm, &even(16.0, 250.0), friction), "x"));
        let prepared = PreparedRecording::new(&arm, &made, &Settings::default()).expect("a ground");
        let recording = LinearisedRecording::new(&arm, &[], &prepared).expect("a stage");
        let data = Data::new(vec![recording], &Tolerances::default(), &[]);
        let mut search = Search::over(&data).expect("a system");
        let is_coupling = |&index: &usize| search.system.candidate(index).kind.name == "joint_coupling";
        let coupling = search.available.iter().copied().find(is_coupling).expect("a coupling");
        let coupled = search.with_best_shares(vec![coupling]).expect("an answer");
        let mut answer = coupled.clone();
        let is_better = with_several(&mut search, &mut answer, &mut |_| {});
        assert_eq!(is_better, Some(true), "something is more probable");
        assert!(answer.evidence > coupled.evidence);
        let mut found: Vec<(&str, Option<usize>)> = answer
            .members
            .iter()
            .map(|&member| (search.system.candidate(member).kind.name, search.system.candidate(member).joint))
            .collect();
        found.sort_unstable();
        println!("{found:?}, log of the evidence {} after {}", answer.evidence, coupled.evidence);
        let frictions =
            ["coulomb_friction", "viscous_friction"].map(|kind| [(kind, Some(0)), (kind, Some(1))]);
        assert_eq!(found, frictions.concat());
    }
}
