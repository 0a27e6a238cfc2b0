//! The confirmation: with more of the data the findings are refined together, others are tried in the place of each, and the search goes on from the best.

use super::alternatives::tried;
use super::search::{Answer, Search, WORTH};
use crate::statistics::MOST_ROUNDS;

/// `members` with their numbers in agreement, once nothing that is tried in the place of one of them is more probable; `None` if the system is singular.
pub(crate) fn confirmed(
    search: &mut Search,
    members: Vec<usize>,
    progress: &mut dyn FnMut(&str),
) -> Option<Answer> {
    let mut instead = search.improve(members, progress)?.members;
    for turn in 1.. {
        progress("trying others in the place of each finding");
        let polished = search.polished(instead)?;
        let better = search.improve(polished.members, progress)?;
        let now = search.agreed(&better)?;
        let fit = search.system.held_fit(&now.members)?;
        let tried = tried(search, &fit);
        let best = tried.iter().min_by(|a, b| a.against.total_cmp(&b.against));
        let Some(best) = best.filter(|best| best.against < -WORTH && turn < MOST_ROUNDS) else {
            return Some(now);
        };
        instead =
            now.members.into_iter().filter(|member| *member != best.member).chain([best.index]).collect();
    }
    None
}

/// The better one of `answer` and what the search finds with the fit and the choice part together, by its evidence; `None` if the system is singular.
pub(crate) fn searched_again(
    search: &mut Search,
    answer: &Answer,
    progress: &mut dyn FnMut(&str),
) -> Option<Answer> {
    search.system.trust_all()?;
    search.met.clear();
    let again = search.run(&[], progress)?;
    let again = confirmed(search, again.members, progress)?;
    search.system.trust_all()?;
    let known = search.settled(answer.members.clone())?;
    let there = search.settled(again.members.clone())?;
    let best = if there.evidence > known.evidence + WORTH { again } else { known };
    search.agreed(&best)
}
