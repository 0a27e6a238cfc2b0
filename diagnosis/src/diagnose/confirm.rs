//! The confirmation: with more of the data the findings are refined together, others are tried in the place of each, and the search goes on from the best.

use super::alternatives::tried;
use super::search::{Answer, Search, WORTH};

/// `members` with their numbers in agreement, once nothing that is tried in the place of one of them is more probable; `None` if the system is singular.
pub(crate) fn confirmed(
    search: &mut Search,
    members: Vec<usize>,
    progress: &mut dyn FnMut(&str),
) -> Option<Answer> {
    /// The search has come to rest before; what is found here is a member that imitates another law in part.
    const TURNS: usize = 4;
    let mut instead = search.improve(members, progress)?.members;
    for turn in 1.. {
        progress("trying others in the place of each finding");
        let polished = search.polished(instead)?;
        let better = search.improve(polished.members, progress)?;
        let now = search.agreed(&better)?;
        let fit = search.system.held_fit(&now.members)?;
        let tried = tried(search, &fit);
        let best = tried.iter().min_by(|a, b| a.against.total_cmp(&b.against));
        let Some(best) = best.filter(|best| best.against < -WORTH && turn < TURNS) else { return Some(now) };
        instead =
            now.members.into_iter().filter(|member| *member != best.member).chain([best.index]).collect();
    }
    None
}

/// The better one of `answer` and what is confirmed from those of its members alone that do not happen at a time, by its evidence: a law that is found late says what
/// seemed to happen; `None` if the system is singular.
pub(crate) fn confirmed_without_events(
    search: &mut Search,
    answer: Answer,
    progress: &mut dyn FnMut(&str),
) -> Option<Answer> {
    let lasts = |&member: &usize| !search.system.candidate(member).kind.happens();
    let lasting: Vec<usize> = answer.members.iter().copied().filter(lasts).collect();
    if lasting.len() == answer.members.len() {
        return Some(answer);
    }
    search.system.trust_all()?;
    let other = confirmed(search, lasting, progress)?;
    better(search, &answer, other)
}

/// The better one of `answer` and what the search finds from what happens at a time alone with the fit and the choice part together, by its evidence; `None` if the system is singular.
pub(crate) fn searched_again(
    search: &mut Search,
    answer: &Answer,
    progress: &mut dyn FnMut(&str),
) -> Option<Answer> {
    search.system.trust_all()?;
    search.met.clear();
    let seen: Vec<usize> = answer.members.iter().copied().filter(|&member| search.is_seen(member)).collect();
    let again = search.run(&seen, progress)?;
    let again = confirmed(search, again.members, progress)?;
    better(search, answer, again)
}

/// The better one of `answer` and `other` by their evidence when every row is believed alike; `None` if the system is singular.
fn better(search: &mut Search, answer: &Answer, other: Answer) -> Option<Answer> {
    search.system.trust_all()?;
    let known = search.settled(answer.members.clone())?;
    let there = search.settled(other.members.clone())?;
    let best = if there.evidence > known.evidence + WORTH { other } else { known };
    search.agreed(&best)
}
